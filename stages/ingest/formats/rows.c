/* Rows: what a reader collects a cloud or a mesh in, and the binary rows of numbers that go into it. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/ingest_internal.h"
#include "pipeline/order.h"

/* A number beyond this is damage, not a place: as origin it would swallow every other point. */
#define ORIGIN_MAX  1e15
#define SAMPLES     1001 /* of a cloud, for its median                                                     */
#define AWAY_MAX    16   /* spreads between origin and median: float, of 24 bits, keeps 1e-6 of the spread */
#define BLOCK_BYTES ((size_t)64 << 10) /* decoded at a time; set by trial */

int npg_slot_of(const char *name)
{
    static const char *const names[NPG_SLOTS] = {[NPG_X] = "x",
                                                 [NPG_Y] = "y",
                                                 [NPG_Z] = "z",
                                                 [NPG_NX] = "nx normal_x",
                                                 [NPG_NY] = "ny normal_y",
                                                 [NPG_NZ] = "nz normal_z",
                                                 [NPG_RED] = "red r diffuse_red",
                                                 [NPG_GREEN] = "green g diffuse_green",
                                                 [NPG_BLUE] = "blue b diffuse_blue",
                                                 [NPG_ALPHA] = "alpha a",
                                                 [NPG_U] = "u s texture_u",
                                                 [NPG_V] = "v t texture_v"};
    for (int slot = 0; slot < NPG_SLOTS; slot++)
        for (const char *at = names[slot]; *at; at += strspn(at, " ")) {
            size_t length = strcspn(at, " ");
            if (length == strlen(name) && !memcmp(at, name, length)) return slot;
            at += length;
        }
    return -1;
}

/* ---- coordinates ---- */

void npg_local_of(float local[3], npg_origin *origin, const double world[3])
{
    if (!origin->known && fabs(world[0]) < ORIGIN_MAX && fabs(world[1]) < ORIGIN_MAX &&
        fabs(world[2]) < ORIGIN_MAX)
        npg_origin_offer(origin, world);
    for (int a = 0; a < 3; a++) local[a] = (float)(world[a] - (origin->known ? origin->world[a] : 0));
}

bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count)
{
    double values[SAMPLES], median[3] = {0}, spread = 0, away = 0;
    size_t step = point_count / SAMPLES + 1; /* at most SAMPLES points, evenly over the file */
    for (size_t a = 0; a < 3; a++) {
        size_t count = 0;
        for (size_t i = 0; i < point_count; i += step)
            if (isfinite(pos_local[3 * i + a])) values[count++] = (double)pos_local[3 * i + a];
        if (count < 8) return false; /* too few for deciles; any origin will do */
        qsort(values, count, sizeof *values, npg_order_double);
        median[a] = values[count / 2];
        spread = fmax(spread, values[count * 9 / 10] - values[count / 10]); /* outliers aside */
        away = fmax(away, fabs(median[a]));
    }
    if (!origin->known || away <= AWAY_MAX * spread) return false;
    for (int a = 0; a < 3; a++) origin->world[a] += median[a];
    return true;
}

void npg_unit_normal(float out[3], const double normal[3])
{
    double length = npg_vec3_length(normal);
    bool usable = length > 1e-12 && isfinite(length); /* shorter ones have no direction */
    for (int a = 0; a < 3; a++) out[a] = usable ? (float)(normal[a] / length) : 0;
}

/* ---- building ---- */

npg_status npg_builder_reserve(npg_builder *b, size_t vertices, size_t triangles)
{
    if (vertices > UINT32_MAX - b->vert_count || triangles > UINT32_MAX - b->face_count)
        return npg_error(NPG_MEMORY, "more than %u points or faces", UINT32_MAX);
    const struct {
        void *array;
        size_t row;
        bool is_there;
    } arrays[] = {{&b->pos, 3 * sizeof(float), true},
                  {&b->normals, 3 * sizeof(float), b->has_normals},
                  {&b->colours, 4, b->has_colours},
                  {&b->uvs, 2 * sizeof(float), b->has_uvs}};
    size_t capacity = b->vert_capacity;
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++) {
        if (!arrays[i].is_there) continue;
        capacity = b->vert_capacity;
        NPG_TRY(npg_grow(arrays[i].array, &capacity, b->vert_count + vertices, arrays[i].row, b->purpose));
    }
    b->vert_capacity = capacity;
    return npg_grow(&b->faces, &b->face_capacity, b->face_count + triangles, 3 * sizeof(uint32_t),
                    b->purpose);
}

static void count_far(npg_builder *b, const double world[3])
{
    double largest = 0, sum = world[0] + world[1] + world[2];
    for (int a = 0; a < 3; a++) largest = fmax(largest, fabs(world[a] - b->origin->world[a]));
    b->finite_count += isfinite(sum);
    b->far_count += isfinite(sum) && largest > NPG_SIDE_MAX;
}

size_t npg_builder_add(npg_builder *b, const double values[NPG_SLOTS])
{
    size_t at = b->vert_count++;
    npg_local_of(b->pos + 3 * at, b->origin, values + NPG_X);
    count_far(b, values + NPG_X);
    if (b->has_normals) npg_unit_normal(b->normals + 3 * at, values + NPG_NX);
    for (size_t c = 0; c < 4 && b->has_colours; c++) {
        double value = values[NPG_RED + c];
        b->colours[4 * at + c] = value >= 255 ? 255 : value > 0 ? (uint8_t)(value + 0.5) : 0;
    }
    for (size_t c = 0; c < 2 && b->has_uvs; c++) b->uvs[2 * at + c] = (float)values[NPG_U + c];
    return at;
}

