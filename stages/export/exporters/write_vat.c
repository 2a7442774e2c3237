/* Vertex animation textures: what a shader of a game engine moves a mesh by.
 *
 *     OUT/motion_vat_positions.png   RGB of 16 bits, linear: position = lo + rgb / 65535 * (hi - lo), box as in the JSON
 *     OUT/motion_vat_normals.png     the same: normal = 2 * rgb / 65535 - 1
 *     OUT/motion_vat.glb             the mesh in the first frame; its second texture coordinates (TEXCOORD_1) are the middle
 *                                    of the vertex's texel in that frame, v from the top; k frames on it is k * step_v lower
 *     OUT/motion_vat.json            box, frames, fps, sizes and names
 *
 * A frame is `rows` rows of the pictures, a vertex a texel, from left to right and top to bottom.  Coordinates are those of the
 * mesh itself, before its node turns and scales them.  A frame without a mesh repeats the one before it.  Poses lie in a
 * file of their own until the box of all is known. */
#include <float.h>
#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "pipeline/json_file.h"

#define SIDE_MOST 8192 /* texels: what engines take on every graphics card of today */
#define TEXT_SIZE 160

typedef struct picture {
    npg_file *file;
    png_structp png;
    png_infop info;
    png_uint_32 width, height;
    unsigned char *row;   /* of texels, RGB of 16 bits */
    char text[TEXT_SIZE]; /* of libpng's error         */
} picture;

typedef struct vat_state {
    npg_writer writer;
    npg_arena arena;
    npg_file *poses; /* owned */
    size_t width, rows, height;
    float lo[3], hi[3];
    float *pos, *normals; /* V x 3 */
    picture pictures[2];  /* of positions and normals */
    int64_t count;
} vat_state;

static const char *const names[] = {"motion_vat_positions.png", "motion_vat_normals.png"};

static int64_t frames_of(const npg_export_facts *facts)
{
    return facts->last_index - facts->first_index + 1;
}

static size_t rows_of(const npg_export_facts *facts)
{
    return (facts->vert_count + SIDE_MOST - 1) / SIDE_MOST;
}

static npg_status check(const npg_export_facts *facts)
{
    if (facts->pose_count < 0 || frames_of(facts) * (int64_t)rows_of(facts) <= SIDE_MOST) return NPG_OK;
    return npg_error(NPG_USAGE,
                     "vat can't hold the capture: %lld frames of %zu vertices take more than %d x %d texels; "
                     "fewer --faces or --frames do",
                     (long long)frames_of(facts), facts->vert_count, SIDE_MOST, SIDE_MOST);
}

static uint64_t bytes(const npg_export_facts *facts)
{
    return (uint64_t)facts->pose_count * facts->vert_count * 12;
}

/* ---- pictures, row by row ---- */

static void on_png_error(png_structp png, png_const_charp text)
{
    snprintf(png_get_error_ptr(png), TEXT_SIZE, "%s", text);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp text)
{
    (void)png, (void)text;
}

/* A file that can't be written says so when it is committed. */
static void put_bytes(png_structp png, png_bytep bytes, size_t size)
{
    npg_file_write(png_get_io_ptr(png), bytes, size);
}

static void flush_nothing(png_structp png)
{
    (void)png;
}

/* One step of libpng's, with its error. */
static npg_status step_of(picture *p, void (*step)(picture *))
{
    if (setjmp(png_jmpbuf(p->png))) return npg_error(NPG_FAILED, "a texture: libpng: %s", p->text);
    step(p);
    return NPG_OK;
}

/* Rows as differences from the one above, which is the frame before where a frame is one row. */
static void begin(picture *p)
{
    png_set_write_fn(p->png, p->file, put_bytes, flush_nothing);
    png_set_IHDR(p->png, p->info, p->width, p->height, 16, PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_set_filter(p->png, PNG_FILTER_TYPE_BASE, PNG_FILTER_UP);
    png_write_info(p->png, p->info);
}

static void put_row(picture *p)
{
    png_write_row(p->png, p->row);
}

static void end(picture *p)
{
    png_write_end(p->png, NULL);
}

static npg_status open_picture(vat_state *s, int which)
{
    picture *p = &s->pictures[which];
    p->width = (png_uint_32)s->width;
    p->height = (png_uint_32)s->height;
    p->row = npg_arena_take(&s->arena, s->width, 6);
    NPG_TRY(npg_arena_status(&s->arena));
    p->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, p->text, on_png_error, on_warning);
    p->info = p->png ? png_create_info_struct(p->png) : NULL;
    if (!p->info) return npg_error(NPG_MEMORY, "no memory for %s", names[which]);
    NPG_TRY(npg_file_open_in(&p->file, s->writer.facts->output, names[which]));
    return step_of(p, begin);
}

