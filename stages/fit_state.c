/* What a fit knows after a window, to a file and back. */
#include "fit_state.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>
#include <xxhash.h>

#include "adam.h"
#include "file.h"
#include "levels.h"

/* ---- the grids' file ---- */

static npg_status copy_bytes(npg_file *file, uint64_t *hash, int fd, const char *path)
{
    unsigned char block[16 << 10];
    XXH3_state_t *state = XXH3_createState();
    if (!state) return npg_error(NPG_MEMORY, "no memory for a checksum");
    XXH3_64bits_reset(state);
    npg_status status = NPG_OK;
    for (off_t at = 0; !status;) {
        ssize_t got = pread(fd, block, sizeof block, at);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) status = npg_error_errno(NPG_FAILED, "can't read back the grids of %s", path);
        if (got <= 0) break;
        XXH3_64bits_update(state, block, (size_t)got);
        npg_file_write(file, block, (size_t)got);
        at += got;
    }
    *hash = XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return status;
}

/* OpenVDB does not tell when a disk is full: it writes to memory, and the bytes go to disk with every check.
 */
static npg_status write_grids(uint64_t *hash, const char *path, const npg_levels *levels, const float *rows,
                              const npg_vdb_place *place)
{
    char memory_path[64];
    npg_file *file = NULL;
    int fd = memfd_create("neupig-grids", MFD_CLOEXEC);
    if (fd < 0) return npg_error_errno(NPG_FAILED, "can't make a file in memory");
    snprintf(memory_path, sizeof memory_path, "/proc/self/fd/%d", fd);
    npg_status status = npg_vdb_save_levels(memory_path, levels, rows, place);
    if (!status) status = npg_file_open(&file, path);
    if (!status) status = copy_bytes(file, hash, fd, path);
    if (!status)
        status = npg_file_commit(&file);
    else
        npg_file_discard(&file);
    close(fd);
    return status;
}

static bool is_of_grid(const npg_level *level, int channel)
{
    return level->kind != NPG_LEVEL_HASHED && channel >= level->channel_first && channel < level->channel_end;
}

/* Whether the table holds more than its dense grids: hashed levels, or values in channels that a level does
 * not fill. */
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

static npg_status save_grids(const npg_fit_parts *parts, npg_archive_writer *archive, const char *path,
                             const npg_vdb_place *place)
{
    float *rows;
    uint64_t hash;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts->u->size));
    npg_status status = npg_buffer_read(parts->u, 0, rows, parts->u->size);
    if (!status) status = write_grids(&hash, path, parts->levels, rows, place);
    if (!status) status = npg_archive_put(archive, "grids.hash", &hash, sizeof hash);
    if (!status && has_rest(parts->levels, rows))
        status = npg_archive_put(archive, "fit.rows", rows, parts->u->size);
    npg_release(&rows);
    return status;
}

static npg_status restore_grids(const npg_fit_parts *parts, const npg_archive *archive, const char *path)
{
    float *rows;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts->u->size));
    size_t size;
    npg_status status = NPG_OK;
    if (npg_archive_find(archive, "fit.rows", &size))
        status = npg_archive_get(archive, "fit.rows", rows, parts->u->size);
    if (!status) status = npg_vdb_load_levels(path, parts->levels, rows);
    if (!status) status = npg_buffer_write(parts->u, 0, rows, parts->u->size);
    npg_release(&rows);
    return status;
}

/* ---- optimisers ---- */

static npg_status save_adam(const npg_adam *adam, npg_archive_writer *archive, const char *name)
{
    char block[NPG_BLOCK_NAME];
    float *both;
    size_t bytes = adam->count * sizeof(float);
    NPG_TRY(npg_alloc(&both, NPG_FOR_FILES, 2 * bytes));
    npg_status status = npg_buffer_read(&adam->first, 0, both, bytes);
    if (!status) status = npg_buffer_read(&adam->second, 0, both + adam->count, bytes);
    snprintf(block, sizeof block, "fit.%s.moments", name);
    if (!status) status = npg_archive_put(archive, block, both, 2 * bytes);
    snprintf(block, sizeof block, "fit.%s.step", name);
    if (!status) status = npg_archive_put(archive, block, &adam->step, sizeof adam->step);
    npg_release(&both);
    return status;
}

static npg_status restore_adam(npg_adam *adam, const npg_archive *archive, const char *name)
{
    char block[NPG_BLOCK_NAME];
    float *both;
    size_t bytes = adam->count * sizeof(float);
    NPG_TRY(npg_alloc(&both, NPG_FOR_FILES, 2 * bytes));
    snprintf(block, sizeof block, "fit.%s.moments", name);
    npg_status status = npg_archive_get(archive, block, both, 2 * bytes);
    if (!status) status = npg_buffer_write(&adam->first, 0, both, bytes);
    if (!status) status = npg_buffer_write(&adam->second, 0, both + adam->count, bytes);
    snprintf(block, sizeof block, "fit.%s.step", name);
    if (!status) status = npg_archive_get(archive, block, &adam->step, sizeof adam->step);
    npg_release(&both);
    return status;
}

/* ---- all of it ---- */

npg_status npg_fit_save(npg_fit *fit, npg_archive_writer *archive, const char *grids_path,
                        const npg_vdb_place *place)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    size_t code_count;
    int64_t *code_step;
    double *code = npg_time_code_parts(parts.time_code, &code_count, &code_step);
    NPG_TRY(save_grids(&parts, archive, grids_path, place));
    NPG_TRY(save_adam(parts.grid_adam, archive, "grids"));
    NPG_TRY(save_adam(parts.mlp_adam, archive, "decoder"));
    NPG_TRY(npg_archive_put(archive, "fit.decoder", parts.params, parts.param_count * sizeof(float)));
    NPG_TRY(npg_archive_put(archive, "fit.time", code, code_count * sizeof(double)));
    return npg_archive_put(archive, "fit.time.step", code_step, sizeof *code_step);
}

npg_status npg_fit_restore(npg_fit *fit, const npg_archive *archive, const char *grids_path)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    size_t code_count;
    int64_t *code_step;
    double *code = npg_time_code_parts(parts.time_code, &code_count, &code_step);
    NPG_TRY(restore_grids(&parts, archive, grids_path));
    NPG_TRY(restore_adam(parts.grid_adam, archive, "grids"));
    NPG_TRY(restore_adam(parts.mlp_adam, archive, "decoder"));
    NPG_TRY(npg_archive_get(archive, "fit.decoder", parts.params, parts.param_count * sizeof(float)));
    NPG_TRY(npg_archive_get(archive, "fit.time", code, code_count * sizeof(double)));
    return npg_archive_get(archive, "fit.time.step", code_step, sizeof *code_step);
}
