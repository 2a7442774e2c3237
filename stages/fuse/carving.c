/* Free-space carving: a band of cubes around the surface, and their votes. */
#include "fuse/fuse_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/parallel.h"

#define PARTS_MOST     8
#define GRID_BITS_MOST ((size_t)1 << 28) /* cells of the box around the band: 32 MiB of marks */

enum { NOTHING, EMPTY, FILLED };

typedef struct cell {
    float place[3];         /* middle, at rest */
    uint16_t empty, filled; /* frames */
    uint8_t says;           /* the frame at work */
    bool is_of_key;         /* the frame with npg_seen.is_key fills it */
} cell;

struct npg_carving {
    double side;
    size_t count;
    npg_arena arena;
    cell *cells;
    npg_surface_hit *hits; /* of their places, at rest               */
    float *now;            /* where they are in the frame at work    */
};

/* ---- the band ---- */

typedef struct grid {
    double side, low[3];
    size_t size[3];
    uint8_t *bits; /* owned */
} grid;

static npg_status open_grid(grid *g, const npg_mesh *mesh, double side, double band)
{
    npg_bounds bounds = npg_bounds_empty();
    size_t count = 1;
    npg_bounds_add_points(&bounds, mesh->vert_pos, mesh->vert_count);
    g->side = side;
    for (int a = 0; a < 3; a++) {
        g->low[a] = floor((bounds.lo[a] - band) / side) * side;
        g->size[a] = (size_t)ceil((bounds.hi[a] + band - g->low[a]) / side) + 1;
        count *= g->size[a];
        if (count > GRID_BITS_MOST) return NPG_OK;
    }
    return npg_alloc(&g->bits, NPG_FOR_MESH, count / 8 + 1);
}

/* Marks the cells around a vertex; returns how many are new. */
static size_t mark_around(grid *g, const float vertex[3], double reach)
{
    long first[3], last[3];
    size_t marked = 0;
    for (int a = 0; a < 3; a++) {
        first[a] = (long)fmax(0, floor(((double)vertex[a] - reach - g->low[a]) / g->side));
        last[a] =
            (long)fmin((double)g->size[a] - 1, floor(((double)vertex[a] + reach - g->low[a]) / g->side));
    }
    for (long z = first[2]; z <= last[2]; z++)
        for (long y = first[1]; y <= last[1]; y++)
            for (long x = first[0]; x <= last[0]; x++) {
                size_t at = ((size_t)z * g->size[1] + (size_t)y) * g->size[0] + (size_t)x;
                marked += !(g->bits[at / 8] >> at % 8 & 1);
                g->bits[at / 8] |= (uint8_t)(1 << at % 8);
            }
    return marked;
}

static npg_status take_cells(npg_carving *c, const grid *g, size_t count)
{
    c->arena.purpose = NPG_FOR_MESH;
    c->cells = npg_arena_take(&c->arena, count, sizeof *c->cells);
    c->hits = npg_arena_take(&c->arena, count, sizeof *c->hits);
    c->now = npg_arena_take(&c->arena, count, 3 * sizeof *c->now);
    NPG_TRY(npg_arena_status(&c->arena));
    for (size_t at = 0; at < g->size[0] * g->size[1] * g->size[2]; at++) {
        if (!(g->bits[at / 8] >> at % 8 & 1)) continue;
        const size_t i[3] = {at % g->size[0], at / g->size[0] % g->size[1], at / g->size[0] / g->size[1]};
        for (int a = 0; a < 3; a++)
            c->cells[c->count].place[a] = (float)(g->low[a] + ((double)i[a] + 0.5) * g->side);
        c->count++;
    }
    return NPG_OK;
}

/* The points of the surface that the cells hang on. */
static npg_status bind(npg_carving *c, const npg_mesh *mesh)
{
    for (size_t i = 0; i < c->count; i++) memcpy(c->now + 3 * i, c->cells[i].place, sizeof c->cells[i].place);
    return npg_mesh_closest(c->hits, mesh, c->now, c->count);
}

