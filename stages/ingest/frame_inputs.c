/* Frame inputs: the files that a folder, pattern, glob, list or single path stands for; listings of them. */
#include "ingest/ingest_internal.h"

#include <glob.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#define FORMATS_TEXT "PLY, OBJ, XYZ, TXT, PTS, NPY, PCD"

static npg_status add_path(npg_listing *list, char *path)
{
    NPG_TRY(npg_arena_grow(list->arena, &list->paths, &list->room, list->count + 1, sizeof path));
    list->paths[list->count++] = path;
    return NPG_OK;
}

static void sort_paths(npg_listing *list, size_t first)
{
    if (list->count > first)
        qsort(list->paths + first, list->count - first, sizeof *list->paths, npg_natural_order);
}

/* ---- a folder ---- */

static bool ends_in(const char *name, const char *endings)
{
    const char *dot = strrchr(name, '.');
    for (const char *at = endings; dot && *at; at += strspn(at, " ")) {
        size_t length = strcspn(at, " ");
        if (strlen(dot) == length && !strncasecmp(dot, at, length)) return true;
        at += length;
    }
    return false;
}

/* Names in a folder that do not begin with a dot: the files with one of these endings, or without any the sub-folders. */
typedef struct wanted {
    npg_listing *out;
    const char *folder, *endings;
} wanted;

static npg_status add_wanted(void *user, const char *name)
{
    const wanted *w = user;
    if (name[0] == '.' || (w->endings && !ends_in(name, w->endings))) return NPG_OK;
    char *path = npg_arena_path(w->out->arena, w->folder, name);
    NPG_TRY(npg_arena_status(w->out->arena));
    return npg_is_folder(path) == !w->endings ? add_path(w->out, path) : NPG_OK;
}

static npg_status list_folder(npg_listing *out, const char *folder, const char *endings)
{
    size_t before = out->count;
    npg_status status = npg_folder_each(folder, NPG_BAD_INPUT, add_wanted, &(wanted){out, folder, endings});
    sort_paths(out, before);
    return status;
}

/* Frames of one capture have one ending; the others are counted, not taken. */
static npg_status keep_one_ending(npg_listing *list, const char *folder)
{
    size_t kept = 0, most, next;
    const char *ending = npg_ending_of_most(&most, list->paths, list->count, sizeof *list->paths, NULL);
    const char *other = npg_ending_of_most(&next, list->paths, list->count, sizeof *list->paths, ending);
    if (most && most == next)
        return npg_error(NPG_BAD_INPUT,
                         "%s: holds %zu files *%s and as many *%s; say which with a pattern such as %s/*%s",
                         folder, most, ending, other, folder, ending);
    for (size_t i = 0; i < list->count; i++)
        if (ends_in(list->paths[i], ending)) list->paths[kept++] = list->paths[i];
    list->left_out += list->count - kept;
    list->count = kept;
    return NPG_OK;
}

npg_status npg_subfolder(npg_arena *arena, const char **out, const char *folder, const char *names)
{
    for (const char *at = names; *at; at += strspn(at, " ")) {
        char name[64];
        size_t length = strcspn(at, " ");
        snprintf(name, sizeof name, "%.*s", (int)length, at);
        *out = npg_arena_path(arena, folder, name);
        NPG_TRY(npg_arena_status(arena));
        if (npg_is_folder(*out)) return NPG_OK;
        at += length;
    }
    *out = folder;
    return NPG_OK;
}

/* Captures often keep their clouds one level down: in points/ (ours, and that of neupig synth), in
 * point_clouds/ (the paper's data), or in an only sub-folder. */
static npg_status find_sub_folder(npg_arena *arena, const char **out, const char *folder)
{
    npg_listing folders = {.arena = arena};
    NPG_TRY(npg_subfolder(arena, out, folder, "points point_clouds"));
    if (*out != folder) return NPG_OK;
    NPG_TRY(list_folder(&folders, folder, NULL));
    if (folders.count == 1) *out = folders.paths[0];
    return NPG_OK;
}

static npg_status find_in_folder(npg_listing *out, const char *folder)
{
    const char *from = folder;
    NPG_TRY(list_folder(out, folder, NPG_CLOUDS));
    if (!out->count) NPG_TRY(find_sub_folder(out->arena, &from, folder));
    if (from != folder) NPG_TRY(list_folder(out, from, NPG_CLOUDS));
    NPG_TRY(keep_one_ending(out, from));
    if (out->count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: no file here has a format that can be read (" FORMATS_TEXT ")",
                     from);
}

/* ---- a glob ---- */

static npg_status find_by_glob(npg_listing *out, const char *pattern)
{
    glob_t found = {0};
    npg_status status = NPG_OK;
    int result = glob(pattern, GLOB_NOSORT, NULL, &found);
    if (result == GLOB_NOSPACE) status = npg_error(NPG_MEMORY, "%s: no memory for the names", pattern);
    for (size_t i = 0; i < found.gl_pathc && !status && !result; i++)
        if (!npg_is_folder(found.gl_pathv[i]))
            status = add_path(out, npg_arena_text(out->arena, found.gl_pathv[i]));
    globfree(&found);
    sort_paths(out, 0);
    return status;
}

