/* GLB writer: glTF 2.0 with morph targets.
 *
 * The first frame of a file is its mesh, each further one a morph target with the difference, and an
 * animation of the weights shows one after the other, blending in between.  A file holds at most
 * NPG_GLB_POSES frames (and 4 GiB): a longer capture becomes motion_000.glb, motion_001.glb ..., each
 * beginning at time 0 with the frame after the last one of the file before; asset.extras says where it
 * belongs.  The node turns z up into y up and the unit into metres.  Colours are linear light there, v of
 * texture coordinates runs down. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"

/* Of a file's binary part: lengths have 32 bits, and a MiB is left for the JSON. */
#define BYTES_MOST (UINT64_C(0xffffffff) - (1 << 20))

/* Vertices doubled where their corners have more than one texture coordinate. */
typedef struct corner_split {
    size_t count;      /* G >= V                              */
    uint32_t *vertex;  /* G: the vertex each one is a copy of */
    float *uvs;        /* G x 2 or NULL                       */
    uint32_t *indices; /* F x 3 of them                       */
} corner_split;

typedef struct glb_state {
    npg_writer writer;
    npg_arena arena; /* of the split and the base */
    corner_split split;
    size_t poses_most;      /* in one file                 */
    int64_t done, segments; /* poses so far; files in all  */
    size_t at;              /* poses in the file under way */
    npg_glb_layout layout;
    char name[32];
    size_t text_length;
    float *base, *base_normals; /* V x 3, of the first pose of the file */
} glb_state;

/* ---- vertices with more than one texture coordinate ---- */

/* The copies of one vertex are a list: the vertex itself, then next[] until UINT32_MAX. */
typedef struct splitting {
    corner_split *split;
    uint32_t *next;   /* one per copy                                */
    uint8_t *is_used; /* one per vertex: it has a texture coordinate */
} splitting;

static uint32_t copy_for(splitting *s, uint32_t vertex, const float uv[2])
{
    corner_split *split = s->split;
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

/* corner_uvs (F x 3 x 2) or uvs (V x 2) may be NULL; with both the corners' count.  Without corner_uvs the
 * vertices stay as they are.  Vertices that no face uses are kept. */
static npg_status split_vertices(corner_split *split, npg_arena *arena, size_t vert_count,
                                 const uint32_t *faces, size_t face_count, const float *uvs,
                                 const float *corner_uvs)
{
    size_t most = vert_count + (corner_uvs ? 3 * face_count : 0);
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    NPG_REQUIRE(most < UINT32_MAX);
    splitting s = {split, npg_arena_take(&scratch, most, sizeof *s.next),
                   npg_arena_take(&scratch, vert_count, 1)};
    *split = (corner_split){.count = vert_count,
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
    npg_glb_layout layout = {.facts = facts,
                             .vert_count = vert_count,
                             .pose_count = poses,
                             .has_uvs = facts->uvs || facts->corner_uvs};
    return npg_glb_bytes(&layout);
}

static size_t poses_for(const npg_export_facts *facts, size_t vert_count)
{
    size_t poses = NPG_GLB_POSES;
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

static void write_floats(npg_file *file, const float *values, size_t count)
{
    unsigned char word[4];
    for (size_t i = 0; i < count; i++)
        npg_file_write(file, word, npg_put_little(word, npg_float_bits(values[i]), 4));
}

static void widen(npg_glb_range *range, const float *row)
{
    for (size_t a = 0; a < 3; a++) {
        range->lo[a] = fminf(range->lo[a], row[a]);
        range->hi[a] = fmaxf(range->hi[a], row[a]);
    }
}

/* rows - base (NULL: rows) of every vertex there is a copy of; range may be NULL. */
static void write_rows(glb_state *s, npg_glb_range *range, const float *rows, const float *base)
{
    if (range) *range = (npg_glb_range){{FLT_MAX, FLT_MAX, FLT_MAX}, {-FLT_MAX, -FLT_MAX, -FLT_MAX}};
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
        unsigned char row[8];
        for (size_t c = 0; c < 4; c++) {
            double value = c < 3 ? (double)npg_srgb_to_linear(colour[c]) : colour[c] / 255.0;
            npg_put_little(row + 2 * c, (uint64_t)lround(65535 * value), 2);
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
    unsigned char word[4];
    for (size_t i = 0; i < 3 * s->writer.facts->face_count; i++)
        npg_file_write(s->writer.file, word, npg_put_little(word, s->split.indices[i], 4));
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
    uint64_t binary = npg_glb_bytes(&s->layout);
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
    s->layout = (npg_glb_layout){.facts = facts,
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
    NPG_TRY(npg_export_open(&s->writer.file, facts->output, s->name));
    s->text_length = 0;
    NPG_TRY(npg_glb_text(&text, &s->text_length, &s->layout));
    put_heads(s, heads);
    npg_file_write(s->writer.file, heads, sizeof heads);
    npg_file_write(s->writer.file, text, s->text_length);
    npg_release(&text);
    npg_put_little(binary_head, npg_glb_bytes(&s->layout), 4);
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
    NPG_TRY(npg_glb_text(&text, &s->text_length, &s->layout));
    npg_status status = npg_file_patch(s->writer.file, 20, text, s->text_length);
    npg_release(&text);
    NPG_TRY(status);
    NPG_TRY(npg_file_commit(&s->writer.file));
    s->at = 0;
    return npg_export_made(s->writer.facts->log, "glb", s->name, s->layout.first_index,
                           (int64_t)s->layout.pose_count);
}

/* ---- the exporter ---- */

static npg_status open_glb(void *state)
{
    glb_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    s->arena.purpose = NPG_FOR_FILES;
    NPG_TRY(split_vertices(&s->split, &s->arena, facts->vert_count, facts->faces, facts->face_count,
                           facts->uvs, facts->corner_uvs));
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
                                       .is_float = true,
                                       .state_size = sizeof(glb_state),
                                       .check = check_glb,
                                       .bytes = bytes,
                                       .open = open_glb,
                                       .pose = write_pose,
                                       .finish = finish_glb,
                                       .close = close_glb};
