/* Copy: what a fit knows, on the host. */
#include "optimize/grids/fit.h"

#include <string.h>

#include "kernels/adam.h"

#define PARTS_MAX 8

/* A part of the state: on the device or on the host. */
typedef struct part {
    npg_buffer *buffer;
    void *host;
    size_t size;
} part;

static size_t parts_of(part parts[PARTS_MAX], npg_fit *fit)
{
    npg_fit_parts p = npg_fit_open_parts(fit);
    size_t adam = p.param_count * sizeof(float);
    const part all[] = {{p.u, NULL, p.u->size},
                        {&p.grid_adam->first, NULL, p.u->size},
                        {&p.grid_adam->second, NULL, p.u->size},
                        {NULL, &p.grid_adam->step, sizeof p.grid_adam->step},
                        {NULL, p.params, adam},
                        {&p.mlp_adam->first, NULL, adam},
                        {&p.mlp_adam->second, NULL, adam},
                        {NULL, &p.mlp_adam->step, sizeof p.mlp_adam->step}};
    memcpy(parts, all, sizeof all);
    return sizeof all / sizeof *all;
}

static size_t size_of(const part *parts, size_t count)
{
    size_t size = 0;
    for (size_t i = 0; i < count; i++) size += parts[i].size;
    return size;
}

npg_status npg_fit_copy_take(npg_fit_copy *copy, npg_fit *fit)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), size = size_of(parts, count), at = 0;
    NPG_TRY(npg_fit_read_params(fit));
    if (copy->size != size) npg_fit_copy_clear(copy);
    if (!copy->bytes) NPG_TRY(npg_alloc(&copy->bytes, NPG_FOR_FIT, size));
    copy->size = size;
    for (size_t i = 0; i < count; at += parts[i++].size) {
        if (parts[i].buffer) NPG_TRY(npg_buffer_read(parts[i].buffer, 0, copy->bytes + at, parts[i].size));
        if (parts[i].host && parts[i].size) memcpy(copy->bytes + at, parts[i].host, parts[i].size);
    }
    return NPG_OK;
}

npg_status npg_fit_copy_give(const npg_fit_copy *copy, npg_fit *fit)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), at = 0;
    if (copy->size != size_of(parts, count))
        return npg_error(NPG_BAD_INPUT, "the state of a fit has another size than this fit's");
    for (size_t i = 0; i < count; at += parts[i++].size) {
        if (parts[i].buffer) NPG_TRY(npg_buffer_write(parts[i].buffer, 0, copy->bytes + at, parts[i].size));
        if (parts[i].host && parts[i].size) memcpy(parts[i].host, copy->bytes + at, parts[i].size);
    }
    return npg_fit_write_params(fit);
}

void npg_fit_copy_clear(npg_fit_copy *copy)
{
    npg_release(&copy->bytes);
    copy->size = 0;
}

npg_status npg_fit_hand_over(npg_fit *to, npg_fit *from)
{
    npg_fit_parts source = npg_fit_open_parts(from), target = npg_fit_open_parts(to);
    float *rows;
    NPG_TRY(npg_fit_read_params(from));
    NPG_REQUIRE(source.u->size == target.u->size && source.param_count == target.param_count);
    memcpy(target.params, source.params, source.param_count * sizeof(float));
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FIT, source.u->size));
    npg_status status = npg_buffer_read(source.u, 0, rows, source.u->size);
    if (!status) status = npg_buffer_write(target.u, 0, rows, source.u->size);
    npg_release(&rows);
    return status ? status : npg_fit_write_params(to);
}

npg_status npg_fit_copy_save(const npg_fit_copy *copy, npg_store *store, const char *block)
{
    return copy->bytes ? npg_store_put(store, block, copy->bytes, copy->size) : NPG_OK;
}

npg_status npg_fit_copy_load(npg_fit_copy *copy, const npg_record *record, const char *block)
{
    npg_fit_copy_clear(copy);
    if (!npg_record_find(record, block, &copy->size)) {
        copy->size = 0;
        return NPG_OK;
    }
    NPG_TRY(npg_alloc(&copy->bytes, NPG_FOR_FIT, copy->size));
    return npg_record_get(record, block, copy->bytes, copy->size);
}

npg_status npg_fit_save(npg_fit *fit, npg_store *store, const char *block)
{
    npg_fit_copy copy = {0};
    npg_status status = npg_fit_copy_take(&copy, fit);
    if (!status) status = npg_fit_copy_save(&copy, store, block);
    npg_fit_copy_clear(&copy);
    return status;
}

npg_status npg_fit_restore(npg_fit *fit, const npg_record *record, const char *block)
{
    npg_fit_copy copy = {0};
    npg_status status = npg_fit_copy_load(&copy, record, block);
    if (!status) status = npg_fit_copy_give(&copy, fit);
    npg_fit_copy_clear(&copy);
    return npg_error_prefix(status, "the block %s", block);
}