/* ---- a pattern ---- */

/* The place of the number in a pattern: everything before it, its least width, everything after it. */
typedef struct pattern {
    char *before;
    const char *after;
    int width;
} pattern;

/* Finds %d, %04d or ####.  *length is that of the conversion, 0 without one; a width of more than three
 * digits is longer than any file name. */
static const char *find_conversion(const char *text, size_t *length, int *width)
{
    *length = 0;
    for (const char *at = text; *at; at++) {
        size_t digits = *at == '%' ? strspn(at + 1, "0123456789") : 0;
        if (*at == '%' && at[1 + digits] == 'd' && digits <= 3) {
            *width = atoi(at + 1);
            *length = digits + 2;
            return at;
        }
        if (*at == '#') {
            *length = strspn(at, "#");
            *width = (int)*length;
            return at;
        }
    }
    return NULL;
}

static npg_status parse_pattern(npg_arena *arena, pattern *p, const char *text)
{
    size_t length, other;
    int unused;
    const char *at = find_conversion(text, &length, &p->width);
    if (find_conversion(at + length, &other, &unused))
        return npg_error(NPG_USAGE, "%s: a pattern has one place for the number, not two", text);
    p->before = npg_arena_copy(arena, text, (size_t)(at - text) + 1, 1);
    p->after = at + length;
    NPG_TRY(npg_arena_status(arena));
    p->before[at - text] = 0;
    return NPG_OK;
}

static char *pattern_as_glob(npg_arena *arena, const pattern *p)
{
    size_t at = 0;
    char *out = npg_arena_take(arena, 2 * (strlen(p->before) + strlen(p->after)) + 2, 1);
    for (int part = 0; part < 2 && out; part++) {
        for (const char *c = part ? p->after : p->before; *c; c++) {
            if (strchr("*?[\\", *c)) out[at++] = '\\';
            out[at++] = *c;
        }
        if (part == 0) out[at++] = '*';
    }
    return out;
}

/* The number a path has under the pattern, -1 when it does not fit ("frame_12b.ply", a wrong width). */
static int64_t number_under(const pattern *p, const char *path)
{
    const char *digits = path + strlen(p->before);
    size_t length = strspn(digits, "0123456789"); /* 17 always fit an int64_t */
    if (!length || length > 17 || strcmp(digits + length, p->after) != 0) return -1;
    /* printf() pads with zeros up to the width and never beyond it. */
    bool is_padded = digits[0] == '0' && length > 1;
    if ((int)length < p->width || (is_padded && (int)length != p->width)) return -1;
    return strtoll(digits, NULL, 10);
}

static npg_status keep_fitting(npg_listing *list, const pattern *p)
{
    size_t kept = 0;
    list->numbers = npg_arena_take(list->arena, list->count + 1, sizeof *list->numbers);
    NPG_TRY(npg_arena_status(list->arena));
    for (size_t i = 0; i < list->count; i++) {
        int64_t number = number_under(p, list->paths[i]);
        if (number < 0) continue;
        list->numbers[kept] = number;
        list->paths[kept++] = list->paths[i];
    }
    list->count = kept;
    return NPG_OK;
}

static npg_status find_by_pattern(npg_listing *out, const char *text)
{
    pattern p = {0};
    NPG_TRY(parse_pattern(out->arena, &p, text));
    char *as_glob = pattern_as_glob(out->arena, &p);
    NPG_TRY(npg_arena_status(out->arena));
    NPG_TRY(find_by_glob(out, as_glob));
    return keep_fitting(out, &p);
}

/* ---- a list file ---- */

/* A line's path as it can be opened: as it stands or beside the list; NULL when it is not there. */
static char *resolve(npg_arena *arena, const char *list_path, char *line)
{
    const char *slash = strrchr(list_path, '/');
    if (*line != '/' && slash) {
        char *folder = npg_arena_text(arena, list_path);
        if (!folder) return NULL;
        folder[slash == list_path ? 1 : slash - list_path] = 0;
        char *path = npg_arena_path(arena, folder, line);
        if (path && npg_is_there(path)) return path;
    }
    return npg_is_there(line) ? line : NULL;
}

/* The next line that says something, as text of its own; NPG_END. */
static npg_status next_entry(npg_arena *arena, char **out, npg_source *source)
{
    const char *at, *end;
    do {
        NPG_TRY(npg_source_row(source, &at, &end));
    } while (*at == '#');
    while (end > at && (end[-1] == ' ' || end[-1] == '\t')) end--;
    size_t length = (size_t)(end - at);
    if (length > 4096 || memchr(at, 0, length)) return npg_source_bad_line(source, "not a path");
    *out = npg_arena_take(arena, length + 1, 1);
    if (*out) memcpy(*out, at, length);
    return npg_arena_status(arena);
}

