/* Readers: which format a file has, and the calls that do not care. */
#include "ingest/ingest_internal.h"

#include <string.h>
#include <strings.h>

enum { PLY, OBJ, NPY, XYZ, XYZN, TXT, PTS, PCD, FORMATS };

/* clang-format off */
static const struct format {
    const char *ending, *name;
    npg_format_read *read;
    bool needs_whole; /* nothing but blanks may follow */
} formats[FORMATS] = {
    [PLY]  = {".ply",  "ply", npg_ply_read, true},
    [OBJ]  = {".obj",  "obj", npg_obj_read, false},
    [NPY]  = {".npy",  "npy", npg_npy_read, true},
    [XYZ]  = {".xyz",  "xyz", npg_xyz_read,           false},
    [XYZN] = {".xyzn", "xyz", npg_xyz_read,           false},
    [TXT]  = {".txt",  "xyz", npg_xyz_read,           false},
    [PTS]  = {".pts",  "xyz", npg_xyz_read,           false},
    [PCD]  = {".pcd",  "pcd", npg_pcd_read, false}};
/* clang-format on */

static const struct format *by_ending(const char *path)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    for (size_t i = 0; dot && i < FORMATS; i++)
        if (!strcasecmp(dot, formats[i].ending)) return &formats[i];
    return NULL;
}

static bool looks_like_numbers(const char *text, size_t length)
{
    size_t digits = 0;
    for (size_t i = 0; i < length; i++) {
        if (!text[i] || !strchr("0123456789+-.eE,; \t\r\n", text[i])) return false;
        digits += text[i] >= '0' && text[i] <= '9';
    }
    return digits >= 3; /* a point has at least three */
}

/* From the first bytes of a file. */
static const struct format *by_content(const unsigned char *data, size_t size)
{
    const char *text = (const char *)data;
    if (size >= 4 && !memcmp(text, "ply", 3) && strchr("\r\n ", text[3]) && text[3]) return &formats[PLY];
    if (size >= 6 && !memcmp(text, "\x93NUMPY", 6)) return &formats[NPY];
    if (size >= 5 && (!memcmp(text, "# .PCD", 5) || !memcmp(text, "VERSION", 5))) return &formats[PCD];
    if (size >= 2 && !memcmp(text, "v ", 2)) return &formats[OBJ];
    const char *end = memchr(text, '\n', size);
    return end && looks_like_numbers(text, (size_t)(end - text)) ? &formats[XYZ] : NULL;
}

/* The ending decides; of a file with another ending, or of a PLY, NPY or PCD under a foreign name, its first
 * bytes do. */
static npg_status find_format(const struct format **out, npg_source *source)
{
    size_t available;
    NPG_TRY(npg_source_fill(source, 512, &available));
    const struct format *ending = by_ending(source->name),
                        *content = by_content(npg_source_data(source), available);
    bool has_magic = content == &formats[PLY] || content == &formats[NPY] || content == &formats[PCD];
    *out = has_magic || !ending ? content : ending;
    if (*out) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: not a format that can be read (PLY, OBJ, XYZ, TXT, PTS, NPY, PCD)",
                     source->name);
}

const char *npg_ending_of_most(size_t *most, const void *names, size_t count, size_t size, const char *but)
{
    const char *ending = "";
    *most = 0;
    for (size_t f = 0; f < FORMATS; f++) {
        size_t same = 0;
        for (size_t i = 0; i < count && formats[f].ending != but; i++) {
            const char *name = *(char *const *)(const void *)((const char *)names + i * size);
            same += !strcasecmp(strrchr(name, '.'), formats[f].ending);
        }
        if (same > *most) ending = formats[f].ending;
        if (same > *most) *most = same;
    }
    return ending;
}

const char *npg_format_by_ending(const char *path)
{
    const struct format *format = by_ending(path);
    return format ? format->name : NULL;
}

const char *npg_reader_for(const char *path)
{
    npg_source *source = NULL;
    const struct format *format = by_ending(path);
    if (!npg_source_open_file(&source, path) && find_format(&format, source)) format = NULL;
    npg_source_close(&source);
    return format ? format->name : NULL;
}

static npg_status skip_blanks(npg_source *source, size_t *available)
{
    for (;;) {
        NPG_TRY(npg_source_fill(source, 1, available));
        if (!*available || !memchr(" \t\r\n", npg_source_data(source)[0], 4)) return NPG_OK;
        npg_source_take(source, 1);
    }
}

/* Data after the end is as wrong as data that is missing: the header's count is not the file's. */
static npg_status expect_end(npg_source *source)
{
    size_t available;
    NPG_TRY(skip_blanks(source, &available));
    return available ? npg_source_bad_byte(source, "more data than the header declares") : NPG_OK;
}

/* All of a file; the builder is empty after a failure. */
static npg_status read_file(npg_builder *b, const char *path)
{
    npg_source *source = NULL;
    const struct format *format;
    npg_status status = npg_source_open_file(&source, path);
    if (!status) status = find_format(&format, source);
    if (!status && b->wants_faces && format != &formats[PLY] && format != &formats[OBJ])
        status = npg_error(NPG_BAD_INPUT, "%s: a mesh must be PLY or OBJ", path);
    if (!status) status = format->read(b, source);
    if (!status && format->needs_whole) status = expect_end(source);
    if (status == NPG_END) status = npg_error(NPG_BAD_INPUT, "%s: the file is empty", path);
    npg_source_close(&source);
    if (status) npg_builder_clear(b);
    return status;
}

