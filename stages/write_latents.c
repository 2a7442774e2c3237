/* Latents: the latent grids of a run's windows for other programs. */
#include "write_latents.h"

#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "vdb_file.h"
#include "vdb_latents.h"

typedef struct windows {
    int64_t *serials; /* owned */
    size_t count, capacity;
} windows;

static int by_value(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return a < b ? -1 : a > b;
}

static npg_status find_windows(windows *w, const char *folder)
{
    npg_status status = NPG_OK;
    DIR *listing = opendir(folder);
    if (!listing) return npg_error_errno(NPG_DISK, "can't list %s", folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));) {
        long long serial;
        char rest[8];
        if (sscanf(entry->d_name, "window_%lld.%7s", &serial, rest) != 2 || strcmp(rest, "vdb") != 0)
            continue;
        status = npg_grow(&w->serials, &w->capacity, w->count + 1, sizeof *w->serials, NPG_FOR_FILES);
        if (!status) w->serials[w->count++] = serial;
    }
    closedir(listing);
    if (!status && w->count) qsort(w->serials, w->count, sizeof *w->serials, by_value);
    return status;
}

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

static npg_status write_window(const npg_form_facts *facts, const char *folder, int64_t serial)
{
    char name[64], file[80], *grids_path = NULL, *path = NULL;
    snprintf(name, sizeof name, "window_%06lld.vdb", (long long)serial);
    snprintf(file, sizeof file, "latents/%s", name);
    npg_status status = npg_join_path(&grids_path, folder, name);
    if (!status) status = npg_join_path(&path, facts->output, file);
    latents l = {grids_path, facts->placement, {0}};
    if (!status) status = npg_vdb_file_write(path, NULL, save, &l);
    if (!status)
        status = npg_form_made(facts->log, "latents", file, l.span.first, l.span.last - l.span.first + 1);
    npg_release(&grids_path);
    npg_release(&path);
    return status;
}

npg_status npg_latents_write(const npg_form_facts *facts)
{
    windows w = {0};
    char *folder = NULL, *made = NULL;
    if (!facts->has_grids) return NPG_OK;
    npg_status status = npg_join_path(&folder, facts->output, "job");
    if (!status) status = npg_join_path(&made, facts->output, "latents");
    if (!status) status = npg_make_folder(made);
    if (!status) status = find_windows(&w, folder);
    for (size_t i = 0; i < w.count && !status; i++) status = write_window(facts, folder, w.serials[i]);
    npg_release(&w.serials);
    npg_release(&folder);
    npg_release(&made);
    return status;
}
