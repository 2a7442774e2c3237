/* GLB writer: glTF 2.0 with morph targets.
 *
 * The first frame of a file is its mesh, each further one a morph target with the difference, and an
 * animation of the weights shows one after the other, blending in between.  A file holds at most
 * NPG_GLB_POSES_MOST frames (and 4 GiB): a longer capture becomes motion_000.glb, motion_001.glb ..., each
 * beginning at time 0 with the frame after the last one of the file before; asset.extras says where it
 * belongs.  The node turns z up into y up and the unit into metres.  Colours are linear light there, v of
 * texture coordinates runs down. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"

typedef struct glb_range { /* of an accessor */
    float lo[3], hi[3];
} glb_range;

/* The binary part, in this order, every piece at a multiple of 4:
 *
 *     indices 3F uint32 | base positions G float3 | base normals | colours G uint16x4 | uvs G float2 |
 *     per further pose: position deltas G float3, normal deltas | times T float | weights T (T - 1) float */
typedef struct glb_layout {
    const npg_export_facts *facts;
    size_t vert_count;         /* G                                  */
    size_t pose_count;         /* T of this mesh, NPG_GLB_POSES_MOST most */
    int64_t first_index;       /* of its frames                      */
    int64_t segment, segments; /* which of how many files            */
    bool has_uvs;
    glb_range base, delta[NPG_GLB_POSES_MOST]; /* delta[0] is not used        */
    float times[NPG_GLB_POSES_MOST];           /* seconds from the first pose */
} glb_layout;

/* ---- the JSON part ---- */

enum { NUMBER_SIZE = 24 }; /* of a float with 17 digits, which bring it back, and the comma */

/* Of the binary part. */
static uint64_t glb_bytes(const glb_layout *layout)
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
json_t *npg_glb_node(const npg_export_facts *facts)
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
static json_t *add_pose(pieces *p, const glb_layout *layout, const glb_range *range)
{
    json_t *pose = json_object();
    json_object_set_new(pose, "POSITION",
                        add_piece(p, &of_vectors, layout->vert_count, range->lo, range->hi));
    if (layout->facts->has_normals)
        json_object_set_new(pose, "NORMAL", add_piece(p, &of_vectors, layout->vert_count, NULL, NULL));
    return pose;
}

/* Of the mesh that is there, the motion: a morph target for each further pose. */
static void add_motion(json_t *root, pieces *p, const glb_layout *layout, json_t *mesh, json_t *part)
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
static void add_mesh(json_t *root, const glb_layout *layout)
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

static json_t *json_of(const glb_layout *layout)
{
    json_t *root = json_pack(
        "{s{ss so s{sI sI sI sI sf}} si s[{s[i]}] s[o] s[{ss s{si sf} sb}]}", "asset", "version", "2.0",
        "generator", json_sprintf("neupig %s", npg_version()), "extras", "segment",
        (json_int_t)layout->segment, "segments", (json_int_t)layout->segments, "first_frame",
        (json_int_t)layout->first_index, "frames", (json_int_t)layout->pose_count, "fps", layout->facts->fps,
        "scene", 0, "scenes", "nodes", 0, "nodes", npg_glb_node(layout->facts), "materials", "name",
        "surface", "pbrMetallicRoughness", "metallicFactor", 0, "roughnessFactor", 0.9, "doubleSided", 1);
    add_mesh(root, layout);
    return root;
}

/* The JSON, padded with blanks to *length bytes; 0: to as many as it takes when ranges and times are known,
 * too, so that they can be put in when all is written.  To be given to npg_release(). */
static npg_status make_text(char **text, size_t *length, const glb_layout *layout)
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

npg_status npg_glb_begin(npg_file *file, const json_t *root, uint64_t binary_size)
{
    unsigned char head[20] = "glTF", binary_head[8] = "....BIN"; /* its length comes first */
    char *text = json_dumps(root, JSON_COMPACT | JSON_REAL_PRECISION(17));
    if (!text) return npg_error(NPG_MEMORY, "no memory for the text of a GLB");
    size_t length = strlen(text), padded = length + (4 - length % 4) % 4;
    npg_put_little(head + 4, 2, 4); /* version */
    npg_put_little(head + 8, 12 + 8 + padded + 8 + binary_size, 4);
    npg_put_little(head + 12, padded, 4);
    memcpy(head + 16, "JSON", 4);
    npg_put_little(binary_head, binary_size, 4);
    npg_file_write(file, head, sizeof head);
    npg_file_write(file, text, length);
    npg_file_write(file, "   ", padded - length);
    free(text);
    return npg_file_write(file, binary_head, sizeof binary_head);
}

