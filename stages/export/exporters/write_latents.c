/* Latents: the latent grids of a run's windows for other programs. */
#include "export/exporters/exporters_internal.h"

#include <stdio.h>
#include <stdlib.h>

#include "export/exporters/vdb.h"
#include "job/vdb_file.h"
#include "pipeline/order.h"

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

typedef struct windows {
    int64_t *serials; /* owned */
    size_t count, capacity;
} windows;

static npg_status add_window(void *user, const char *name)
{
    windows *w = user;
    long long serial;
    int end = 0;
    if (sscanf(name, "window_%lld.vdb%n", &serial, &end) != 1 || !end || name[end] || name[7] < '0')
        return NPG_OK;
    NPG_TRY(npg_grow(&w->serials, &w->capacity, w->count + 1, sizeof *w->serials, NPG_FOR_FILES));
    w->serials[w->count++] = serial;
    return NPG_OK;
}

npg_status npg_latents_write(const npg_export_facts *facts)
{
    windows w = {0};
    char folder[NPG_PATH_SIZE];
    if (!facts->has_grids) return NPG_OK;
    npg_status status = npg_path_of(folder, facts->output, "job");
    if (!status) status = npg_export_folder(facts->output, "latents");
    if (!status) status = npg_folder_each(folder, NPG_DISK, add_window, &w);
    if (w.count) qsort(w.serials, w.count, sizeof *w.serials, npg_order_int64);
    for (size_t i = 0; i < w.count && !status; i++) status = write_window(facts, folder, w.serials[i]);
    npg_release(&w.serials);
    return status;
}
