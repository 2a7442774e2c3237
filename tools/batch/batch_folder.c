/* Batch of a folder: every sub-folder is a capture, in natural order.
 *
 * The layout of the paper's published code is understood: <capture>/point_clouds/0000.ply ... beside
 * <capture>/gt/0000.obj ..., or gt/ alone; and that of neupig synth: points/ beside truth/. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/memory.h"
#include "tools/batch/batch.h"

#define MESH_ENDINGS ".ply .obj"

/* ---- inside of a capture ---- */

static bool is_folder(const char *path)
{
    struct stat info;
    return !stat(path, &info) && S_ISDIR(info.st_mode);
}

/* *found: whether files of these endings lie in the folder. */
static npg_status holds(bool *found, const char *folder, const char *endings)
{
    npg_listing files = {0};
    npg_status status = npg_listing_add(&files, folder, endings);
    *found = !status;
    npg_listing_close(&files);
    return status == NPG_MEMORY ? status : NPG_OK;
}

typedef struct inside {
    npg_arena *arena;
    const char *folder;
    bool is_confined;
} inside;

/* The first of the names that is a sub-folder with files of these endings; NULL when none is. */
static npg_status find_first(char **found, const inside *in, const char *const *names, const char *endings)
{
    for (*found = NULL; *names && !*found; names++) {
        bool is_there;
        char *path = npg_arena_path(in->arena, in->folder, *names);
        NPG_TRY(npg_arena_status(in->arena));
        if (!is_folder(path)) continue;
        if (in->is_confined) NPG_TRY(npg_path_confine(path, in->folder));
        NPG_TRY(holds(&is_there, path, endings));
        if (is_there) *found = path;
    }
    return NPG_OK;
}

npg_status npg_batch_find_input(npg_batch *batch, npg_capture *capture, bool is_confined)
{
    static const char *const truths[] = {"truth", "gt", NULL};
    static const char *const of_clouds[] = {"points", "point_clouds", "points_clouds", NULL};
    static const char *const raw[] = {"pcl_seqs", NULL};
    const inside in = {&batch->arena, capture->input, is_confined};
    bool own = false;
    char *truth, *found;
    NPG_TRY(find_first(&truth, &in, truths, MESH_ENDINGS));
    NPG_TRY(find_first(&found, &in, of_clouds, NPG_CLOUDS));
    if (!found) NPG_TRY(holds(&own, in.folder, NPG_CLOUDS));
    if (!found && !own) NPG_TRY(find_first(&found, &in, raw, NPG_CLOUDS));
    capture->of_mesh_vertices = !found && !own && truth;
    if (capture->of_mesh_vertices) found = truth;
    if (found) capture->input = found;
    return NPG_OK;
}

/* ---- the folder ---- */

/* Whether the entry is a folder, and not the one that the results go to. */
static npg_status is_capture(bool *yes, const npg_batch *batch, const char *name)
{
    struct stat info, output;
    char path[NPG_PATH_SIZE];
    *yes = false;
    if (name[0] == '.') return NPG_OK;
    NPG_TRY(npg_path_of(path, batch->path, name));
    if (!stat(path, &info) && S_ISDIR(info.st_mode))
        *yes = stat(batch->output, &output) || output.st_dev != info.st_dev || output.st_ino != info.st_ino;
    return NPG_OK;
}

typedef struct listed {
    npg_batch *batch;
    char **names;
    size_t count, capacity;
} listed;

static npg_status list_capture(void *user, const char *name)
{
    listed *l = user;
    npg_arena *arena = &l->batch->arena;
    bool yes;
    NPG_TRY(is_capture(&yes, l->batch, name));
    if (!yes) return NPG_OK;
    NPG_TRY(npg_arena_grow(arena, &l->names, &l->capacity, l->count + 1, sizeof *l->names));
    l->names[l->count++] = npg_arena_text(arena, name);
    return npg_arena_status(arena);
}

/* The name of its folder in the output: without what can't be one (npg_batch_add()),
 * and not that of another. */
static void name_of(char *out, size_t size, const npg_batch *batch, const char *name)
{
    enum { LONGEST = 190 };
    size_t length = strlen(name), copies = 1;
    if (length > LONGEST)
        for (length = LONGEST; length > 1 && ((unsigned char)name[length] & 0xc0) == 0x80;) length--;
    snprintf(out, size, "%.*s", (int)length, name);
    if (out[0] == '-') out[0] = '_';
    for (char *c = out; *c; c++)
        if ((unsigned char)*c < 32 || *c == 127) *c = '_';
    for (size_t i = 0; i < batch->count; i++)
        if (!strcmp(batch->captures[i].name, out)) {
            snprintf(out + length, size - length, "_%zu", ++copies);
            i = (size_t)-1; /* this one may be another's, too */
        }
}

static npg_status add_capture(npg_batch *batch, const char *folder, const npg_batch_given *given)
{
    char name[256];
    npg_capture *capture;
    name_of(name, sizeof name, batch, folder);
    NPG_TRY(npg_batch_add(batch, &capture, name));
    return npg_batch_complete(batch, capture, batch->path, folder, given);
}

npg_status npg_batch_read_folder(npg_batch *batch, const npg_batch_given *given)
{
    listed l = {.batch = batch};
    if (!batch->output) return npg_error(NPG_USAGE, "no output folder; say where with -o DIR");
    NPG_TRY(npg_folder_each(batch->path, NPG_BAD_INPUT, list_capture, &l));
    if (!l.count)
        return npg_error(NPG_BAD_INPUT, "%s: no sub-folder here, and each would be a capture", batch->path);
    qsort(l.names, l.count, sizeof *l.names, npg_natural_order);
    for (size_t i = 0; i < l.count; i++)
        NPG_TRY(npg_error_prefix(add_capture(batch, l.names[i], given), "%s/%s", batch->path, l.names[i]));
    return NPG_OK;
}