/* Where there are too many cells, half as many. */
npg_status npg_carving_open(npg_carving **out, const npg_mesh *mesh, double side, double band, size_t most)
{
    npg_carving *c;
    *out = NULL;
    NPG_TRY(npg_alloc(&c, NPG_FOR_MESH, sizeof *c));
    npg_status status = NPG_OK;
    for (size_t count = SIZE_MAX; count > most && !status; side *= cbrt(2)) {
        grid g = {0};
        c->side = side;
        count = 0;
        status = open_grid(&g, mesh, side, band);
        if (!g.bits) count = SIZE_MAX;
        for (size_t v = 0; v < mesh->vert_count && !status && count <= most; v++)
            count += mark_around(&g, mesh->vert_pos + 3 * v, band);
        if (!status && count <= most) status = take_cells(c, &g, count);
        npg_release(&g.bits);
    }
    if (!status) status = bind(c, mesh);
    if (status) npg_carving_close(&c);
    *out = c;
    return status;
}

void npg_carving_close(npg_carving **cells)
{
    if (!cells || !*cells) return;
    npg_arena_release(&(*cells)->arena);
    npg_release(cells);
}

/* ---- a frame ---- */

typedef struct looking {
    npg_carving *c;
    const npg_skin *skin;
    const npg_depth_map *map; /* or: */
    const npg_free_space *space;
    size_t parts;
} looking;

static size_t first_of(const looking *l, size_t part)
{
    return part * l->c->count / l->parts;
}

static npg_status move_part(void *user, size_t part)
{
    const looking *l = user;
    npg_carving *c = l->c;
    for (size_t i = first_of(l, part); i < first_of(l, part + 1); i++) {
        npg_skin_from_rest(l->skin, c->now + 3 * i, &c->hits[i], c->cells[i].place);
        c->cells[i].says = NOTHING;
    }
    return NPG_OK;
}

static npg_status look_part(void *user, size_t part)
{
    const looking *l = user;
    for (size_t i = first_of(l, part); i < first_of(l, part + 1); i++) {
        uint8_t *says = &l->c->cells[i].says;
        if (*says == FILLED) continue;
        const float *place = l->c->now + 3 * i;
        npg_sight_kind kind =
            l->space ? npg_free_space_look(l->space, place) : npg_depth_map_look(l->map, place);
        if (kind == NPG_SEEN_AT) *says = FILLED;
        if (kind == NPG_SEEN_EMPTY || kind == NPG_SEEN_BESIDE) *says = EMPTY;
    }
    return NPG_OK;
}

static void count_frame(npg_carving *c, bool is_key)
{
    for (size_t i = 0; i < c->count; i++) {
        cell *one = &c->cells[i];
        one->empty += one->says == EMPTY && one->empty < UINT16_MAX;
        one->filled += one->says == FILLED && one->filled < UINT16_MAX;
        one->is_of_key = one->is_of_key || (is_key && one->says == FILLED);
    }
}

/* One map at a time: they are large. */
npg_status npg_carving_see(npg_carving *c, const npg_skin *skin, const npg_seen *seen)
{
    looking l = {c, skin, NULL, seen->space, npg_parallel_parts(c->count, 1000, PARTS_MOST)};
    npg_status status = npg_parallel(move_part, &l, l.parts);
    if (!status && seen->space) status = npg_parallel(look_part, &l, l.parts);
    for (size_t i = 0; i < seen->sensor_count && !status && !seen->space; i++) {
        const float *sensor = seen->sensors + 3 * i;
        npg_depth_map *map;
        if (!isfinite(sensor[0] + sensor[1] + sensor[2])) continue;
        status = npg_depth_map_open(&map, sensor, seen->points, seen->point_count, seen->bin, seen->margin);
        l.map = map;
        if (!status) status = npg_parallel(look_part, &l, l.parts);
        npg_depth_map_close(&map);
    }
    if (!status) count_frame(c, seen->is_key);
    return status;
}

/* ---- what came out ---- */

size_t npg_carving_count(const npg_carving *c)
{
    return c->count;
}

double npg_carving_side(const npg_carving *c)
{
    return c->side;
}

size_t npg_carving_find(const npg_carving *c, float *places, int frames_least, double share)
{
    size_t count = 0;
    for (size_t i = 0; i < c->count; i++) {
        const cell *one = &c->cells[i];
        double least = (one->is_of_key ? 1 - share : share) * (one->empty + one->filled);
        if (one->empty < frames_least || one->empty < least) continue;
        memcpy(places + 3 * count++, one->place, sizeof one->place);
    }
    return count;
}

size_t npg_carving_memory(size_t most)
{
    return most * (sizeof(cell) + sizeof(npg_surface_hit) + 6 * sizeof(float)) + GRID_BITS_MOST / 8 +
           npg_depth_map_memory();
}
