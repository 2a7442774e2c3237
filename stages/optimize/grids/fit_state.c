/* State: what a fit knows, to a store and back. */
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

npg_status npg_fit_save(npg_fit *fit, npg_store *store)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), at = 0, size = size_of(parts, count);
    char *bytes;
    NPG_TRY(npg_fit_read_params(fit));
    NPG_TRY(npg_alloc(&bytes, NPG_FOR_FIT, size));
    npg_status status = NPG_OK;
    for (size_t i = 0; i < count && !status; at += parts[i++].size) {
        if (parts[i].buffer) status = npg_buffer_read(parts[i].buffer, 0, bytes + at, parts[i].size);
        if (parts[i].host) memcpy(bytes + at, parts[i].host, parts[i].size);
    }
    if (!status) status = npg_store_put(store, "fit", bytes, size);
    npg_release(&bytes);
    return status;
}

npg_status npg_fit_restore(npg_fit *fit, const npg_record *record)
{
    part parts[PARTS_MAX];
    size_t count = parts_of(parts, fit), at = 0, size;
    const char *bytes = npg_record_find(record, "fit", &size);
    if (!bytes || size != size_of(parts, count))
        return npg_error(NPG_BAD_INPUT, "the block fit is of another fit");
    for (size_t i = 0; i < count; at += parts[i++].size) {
        if (parts[i].buffer) NPG_TRY(npg_buffer_write(parts[i].buffer, 0, bytes + at, parts[i].size));
        if (parts[i].host) memcpy(parts[i].host, bytes + at, parts[i].size);
    }
    return npg_fit_write_params(fit);
}
