/* OBJ reader: vertices with normals, colours and texture coordinates; polygons become fans. */
#include <string.h>

#include "ingest/ingest_internal.h"

#define CORNERS_MAX 1024 /* of a polygon; larger ones are damage (set by trial) */

enum { POSITION, UV, NORMAL, KINDS };

typedef struct reader {
    npg_source *source;
    npg_builder *builder;
    size_t total[KINDS]; /* of the whole file; of what was read so far where it can't be read twice */
    size_t triangles;
    size_t normal_count, normal_capacity, uv_count, uv_capacity, link_capacity[KINDS];
    float *normals, *uvs; /* vn and vt lines in their own order; owned */
    size_t corner_capacity;
    uint32_t *corner_uv;   /* 3 per triangle: 1 + its vt, 0: none; owned */
    bool has_seams;        /* some vertex has more than one vt */
    uint32_t *link[KINDS]; /* [UV] and [NORMAL]: 1 + the one a vertex takes, 0: none yet; owned */
} reader;

static const char *const ignored_words[] = {
    "vp",     "l",      "p",      "o",     "g",          "s",         "mg",       "usemtl",  "mtllib",
    "usemap", "maplib", "cstype", "deg",   "bmat",       "step",      "curv",     "curv2",   "surf",
    "parm",   "trim",   "hole",   "scrv",  "sp",         "end",       "con",      "bevel",   "lod",
    "call",   "csh",    "ctech",  "stech", "shadow_obj", "trace_obj", "c_interp", "d_interp"};

/* ---- words of a line ---- */

/* The line's keyword; *at moves behind it. */
static size_t next_word(const char **word, const char **at, const char *end)
{
    *word = *at;
    while (*at < end && **at != ' ' && **at != '\t') ++*at;
    size_t length = (size_t)(*at - *word);
    *at = npg_skip_blanks(*at, end);
    return length;
}

static bool is_word(const char *word, size_t length, const char *wanted)
{
    return strlen(wanted) == length && !memcmp(word, wanted, length);
}

static int kind_of(const char *word, size_t length)
{
    return is_word(word, length, "v")    ? POSITION
           : is_word(word, length, "vt") ? UV
           : is_word(word, length, "vn") ? NORMAL
                                         : KINDS;
}

static size_t count_words(const char *at, const char *end)
{
    size_t count = 0;
    for (const char *word; at < end; count++) next_word(&word, &at, end);
    return count;
}

/* How much of everything there is, so that arrays are allocated once, and so that faces may use vertices of
 * later lines and an index that is wrong is still reported with its own line. */
static npg_status count_lines(reader *r)
{
    const char *at, *word;
    size_t length;
    npg_status status;
    while (!(status = npg_source_line(r->source, &at, &length))) {
        const char *end = at + length;
        at = npg_skip_blanks(at, end);
        length = next_word(&word, &at, end);
        int kind = kind_of(word, length);
        if (kind < KINDS) r->total[kind]++;
        if (r->builder->wants_faces && is_word(word, length, "f")) {
            size_t corners = count_words(at, end);
            r->triangles += corners > 2 ? corners - 2 : 0;
        }
    }
    if (status != NPG_END) return status;
    return npg_source_rewind(r->source);
}

static npg_status parse_values(reader *r, double *values, int least, int most, int *count, const char *at,
                               const char *end)
{
    for (*count = 0; at < end && *count < most; ++*count)
        NPG_TRY(npg_source_number(r->source, &values[*count], &at, end));
    if (at < end) return npg_source_bad_line(r->source, "more than %d values", most);
    if (*count < least)
        return npg_source_bad_line(r->source, "%d value%s where there must be %d", *count,
                                   *count == 1 ? "" : "s", least);
    return NPG_OK;
}

/* ---- v, vn, vt ---- */

static npg_status add_position(reader *r, const char *at, const char *end)
{
    npg_builder *b = r->builder;
    double values[8], slots[NPG_SLOTS] = {0};
    int count;
    NPG_TRY(parse_values(r, values, 3, 8, &count, at, end));
    /* x y z [w] r g b, an extension of the format; the first vertex settles whether it is used. */
    if (b->vert_count == 0) b->has_colours = count >= 6;
    if (b->vert_count == b->vert_capacity || !b->vert_count)
        NPG_TRY(npg_builder_reserve(b, b->vert_count < r->total[POSITION] ? r->total[POSITION] : 1,
                                    b->face_count < r->triangles ? r->triangles : 0));
    memcpy(slots, values, 3 * sizeof *values);
    for (int c = 0; c < 4; c++)
        slots[NPG_RED + c] =
            c < 3 && count >= 6 ? npg_colour_value(values[count - 3 + c], NPG_PLY_FLOAT) : 255;
    npg_builder_add(b, slots);
    return NPG_OK;
}

