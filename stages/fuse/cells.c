/* Cells: an open-addressed table of cubes. */
#include "fuse/cells.h"

#include <math.h>
#include <string.h>

#include "fuse/cell_key.h"
#include "pipeline/memory.h"

#define VOTE_CELLS  4 /* sides of the cubes over which frames are counted, in cells */
#define SIDE_LEAST  1e-5
#define CELLS_LEAST 65 /* cubes on both sides of 0 never become one: 8 of them, facing 8 octants, and room */

typedef struct cell {
    uint64_t key;
    float point[3], normal[3]; /* weighted sums */
    float weight;
    uint32_t frames; /* that added to it */
    int64_t last;    /* of them */
} cell;

typedef struct table {
    cell *cells;     /* in the order in which they were met; owned */
    uint32_t *place; /* 2^bits places of the table: which cell, or NPG_CELL_NONE; owned */
    size_t count, most;
    int bits;
} table;

struct npg_cells {
    table fine, votes;
    double side;
};

/* ---- a table ---- */

static npg_status open_table(table *t, size_t most)
{
    size_t places = (size_t)1 << npg_cell_table_bits(most);
    t->most = most;
    t->bits = npg_cell_table_bits(most);
    NPG_TRY(npg_alloc_array(&t->cells, NPG_FOR_MESH, most + 1, sizeof *t->cells));
    NPG_TRY(npg_alloc_array(&t->place, NPG_FOR_MESH, places, sizeof *t->place));
    memset(t->place, 0xff, places * sizeof *t->place);
    return NPG_OK;
}

static void close_table(table *t)
{
    npg_release(&t->cells);
    npg_release(&t->place);
}

/* The key's place in the table: NPG_CELL_NONE is there where it is new. */
static size_t place_of(const table *t, uint64_t key)
{
    size_t mask = ((size_t)1 << t->bits) - 1;
    size_t at = npg_cell_place(key, t->bits);
    while (t->place[at] != NPG_CELL_NONE && t->cells[t->place[at]].key != key) at = (at + 1) & mask;
    return at;
}

/* The cell of the key, made where it is new. */
static cell *find(table *t, uint64_t key)
{
    size_t at = place_of(t, key);
    if (t->place[at] == NPG_CELL_NONE) {
        t->place[at] = (uint32_t)t->count;
        t->cells[t->count++] = (cell){.key = key, .last = -1};
    }
    return &t->cells[t->place[at]];
}

/* The key of the cube of twice the side around a cell. */
static uint64_t key_of_double(uint64_t key)
{
    const uint64_t mask = (UINT64_C(1) << NPG_CELL_COORDS_BITS) - 1, middle = UINT64_C(1)
                                                                              << (NPG_CELL_COORDS_BITS - 1);
    uint64_t out = 0;
    for (int a = 2; a >= 0; a--) {
        uint64_t at = key >> (3 + a * NPG_CELL_COORDS_BITS) & mask; /* counted from -middle */
        out = out << NPG_CELL_COORDS_BITS | ((at + middle) >> 1);
    }
    return out << 3 | (key & 7);
}

/* ---- adding ---- */

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
    c->frames += c->last != frame;
    c->last = frame;
}

/* All cells into cubes of twice the side: at most as many as before, on a surface a quarter. */
static npg_status grow(table *t)
{
    table wide = {0};
    npg_status status = open_table(&wide, t->most);
    for (size_t i = 0; i < t->count && !status; i++) {
        const cell *from = &t->cells[i];
        cell *to = find(&wide, key_of_double(from->key));
        for (int a = 0; a < 3; a++) {
            to->point[a] += from->point[a];
            to->normal[a] += from->normal[a];
        }
        to->weight += from->weight;
        to->frames = from->frames > to->frames ? from->frames : to->frames;
        to->last = from->last > to->last ? from->last : to->last;
    }
    close_table(status ? &wide : t);
    if (!status) *t = wide;
    return status;
}

npg_status npg_cells_add(npg_cells *c, const float at[3], const float facing[3], const float point[3],
                         const float normal[3], float weight, int64_t frame)
{
    while (c->fine.count >= c->fine.most || c->votes.count >= c->votes.most) {
        NPG_TRY(grow(&c->fine));
        NPG_TRY(grow(&c->votes));
        c->side *= 2;
    }
    add(find(&c->fine, npg_cell_key(at, facing, c->side)), point, normal, weight);
    count_frame(find(&c->votes, npg_cell_key(at, facing, VOTE_CELLS * c->side)), frame);
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
    npg_status status = open_table(&c->fine, most);
    if (!status) status = open_table(&c->votes, most);
    if (status) npg_cells_close(&c);
    *out = c;
    return status;
}

void npg_cells_close(npg_cells **slot)
{
    if (!slot || !*slot) return;
    close_table(&(*slot)->fine);
    close_table(&(*slot)->votes);
    npg_release(slot);
}

size_t npg_cells_count(const npg_cells *cells)
{
    return cells->fine.count;
}

double npg_cells_side(const npg_cells *cells)
{
    return cells->side;
}

/* The frames around a cell: those of the cube of votes that it lies in. */
static int64_t votes_of(const npg_cells *c, const cell *of)
{
    const table *votes = &c->votes;
    uint64_t key = of->key;
    for (int side = 1; side < VOTE_CELLS; side *= 2) key = key_of_double(key);
    uint32_t at = votes->place[place_of(votes, key)];
    return at == NPG_CELL_NONE ? 0 : votes->cells[at].frames;
}

npg_status npg_cells_means(const npg_cells *c, float *points, float *normals, size_t *count,
                           int64_t frames_least)
{
    *count = 0;
    for (size_t i = 0; i < c->fine.count; i++) {
        const cell *of = &c->fine.cells[i];
        float length = sqrtf(of->normal[0] * of->normal[0] + of->normal[1] * of->normal[1] +
                             of->normal[2] * of->normal[2]);
        if (!(of->weight > 0) || !(length > 0) || votes_of(c, of) < frames_least) continue;
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
    return 4 * ((most + 1) * sizeof(cell) + ((size_t)1 << npg_cell_table_bits(most)) * sizeof(uint32_t));
}
