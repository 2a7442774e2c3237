/* Compact GLB writer: glTF 2.0 with KHR_mesh_quantization and EXT_meshopt_compression, a fifth of motion.glb.
 *
 * As in motion.glb the first frame is the mesh, each further one a morph target; positions are whole numbers of a grid of
 * 2^14 steps over the box of all frames, which a node turns back, differences differences of these: every frame is as near
 * as half a step.  Vertices and faces are put in an order that packs well, so vertices are not numbered as in other files.
 * Each piece of the binary part is packed by meshoptimizer's codecs; the second buffer is that of the unpacked pieces,
 * which is not there.  A file holds at most POSES_MOST frames, as motion.glb does. */
#include <float.h>
#include <math.h>
#include <meshoptimizer.h>
#include <stdio.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"

#define GRID_STEPS 16383 /* 14 bits, as gltfpack has them: differences then fit 16 */

enum { SHORT = 5122, UNSIGNED_SHORT = 5123, UNSIGNED_INT = 5125, FLOAT = 5126 };
enum { ARRAY_BUFFER = 34962, ELEMENT_ARRAY_BUFFER = 34963 };

typedef struct compact_state {
    npg_writer writer;
    npg_arena arena; /* of all arrays */
    npg_corner_split split;
    uint32_t *order;           /* G: the vertex that each of the file is a copy of */
    npg_file *poses, *binary;  /* of the file under way, owned: positions as they come, what was packed */
    json_t *views, *accessors; /* the same, owned */
    uint64_t plain_end, packed_end;
    float *pos;     /* V x 3 */
    int16_t *base;  /* G x 4, the first pose on the grid */
    int16_t *rows;  /* the same, of another                 */
    float *weights; /* of all poses of a file at all times */
    unsigned char *packed;
    size_t packed_room;
    float lo[3], hi[3], times[NPG_GLB_POSES_MOST];
    int64_t done, first_index;
    size_t at; /* poses in the file under way */
} compact_state;

/* ---- pieces ---- */

typedef struct piece {
    const char *shape, *mode;
    int type, target;
    size_t stride;
    bool is_normalized;
} piece;

static const piece of_indices = {"SCALAR", "TRIANGLES", UNSIGNED_INT, ELEMENT_ARRAY_BUFFER, 4, false},
                   of_base = {"VEC3", "ATTRIBUTES", UNSIGNED_SHORT, ARRAY_BUFFER, 8, false},
                   of_delta = {"VEC3", "ATTRIBUTES", SHORT, ARRAY_BUFFER, 8, false},
                   of_colours = {"VEC4", "ATTRIBUTES", UNSIGNED_SHORT, ARRAY_BUFFER, 8, true},
                   of_uvs = {"VEC2", "ATTRIBUTES", FLOAT, ARRAY_BUFFER, 8, false},
                   of_numbers = {"SCALAR", "ATTRIBUTES", FLOAT, 0, 4, false};

/* Pack `count` rows behind the others: *number is that of their accessor, to which a range may be added. */
static npg_status add_piece(compact_state *s, json_t **accessor, const piece *of, const void *rows,
                            size_t count)
{
    bool is_faces = of == &of_indices;
    size_t size = is_faces ? meshopt_encodeIndexBuffer(s->packed, s->packed_room, rows, count)
                           : meshopt_encodeVertexBuffer(s->packed, s->packed_room, rows, count, of->stride);
    json_int_t bytes = (json_int_t)(count * of->stride);
    if (!size) return npg_error(NPG_FAILED, "glb-meshopt: a piece of %zu rows could not be packed", count);
    json_t *view =
        json_pack("{si sI sI s{s{si sI sI si sI ss}}}", "buffer", 1, "byteOffset", (json_int_t)s->plain_end,
                  "byteLength", bytes, "extensions", "EXT_meshopt_compression", "buffer", 0, "byteOffset",
                  (json_int_t)s->packed_end, "byteLength", (json_int_t)size, "byteStride", (int)of->stride,
                  "count", (json_int_t)count, "mode", of->mode);
    *accessor = json_pack("{sI si ss sI}", "bufferView", (json_int_t)json_array_size(s->views),
                          "componentType", of->type, "type", of->shape, "count", (json_int_t)count);
    if (of->target) json_object_set_new(view, "target", json_integer(of->target));
    if (of->target == ARRAY_BUFFER) json_object_set_new(view, "byteStride", json_integer((int)of->stride));
    if (of->is_normalized) json_object_set_new(*accessor, "normalized", json_true());
    json_array_append_new(s->views, view);
    json_array_append_new(s->accessors, *accessor);
    s->plain_end += (uint64_t)bytes;
    size_t padded = size + (4 - size % 4) % 4;
    memset(s->packed + size, 0, padded - size);
    s->packed_end += padded;
    return npg_file_write(s->binary, s->packed, padded);
}

