/* Averages: means of points, and robust means of colours, over cubes and octants. */
#include <math.h>

#include "fuse/fuse_internal.h"
#include "geometry/geometry.h"

#define SIDE_LEAST  1e-5
#define CELLS_LEAST 65 /* cubes on both sides of 0 never become one: 8 of them, facing 8 octants, and room */

typedef struct cell {
    float point[3], normal[3]; /* weighted sums */
    float weight;
    uint32_t frames; /* that added to it */
    int64_t last;    /* of them, plus one */
} cell;

typedef struct layer {
    npg_cell_table table;
    cell *cells; /* of the table's numbers and arena */
} layer;

struct npg_cells {
    layer fine, votes;
    double side;
};

/* ---- points ---- */

static npg_status open_layer(layer *l, size_t most)
{
    NPG_TRY(npg_cell_table_open(&l->table, most));
    l->cells = npg_arena_take(&l->table.arena, most + 1, sizeof *l->cells);
    return npg_arena_status(&l->table.arena);
}

static bool is_full(const layer *l)
{
    return l->table.count >= l->table.most;
}

/* The cell of the key, made where it is new. */
static cell *find(layer *l, uint64_t key)
{
    return &l->cells[npg_cell_add(&l->table, key)];
}

static void add(cell *c, const float point[3], const float normal[3], float weight)
{
    for (int a = 0; a < 3; a++) {
        c->point[a] += weight * point[a];
        c->normal[a] += weight * normal[a];
    }
    c->weight += weight;
}

static void count_frame(cell *c, int64_t frame)
{
    c->frames += c->last != frame + 1;
    c->last = frame + 1;
}

/* All cells into cubes of twice the side: at most as many as before, on a surface a quarter. */
static npg_status grow(layer *l)
{
    layer wide;
    npg_status status = open_layer(&wide, l->table.most);
    for (size_t i = 0; i < l->table.count && !status; i++) {
        const cell *from = &l->cells[i];
        cell *to = find(&wide, npg_cell_key_of_double(l->table.keys[i]));
        for (int a = 0; a < 3; a++) {
            to->point[a] += from->point[a];
            to->normal[a] += from->normal[a];
        }
        to->weight += from->weight;
        to->frames = from->frames > to->frames ? from->frames : to->frames;
        to->last = from->last > to->last ? from->last : to->last;
    }
    npg_cell_table_close(status ? &wide.table : &l->table);
    if (!status) *l = wide;
    return status;
}

npg_status npg_cells_add(npg_cells *c, const float at[3], const float facing[3], const float point[3],
                         const float normal[3], float weight, int64_t frame)
{
    while (is_full(&c->fine) || is_full(&c->votes)) {
        NPG_TRY(grow(&c->fine));
        NPG_TRY(grow(&c->votes));
        c->side *= 2;
    }
    add(find(&c->fine, npg_cell_key(at, facing, c->side)), point, normal, weight);
    count_frame(find(&c->votes, npg_cell_key(at, facing, NPG_VOTE_CELLS * c->side)), frame);
    return NPG_OK;
}

/* ---- the whole ---- */

npg_status npg_cells_open(npg_cells **out, double side, size_t most)
{
    npg_cells *c;
    *out = NULL;
    NPG_TRY(npg_alloc(&c, NPG_FOR_MESH, sizeof *c));
    c->side = fmax(side, SIDE_LEAST);
    if (most < CELLS_LEAST) most = CELLS_LEAST;
    npg_status status = open_layer(&c->fine, most);
    if (!status) status = open_layer(&c->votes, most);
    if (status) npg_cells_close(&c);
    *out = c;
    return status;
}

void npg_cells_close(npg_cells **slot)
{
    if (!slot || !*slot) return;
    npg_cell_table_close(&(*slot)->fine.table);
    npg_cell_table_close(&(*slot)->votes.table);
    npg_release(slot);
}

size_t npg_cells_count(const npg_cells *cells)
{
    return cells->fine.table.count;
}

double npg_cells_side(const npg_cells *cells)
{
    return cells->side;
}

/* The frames around a cell: those of the cube of votes that it lies in. */
static int64_t votes_of(const npg_cells *c, uint64_t key)
{
    for (int side = 1; side < NPG_VOTE_CELLS; side *= 2) key = npg_cell_key_of_double(key);
    uint32_t at = npg_cell_find(&c->votes.table, key);
    return at == NPG_CELL_NONE ? 0 : c->votes.cells[at].frames;
}