npg_status npg_builder_polygon(npg_builder *b, const uint32_t *corners, size_t corner_count)
{
    NPG_TRY(npg_builder_reserve(b, 0, corner_count - 2));
    for (size_t i = 2; i < corner_count; i++) {
        uint32_t *face = b->faces + 3 * b->face_count++;
        face[0] = corners[0];
        face[1] = corners[i - 1];
        face[2] = corners[i];
    }
    return NPG_OK;
}

void npg_builder_frame(npg_frame *frame, npg_builder *b)
{
    frame->pos_local = b->pos;
    frame->normals = b->normals;
    frame->colours = b->colours;
    frame->point_count = b->vert_count;
    b->pos = b->normals = NULL;
    b->colours = NULL;
}

static npg_status check_faces(const npg_builder *b, const char *name)
{
    if (!b->vert_count) return npg_error(NPG_BAD_INPUT, "%s: there are no points", name);
    if (!b->face_count && !b->may_be_points)
        return npg_error(NPG_BAD_INPUT, "%s: no faces, so it is not a mesh", name);
    for (size_t i = 0; i < 3 * b->face_count; i++)
        if (b->faces[i] >= b->vert_count)
            return npg_error(NPG_BAD_INPUT, "%s: triangle %zu uses vertex %u, but there are only %zu", name,
                             i / 3, b->faces[i], b->vert_count);
    return NPG_OK;
}

npg_status npg_builder_mesh(npg_mesh **out, npg_builder *b, const char *name)
{
    NPG_TRY(check_faces(b, name));
    NPG_TRY(npg_mesh_open(out, 0, 0));
    (*out)->vert_count = b->vert_count;
    (*out)->face_count = b->face_count;
    (*out)->vert_pos = b->pos;
    (*out)->vert_normals = b->normals;
    (*out)->vert_colours = b->colours;
    (*out)->vert_uvs = b->uvs;
    (*out)->corner_uvs = b->corner_uvs;
    (*out)->faces = b->faces;
    *b = (npg_builder){0};
    return NPG_OK;
}

void npg_builder_clear(npg_builder *b)
{
    npg_release(&b->pos);
    npg_release(&b->normals);
    npg_release(&b->colours);
    npg_release(&b->uvs);
    npg_release(&b->corner_uvs);
    npg_release(&b->faces);
}

/* ---- binary rows ---- */

size_t npg_ply_type_size(npg_ply_type type)
{
    static const size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[type];
}

double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format)
{
    size_t size = npg_ply_type_size(type);
    uint64_t bits = 0;
    if (format == NPG_PLY_LITTLE) {
        for (size_t i = size; i-- > 0;) bits = bits << 8 | bytes[i];
    } else {
        for (size_t i = 0; i < size; i++) bits = bits << 8 | bytes[i];
    }
    uint32_t low = (uint32_t)bits;
    float single;
    double whole;
    switch (type) {
    case NPG_PLY_INT8: return (double)(int8_t)low;
    case NPG_PLY_UINT8: return (double)(uint8_t)low;
    case NPG_PLY_INT16: return (double)(int16_t)low;
    case NPG_PLY_UINT16: return (double)(uint16_t)low;
    case NPG_PLY_INT32: return (double)(int32_t)low;
    case NPG_PLY_UINT32: return (double)low;
    case NPG_PLY_FLOAT: memcpy(&single, &low, sizeof single); return (double)single;
    case NPG_PLY_DOUBLE: memcpy(&whole, &bits, sizeof whole); return whole;
    }
    return 0;
}

double npg_colour_value(double value, npg_ply_type type)
{
    if (type >= NPG_PLY_FLOAT) return value * 255; /* 0 .. 1 */
    return type == NPG_PLY_UINT16 ? value / 257 /* 65535 / 255 */ : value;
}

void npg_rows_add(npg_builder *b, const npg_columns *columns, const unsigned char *data, size_t count)
{
    size_t used[NPG_SLOTS], used_count = 0;
    double values[NPG_SLOTS] = {[NPG_ALPHA] = 255};
    for (size_t slot = 0; slot < NPG_SLOTS; slot++)
        if (columns->of[slot].is_there && (slot < NPG_U || b->has_uvs)) used[used_count++] = slot;
    for (size_t i = 0; i < count; i++) {
        for (size_t k = 0; k < used_count; k++) {
            const npg_column *c = &columns->of[used[k]];
            double value = npg_ply_value(data + c->offset + i * c->step, c->type, columns->format);
            bool is_colour = used[k] >= NPG_RED && used[k] <= NPG_ALPHA;
            values[used[k]] = is_colour ? npg_colour_value(value, c->type) : value;
        }
        npg_builder_add(b, values);
    }
}

npg_status npg_rows_read(npg_builder *b, npg_source *source, const npg_columns *columns, uint64_t count,
                         size_t row_size, uint64_t *done)
{
    size_t block = BLOCK_BYTES / row_size + 1, available;
    /* All at once where the count has been checked against the file's size, else block by block. */
    if (npg_source_left(source) != UINT64_MAX) NPG_TRY(npg_builder_reserve(b, (size_t)count, 0));
    for (*done = 0; *done < count;) {
        size_t rows = count - *done < block ? (size_t)(count - *done) : block;
        NPG_TRY(npg_source_fill(source, rows * row_size, &available));
        if (available < rows * row_size) {
            *done += available / row_size;
            return NPG_END;
        }
        NPG_TRY(npg_builder_reserve(b, rows, 0));
        npg_rows_add(b, columns, npg_source_data(source), rows);
        npg_source_take(source, rows * row_size);
        *done += rows;
    }
    return NPG_OK;
}