static npg_status add_normal(reader *r, const char *at, const char *end)
{
    double values[3];
    int count;
    NPG_TRY(parse_values(r, values, 3, 3, &count, at, end));
    size_t need = r->normal_count < r->total[NORMAL] ? r->total[NORMAL] : r->normal_count + 1;
    NPG_TRY(npg_grow(&r->normals, &r->normal_capacity, need, 3 * sizeof(float), NPG_FOR_FILES));
    npg_unit_normal(r->normals + 3 * r->normal_count++, values);
    return NPG_OK;
}

static npg_status add_uv(reader *r, const char *at, const char *end)
{
    double values[3] = {0};
    int count;
    NPG_TRY(parse_values(r, values, 1, 3, &count, at, end));
    if (!r->builder->wants_faces) return NPG_OK;
    size_t need = r->uv_count < r->total[UV] ? r->total[UV] : r->uv_count + 1;
    NPG_TRY(npg_grow(&r->uvs, &r->uv_capacity, need, 2 * sizeof(float), NPG_FOR_FILES));
    r->uvs[2 * r->uv_count] = (float)values[0];
    r->uvs[2 * r->uv_count++ + 1] = (float)values[1];
    return NPG_OK;
}

/* ---- f ---- */

/* One index of a corner: 1-based, or negative from the last one read.  *index becomes 0-based. */
static npg_status parse_index(reader *r, uint32_t *index, int kind, const char **at, const char *end)
{
    static const char *const names[] = {"vertex", "texture coordinate", "normal"};
    size_t so_far[] = {r->builder->vert_count, r->uv_count, r->normal_count};
    size_t there = r->total[kind] > so_far[kind] ? r->total[kind] : so_far[kind];
    bool negative = *at < end && **at == '-';
    const char *first = *at += negative;
    int64_t value = 0;
    while (*at < end && **at >= '0' && **at <= '9' && value < (int64_t)1 << 40) /* no overflow */
        value = value * 10 + (*(*at)++ - '0');
    int shown = end - first > 20 ? 20 : (int)(end - first);
    if (*at == first) return npg_source_bad_line(r->source, "\"%.*s\" is not an index", shown, first);
    int64_t zero_based = negative ? (int64_t)so_far[kind] - value : value - 1;
    if (value == 0 || zero_based < 0 || zero_based >= (int64_t)there)
        return npg_source_bad_line(r->source, "%s %s%lld is not there (%zu are)", names[kind],
                                   negative ? "-" : "", (long long)value, there);
    *index = (uint32_t)zero_based;
    return NPG_OK;
}

/* The first corner that names a normal or texture coordinate for a vertex decides for it. */
static npg_status link_vertex(reader *r, int kind, uint32_t vertex, uint32_t to)
{
    size_t need = r->total[POSITION] > vertex ? r->total[POSITION] : (size_t)vertex + 1;
    NPG_TRY(npg_grow(&r->link[kind], &r->link_capacity[kind], need, sizeof(uint32_t), NPG_FOR_FILES));
    if (kind == UV && r->link[kind][vertex] && r->link[kind][vertex] != to + 1) r->has_seams = true;
    if (!r->link[kind][vertex]) r->link[kind][vertex] = to + 1;
    return NPG_OK;
}

/* *uv: 1 + the vt it names, 0: none. */
static npg_status parse_corner(reader *r, uint32_t *vertex, uint32_t *uv, const char **at, const char *end)
{
    uint32_t other;
    *uv = 0;
    NPG_TRY(parse_index(r, vertex, POSITION, at, end));
    for (int kind = UV; kind <= NORMAL && *at < end && **at == '/'; kind++) {
        ++*at;
        if (*at < end && **at == '/' && kind == UV) continue;
        if (*at == end || **at == ' ' || **at == '\t') break;
        const char *before = *at;
        bool is_unread =
            kind == UV && !r->builder->wants_faces; /* a cloud has no use for texture coordinates */
        if (is_unread) {
            while (*at < end && **at != '/' && **at != ' ' && **at != '\t') ++*at;
            if (*at == before) break;
            continue;
        }
        NPG_TRY(parse_index(r, &other, kind, at, end));
        NPG_TRY(link_vertex(r, kind, *vertex, other));
        if (kind == UV) *uv = other + 1;
    }
    if (*at < end && **at != ' ' && **at != '\t')
        return npg_source_bad_line(r->source, "a corner that is not v, v/vt, v//vn or v/vt/vn");
    *at = npg_skip_blanks(*at, end);
    return NPG_OK;
}