static npg_status end_picture(vat_state *s, int which)
{
    picture *p = &s->pictures[which];
    NPG_TRY(step_of(p, end));
    NPG_TRY(npg_file_commit(&p->file));
    return npg_export_made(s->writer.facts, "vat", names[which], s->writer.facts->first_index, s->count);
}

/* V x 3 values, each between lo and hi of its axis. */
static npg_status write_frame(vat_state *s, picture *p, const float *values, const float lo[3],
                              const float hi[3])
{
    size_t verts = s->writer.facts->vert_count;
    for (size_t row = 0; row < s->rows; row++) {
        memset(p->row, 0, 6 * s->width);
        for (size_t i = 0; i < 3 * s->width && row * s->width + i / 3 < verts; i++) {
            double span = (double)hi[i % 3] - (double)lo[i % 3];
            double share =
                ((double)values[3 * row * s->width + i] - (double)lo[i % 3]) / (span > 0 ? span : 1);
            npg_put_big(p->row + 2 * i, (uint64_t)lround(65535 * fmin(fmax(share, 0), 1)), 2);
        }
        NPG_TRY(step_of(p, put_row));
    }
    return NPG_OK;
}

/* ---- the mesh ---- */

typedef struct attribute {
    const char *name, *shape;
    const float *values;
    size_t width;
} attribute;

static void add_view(json_t *root, json_int_t *end, json_int_t count, const char *shape, bool is_index,
                     size_t row)
{
    json_array_append_new(json_object_get(root, "accessors"),
                          json_pack("{sI si ss sI}", "bufferView",
                                    (json_int_t)json_array_size(json_object_get(root, "bufferViews")),
                                    "componentType", is_index ? 5125 : 5126, "type", shape, "count", count));
    json_array_append_new(json_object_get(root, "bufferViews"),
                          json_pack("{si sI sI si}", "buffer", 0, "byteOffset", *end, "byteLength",
                                    count * (json_int_t)row, "target", is_index ? 34963 : 34962));
    *end += count * (json_int_t)row;
}

static npg_status write_glb(vat_state *s, const npg_corner_split *split, const attribute *attributes,
                            size_t count)
{
    const npg_export_facts *facts = s->writer.facts;
    json_int_t end = 0, verts = (json_int_t)split->count;
    json_t *named = json_object(),
           *root = json_pack("{s{ss} si s[{s[i]}] s[o] s[] s[] s[{ss s[{si so}]}]}", "asset", "version",
                             "2.0", "scene", 0, "scenes", "nodes", 0, "nodes", npg_glb_node(facts),
                             "accessors", "bufferViews", "meshes", "name", "surface", "primitives", "indices",
                             0, "attributes", named);
    add_view(root, &end, 3 * (json_int_t)facts->face_count, "SCALAR", true, 4);
    for (size_t i = 0; i < count; i++) {
        json_object_set_new(named, attributes[i].name, json_integer((json_int_t)i + 1));
        add_view(root, &end, verts, attributes[i].shape, false, 4 * attributes[i].width);
    }
    json_t *positions = json_array_get(json_object_get(root, "accessors"), 1);
    npg_bounds box = npg_bounds_of(attributes[0].values, split->count);
    json_object_set_new(positions, "min", json_pack("[fff]", box.lo[0], box.lo[1], box.lo[2]));
    json_object_set_new(positions, "max", json_pack("[fff]", box.hi[0], box.hi[1], box.hi[2]));
    json_object_set_new(root, "buffers", json_pack("[{sI}]", "byteLength", end));
    npg_status status = npg_glb_begin(s->writer.file, root, (uint64_t)end);
    json_decref(root);
    if (!status) status = npg_file_write(s->writer.file, split->indices, 12 * facts->face_count);
    for (size_t i = 0; i < count && !status; i++)
        status = npg_file_write(s->writer.file, attributes[i].values,
                                split->count * attributes[i].width * sizeof(float));
    return status;
}

/* In the first frame, whose positions and normals are at hand. */
static npg_status write_mesh(vat_state *s)
{
    npg_corner_split split;
    const npg_export_facts *facts = s->writer.facts;
    NPG_TRY(npg_split_corners(&split, &s->arena, facts));
    float *pos = npg_arena_take(&s->arena, split.count, 3 * sizeof *pos);
    float *normals = npg_arena_take(&s->arena, split.count, 3 * sizeof *normals);
    float *own = npg_arena_take(&s->arena, split.count, 2 * sizeof *own);
    float *texels = npg_arena_take(&s->arena, split.count, 2 * sizeof *texels);
    NPG_TRY(npg_arena_status(&s->arena));
    for (size_t i = 0; i < split.count; i++) {
        size_t v = split.vertex[i];
        memcpy(pos + 3 * i, s->pos + 3 * v, 3 * sizeof *pos);
        memcpy(normals + 3 * i, s->normals + 3 * v, 3 * sizeof *normals);
        texels[2 * i] = ((float)(v % s->width) + 0.5f) / (float)s->width;
        texels[2 * i + 1] = ((float)(v / s->width) + 0.5f) / (float)s->height;
        if (!split.uvs) continue;
        own[2 * i] = split.uvs[2 * i];
        own[2 * i + 1] = 1 - split.uvs[2 * i + 1];
    }
    const attribute attributes[] = {{"POSITION", "VEC3", pos, 3},
                                    {"NORMAL", "VEC3", normals, 3},
                                    {"TEXCOORD_0", "VEC2", own, 2},
                                    {"TEXCOORD_1", "VEC2", texels, 2}};
    NPG_TRY(npg_file_open_in(&s->writer.file, facts->output, "motion_vat.glb"));
    NPG_TRY(write_glb(s, &split, attributes, 4));
    NPG_TRY(npg_file_commit(&s->writer.file));
    return npg_export_made(facts, "vat", "motion_vat.glb", facts->first_index, 1);
}