static json_int_t last_of(const compact_state *s)
{
    return (json_int_t)json_array_size(s->accessors) - 1;
}

static void set_range(json_t *accessor, const int16_t *rows, size_t count)
{
    int lo[3] = {INT16_MAX, INT16_MAX, INT16_MAX}, hi[3] = {INT16_MIN, INT16_MIN, INT16_MIN};
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            lo[a] = rows[4 * i + a] < lo[a] ? rows[4 * i + a] : lo[a];
            hi[a] = rows[4 * i + a] > hi[a] ? rows[4 * i + a] : hi[a];
        }
    json_object_set_new(accessor, "min", json_pack("[iii]", lo[0], lo[1], lo[2]));
    json_object_set_new(accessor, "max", json_pack("[iii]", hi[0], hi[1], hi[2]));
}

static float step_of(const compact_state *s)
{
    float longest = fmaxf(fmaxf(s->hi[0] - s->lo[0], s->hi[1] - s->lo[1]), s->hi[2] - s->lo[2]);
    return longest > 0 ? longest / GRID_STEPS : 1;
}

/* The k-th pose of the file on the grid, or (base) its difference from that. */
static npg_status quantize(compact_state *s, int16_t *rows, size_t k, const int16_t *base)
{
    size_t size = s->writer.facts->vert_count * 3 * sizeof *s->pos;
    double step = (double)step_of(s);
    NPG_TRY(npg_file_reread(s->poses, s->pos, size, k * size));
    for (size_t i = 0; i < s->split.count; i++)
        for (size_t a = 0; a < 3; a++) {
            double place = ((double)s->pos[3 * (size_t)s->order[i] + a] - (double)s->lo[a]) / step;
            rows[4 * i + a] = (int16_t)(lround(place) - (base ? base[4 * i + a] : 0));
        }
    return NPG_OK;
}

static npg_status add_pose(compact_state *s, json_t *in, size_t k)
{
    json_t *accessor;
    int16_t *rows = k ? s->rows : s->base;
    NPG_TRY(quantize(s, rows, k, k ? s->base : NULL));
    NPG_TRY(add_piece(s, &accessor, k ? &of_delta : &of_base, rows, s->split.count));
    set_range(accessor, rows, s->split.count);
    json_object_set_new(in, "POSITION", json_integer(last_of(s)));
    return NPG_OK;
}

/* What is the same in all frames; rows have room for it. */
static npg_status add_looks(compact_state *s, json_t *attributes)
{
    const npg_export_facts *facts = s->writer.facts;
    json_t *accessor;
    uint16_t *colours = (uint16_t *)s->rows;
    for (size_t i = 0; i < 4 * s->split.count && facts->colours; i++) {
        uint8_t byte = facts->colours[4 * (size_t)s->order[i / 4] + i % 4];
        colours[i] = (uint16_t)lround(65535 * (i % 4 < 3 ? (double)npg_srgb_to_linear(byte) : byte / 255.0));
    }
    if (facts->colours) {
        NPG_TRY(add_piece(s, &accessor, &of_colours, colours, s->split.count));
        json_object_set_new(attributes, "COLOR_0", json_integer(last_of(s)));
    }
    if (s->split.uvs) {
        NPG_TRY(add_piece(s, &accessor, &of_uvs, s->split.uvs, s->split.count));
        json_object_set_new(attributes, "TEXCOORD_0", json_integer(last_of(s)));
    }
    return NPG_OK;
}

/* All weights 0 at the first time, then one of them 1. */
static npg_status add_motion(compact_state *s, json_t *root)
{
    size_t t = s->at;
    json_t *accessor;
    memset(s->weights, 0, t * (t - 1) * sizeof *s->weights);
    for (size_t k = 1; k < t; k++) s->weights[k * (t - 1) + k - 1] = 1;
    NPG_TRY(add_piece(s, &accessor, &of_numbers, s->times, t));
    json_object_set_new(accessor, "min", json_pack("[f]", (double)s->times[0]));
    json_object_set_new(accessor, "max", json_pack("[f]", (double)s->times[t - 1]));
    NPG_TRY(add_piece(s, &accessor, &of_numbers, s->weights, t * (t - 1)));
    json_object_set_new(root, "animations",
                        json_pack("[{ss s[{sI sI ss}] s[{si s{si ss}}]}]", "name", "motion", "samplers",
                                  "input", last_of(s) - 1, "output", last_of(s), "interpolation", "LINEAR",
                                  "channels", "sampler", 0, "target", "node", 1, "path", "weights"));
    return NPG_OK;
}