/* ---- the file ---- */

/* Of a file's binary part: lengths have 32 bits, and a MiB is left for the JSON. */
#define BYTES_MOST (UINT64_C(0xffffffff) - (1 << 20))

typedef struct glb_state {
    npg_writer writer;
    npg_arena arena; /* of the split and the base */
    npg_corner_split split;
    size_t poses_most;      /* in one file                 */
    int64_t done, segments; /* poses so far; files in all  */
    size_t at;              /* poses in the file under way */
    glb_layout layout;
    char name[32];
    size_t text_length;
    float *base, *base_normals; /* V x 3, of the first pose of the file */
} glb_state;

/* ---- vertices with more than one texture coordinate ---- */

/* The copies of one vertex are a list: the vertex itself, then next[] until UINT32_MAX. */
typedef struct splitting {
    npg_corner_split *split;
    uint32_t *next;   /* one per copy                                */
    uint8_t *is_used; /* one per vertex: it has a texture coordinate */
} splitting;

static uint32_t copy_for(splitting *s, uint32_t vertex, const float uv[2])
{
    npg_corner_split *split = s->split;
    uint32_t at = vertex;
    if (!s->is_used[vertex]) {
        s->is_used[vertex] = 1;
        memcpy(split->uvs + 2 * (size_t)vertex, uv, 2 * sizeof *uv);
    }
    while (memcmp(split->uvs + 2 * (size_t)at, uv, 2 * sizeof *uv) != 0) {
        if (s->next[at] == UINT32_MAX) {
            uint32_t made = (uint32_t)split->count++;
            s->next[at] = made;
            s->next[made] = UINT32_MAX;
            split->vertex[made] = vertex;
            memcpy(split->uvs + 2 * (size_t)made, uv, 2 * sizeof *uv);
        }
        at = s->next[at];
    }
    return at;
}

npg_status npg_split_corners(npg_corner_split *split, npg_arena *arena, const npg_export_facts *facts)
{
    size_t vert_count = facts->vert_count, face_count = facts->face_count;
    const uint32_t *faces = facts->faces;
    const float *uvs = facts->uvs, *corner_uvs = facts->corner_uvs;
    size_t most = vert_count + (corner_uvs ? 3 * face_count : 0);
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    NPG_REQUIRE(most < UINT32_MAX);
    splitting s = {split, npg_arena_take(&scratch, most, sizeof *s.next),
                   npg_arena_take(&scratch, vert_count, 1)};
    *split = (npg_corner_split){.count = vert_count,
                                .vertex = npg_arena_take(arena, most, sizeof *split->vertex),
                                .indices = npg_arena_copy(arena, faces, face_count, 3 * sizeof *faces)};
    if (uvs || corner_uvs) split->uvs = npg_arena_take(arena, most, 2 * sizeof *split->uvs);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_arena_status(arena);
    for (size_t i = 0; i < vert_count && !status; i++) {
        split->vertex[i] = (uint32_t)i;
        s.next[i] = UINT32_MAX;
    }
    for (size_t i = 0; i < 3 * face_count && corner_uvs && !status; i++)
        split->indices[i] = copy_for(&s, faces[i], corner_uvs + 2 * i);
    if (!status && !corner_uvs && uvs) memcpy(split->uvs, uvs, vert_count * 2 * sizeof *uvs);
    npg_arena_release(&scratch);
    return status;
}

/* ---- how many go into one file ---- */

static uint64_t bytes_of(const npg_export_facts *facts, size_t vert_count, uint64_t poses)
{
    glb_layout layout = {.facts = facts,
                         .vert_count = vert_count,
                         .pose_count = poses,
                         .has_uvs = facts->uvs || facts->corner_uvs};
    return glb_bytes(&layout);
}

