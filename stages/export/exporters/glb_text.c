/* GLB text: the JSON part of a GLB with one animated mesh. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/memory.h"

/* Constants of OpenGL that glTF 2.0 uses. */
enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963 };
enum { UNSIGNED_SHORT = 5123, UNSIGNED_INT = 5125, FLOAT = 5126 };

enum { NUMBER_SIZE = 24 }; /* of a float with 17 digits, which bring it back, and the comma */

npg_glb_places npg_glb_places_of(const npg_glb_layout *layout)
{
    const npg_export_facts *facts = layout->facts;
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

/* ---- parts ---- */

/* x, y, z of the files to metres with y up. */
static json_t *json_of_node(const npg_export_facts *facts)
{
    double unit = facts->metres_per_unit;
    json_t *node = json_pack("{ss si}", "name", "capture", "mesh", 0);
    if (facts->is_z_up) /* x, y, z, w: a quarter turn about x, z up becomes y up */
        json_object_set_new(node, "rotation", json_pack("[fiif]", -sqrt(0.5), 0, 0, sqrt(0.5)));
    if (unit != 1) json_object_set_new(node, "scale", json_pack("[fff]", unit, unit, unit));
    return node;
}

/* One pose's accessors, the next ones from *next on. */
static json_t *json_of_pose(int *next, bool has_normals)
{
    json_t *pose = json_pack("{si}", "POSITION", (*next)++);
    if (has_normals) json_object_set_new(pose, "NORMAL", json_integer((*next)++));
    return pose;
}

/* The mesh and, where it moves, its animation.  Accessors: indices 0, positions 1, then what there is. */
static void add_mesh(json_t *root, const npg_glb_layout *layout)
{
    const npg_export_facts *facts = layout->facts;
    int next = 1;
    json_t *attributes = json_of_pose(&next, facts->has_normals);
    if (facts->colours) json_object_set_new(attributes, "COLOR_0", json_integer(next++));
    if (layout->has_uvs) json_object_set_new(attributes, "TEXCOORD_0", json_integer(next++));
    json_t *part = json_pack("{si si so}", "indices", 0, "material", 0, "attributes", attributes);
    json_t *mesh = json_pack("{ss s[o]}", "name", "surface", "primitives", part);
    json_object_set_new(root, "meshes", json_pack("[o]", mesh));
    if (layout->pose_count < 2) return;
    json_t *targets = json_array(), *weights = json_array(); /* weights at rest: VTK crashes without */
    for (size_t t = 1; t < layout->pose_count; t++) {
        json_array_append_new(targets, json_of_pose(&next, facts->has_normals));
        json_array_append_new(weights, json_integer(0));
    }
    json_object_set_new(part, "targets", targets);
    json_object_set_new(mesh, "weights", weights);
    json_object_set_new(root, "animations",
                        json_pack("[{ss s[{si si ss}] s[{si s{si ss}}]}]", "name", "motion", "samplers",
                                  "input", next, "output", next + 1, "interpolation", "LINEAR", "channels",
                                  "sampler", 0, "target", "node", 0, "path", "weights"));
}

static void add_view(json_t *views, uint64_t from, uint64_t to, int target, int stride)
{
    json_t *view = json_pack("{si sI sI}", "buffer", 0, "byteOffset", (json_int_t)from, "byteLength",
                             (json_int_t)(to - from));
    if (stride) json_object_set_new(view, "byteStride", json_integer(stride));
    if (target) json_object_set_new(view, "target", json_integer(target));
    json_array_append_new(views, view);
}

static void add_views(json_t *root, const npg_glb_layout *layout)
{
    const npg_glb_places at = npg_glb_places_of(layout);
    const npg_export_facts *facts = layout->facts;
    bool moves = layout->pose_count > 1;
    json_t *views = json_array();
    add_view(views, at.indices, at.positions, ELEMENT_ARRAY_BUFFER, 0);
    add_view(views, at.positions, at.normals, ARRAY_BUFFER, 12);
    if (facts->has_normals) add_view(views, at.normals, at.colours, ARRAY_BUFFER, 12);
    if (facts->colours) add_view(views, at.colours, at.uvs, ARRAY_BUFFER, 8);
    if (layout->has_uvs) add_view(views, at.uvs, at.deltas, ARRAY_BUFFER, 8);
    if (moves) add_view(views, at.deltas, at.times, ARRAY_BUFFER, 12);
    if (moves) add_view(views, at.times, at.weights, 0, 0);
    if (moves) add_view(views, at.weights, at.end, 0, 0);
    json_object_set_new(root, "buffers", json_pack("[{sI}]", "byteLength", (json_int_t)at.end));
    json_object_set_new(root, "bufferViews", views);
}

/* The new one is a loan. */
static json_t *add_accessor(json_t *list, int view, uint64_t offset, int type, const char *shape,
                            uint64_t count)
{
    json_t *accessor = json_pack("{si sI si ss sI}", "bufferView", view, "byteOffset", (json_int_t)offset,
                                 "componentType", type, "type", shape, "count", (json_int_t)count);
    json_array_append_new(list, accessor);
    return accessor;
}

static json_t *json_of_floats(const float *values, int count)
{
    json_t *out = json_array();
    for (int i = 0; i < count; i++) json_array_append_new(out, json_real((double)values[i]));
    return out;
}

static void set_range(json_t *accessor, const float *lo, const float *hi, int width)
{
    json_object_set_new(accessor, "min", json_of_floats(lo, width));
    json_object_set_new(accessor, "max", json_of_floats(hi, width));
}

static void add_motion_accessors(json_t *list, const npg_glb_layout *layout, int view)
{
    uint64_t g = layout->vert_count, t = layout->pose_count;
    uint64_t size = npg_glb_places_of(layout).delta_size;
    for (size_t k = 1; k < t; k++) {
        set_range(add_accessor(list, view, (k - 1) * size, FLOAT, "VEC3", g), layout->delta[k].lo,
                  layout->delta[k].hi, 3);
        if (layout->facts->has_normals) add_accessor(list, view, (k - 1) * size + 12 * g, FLOAT, "VEC3", g);
    }
    set_range(add_accessor(list, view + 1, 0, FLOAT, "SCALAR", t), &layout->times[0], &layout->times[t - 1],
              1);
    add_accessor(list, view + 2, 0, FLOAT, "SCALAR", t * (t - 1));
}

static void add_accessors(json_t *root, const npg_glb_layout *layout)
{
    const npg_export_facts *facts = layout->facts;
    uint64_t g = layout->vert_count;
    int view = 2;
    json_t *list = json_array();
    add_accessor(list, 0, 0, UNSIGNED_INT, "SCALAR", 3 * (uint64_t)facts->face_count);
    set_range(add_accessor(list, 1, 0, FLOAT, "VEC3", g), layout->base.lo, layout->base.hi, 3);
    if (facts->has_normals) add_accessor(list, view++, 0, FLOAT, "VEC3", g);
    if (facts->colours)
        json_object_set_new(add_accessor(list, view++, 0, UNSIGNED_SHORT, "VEC4", g), "normalized",
                            json_true());
    if (layout->has_uvs) add_accessor(list, view++, 0, FLOAT, "VEC2", g);
    if (layout->pose_count > 1) add_motion_accessors(list, layout, view);
    json_object_set_new(root, "accessors", list);
}

static json_t *json_of(const npg_glb_layout *layout)
{
    json_t *root = json_pack(
        "{s{ss so s{sI sI sI sI sf}} si s[{s[i]}] s[o] s[{ss s{si sf} sb}]}", "asset", "version", "2.0",
        "generator", json_sprintf("neupig %s", npg_version()), "extras", "segment",
        (json_int_t)layout->segment, "segments", (json_int_t)layout->segments, "first_frame",
        (json_int_t)layout->first_index, "frames", (json_int_t)layout->pose_count, "fps", layout->facts->fps,
        "scene", 0, "scenes", "nodes", 0, "nodes", json_of_node(layout->facts), "materials", "name",
        "surface", "pbrMetallicRoughness", "metallicFactor", 0, "roughnessFactor", 0.9, "doubleSided", 1);
    add_mesh(root, layout);
    add_views(root, layout);
    add_accessors(root, layout);
    return root;
}

npg_status npg_glb_text(char **text, size_t *length, const npg_glb_layout *layout)
{
    json_t *root = json_of(layout);
    char *dumped = root ? json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(17)) : NULL;
    size_t size = dumped ? strlen(dumped) : 0;
    size_t least = size + NUMBER_SIZE * (6 * layout->pose_count + 2), room = *length ? *length : least;
    room += (4 - room % 4) % 4;
    npg_status status = !dumped       ? npg_error(NPG_MEMORY, "no memory for the text of a GLB")
                        : size > room ? npg_error(NPG_FAILED, "glb: the text has outgrown its place")
                                      : npg_alloc(text, NPG_FOR_FILES, room);
    if (!status) {
        memcpy(*text, dumped, size);
        memset(*text + size, ' ', room - size);
        *length = room;
    }
    free(dumped);
    json_decref(root);
    return status;
}