static npg_status write_facts(vat_state *s)
{
    const npg_export_facts *facts = s->writer.facts;
    const double lo[3] = {(double)s->lo[0], (double)s->lo[1], (double)s->lo[2]};
    const double hi[3] = {(double)s->hi[0], (double)s->hi[1], (double)s->hi[2]};
    json_t *about = json_pack(
        "{ss ss ss sI sI sI sI sI sf sI sf s{so so} ss sf}", "mesh", "motion_vat.glb", "positions", names[0],
        "normals", names[1], "width", (json_int_t)s->width, "height", (json_int_t)s->height, "rows",
        (json_int_t)s->rows, "frames", (json_int_t)s->count, "first_frame", (json_int_t)facts->first_index,
        "fps", facts->fps, "vertices", (json_int_t)facts->vert_count, "step_v",
        (double)s->rows / (double)s->height, "box", "lo", npg_json_place(lo), "hi", npg_json_place(hi), "up",
        facts->is_z_up ? "z" : "y", "metres_per_unit", facts->metres_per_unit);
    npg_status status = npg_json_write(facts->output, "motion_vat.json", about);
    json_decref(about);
    return status ? status : npg_export_made(facts, "vat", "motion_vat.json", facts->first_index, s->count);
}

/* ---- the exporter ---- */

static npg_status open_vat(void *state)
{
    vat_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    s->arena.purpose = NPG_FOR_FILES;
    s->rows = rows_of(facts);
    s->width = (facts->vert_count + s->rows - 1) / s->rows;
    s->height = s->rows * (size_t)frames_of(facts);
    s->pos = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof *s->pos);
    s->normals = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof *s->normals);
    NPG_TRY(npg_arena_status(&s->arena));
    for (size_t a = 0; a < 3; a++) s->lo[a] = FLT_MAX, s->hi[a] = -FLT_MAX;
    return npg_file_open_in(&s->poses, facts->output, "motion_vat.0");
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    vat_state *s = state;
    size_t values = 3 * s->writer.facts->vert_count;
    for (size_t i = 0; i < values; i++) {
        s->lo[i % 3] = fminf(s->lo[i % 3], pose->pos[i]);
        s->hi[i % 3] = fmaxf(s->hi[i % 3], pose->pos[i]);
    }
    s->count++;
    return npg_file_write(s->poses, pose->pos, values * sizeof *pose->pos);
}

static npg_status finish_vat(void *state)
{
    vat_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    const float low[3] = {-1, -1, -1}, high[3] = {1, 1, 1};
    size_t size = facts->vert_count * 3 * sizeof *s->pos;
    for (int i = 0; i < 2; i++) NPG_TRY(open_picture(s, i));
    for (int64_t k = 0; k < s->count; k++) {
        NPG_TRY(npg_file_reread(s->poses, s->pos, size, (uint64_t)k * size));
        npg_mesh_vertex_normals(s->normals, s->pos, facts->vert_count, facts->faces, facts->face_count);
        NPG_TRY(write_frame(s, &s->pictures[0], s->pos, s->lo, s->hi));
        NPG_TRY(write_frame(s, &s->pictures[1], s->normals, low, high));
        if (!k) NPG_TRY(write_mesh(s));
    }
    for (int i = 0; i < 2; i++) NPG_TRY(end_picture(s, i));
    return write_facts(s);
}

static void close_vat(void *state)
{
    vat_state *s = state;
    for (int i = 0; i < 2; i++) {
        png_destroy_write_struct(&s->pictures[i].png, &s->pictures[i].info);
        npg_file_discard(&s->pictures[i].file);
    }
    npg_file_discard(&s->poses);
    npg_arena_release(&s->arena);
}

const npg_exporter npg_exporter_vat = {.name = "vat",
                                       .is_surface = true,
                                       .is_float = true,
                                       .has_fixed_rate = true,
                                       .state_size = sizeof(vat_state),
                                       .check = check,
                                       .bytes = bytes,
                                       .open = open_vat,
                                       .pose = write_pose,
                                       .finish = finish_vat,
                                       .close = close_vat};