static npg_status add_mesh(compact_state *s, json_t *root)
{
    json_t *accessor, *attributes = json_object(), *targets = json_array(), *weights = json_array();
    json_t *part = json_pack("{si si so}", "indices", 0, "material", 0, "attributes", attributes);
    json_t *mesh = json_pack("{ss s[o]}", "name", "surface", "primitives", part);
    json_object_set_new(root, "meshes", json_pack("[o]", mesh));
    if (s->at > 1) json_object_set(part, "targets", targets);
    if (s->at > 1) json_object_set(mesh, "weights", weights);
    npg_status status =
        add_piece(s, &accessor, &of_indices, s->split.indices, 3 * s->writer.facts->face_count);
    if (!status) status = add_looks(s, attributes);
    for (size_t k = 0; k < s->at && !status; k++) {
        json_t *target = k ? json_object() : json_incref(attributes);
        status = add_pose(s, target, k);
        if (k) json_array_append(targets, target);
        if (k) json_array_append_new(weights, json_integer(0));
        json_decref(target);
    }
    json_decref(targets);
    json_decref(weights);
    return status || s->at < 2 ? status : add_motion(s, root);
}

/* ---- a file ---- */

static json_t *json_of_scene(const compact_state *s)
{
    double step = (double)step_of(s);
    json_t *capture = npg_glb_node(s->writer.facts);
    json_object_del(capture, "mesh");
    json_object_set_new(capture, "children", json_pack("[i]", 1));
    return json_pack(
        "{s{ss so s{sI sI sf}} s[ss] s[ss] si s[{s[i]}] s[o {ss si s[fff] s[fff]}] s[{ss s{si sf} sb}]}",
        "asset", "version", "2.0", "generator", json_sprintf("neupig %s", npg_version()), "extras",
        "first_frame", (json_int_t)s->first_index, "frames", (json_int_t)s->at, "fps", s->writer.facts->fps,
        "extensionsUsed", "EXT_meshopt_compression", "KHR_mesh_quantization", "extensionsRequired",
        "EXT_meshopt_compression", "KHR_mesh_quantization", "scene", 0, "scenes", "nodes", 0, "nodes",
        capture, "name", "grid", "mesh", 0, "translation", (double)s->lo[0], (double)s->lo[1],
        (double)s->lo[2], "scale", step, step, step, "materials", "name", "surface", "pbrMetallicRoughness",
        "metallicFactor", 0, "roughnessFactor", 0.9, "doubleSided", 1);
}

static npg_status put_together(compact_state *s, json_t *root)
{
    json_object_set(root, "bufferViews", s->views);
    json_object_set(root, "accessors", s->accessors);
    json_object_set_new(root, "buffers",
                        json_pack("[{sI} {sI s{s{sb}}}]", "byteLength", (json_int_t)s->packed_end,
                                  "byteLength", (json_int_t)s->plain_end, "extensions",
                                  "EXT_meshopt_compression", "fallback", 1));
    NPG_TRY(npg_glb_begin(s->writer.file, root, s->packed_end));
    return npg_file_append(s->writer.file, &s->binary);
}

static npg_status end_file(compact_state *s)
{
    const npg_export_facts *facts = s->writer.facts;
    char name[48] = "motion_meshopt.glb";
    if (facts->pose_count > NPG_GLB_POSES_MOST)
        snprintf(name, sizeof name, "motion_meshopt_%03lld.glb",
                 (long long)((s->done - 1) / NPG_GLB_POSES_MOST));
    NPG_TRY(npg_file_open_in(&s->writer.file, facts->output, name));
    NPG_TRY(npg_file_open_in(&s->binary, facts->output, "motion.meshopt.1"));
    s->views = json_array();
    s->accessors = json_array();
    s->plain_end = s->packed_end = 0;
    json_t *root = json_of_scene(s);
    npg_status status = add_mesh(s, root);
    if (!status) status = put_together(s, root);
    json_decref(root);
    json_decref(s->views);
    json_decref(s->accessors);
    s->views = s->accessors = NULL;
    npg_file_discard(&s->poses);
    NPG_TRY(status);
    NPG_TRY(npg_file_commit(&s->writer.file));
    int64_t count = (int64_t)s->at;
    s->at = 0;
    return npg_export_made(facts, "glb-meshopt", name, s->first_index, count);
}

