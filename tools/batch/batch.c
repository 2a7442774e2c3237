/* Batch: the list of captures, whatever it was made from. */
#include "tools/batch/batch.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/memory.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"

npg_status npg_path_from(npg_arena *arena, char **path, const char *folder, const char *text)
{
    char here[PATH_MAX];
    if (*text != '/' && *folder != '/') {
        if (!getcwd(here, sizeof here)) return npg_error_errno(NPG_FAILED, "the working folder has no name");
        folder = strcmp(folder, ".") ? npg_arena_path(arena, here, folder) : here;
        NPG_TRY(npg_arena_status(arena));
    }
    *path = *text == '/' ? npg_arena_text(arena, text) : npg_arena_path(arena, folder, text);
    return npg_arena_status(arena);
}

/* ---- captures ---- */

/* A name becomes a folder and stands in commands and tables. */
static npg_status check_name(const npg_batch *batch, const char *name)
{
    if (!*name) return npg_error(NPG_USAGE, "the capture's name is empty");
    if (strlen(name) > 200) return npg_error(NPG_USAGE, "the name %.40s... is longer than 200 bytes", name);
    if (*name == '.' || *name == '-')
        return npg_error(NPG_USAGE, "the name %s begins with \"%c\"", name, *name);
    for (const char *c = name; *c; c++)
        if (*c == '/' || (unsigned char)*c < 32 || *c == 127)
            return npg_error(NPG_USAGE, "the name %s has a slash or a control character in it", name);
    for (size_t i = 0; i < batch->count; i++)
        if (!strcmp(batch->captures[i].name, name))
            return npg_error(NPG_USAGE, "two captures have the name %s; give one another \"name\"", name);
    return NPG_OK;
}

npg_status npg_batch_add(npg_batch *batch, npg_capture **out, const char *name)
{
    NPG_TRY(check_name(batch, name));
    NPG_TRY(npg_arena_grow(&batch->arena, &batch->captures, &batch->capacity, batch->count + 1,
                           sizeof *batch->captures));
    npg_capture *capture = *out = &batch->captures[batch->count++];
    capture->name = npg_arena_text(&batch->arena, name);
    NPG_TRY(npg_arena_status(&batch->arena));
    return npg_options_open(&capture->options);
}

/* What the command line sets wins; where results go is the batch's business. */
static npg_status set_given(npg_options *options, const npg_options *given)
{
    npg_option_info info = {.struct_size = sizeof info};
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        if (strcmp(info.name, "output") != 0 && npg_options_is_set(given, info.name))
            NPG_TRY(npg_options_set(options, info.name, npg_options_get(given, info.name)));
    return NPG_OK;
}

/* A run of a batch reads files and is alone with its output. */
static npg_status check_options(const npg_options *options)
{
    static const char *const refused[] = {"follow", "pull", "append"};
    for (size_t i = 0; i < sizeof refused / sizeof *refused; i++)
        if (npg_options_is_set(options, refused[i]))
            return npg_error(NPG_USAGE, "option %s is not for a batch", refused[i]);
    return NPG_OK;
}

/* Captures come from others: what leads out of a capture's folder is not read unless the batch says so. */
static npg_status confine(bool *is_confined, npg_options *options)
{
    npg_settings settings;
    if (!npg_options_is_set(options, "confine")) NPG_TRY(npg_options_set(options, "confine", "yes"));
    npg_options_fill(options, npg_run_options, &settings);
    *is_confined = settings.confine;
    return NPG_OK;
}

/* Of a batch that is a folder, whoever fills it, a capture is not read that is a link out of it. */
static npg_status check_input(const npg_batch *batch, const npg_capture *capture, bool is_confined)
{
    struct stat info;
    if (!is_confined || !batch->is_folder || stat(capture->input, &info) || !S_ISDIR(info.st_mode))
        return NPG_OK;
    return npg_path_confine(capture->input, batch->path);
}

npg_status npg_batch_complete(npg_batch *batch, npg_capture *capture, const char *folder, const char *text,
                              const npg_batch_given *given)
{
    bool is_confined;
    NPG_TRY(set_given(capture->options, given->options));
    NPG_TRY(check_options(capture->options));
    NPG_TRY(confine(&is_confined, capture->options));
    if (given->max_time_s >= 0) capture->max_time_s = given->max_time_s;
    if (given->segments) capture->segments = given->segments;
    NPG_TRY(npg_path_from(&batch->arena, &capture->input, folder, text));
    npg_status status = check_input(batch, capture, is_confined);
    if (status == NPG_BAD_INPUT)
        capture->refusal = npg_arena_text(&batch->arena, npg_error_text());
    else
        NPG_TRY(status);
    capture->output = npg_arena_path(&batch->arena, batch->output, capture->name);
    NPG_TRY(npg_arena_status(&batch->arena));
    NPG_TRY(npg_options_set(capture->options, "input", capture->input));
    return npg_options_set(capture->options, "output", capture->output);
}

/* ---- a folder whose sub-folders are captures, in natural order ---- */

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

static npg_status read_folder(npg_batch *batch, const npg_batch_given *given)
{
    struct dirent **entries = NULL;
    npg_status status = NPG_OK;
    if (!batch->output) return npg_error(NPG_USAGE, "no output folder; say where with -o DIR");
    int count = scandir(batch->path, &entries, NULL, versionsort);
    if (count < 0) return npg_error_errno(NPG_BAD_INPUT, "can't list %s", batch->path);
    for (int i = 0; i < count; i++) {
        const char *name = entries[i]->d_name;
        bool yes = false;
        if (!status) status = is_capture(&yes, batch, name);
        if (!status && yes)
            status = npg_error_prefix(add_capture(batch, name, given), "%s/%s", batch->path, name);
        free(entries[i]);
    }
    free(entries);
    if (!status && !batch->count)
        return npg_error(NPG_BAD_INPUT, "%s: no sub-folder here, and each would be a capture", batch->path);
    return status;
}

/* ---- the batch ---- */

bool npg_batch_is_mine(const npg_batch *batch, size_t i)
{
    return i % batch->task_count == batch->task_index;
}

static npg_status fill(npg_batch *batch, const char *path, const npg_batch_given *given)
{
    struct stat info;
    const char *output = npg_options_get(given->options, "output");
    batch->task_count = 1;
    batch->path = npg_arena_text(&batch->arena, path);
    NPG_TRY(npg_arena_status(&batch->arena));
    if (output[0]) NPG_TRY(npg_path_from(&batch->arena, &batch->output, ".", output));
    if (npg_options_is_set(given->options, "input"))
        return npg_error(NPG_USAGE, "option input is not for a batch: its captures have theirs");
    if (stat(path, &info)) return npg_error(NPG_BAD_INPUT, "%s: %s", path, strerror(errno));
    batch->is_folder = S_ISDIR(info.st_mode);
    return batch->is_folder ? read_folder(batch, given) : npg_batch_read_manifest(batch, given);
}

npg_status npg_batch_open(npg_batch **out, const char *path, const npg_batch_given *given)
{
    *out = NULL;
    NPG_TRY(npg_object_open(out, NPG_FOR_RUN, sizeof **out));
    npg_status status = fill(*out, path, given);
    if (status) npg_batch_close(out);
    return status;
}

void npg_batch_close(npg_batch **batch)
{
    for (size_t i = 0; *batch && i < (*batch)->count; i++) npg_options_close(&(*batch)->captures[i].options);
    npg_object_close(batch);
}
