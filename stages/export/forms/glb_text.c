/* GLB text: the JSON part of a GLB with one animated mesh. */
#include "export/forms/glb_text.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/number.h"

/* Constants of OpenGL that glTF 2.0 uses. */
enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963 };
enum { UNSIGNED_SHORT = 5123, UNSIGNED_INT = 5125, FLOAT = 5126 };

typedef struct builder {
    char *text; /* owned */
    size_t length, capacity;
    npg_status status; /* of the first failure */
    const npg_glb_layout *layout;
    npg_glb_places at;
    int views, accessors; /* so far */
} builder;

npg_glb_places npg_glb_places_of(const npg_glb_layout *layout)
{
    const npg_form_facts *facts = layout->facts;
    uint64_t g = layout->vert_count, t = layout->pose_count;
    npg_glb_places at = {.positions = 12 * (uint64_t)facts->face_count,
                         .delta_size = (facts->has_normals ? 24 : 12) * g};
    at.normals = at.positions + 12 * g;
    at.colours = at.normals + (facts->has_normals ? 12 * g : 0);
    at.uvs = at.colours + (facts->colours ? 8 * g : 0);
    at.deltas = at.uvs + (layout->has_uvs ? 8 * g : 0);
    at.times = at.deltas + (t - 1) * at.delta_size;
    at.weights = at.times + (t > 1 ? 4 * t : 0);
    at.end = at.weights + 4 * t * (t - 1);
    return at;
}

/* ---- text ---- */

static NPG_PRINTF(2, 3) void add(builder *b, const char *format, ...)
{
    char piece[512];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(piece, sizeof piece, format, arguments);
    va_end(arguments);
    if (!b->status && (length < 0 || (size_t)length >= sizeof piece))
        b->status = npg_error(NPG_FAILED, "glb: a piece of text is too long");
    if (!b->status)
        b->status = npg_grow(&b->text, &b->capacity, b->length + (size_t)length + 4, 1, NPG_FOR_FILES);
    if (b->status) return;
    memcpy(b->text + b->length, piece, (size_t)length);
    b->length += (size_t)length;
}

/* 9 digits bring a float back; every number takes 15 bytes. */
static void add_numbers(builder *b, const float *values, int count)
{
    for (int i = 0; i < count; i++) {
        char number[40];
        npg_number_print(number, sizeof number, "% .8e", (double)values[i]);
        add(b, "%s%s", i ? "," : "", number);
    }
}

static void add_number(builder *b, double value)
{
    char number[40];
    npg_number_print(number, sizeof number, "%.17g", value);
    add(b, "%s", number);
}

/* ---- parts ---- */

/* x, y, z of the files to metres with y up. */
static void add_node(builder *b)
{
    const npg_form_facts *facts = b->layout->facts;
    add(b, "\"nodes\":[{\"name\":\"capture\",\"mesh\":0");
    if (facts->is_z_up) {
        add(b, ",\"rotation\":["); /* x, y, z, w: a quarter turn about x, z up becomes y up */
        add_number(b, -sqrt(0.5));
        add(b, ",0,0,");
        add_number(b, sqrt(0.5));
        add(b, "]");
    }
    if (facts->metres_per_unit != 1) {
        add(b, ",\"scale\":[");
        for (int a = 0; a < 3; a++) {
            add(b, a ? "," : "");
            add_number(b, facts->metres_per_unit);
        }
        add(b, "]");
    }
    add(b, "}],");
}

static void add_head(builder *b)
{
    const npg_glb_layout *layout = b->layout;
    add(b,
        "{\"asset\":{\"version\":\"2.0\",\"generator\":\"neupig %s\","
        "\"extras\":{\"segment\":%lld,\"segments\":%lld,"
        "\"first_frame\":%lld,\"frames\":%zu,\"fps\":",
        npg_version(), (long long)layout->segment, (long long)layout->segments,
        (long long)layout->first_index, layout->pose_count);
    add_number(b, layout->facts->fps);
    add(b, "}},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],");
    add_node(b);
    add(b, "\"materials\":[{\"name\":\"surface\","
           "\"pbrMetallicRoughness\":{\"metallicFactor\":0,\"roughnessFactor\":0.9},"
           "\"doubleSided\":true}],");
}

static void add_mesh(builder *b)
{
    const npg_form_facts *facts = b->layout->facts;
    int next = 2; /* accessors: indices 0, positions 1, then what there is */
    add(b, "\"meshes\":[{\"name\":\"surface\",\"primitives\":["
           "{\"indices\":0,\"material\":0,\"attributes\":{\"POSITION\":1");
    if (facts->has_normals) add(b, ",\"NORMAL\":%d", next++);
    if (facts->colours) add(b, ",\"COLOR_0\":%d", next++);
    if (b->layout->has_uvs) add(b, ",\"TEXCOORD_0\":%d", next++);
    add(b, "}");
    for (size_t t = 1; t < b->layout->pose_count; t++) {
        add(b, "%s{\"POSITION\":%d", t == 1 ? ",\"targets\":[" : ",", next++);
        if (facts->has_normals) add(b, ",\"NORMAL\":%d", next++);
        add(b, "}");
    }
    add(b, "%s}]", b->layout->pose_count > 1 ? "]" : "");
    for (size_t t = 1; t < b->layout->pose_count; t++) add(b, "%s", t == 1 ? ",\"weights\":[0" : ",0");
    add(b, "%s}],", b->layout->pose_count > 1 ? "]" : ""); /* weights at rest: VTK crashes without */
    if (b->layout->pose_count > 1)
        add(b,
            "\"animations\":[{\"name\":\"motion\","
            "\"samplers\":[{\"input\":%d,\"output\":%d,\"interpolation\":\"LINEAR\"}],"
            "\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"weights\"}}]}],",
            next, next + 1);
}