static npg_status read_list(npg_listing *out, npg_source *source)
{
    for (;;) {
        char *line;
        npg_status status = next_entry(out->arena, &line, source);
        if (status) return status == NPG_END ? NPG_OK : status;
        char *path = resolve(out->arena, source->name, line);
        NPG_TRY(npg_arena_status(out->arena));
        if (!path) return npg_source_bad_line(source, "there is no file %s", line);
        NPG_TRY(add_path(out, path));
    }
}

/* A list, if its first line is the path of a file; any .lst or .list is one. */
static npg_status is_list(npg_arena *arena, bool *out, const char *path)
{
    npg_source *source;
    const char *dot = strrchr(path, '.');
    char *line;
    *out = dot && (!strcasecmp(dot, ".lst") || !strcasecmp(dot, ".list"));
    /* Of the endings that readers know only those of plain text may be a list. */
    const char *format = npg_format_by_ending(path);
    if (*out || (format && strcmp(format, "xyz") != 0)) return NPG_OK;
    NPG_TRY(npg_source_open_file(&source, path));
    npg_status status = next_entry(arena, &line, source);
    *out = !status && resolve(arena, path, line);
    npg_source_close(&source);
    return status == NPG_MEMORY ? status : npg_arena_status(arena); /* what is no text is no list */
}

static npg_status find_in_list(npg_listing *out, const char *path)
{
    npg_source *source;
    NPG_TRY(npg_source_open_file(&source, path));
    out->is_listed = true;
    npg_status status = read_list(out, source);
    if (!status && !out->count) status = npg_error(NPG_BAD_INPUT, "%s: the list names no file", path);
    npg_source_close(&source);
    return status;
}

/* ---- any of them ---- */

static npg_status find_file(npg_listing *out, const char *path)
{
    struct stat info;
    bool list;
    if (!stat(path, &info) && !S_ISREG(info.st_mode))
        return npg_error(NPG_BAD_INPUT, "%s: neither a file nor a folder; for a pipe use - (standard input)",
                         path);
    NPG_TRY(is_list(out->arena, &list, path));
    return list ? find_in_list(out, path) : add_path(out, npg_arena_text(out->arena, path));
}

static npg_status find_matches(npg_listing *out, const char *input)
{
    size_t length;
    int width;
    if (find_conversion(input, &length, &width))
        NPG_TRY(find_by_pattern(out, input));
    else if (strpbrk(input, "*?["))
        NPG_TRY(find_by_glob(out, input));
    else
        return npg_error(NPG_BAD_INPUT, "%s: there is no such file or folder", input);
    if (!out->count) return npg_error(NPG_BAD_INPUT, "%s: no file fits this pattern", input);
    return NPG_OK;
}

npg_status npg_paths_find(npg_listing *out, const char *input)
{
    return npg_is_folder(input)  ? find_in_folder(out, input)
           : npg_is_there(input) ? find_file(out, input)
                                 : find_matches(out, input);
}

/* ---- listings ---- */

/* The frames of a rig, each as "rig.json#NUMBER" (npg_read_shape()). */
static npg_status add_rig(npg_listing *listing, const char *path)
{
    npg_rig *rig;
    NPG_TRY(npg_rig_open(&rig, path, &npg_rig_usual));
    npg_status status = NPG_OK;
    for (size_t f = 0; f < rig->frame_count && !status; f++) {
        char *name = npg_arena_take(listing->arena, strlen(path) + 24, 1);
        if (name) sprintf(name, "%s#%lld", path, (long long)rig->numbers[f]);
        status = name ? add_path(listing, name) : npg_arena_status(listing->arena);
    }
    npg_rig_close(&rig);
    return status;
}

npg_status npg_listing_add(npg_listing *listing, const char *path, const char *endings)
{
    size_t before = listing->count;
    if (!npg_rig_is_frame(path) && !npg_is_there(path))
        return npg_error_errno(NPG_BAD_INPUT, "can't read %s", path);
    if (npg_is_folder(path)) {
        NPG_TRY(list_folder(listing, path, endings));
        return listing->count > before
                   ? NPG_OK
                   : npg_error(NPG_BAD_INPUT, "%s: the folder has no file that ends in %s", path, endings);
    }
    if (npg_rig_is(path)) return add_rig(listing, path);
    return add_path(listing, npg_arena_text(listing->arena, path));
}

void npg_listing_keep(npg_listing *listing, const npg_selection *selection)
{
    size_t kept = 0;
    int64_t count = (int64_t)listing->count;
    for (int64_t i = 0; i < count; i++)
        if (npg_selection_takes(selection, i, i, count)) listing->paths[kept++] = listing->paths[i];
    listing->count = kept;
}