static size_t poses_for(const npg_export_facts *facts, size_t vert_count)
{
    size_t poses = NPG_GLB_POSES_MOST;
    while (poses > 1 && bytes_of(facts, vert_count, poses) > BYTES_MOST) poses--;
    return poses;
}

static npg_status check_glb(const npg_export_facts *facts)
{
    if (poses_for(facts, facts->vert_count) > 1 || facts->pose_count == 1) return NPG_OK;
    return npg_error(NPG_USAGE, "glb can't hold the capture: two frames of %zu vertices take more than 4 GiB",
                     facts->vert_count);
}

/* A frame is a row per vertex, and about 1500 bytes of JSON. */
static uint64_t bytes(const npg_export_facts *facts)
{
    return (uint64_t)facts->pose_count * (12 * facts->vert_count + 1500);
}

/* ---- pieces of the binary part ---- */

/* Numbers as they stand in memory: the machines this runs on are little-endian. */
static void write_floats(npg_file *file, const float *values, size_t count)
{
    npg_file_write(file, values, count * sizeof *values);
}

static void widen(glb_range *range, const float *row)
{
    for (size_t a = 0; a < 3; a++) {
        range->lo[a] = fminf(range->lo[a], row[a]);
        range->hi[a] = fmaxf(range->hi[a], row[a]);
    }
}