/* The corners' texture coordinates, cut into the triangles of the fan that the builder makes next. */
static npg_status keep_corner_uvs(reader *r, const uint32_t *uvs, size_t count)
{
    size_t first = r->builder->face_count, faces = first + count - 2;
    size_t need = r->triangles > faces ? r->triangles : faces;
    if (!r->uv_count) return NPG_OK;
    NPG_TRY(npg_grow(&r->corner_uv, &r->corner_capacity, need, 3 * sizeof(uint32_t), NPG_FOR_FILES));
    for (size_t i = 2; i < count; i++) {
        const uint32_t triangle[3] = {uvs[0], uvs[i - 1], uvs[i]};
        memcpy(r->corner_uv + 3 * (first + i - 2), triangle, sizeof triangle);
    }
    return NPG_OK;
}

static npg_status add_face(reader *r, const char *at, const char *end)
{
    uint32_t corners[CORNERS_MAX], uvs[CORNERS_MAX];
    size_t count = 0;
    for (; at < end && count < CORNERS_MAX; count++)
        NPG_TRY(parse_corner(r, &corners[count], &uvs[count], &at, end));
    if (at < end) return npg_source_bad_line(r->source, "a face of more than %d corners", CORNERS_MAX);
    if (count < 3) return npg_source_bad_line(r->source, "a face of %zu corners", count);
    if (!r->builder->wants_faces) return NPG_OK;
    NPG_TRY(keep_corner_uvs(r, uvs, count));
    return npg_builder_polygon(r->builder, corners, count);
}

/* ---- the whole ---- */

static npg_status parse_line(reader *r, const char *at, const char *end)
{
    const char *word;
    at = npg_skip_blanks(at, end);
    if (at == end || *at == '#') return NPG_OK;
    size_t length = next_word(&word, &at, end);
    switch (kind_of(word, length)) {
    case POSITION: return add_position(r, at, end);
    case NORMAL: return add_normal(r, at, end);
    case UV: return add_uv(r, at, end);
    }
    /* "fo" is the face of older versions of the format. */
    if (is_word(word, length, "f") || is_word(word, length, "fo")) return add_face(r, at, end);
    for (size_t i = 0; i < sizeof ignored_words / sizeof *ignored_words; i++)
        if (is_word(word, length, ignored_words[i])) return NPG_OK;
    return npg_source_bad_line(r->source, "unknown word \"%.*s\"", length > 30 ? 30 : (int)length, word);
}

static npg_status read_lines(reader *r)
{
    const char *text;
    size_t length;
    npg_status status;
    NPG_TRY(npg_source_find_line_end(r->source));
    if (r->source->is_seekable) NPG_TRY(count_lines(r));
    while (!(status = npg_source_line(r->source, &text, &length)))
        NPG_TRY(parse_line(r, text, text + length));
    return status == NPG_END ? NPG_OK : status;
}

/* Values of the linked vn or vt lines, one row of `width` floats per vertex; 0 where a vertex has none. */
static npg_status gather(float **out, const reader *r, int kind, const float *rows, size_t width)
{
    size_t count = r->builder->vert_count;
    NPG_TRY(npg_alloc_array(out, NPG_FOR_MESH, count, width * sizeof(float)));
    for (size_t i = 0; i < count && i < r->link_capacity[kind]; i++)
        if (r->link[kind][i])
            memcpy(*out + width * i, rows + width * (r->link[kind][i] - 1), width * sizeof(float));
    return NPG_OK;
}

/* One row per corner of a triangle, 0 where it has none. */
static npg_status gather_corners(reader *r)
{
    npg_builder *b = r->builder;
    NPG_TRY(npg_alloc_array(&b->corner_uvs, NPG_FOR_MESH, b->face_count, 6 * sizeof(float)));
    for (size_t i = 0; i < 3 * b->face_count && i < 3 * r->corner_capacity; i++)
        if (r->corner_uv[i])
            memcpy(b->corner_uvs + 2 * i, r->uvs + 2 * (size_t)(r->corner_uv[i] - 1), 2 * sizeof(float));
    return NPG_OK;
}

/* Without faces the i-th vn belongs to the i-th v when there are as many. */
static npg_status set_vertex_data(reader *r)
{
    npg_builder *b = r->builder;
    if (r->link[UV]) NPG_TRY(gather(&b->uvs, r, UV, r->uvs, 2));
    if (r->has_seams) NPG_TRY(gather_corners(r));
    if (r->link[NORMAL]) return gather(&b->normals, r, NORMAL, r->normals, 3);
    if (r->normal_count && r->normal_count == b->vert_count) {
        b->normals = r->normals;
        r->normals = NULL;
    }
    return NPG_OK;
}

npg_status npg_obj_read(npg_builder *b, npg_source *source)
{
    reader r = {.source = source, .builder = b};
    npg_status status = read_lines(&r);
    if (!status) status = set_vertex_data(&r);
    npg_release(&r.normals);
    npg_release(&r.uvs);
    npg_release(&r.corner_uv);
    npg_release(&r.link[UV]);
    npg_release(&r.link[NORMAL]);
    return status;
}