npg_status npg_cells_means(const npg_cells *c, float *points, float *normals, size_t *count,
                           int64_t frames_least)
{
    *count = 0;
    for (size_t i = 0; i < c->fine.table.count; i++) {
        const cell *of = &c->fine.cells[i];
        float length = sqrtf(of->normal[0] * of->normal[0] + of->normal[1] * of->normal[1] +
                             of->normal[2] * of->normal[2]);
        if (!(of->weight > 0) || !(length > 0) || votes_of(c, c->fine.table.keys[i]) < frames_least) continue;
        for (int a = 0; a < 3; a++) {
            points[3 * *count + (size_t)a] = of->point[a] / of->weight;
            normals[3 * *count + (size_t)a] = of->normal[a] / length;
        }
        ++*count;
    }
    return NPG_OK;
}

size_t npg_cells_memory(size_t most)
{
    if (most < CELLS_LEAST) most = CELLS_LEAST;
    /* two tables, each twice while it grows */
    return 4 * ((most + 1) * sizeof(cell) + npg_cell_table_memory(most));
}

/* ---- colours ---- */

typedef struct colour_cell {
    float point[3], normal[3]; /* sums */
    uint32_t count;
    npg_colour_sums sums;
} colour_cell;

struct npg_colour_cells {
    npg_cell_table table;
    colour_cell *cells; /* capacity of them; owned */
    size_t capacity;
    double side;
};

npg_status npg_colour_cells_open(npg_colour_cells **out, double side, size_t most)
{
    npg_colour_cells *c;
    *out = NULL;
    NPG_REQUIRE(side > 0 && most > 0 && most < NPG_CELL_NONE / 2);
    NPG_TRY(npg_alloc(&c, NPG_FOR_MESH, sizeof *c));
    c->side = fmax(side, 4e-6); /* the unit box fits the bits of a key */
    npg_status status = npg_cell_table_open(&c->table, most);
    if (status) npg_colour_cells_close(&c);
    *out = c;
    return status;
}

void npg_colour_cells_close(npg_colour_cells **slot)
{
    if (!slot || !*slot) return;
    npg_cell_table_close(&(*slot)->table);
    npg_release(&(*slot)->cells);
    npg_release(slot);
}

/* The cube of a key, NULL where it is new and there is no room. */
static colour_cell *find_colour(npg_colour_cells *c, uint64_t key)
{
    npg_cell_table *t = &c->table;
    if (npg_cell_find(t, key) == NPG_CELL_NONE &&
        (t->count >= t->most ||
         npg_grow(&c->cells, &c->capacity, t->count + 1, sizeof *c->cells, NPG_FOR_MESH)))
        return NULL;
    return &c->cells[npg_cell_add(t, key)];
}

void npg_colour_cells_add(npg_colour_cells *c, const float point[3], const float facing[3],
                          const uint8_t rgb[3], unsigned weight)
{
    colour_cell *one = find_colour(c, npg_cell_key(point, facing, c->side));
    if (!one) return;
    for (int a = 0; a < 3; a++) {
        one->point[a] += point[a];
        one->normal[a] += facing[a];
    }
    one->count++;
    for (unsigned k = 0; k < weight; k++) npg_colour_add(&one->sums, rgb);
}

size_t npg_colour_cells_count(const npg_colour_cells *c)
{
    return c->table.count;
}

void npg_colour_cells_means(const npg_colour_cells *c, float *points, float *normals, uint8_t *colours)
{
    for (size_t i = 0; i < c->table.count; i++) {
        const colour_cell *one = &c->cells[i];
        for (size_t a = 0; a < 3; a++) {
            points[3 * i + a] = one->point[a] / (float)one->count;
            normals[3 * i + a] = one->normal[a];
        }
        npg_vec3_make_unitf(normals + 3 * i);
        npg_colour_mean(colours + 4 * i, &one->sums);
        colours[4 * i + 3] = NPG_COLOUR_SEEN;
    }
}

size_t npg_colour_cells_memory(size_t most)
{
    return (2 * most + most / 2) * sizeof(colour_cell) +
           npg_cell_table_memory(most); /* twice while it grows */
}