/* rows - base (NULL: rows) of every vertex there is a copy of; range may be NULL. */
static void write_rows(glb_state *s, glb_range *range, const float *rows, const float *base)
{
    if (range) *range = (glb_range){{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
    for (size_t i = 0; i < s->split.count; i++) {
        size_t v = 3 * (size_t)s->split.vertex[i];
        float row[3];
        for (size_t a = 0; a < 3; a++) row[a] = rows[v + a] - (base ? base[v + a] : 0);
        if (range) widen(range, row);
        write_floats(s->writer.file, row, 3);
    }
}

static void write_colours(glb_state *s)
{
    for (size_t i = 0; i < s->split.count; i++) {
        const uint8_t *colour = s->writer.facts->colours + 4 * (size_t)s->split.vertex[i];
        uint16_t row[4];
        for (size_t c = 0; c < 4; c++) {
            double value = c < 3 ? (double)npg_srgb_to_linear(colour[c]) : colour[c] / 255.0;
            row[c] = (uint16_t)lround(65535 * value);
        }
        npg_file_write(s->writer.file, row, sizeof row);
    }
}

/* Normals in a file must have unit length; one that has none looks along z. */
static void set_base(glb_state *s, const npg_pose *pose)
{
    size_t v = s->writer.facts->vert_count;
    memcpy(s->base, pose->pos, v * 3 * sizeof *s->base);
    for (size_t i = 0; i < v && pose->normals; i++) {
        const float *n = pose->normals + 3 * i;
        double length =
            sqrt((double)n[0] * (double)n[0] + (double)n[1] * (double)n[1] + (double)n[2] * (double)n[2]);
        for (size_t a = 0; a < 3; a++)
            s->base_normals[3 * i + a] = length > 0 ? (float)((double)n[a] / length) : a == 2;
    }
}

static void write_base(glb_state *s, const npg_pose *pose)
{
    npg_file_write(s->writer.file, s->split.indices, s->writer.facts->face_count * 3 * sizeof(uint32_t));
    set_base(s, pose);
    write_rows(s, &s->layout.base, s->base, NULL);
    if (s->writer.facts->has_normals) write_rows(s, NULL, s->base_normals, NULL);
    if (s->writer.facts->colours) write_colours(s);
    for (size_t i = 0; i < s->split.count && s->split.uvs; i++) {
        const float uv[2] = {s->split.uvs[2 * i], 1 - s->split.uvs[2 * i + 1]};
        write_floats(s->writer.file, uv, 2);
    }
}

/* One row per time: all weights 0 at the first, then one of them 1. */
static void write_weights(glb_state *s)
{
    size_t t = s->layout.pose_count;
    for (size_t row = 0; row < t; row++)
        for (size_t k = 1; k < t; k++) {
            const float weight = row == k;
            write_floats(s->writer.file, &weight, 1);
        }
}

/* ---- a file ---- */

static void put_heads(glb_state *s, unsigned char heads[20])
{
    uint64_t binary = glb_bytes(&s->layout);
    memcpy(heads, "glTF", 4);
    npg_put_little(heads + 4, 2, 4); /* version */
    npg_put_little(heads + 8, 12 + 8 + s->text_length + 8 + binary, 4);
    npg_put_little(heads + 12, s->text_length, 4);
    memcpy(heads + 16, "JSON", 4);
}

static npg_status begin_file(glb_state *s, const npg_pose *pose)
{
    const npg_export_facts *facts = s->writer.facts;
    unsigned char heads[20], binary_head[8] = "....BIN"; /* its length comes first */
    int64_t left = facts->pose_count - s->done;
    char *text;
    s->layout = (glb_layout){.facts = facts,
                             .vert_count = s->split.count,
                             .pose_count = left < (int64_t)s->poses_most ? (size_t)left : s->poses_most,
                             .first_index = pose->index,
                             .segment = s->done / (int64_t)s->poses_most,
                             .segments = s->segments,
                             .has_uvs = s->split.uvs != NULL};
    if (s->segments == 1)
        strcpy(s->name, "motion.glb");
    else
        snprintf(s->name, sizeof s->name, "motion_%03lld.glb", (long long)s->layout.segment);
    NPG_TRY(npg_file_open_in(&s->writer.file, facts->output, s->name));
    s->text_length = 0;
    NPG_TRY(make_text(&text, &s->text_length, &s->layout));
    put_heads(s, heads);
    npg_file_write(s->writer.file, heads, sizeof heads);
    npg_file_write(s->writer.file, text, s->text_length);
    npg_release(&text);
    npg_put_little(binary_head, glb_bytes(&s->layout), 4);
    npg_file_write(s->writer.file, binary_head, sizeof binary_head);
    write_base(s, pose);
    return NPG_OK;
}

/* Ranges and times are known now: the text again, in the same place. */
static npg_status end_file(glb_state *s)
{
    char *text;
    if (s->layout.pose_count > 1) write_floats(s->writer.file, s->layout.times, s->layout.pose_count);
    write_weights(s);
    NPG_TRY(make_text(&text, &s->text_length, &s->layout));
    npg_status status = npg_file_patch(s->writer.file, 20, text, s->text_length);
    npg_release(&text);
    NPG_TRY(status);
    NPG_TRY(npg_file_commit(&s->writer.file));
    s->at = 0;
    return npg_export_made(s->writer.facts, "glb", s->name, s->layout.first_index,
                           (int64_t)s->layout.pose_count);
}

/* ---- the exporter ---- */

static npg_status open_glb(void *state)
{
    glb_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    s->arena.purpose = NPG_FOR_FILES;
    NPG_TRY(npg_split_corners(&s->split, &s->arena, facts));
    s->poses_most = poses_for(facts, s->split.count);
    s->segments = (facts->pose_count + (int64_t)s->poses_most - 1) / (int64_t)s->poses_most;
    s->base = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof *s->base);
    s->base_normals = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof *s->base_normals);
    return npg_arena_status(&s->arena);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    glb_state *s = state;
    if (!s->at) {
        NPG_TRY(begin_file(s, pose));
    } else {
        write_rows(s, &s->layout.delta[s->at], pose->pos, s->base);
        if (s->writer.facts->has_normals) write_rows(s, NULL, pose->normals, s->base_normals);
    }
    s->layout.times[s->at++] = (float)((double)(pose->index - s->layout.first_index) / s->writer.facts->fps);
    s->done++;
    return s->at == s->layout.pose_count ? end_file(s) : NPG_OK;
}

static npg_status finish_glb(void *state)
{
    const glb_state *s = state;
    return s->at ? npg_error(NPG_FAILED, "glb: %zu frames are missing", s->layout.pose_count - s->at)
                 : NPG_OK;
}

static void close_glb(void *state)
{
    npg_arena_release(&((glb_state *)state)->arena);
}

const npg_exporter npg_exporter_glb = {.name = "glb",
                                       .is_surface = true,
                                       .is_float = true,
                                       .state_size = sizeof(glb_state),
                                       .check = check_glb,
                                       .bytes = bytes,
                                       .open = open_glb,
                                       .pose = write_pose,
                                       .finish = finish_glb,
                                       .close = close_glb};