/* ---- the exporter ---- */

/* Faces in an order that packs well, vertices in that of the faces; those of no face behind them. */
static npg_status put_in_order(compact_state *s)
{
    size_t g = s->split.count, indices = 3 * s->writer.facts->face_count;
    uint32_t *remap = npg_arena_take(&s->arena, g, sizeof *remap);
    float *uvs = s->split.uvs ? npg_arena_copy(&s->arena, s->split.uvs, g, 2 * sizeof *uvs) : NULL;
    NPG_TRY(npg_arena_status(&s->arena));
    meshopt_optimizeVertexCache(s->split.indices, s->split.indices, indices, g);
    size_t used = meshopt_optimizeVertexFetchRemap(remap, s->split.indices, indices, g);
    meshopt_remapIndexBuffer(s->split.indices, s->split.indices, indices, remap);
    for (size_t i = 0; i < g; i++) {
        size_t to = remap[i] == UINT32_MAX ? used++ : remap[i];
        s->order[to] = s->split.vertex[i];
        if (!uvs) continue;
        s->split.uvs[2 * to] = uvs[2 * i];
        s->split.uvs[2 * to + 1] = 1 - uvs[2 * i + 1]; /* v of glTF runs down */
    }
    return NPG_OK;
}

static npg_status open_compact(void *state)
{
    compact_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    s->arena.purpose = NPG_FOR_FILES;
    NPG_TRY(npg_split_corners(&s->split, &s->arena, facts));
    size_t g = s->split.count, t = NPG_GLB_POSES_MOST, room = meshopt_encodeVertexBufferBound(g, 8);
    if (meshopt_encodeVertexBufferBound(t * t, 4) > room) room = meshopt_encodeVertexBufferBound(t * t, 4);
    if (meshopt_encodeIndexBufferBound(3 * facts->face_count, g) > room)
        room = meshopt_encodeIndexBufferBound(3 * facts->face_count, g);
    s->packed_room = room;
    s->packed = npg_arena_take(&s->arena, room + 4, 1);
    s->pos = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof *s->pos);
    s->base = npg_arena_take(&s->arena, g, 4 * sizeof *s->base);
    s->rows = npg_arena_take(&s->arena, g, 4 * sizeof *s->rows);
    s->weights = npg_arena_take(&s->arena, t * t, sizeof *s->weights);
    s->order = npg_arena_take(&s->arena, g, sizeof *s->order);
    NPG_TRY(npg_arena_status(&s->arena));
    meshopt_encodeIndexVersion(1); /* what EXT_meshopt_compression reads */
    meshopt_encodeVertexVersion(0);
    return put_in_order(s);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    compact_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    size_t values = 3 * facts->vert_count;
    if (!s->at) {
        NPG_TRY(npg_file_open_in(&s->poses, facts->output, "motion.meshopt.0"));
        s->first_index = pose->index;
        for (size_t a = 0; a < 3; a++) s->lo[a] = FLT_MAX, s->hi[a] = -FLT_MAX;
    }
    for (size_t i = 0; i < values; i++) {
        s->lo[i % 3] = fminf(s->lo[i % 3], pose->pos[i]);
        s->hi[i % 3] = fmaxf(s->hi[i % 3], pose->pos[i]);
    }
    s->times[s->at++] = (float)((double)(pose->index - s->first_index) / facts->fps);
    s->done++;
    NPG_TRY(npg_file_write(s->poses, pose->pos, values * sizeof *pose->pos));
    return s->at == NPG_GLB_POSES_MOST || s->done == facts->pose_count ? end_file(s) : NPG_OK;
}

static void close_compact(void *state)
{
    compact_state *s = state;
    npg_file_discard(&s->poses);
    npg_file_discard(&s->binary);
    npg_arena_release(&s->arena);
}

static uint64_t bytes(const npg_export_facts *facts)
{
    return (uint64_t)facts->pose_count * (3 * facts->vert_count + 1500);
}

const npg_exporter npg_exporter_glb_meshopt = {.name = "glb-meshopt",
                                               .is_surface = true,
                                               .is_float = true,
                                               .state_size = sizeof(compact_state),
                                               .bytes = bytes,
                                               .open = open_compact,
                                               .pose = write_pose,
                                               .close = close_compact};
