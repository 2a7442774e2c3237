/* What a fit knows after a window, to a file and back. */
#include "optimize/fit_state.h"

#include <stdio.h>
#include <string.h>

#include "job/vdb_file.h"
#include "kernels/adam.h"
#include "kernels/levels.h"
#include "pipeline/file.h"

/* ---- the grids' file ---- */

typedef struct grids {
    const npg_levels *levels;
    const float *rows;
    const npg_vdb_place *place;
} grids;

static npg_status save_levels(void *user, const char *path)
{
    const grids *g = user;
    return npg_vdb_save_levels(path, g->levels, g->rows, g->place);
}

static bool is_of_grid(const npg_level *level, int channel)
{
    return level->kind != NPG_LEVEL_HASHED && channel >= level->channel_first && channel < level->channel_end;
}

/* Whether the table holds more than its dense grids: hashed levels, or values in channels that
 * a level does not fill. */
static bool has_rest(const npg_levels *levels, const float *rows)
{
    for (int l = 0; l < levels->count; l++)
        for (size_t i = 0; i < levels->level[l].row_count; i++)
            for (int c = 0; c < NPG_LATENT_CHANNELS; c++) {
                size_t at = (levels->level[l].first_row + i) * NPG_LATENT_CHANNELS + (size_t)c;
                if (!is_of_grid(&levels->level[l], c) && rows[at] != 0) return true;
            }
    return false;
}

static npg_status save_grids(const npg_fit_parts *parts, npg_store *store, const char *path,
                             const npg_vdb_place *place)
{
    float *rows;
    uint64_t hash;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts->u->size));
    npg_status status = npg_buffer_read(parts->u, 0, rows, parts->u->size);
    if (!status) status = npg_vdb_file_write(path, &hash, save_levels, &(grids){parts->levels, rows, place});
    if (!status) status = npg_store_put(store, "grids.hash", &hash, sizeof hash);
    if (!status && has_rest(parts->levels, rows))
        status = npg_store_put(store, "fit.rows", rows, parts->u->size);
    npg_release(&rows);
    return status;
}

static npg_status restore_grids(const npg_fit_parts *parts, const npg_record *record, const char *path)
{
    float *rows;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts->u->size));
    size_t size;
    npg_status status = NPG_OK;
    if (npg_record_find(record, "fit.rows", &size))
        status = npg_record_get(record, "fit.rows", rows, parts->u->size);
    if (!status) status = npg_vdb_load_levels(path, parts->levels, rows);
    if (!status) status = npg_buffer_write(parts->u, 0, rows, parts->u->size);
    npg_release(&rows);
    return status;
}

/* ---- optimisers ---- */

static npg_status save_adam(const npg_adam *adam, npg_store *store, const char *name)
{
    char block[NPG_BLOCK_NAME];
    float *both;
    size_t bytes = adam->count * sizeof(float);
    NPG_TRY(npg_alloc(&both, NPG_FOR_FILES, 2 * bytes));
    npg_status status = npg_buffer_read(&adam->first, 0, both, bytes);
    if (!status) status = npg_buffer_read(&adam->second, 0, both + adam->count, bytes);
    snprintf(block, sizeof block, "fit.%s.moments", name);
    if (!status) status = npg_store_put(store, block, both, 2 * bytes);
    snprintf(block, sizeof block, "fit.%s.step", name);
    if (!status) status = npg_store_put(store, block, &adam->step, sizeof adam->step);
    npg_release(&both);
    return status;
}

static npg_status restore_adam(npg_adam *adam, const npg_record *record, const char *name)
{
    char block[NPG_BLOCK_NAME];
    float *both;
    size_t bytes = adam->count * sizeof(float);
    NPG_TRY(npg_alloc(&both, NPG_FOR_FILES, 2 * bytes));
    snprintf(block, sizeof block, "fit.%s.moments", name);
    npg_status status = npg_record_get(record, block, both, 2 * bytes);
    if (!status) status = npg_buffer_write(&adam->first, 0, both, bytes);
    if (!status) status = npg_buffer_write(&adam->second, 0, both + adam->count, bytes);
    snprintf(block, sizeof block, "fit.%s.step", name);
    if (!status) status = npg_record_get(record, block, &adam->step, sizeof adam->step);
    npg_release(&both);
    return status;
}

/* ---- all of it ---- */

npg_status npg_fit_save(npg_fit *fit, npg_store *store, const char *grids_path, const npg_vdb_place *place)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    size_t code_count;
    int64_t *code_step;
    double *code = npg_time_code_parts(parts.time_code, &code_count, &code_step);
    NPG_TRY(save_grids(&parts, store, grids_path, place));
    NPG_TRY(save_adam(parts.grid_adam, store, "grids"));
    NPG_TRY(save_adam(parts.mlp_adam, store, "decoder"));
    NPG_TRY(npg_store_put(store, "fit.decoder", parts.params, parts.param_count * sizeof(float)));
    NPG_TRY(npg_store_put(store, "fit.time", code, code_count * sizeof(double)));
    return npg_store_put(store, "fit.time.step", code_step, sizeof *code_step);
}

npg_status npg_fit_restore(npg_fit *fit, const npg_record *record, const char *grids_path)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    size_t code_count;
    int64_t *code_step;
    double *code = npg_time_code_parts(parts.time_code, &code_count, &code_step);
    NPG_TRY(restore_grids(&parts, record, grids_path));
    NPG_TRY(restore_adam(parts.grid_adam, record, "grids"));
    NPG_TRY(restore_adam(parts.mlp_adam, record, "decoder"));
    NPG_TRY(npg_record_get(record, "fit.decoder", parts.params, parts.param_count * sizeof(float)));
    NPG_TRY(npg_record_get(record, "fit.time", code, code_count * sizeof(double)));
    return npg_record_get(record, "fit.time.step", code_step, sizeof *code_step);
}