static void add_view(builder *b, uint64_t from, uint64_t to, int target, int stride)
{
    add(b, "%s{\"buffer\":0,\"byteOffset\":%llu,\"byteLength\":%llu", b->views++ ? "," : "",
        (unsigned long long)from, (unsigned long long)(to - from));
    if (stride) add(b, ",\"byteStride\":%d", stride);
    if (target) add(b, ",\"target\":%d", target);
    add(b, "}");
}

static void add_views(builder *b)
{
    const npg_glb_places *at = &b->at;
    const npg_form_facts *facts = b->layout->facts;
    bool moves = b->layout->pose_count > 1;
    add(b, "\"buffers\":[{\"byteLength\":%llu}],\"bufferViews\":[", (unsigned long long)at->end);
    add_view(b, at->indices, at->positions, ELEMENT_ARRAY_BUFFER, 0);
    add_view(b, at->positions, at->normals, ARRAY_BUFFER, 12);
    if (facts->has_normals) add_view(b, at->normals, at->colours, ARRAY_BUFFER, 12);
    if (facts->colours) add_view(b, at->colours, at->uvs, ARRAY_BUFFER, 8);
    if (b->layout->has_uvs) add_view(b, at->uvs, at->deltas, ARRAY_BUFFER, 8);
    if (moves) add_view(b, at->deltas, at->times, ARRAY_BUFFER, 12);
    if (moves) add_view(b, at->times, at->weights, 0, 0);
    if (moves) add_view(b, at->weights, at->end, 0, 0);
    add(b, "],");
}

static void add_accessor(builder *b, int view, uint64_t offset, int type, const char *shape, uint64_t count)
{
    add(b, "%s{\"bufferView\":%d,\"byteOffset\":%llu,\"componentType\":%d,\"type\":\"%s\",\"count\":%llu",
        b->accessors++ ? "," : "", view, (unsigned long long)offset, type, shape, (unsigned long long)count);
}

static void add_range(builder *b, const float *lo, const float *hi, int width)
{
    add(b, ",\"min\":[");
    add_numbers(b, lo, width);
    add(b, "],\"max\":[");
    add_numbers(b, hi, width);
    add(b, "]}");
}

static void add_motion_accessors(builder *b, int view)
{
    const npg_glb_layout *layout = b->layout;
    uint64_t g = layout->vert_count, t = layout->pose_count;
    for (size_t k = 1; k < t; k++) {
        add_accessor(b, view, (k - 1) * b->at.delta_size, FLOAT, "VEC3", g);
        add_range(b, layout->delta[k].lo, layout->delta[k].hi, 3);
        if (!layout->facts->has_normals) continue;
        add_accessor(b, view, (k - 1) * b->at.delta_size + 12 * g, FLOAT, "VEC3", g);
        add(b, "}");
    }
    add_accessor(b, view + 1, 0, FLOAT, "SCALAR", t);
    add_range(b, &layout->times[0], &layout->times[t - 1], 1);
    add_accessor(b, view + 2, 0, FLOAT, "SCALAR", t * (t - 1));
    add(b, "}");
}

static void add_accessors(builder *b)
{
    const npg_glb_layout *layout = b->layout;
    const npg_form_facts *facts = layout->facts;
    uint64_t g = layout->vert_count;
    int view = 2;
    add(b, "\"accessors\":[");
    add_accessor(b, 0, 0, UNSIGNED_INT, "SCALAR", 3 * (uint64_t)facts->face_count);
    add(b, "}");
    add_accessor(b, 1, 0, FLOAT, "VEC3", g);
    add_range(b, layout->base.lo, layout->base.hi, 3);
    if (facts->has_normals) {
        add_accessor(b, view++, 0, FLOAT, "VEC3", g);
        add(b, "}");
    }
    if (facts->colours) {
        add_accessor(b, view++, 0, UNSIGNED_SHORT, "VEC4", g);
        add(b, ",\"normalized\":true}");
    }
    if (layout->has_uvs) {
        add_accessor(b, view++, 0, FLOAT, "VEC2", g);
        add(b, "}");
    }
    if (layout->pose_count > 1) add_motion_accessors(b, view);
    add(b, "]}");
}

npg_status npg_glb_text(char **text, size_t *length, const npg_glb_layout *layout)
{
    builder b = {.layout = layout, .at = npg_glb_places_of(layout)};
    add_head(&b);
    add_mesh(&b);
    add_views(&b);
    add_accessors(&b);
    while (!b.status && b.length % 4) add(&b, " ");
    if (b.status) npg_release(&b.text);
    *text = b.text;
    *length = b.length;
    return b.status;
}
