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

static npg_status take(struct npg_fit_copy *copy, npg_fit *fit)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), at = 0;
    NPG_TRY(npg_fit_read_params(fit));
    copy->size = size_of(parts, count);
    npg_release(&copy->bytes);
    NPG_TRY(npg_alloc(&copy->bytes, NPG_FOR_FIT, copy->size));
    for (size_t i = 0; i < count; at += parts[i++].size) {
        if (parts[i].buffer) NPG_TRY(npg_buffer_read(parts[i].buffer, 0, copy->bytes + at, parts[i].size));
        if (parts[i].host && parts[i].size) memcpy(copy->bytes + at, parts[i].host, parts[i].size);
    }
    return NPG_OK;
}

static npg_status give(npg_fit *fit, const char *bytes, size_t size)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), at = 0;
    if (!bytes || size != size_of(parts, count))
        return npg_error(NPG_BAD_INPUT, "the state of a fit has another size than this fit's");
    for (size_t i = 0; i < count; at += parts[i++].size) {
        if (parts[i].buffer) NPG_TRY(npg_buffer_write(parts[i].buffer, 0, bytes + at, parts[i].size));
        if (parts[i].host && parts[i].size) memcpy(parts[i].host, bytes + at, parts[i].size);
    }
    return npg_fit_write_params(fit);
}

npg_status npg_fit_recall(npg_fit *fit, const npg_window *window)
{
    const struct npg_fit_copy *first = npg_fit_open_parts(fit).first;
    return window->from == 0 && first->bytes ? give(fit, first->bytes, first->size) : NPG_OK;
}

npg_status npg_fit_remember(npg_fit *fit, const npg_window *window)
{
    return window->direction ? NPG_OK : take(npg_fit_open_parts(fit).first, fit);
}

npg_status npg_fit_save(npg_fit *fit, npg_store *store, bool with_first)
{
    const struct npg_fit_copy *first = npg_fit_open_parts(fit).first;
    struct npg_fit_copy now = {0};
    if (with_first && first->bytes) NPG_TRY(npg_store_put(store, "first", first->bytes, first->size));
    npg_status status = take(&now, fit);
    if (!status) status = npg_store_put(store, "fit", now.bytes, now.size);
    npg_release(&now.bytes);
    return status;
}

npg_status npg_fit_restore(npg_fit *fit, const npg_record *record)
{
    struct npg_fit_copy *first = npg_fit_open_parts(fit).first;
    size_t size;
    const char *now = npg_record_find(record, "fit", &size);
    NPG_TRY(npg_error_prefix(give(fit, now, size), "the block fit"));
    if (!npg_record_find(record, "first", &first->size)) return NPG_OK;
    npg_release(&first->bytes);
    NPG_TRY(npg_alloc(&first->bytes, NPG_FOR_FIT, first->size));
    return npg_record_get(record, "first", first->bytes, first->size);
}
