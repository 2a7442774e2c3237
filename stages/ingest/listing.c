/* Listing: files of a folder in natural order, for those who take folders of meshes or clouds. */
#include "ingest/ingest.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

static bool ends_in(const char *name, const char *endings)
{
    const char *dot = strrchr(name, '.');
    if (!dot || name[0] == '.') return false;
    for (const char *at = endings; *at; at += strspn(at, " ")) {
        size_t length = strcspn(at, " ");
        if (strlen(dot) == length && !strncasecmp(dot, at, length)) return true;
        at += length;
    }
    return false;
}

static npg_status add_path(npg_listing *listing, char *path)
{
    NPG_TRY(
        npg_arena_grow(&listing->arena, &listing->paths, &listing->room, listing->count + 1, sizeof path));
    listing->paths[listing->count++] = path;
    return NPG_OK;
}

typedef struct adding {
    npg_listing *listing;
    const char *folder, *endings;
} adding;

static npg_status add_name(void *user, const char *name)
{
    const adding *a = user;
    if (!ends_in(name, a->endings)) return NPG_OK;
    return add_path(a->listing, npg_arena_path(&a->listing->arena, a->folder, name));
}

static npg_status add_folder(npg_listing *listing, const char *path, const char *endings)
{
    size_t before = listing->count;
    npg_status status = npg_folder_each(path, NPG_BAD_INPUT, add_name, &(adding){listing, path, endings});
    if (!status && listing->count == before)
        return npg_error(NPG_BAD_INPUT, "%s: the folder has no file that ends in %s", path, endings);
    if (!status)
        qsort(listing->paths + before, listing->count - before, sizeof *listing->paths, npg_natural_order);
    return status;
}

/* The frames of a rig, each as "rig.json#NUMBER" (npg_read_shape()). */
static npg_status add_rig(npg_listing *listing, const char *path)
{
    npg_rig *rig;
    NPG_TRY(npg_rig_open(&rig, path, &npg_rig_usual));
    npg_status status = NPG_OK;
    for (size_t f = 0; f < rig->frame_count && !status; f++) {
        char *name = npg_arena_take(&listing->arena, strlen(path) + 24, 1);
        if (name) sprintf(name, "%s#%lld", path, (long long)rig->numbers[f]);
        status = name ? add_path(listing, name) : npg_arena_status(&listing->arena);
    }
    npg_rig_close(&rig);
    return status;
}

npg_status npg_listing_add(npg_listing *listing, const char *path, const char *endings)
{
    struct stat facts;
    listing->arena.purpose = NPG_FOR_FILES;
    if (npg_rig_is_frame(path)) return add_path(listing, npg_arena_text(&listing->arena, path));
    if (stat(path, &facts) != 0) return npg_error(NPG_BAD_INPUT, "%s: %s", path, strerror(errno));
    if (S_ISDIR(facts.st_mode)) return add_folder(listing, path, endings);
    if (npg_rig_is(path)) return add_rig(listing, path);
    return add_path(listing, npg_arena_text(&listing->arena, path));
}

void npg_listing_keep(npg_listing *listing, const npg_selection *selection)
{
    size_t kept = 0;
    int64_t count = (int64_t)listing->count;
    for (int64_t i = 0; i < count; i++)
        if (npg_selection_takes(selection, i, i, count)) listing->paths[kept++] = listing->paths[i];
    listing->count = kept;
}

void npg_listing_close(npg_listing *listing)
{
    npg_arena_release(&listing->arena);
    *listing = (npg_listing){0};
}

npg_status npg_subfolder(char **out, const char *folder, const char *names)
{
    struct stat facts;
    for (const char *at = names; *at; at += strspn(at, " ")) {
        char name[64];
        size_t length = strcspn(at, " ");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        NPG_TRY(npg_join_path(out, folder, name));
        if (stat(*out, &facts) == 0 && S_ISDIR(facts.st_mode)) return NPG_OK;
        npg_release(out);
        at += length;
    }
    return npg_copy_text(out, folder);
}