/* Numbers whose bytes stand in the wrong order have any size, and no box could hold them. */
static npg_status check_sizes(const npg_builder *b, const char *name)
{
    if (2 * b->far_count <= b->finite_count) return NPG_OK;
    return npg_error(
        NPG_BAD_INPUT,
        "%s: %zu of %zu points lie farther than %g away: another unit, or bytes in the wrong order?", name,
        b->far_count, b->vert_count, NPG_SIDE_MAX);
}

/* The same into an empty builder that has only what is asked for.  The first file settles the origin.  Where its
 * first point turns out to lie far off (many sensors write 0 0 0 for a pixel they could not see), float has lost
 * the detail of all others: read again around the median. */
static npg_status read_settled(npg_builder *b, const char *path, npg_origin *origin)
{
    npg_builder empty = *b;
    npg_origin found = *origin;
    empty.origin = b->origin = &found;
    npg_status status = read_file(b, path);
    if (!status && !origin->known && npg_origin_improve(&found, b->pos, b->vert_count)) {
        npg_builder_clear(b);
        *b = empty;
        status = read_file(b, path);
    }
    if (!status && (status = check_sizes(b, path))) npg_builder_clear(b);
    if (!status && !origin->known) *origin = found; /* else others may be reading it */
    return status;
}

/* What every frame that was read has. */
static npg_status finish(npg_frame *frame, npg_status status, const char *path)
{
    if (!status) status = npg_copy_text(&frame->path, path);
    if (status) npg_frame_clear(frame);
    NPG_TRY(status);
    frame->cleaning.read = frame->point_count;
    frame->fields = NPG_FIELD_POINTS;
    return NPG_OK;
}

npg_status npg_read_cloud(npg_frame *frame, const char *path, npg_origin *origin)
{
    npg_builder b = {.purpose = NPG_FOR_FRAMES};
    npg_status status = read_settled(&b, path, origin);
    if (!status) npg_builder_frame(frame, &b);
    npg_builder_clear(&b);
    return finish(frame, status, path);
}

static npg_status read_mesh(npg_mesh **mesh, const char *path, npg_origin *origin, bool wants_faces,
                            bool may_be_points)
{
    npg_builder b = {.purpose = NPG_FOR_MESH, .wants_faces = wants_faces, .may_be_points = may_be_points};
    *mesh = NULL;
    NPG_TRY(read_settled(&b, path, origin));
    npg_status status = npg_builder_mesh(mesh, &b, path);
    npg_builder_clear(&b);
    return status;
}

npg_status npg_read_mesh(npg_mesh **mesh, const char *path, npg_origin *origin)
{
    return read_mesh(mesh, path, origin, true, false);
}

npg_status npg_read_points(npg_mesh **mesh, const char *path, npg_origin *origin)
{
    return read_mesh(mesh, path, origin, false, true);
}

npg_status npg_read_shape(npg_mesh **mesh, const char *path, npg_origin *origin)
{
    if (npg_rig_is_frame(path)) return npg_rig_read_shape(mesh, path, origin);
    const char *format = npg_reader_for(path);
    bool has_faces = !format || !strcmp(format, "ply") || !strcmp(format, "obj");
    return read_mesh(mesh, path, origin, has_faces, true);
}

/* ---- frames one after the other from a pipe ---- */

struct npg_stream {
    npg_source *source; /* owned */
    int64_t frames;
};

npg_status npg_stream_open(npg_stream **out, int fd, const char *name, bool (*stopping)(void *user),
                           void *user)
{
    npg_stream *stream;
    *out = NULL;
    NPG_TRY(npg_alloc(&stream, NPG_FOR_FILES, sizeof *stream));
    npg_status status = npg_source_open_fd(&stream->source, fd, name);
    if (!status) stream->source->stopping = stopping;
    if (!status) stream->source->user = user;
    if (status) npg_release(&stream);
    *out = stream;
    return status;
}

void npg_stream_close(npg_stream **slot)
{
    if (!*slot) return;
    npg_source_close(&(*slot)->source);
    npg_release(slot);
}

/* Only these two formats say in their header where they end. */
static npg_status read_one(npg_stream *stream, npg_builder *b)
{
    npg_source *source = stream->source;
    size_t available;
    NPG_TRY(skip_blanks(source, &available)); /* blank lines may stand between two frames */
    if (!available) return NPG_END;
    NPG_TRY(npg_source_fill(source, 6, &available));
    const unsigned char *data = npg_source_data(source);
    if (available >= 3 && !memcmp(data, "ply", 3)) return npg_ply_read(b, source);
    if (available >= 6 && !memcmp(data, "\x93NUMPY", 6)) return npg_npy_read(b, source);
    return npg_source_bad_byte(source, "frame %lld begins neither as PLY nor as NPY",
                               (long long)stream->frames);
}

npg_status npg_stream_next(npg_stream *stream, npg_frame *frame, npg_origin *origin)
{
    npg_builder b = {.origin = origin, .purpose = NPG_FOR_FRAMES};
    npg_status status = read_one(stream, &b);
    if (!status) status = check_sizes(&b, stream->source->name);
    if (status == NPG_BAD_INPUT) npg_error_prefix(status, "frame %lld", (long long)stream->frames);
    if (!status) npg_builder_frame(frame, &b);
    npg_builder_clear(&b);
    NPG_TRY(finish(frame, status, stream->source->name));
    frame->number = frame->index = stream->frames++;
    return NPG_OK;
}
