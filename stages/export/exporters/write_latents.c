/* Latents: the latent grids of a run's windows for other programs. */
#include "export/exporters/exporters_internal.h"

#include <stdio.h>

#include "export/exporters/vdb.h"
#include "job/vdb_file.h"
#include "pipeline/file.h"

typedef struct latents {
    const char *grids_path;
    const npg_placement *placement;
    npg_vdb_span span;
} latents;

static npg_status save(void *user, const char *path)
{
    latents *l = user;
    return npg_vdb_save_latents(path, &l->span, l->grids_path, l->placement);
}

static npg_status write_window(const npg_export_facts *facts, const char *folder, int64_t serial)
{
    char name[64], file[80], path[NPG_PATH_SIZE], grids_path[NPG_PATH_SIZE];
    snprintf(name, sizeof name, "window_%06lld.vdb", (long long)serial);
    snprintf(file, sizeof file, "latents/%s", name);
    npg_status status = npg_path_of(grids_path, folder, name);
    if (!status) status = npg_path_of(path, facts->output, file);
    latents l = {grids_path, facts->placement, {0}};
    if (!status) status = npg_vdb_file_write(path, NULL, save, &l);
    if (!status)
        status = npg_export_made(facts->log, "latents", file, l.span.first, l.span.last - l.span.first + 1);
    return status;
}

npg_status npg_latents_write(const npg_export_facts *facts)
{
    int64_t *serials = NULL;
    size_t count = 0;
    char folder[NPG_PATH_SIZE];
    if (!facts->has_grids) return NPG_OK;
    npg_status status = npg_path_of(folder, facts->output, "job");
    if (!status) status = npg_export_folder(facts->output, "latents");
    if (!status) status = npg_folder_numbers(&serials, &count, folder, "window_", "vdb");
    for (size_t i = 0; i < count && !status; i++) status = write_window(facts, folder, serials[i]);
    npg_release(&serials);
    return status;
}
