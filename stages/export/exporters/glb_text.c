/* GLB text: the JSON part of a GLB with one animated mesh. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/memory.h"

enum { NUMBER_SIZE = 24 }; /* of a float with 17 digits, which bring it back, and the comma */

uint64_t npg_glb_bytes(const npg_glb_layout *layout)
{
    const npg_export_facts *facts = layout->facts;
    uint64_t t = layout->pose_count, row = facts->has_normals ? 24 : 12;
    uint64_t once = (facts->colours ? 8 : 0) + (layout->has_uvs ? 8 : 0);
    return 12 * (uint64_t)facts->face_count + layout->vert_count * (t * row + once) + (t > 1 ? 4 * t : 0) +
           4 * t * (t - 1);
}

/* What a piece of the binary part holds: constants of OpenGL that glTF 2.0 uses, and the bytes of a row. */
typedef struct kind {
    const char *shape;
    int type, row, target;
} kind;

enum { UNSIGNED_SHORT = 5123, UNSIGNED_INT = 5125, FLOAT = 5126 };
enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963 };
static const kind of_indices = {"SCALAR", UNSIGNED_INT, 4, ELEMENT_ARRAY_BUFFER},
                  of_vectors = {"VEC3", FLOAT, 12, ARRAY_BUFFER},
                  of_colours = {"VEC4", UNSIGNED_SHORT, 8, ARRAY_BUFFER},
                  of_uvs = {"VEC2", FLOAT, 8, ARRAY_BUFFER}, of_numbers = {"SCALAR", FLOAT, 4, 0};

typedef struct pieces {
    json_t *views, *accessors; /* loans */
    uint64_t end;              /* of the last one */
} pieces;

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

static json_t *json_of_floats(const float *values, int count)
{
    json_t *out = json_array();
    for (int i = 0; i < count; i++) json_array_append_new(out, json_real((double)values[i]));
    return out;
}

/* The next piece, of `count` rows, and how far its values reach (NULL: that is not said): its number, as JSON. */
static json_t *add_piece(pieces *p, const kind *of, uint64_t count, const float *lo, const float *hi)
{
    size_t number = json_array_size(p->accessors);
    json_int_t bytes = (json_int_t)count * of->row;
    json_t *view =
        json_pack("{si sI sI}", "buffer", 0, "byteOffset", (json_int_t)p->end, "byteLength", bytes);
    json_t *accessor = json_pack("{sI si ss sI}", "bufferView", (json_int_t)number, "componentType", of->type,
                                 "type", of->shape, "count", (json_int_t)count);
    if (of->target) json_object_set_new(view, "target", json_integer(of->target));
    if (of->type == UNSIGNED_SHORT) json_object_set_new(accessor, "normalized", json_true());
    if (lo) json_object_set_new(accessor, "min", json_of_floats(lo, of->row / 4));
    if (lo) json_object_set_new(accessor, "max", json_of_floats(hi, of->row / 4));
    json_array_append_new(p->views, view);
    json_array_append_new(p->accessors, accessor);
    p->end += (uint64_t)bytes;
    return json_integer((json_int_t)number);
}

/* The vectors of one pose. */
static json_t *add_pose(pieces *p, const npg_glb_layout *layout, const npg_glb_range *range)
{
    json_t *pose = json_object();
    json_object_set_new(pose, "POSITION",
                        add_piece(p, &of_vectors, layout->vert_count, range->lo, range->hi));
    if (layout->facts->has_normals)
        json_object_set_new(pose, "NORMAL", add_piece(p, &of_vectors, layout->vert_count, NULL, NULL));
    return pose;
}

/* Of the mesh that is there, the motion: a morph target for each further pose. */
static void add_motion(json_t *root, pieces *p, const npg_glb_layout *layout, json_t *mesh, json_t *part)
{
    size_t t = layout->pose_count;
    json_t *targets = json_array(), *weights = json_array(); /* weights at rest: VTK crashes without */
    for (size_t k = 1; k < t; k++) {
        json_array_append_new(targets, add_pose(p, layout, &layout->delta[k]));
        json_array_append_new(weights, json_integer(0));
    }
    json_object_set_new(part, "targets", targets);
    json_object_set_new(mesh, "weights", weights);
    json_t *times = add_piece(p, &of_numbers, t, &layout->times[0], &layout->times[t - 1]);
    json_t *shares = add_piece(p, &of_numbers, t * (t - 1), NULL, NULL);
    json_object_set_new(root, "animations",
                        json_pack("[{ss s[{so so ss}] s[{si s{si ss}}]}]", "name", "motion", "samplers",
                                  "input", times, "output", shares, "interpolation", "LINEAR", "channels",
                                  "sampler", 0, "target", "node", 0, "path", "weights"));
}

/* The mesh, where it moves its animation, and what lies where in the binary part. */
static void add_mesh(json_t *root, const npg_glb_layout *layout)
{
    const npg_export_facts *facts = layout->facts;
    pieces p = {.views = json_array(), .accessors = json_array()};
    json_t *indices = add_piece(&p, &of_indices, 3 * (uint64_t)facts->face_count, NULL, NULL);
    json_t *attributes = add_pose(&p, layout, &layout->base);
    if (facts->colours)
        json_object_set_new(attributes, "COLOR_0",
                            add_piece(&p, &of_colours, layout->vert_count, NULL, NULL));
    if (layout->has_uvs)
        json_object_set_new(attributes, "TEXCOORD_0", add_piece(&p, &of_uvs, layout->vert_count, NULL, NULL));
    json_t *part = json_pack("{so si so}", "indices", indices, "material", 0, "attributes", attributes);
    json_t *mesh = json_pack("{ss s[o]}", "name", "surface", "primitives", part);
    json_object_set_new(root, "meshes", json_pack("[o]", mesh));
    if (layout->pose_count > 1) add_motion(root, &p, layout, mesh, part);
    json_object_set_new(root, "buffers", json_pack("[{sI}]", "byteLength", (json_int_t)p.end));
    json_object_set_new(root, "bufferViews", p.views);
    json_object_set_new(root, "accessors", p.accessors);
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
