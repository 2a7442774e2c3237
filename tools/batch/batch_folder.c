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

#define CLOUD_ENDINGS ".ply .obj .xyz .xyzn .txt .pts .npy .pcd"
#define MESH_ENDINGS  ".ply .obj"

/* ---- inside of a capture ---- */

typedef struct inside {
    const char *folder;
    bool is_confined;
} inside;

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

/* *path: that of the sub-folder when it holds files of these endings, else NULL; to be given to
 * npg_release(). */
static npg_status find_inside(char **path, const inside *in, const char *name, const char *endings)
{
    bool found = false;
    NPG_TRY(npg_join_path(path, in->folder, name));
    npg_status status = NPG_OK;
    if (is_folder(*path)) {
        if (in->is_confined) status = npg_path_confine(*path, in->folder);
        if (!status) status = holds(&found, *path, endings);
    }
    if (status || !found) npg_release(path);
    return status;
}

/* The first of the names that holds files; NULL when none does. */
static npg_status find_first(char **path, const inside *in, const char *const *names, const char *endings)
{
    *path = NULL;
    for (; *names && !*path; names++) NPG_TRY(find_inside(path, in, *names, endings));
    return NPG_OK;
}

static npg_status find_input(char **input, bool *of_mesh_vertices, const inside *in, const char *truth)
{
    static const char *const of_clouds[] = {"points", "point_clouds", "points_clouds", NULL};
    static const char *const raw[] = {"pcl_seqs", NULL};
    bool own = false;
    NPG_TRY(find_first(input, in, of_clouds, CLOUD_ENDINGS));
    if (!*input) NPG_TRY(holds(&own, in->folder, CLOUD_ENDINGS));
    if (!*input && !own) NPG_TRY(find_first(input, in, raw, CLOUD_ENDINGS));
    *of_mesh_vertices = !*input && !own && truth;
    return *input ? NPG_OK : npg_copy_text(input, *of_mesh_vertices ? truth : in->folder);
}

npg_status npg_batch_find_input(npg_capture *capture, char **input, const char *folder, bool is_confined)
{
    static const char *const truths[] = {"truth", "gt", NULL};
    const inside in = {folder, is_confined};
    char *truth;
    NPG_TRY(find_first(&truth, &in, truths, MESH_ENDINGS));
    npg_status status = find_input(input, &capture->of_mesh_vertices, &in, truth);
    npg_release(&truth);
    if (status) npg_release(input);
    return status;
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
    const npg_batch *batch;
    npg_listing names;
} listed;

static npg_status list_capture(void *user, const char *name)
{
    listed *l = user;
    npg_listing *names = &l->names;
    bool yes;
    NPG_TRY(is_capture(&yes, l->batch, name));
    if (!yes) return NPG_OK;
    NPG_TRY(npg_grow(&names->paths, &names->room, names->count + 1, sizeof *names->paths, NPG_FOR_FILES));
    NPG_TRY(npg_copy_text(&names->paths[names->count], name));
    names->count++;
    return NPG_OK;
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

static npg_status add_captures(npg_batch *batch, const npg_listing *names, const npg_batch_given *given)
{
    for (size_t i = 0; i < names->count; i++) {
        char name[256];
        npg_capture *capture;
        name_of(name, sizeof name, batch, names->paths[i]);
        npg_status status = npg_batch_add(batch, &capture, name);
        if (!status) status = npg_batch_complete(batch, capture, batch->path, names->paths[i], given);
        if (status) return npg_error_prefix(status, "%s/%s", batch->path, names->paths[i]);
    }
    return NPG_OK;
}

npg_status npg_batch_read_folder(npg_batch *batch, const npg_batch_given *given)
{
    listed l = {.batch = batch};
    if (!batch->output) return npg_error(NPG_USAGE, "no output folder; say where with -o DIR");
    npg_status status = npg_folder_each(batch->path, NPG_BAD_INPUT, list_capture, &l);
    if (l.names.count) qsort(l.names.paths, l.names.count, sizeof *l.names.paths, npg_natural_order);
    if (!status && !l.names.count)
        status = npg_error(NPG_BAD_INPUT, "%s: no sub-folder here, and each would be a capture", batch->path);
    if (!status) status = add_captures(batch, &l.names, given);
    npg_listing_close(&l.names);
    return status;
}
