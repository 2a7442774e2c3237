/* Colour cells: an open-addressed table of cubes with colour histograms. */
#include "fuse/colour_cells.h"

#include <math.h>
#include <string.h>

#include "fuse/cell_key.h"
#include "geometry/colours.h"
#include "geometry/vec3.h"

typedef struct colour_cell {
    uint64_t key;
    float point[3], normal[3]; /* sums */
    uint32_t count;
    npg_colour_sums sums;
} colour_cell;

struct npg_colour_cells {
    colour_cell *cells; /* capacity of them; owned */
    uint32_t *place;    /* 2^bits: which cell, or NPG_CELL_NONE; owned */
    size_t count, capacity, most;
    int bits;
    double side;
};

npg_status npg_colour_cells_open(npg_colour_cells **out, double side, size_t most)
{
    npg_colour_cells *c;
    *out = NULL;
    NPG_REQUIRE(side > 0 && most > 0 && most < NPG_CELL_NONE / 2);
    NPG_TRY(npg_alloc(&c, NPG_FOR_MESH, sizeof *c));
    c->side = fmax(side, 4e-6); /* the unit box fits the bits of a key */
    c->most = most;
    c->bits = npg_cell_table_bits(most);
    size_t places = (size_t)1 << c->bits;
    npg_status status = npg_alloc_array(&c->place, NPG_FOR_MESH, places, sizeof *c->place);
    if (!status) memset(c->place, 0xff, places * sizeof *c->place);
    if (status) npg_colour_cells_close(&c);
    *out = c;
    return status;
}

void npg_colour_cells_close(npg_colour_cells **slot)
{
    if (!slot || !*slot) return;
    npg_release(&(*slot)->cells);
    npg_release(&(*slot)->place);
    npg_release(slot);
}

/* The cube of a key, NULL where it is new and there is no room. */
static colour_cell *find(npg_colour_cells *c, uint64_t key)
{
    size_t mask = ((size_t)1 << c->bits) - 1;
    size_t at = npg_cell_place(key, c->bits);
    while (c->place[at] != NPG_CELL_NONE && c->cells[c->place[at]].key != key) at = (at + 1) & mask;
    if (c->place[at] != NPG_CELL_NONE) return &c->cells[c->place[at]];
    if (c->count >= c->most) return NULL;
    if (npg_grow(&c->cells, &c->capacity, c->count + 1, sizeof *c->cells, NPG_FOR_MESH)) return NULL;
    c->place[at] = (uint32_t)c->count;
    c->cells[c->count].key = key;
    return &c->cells[c->count++];
}

void npg_colour_cells_add(npg_colour_cells *c, const float point[3], const float facing[3],
                          const uint8_t rgb[3], unsigned weight)
{
    colour_cell *cell = find(c, npg_cell_key(point, facing, c->side));
    if (!cell) return;
    for (int a = 0; a < 3; a++) {
        cell->point[a] += point[a];
        cell->normal[a] += facing[a];
    }
    cell->count++;
    for (unsigned k = 0; k < weight; k++) npg_colour_add(&cell->sums, rgb);
}

size_t npg_colour_cells_count(const npg_colour_cells *c)
{
    return c->count;
}

void npg_colour_cells_means(const npg_colour_cells *c, float *points, float *normals, uint8_t *colours)
{
    for (size_t i = 0; i < c->count; i++) {
        const colour_cell *cell = &c->cells[i];
        for (size_t a = 0; a < 3; a++) {
            points[3 * i + a] = cell->point[a] / (float)cell->count;
            normals[3 * i + a] = cell->normal[a];
        }
        npg_vec3_make_unitf(normals + 3 * i);
        npg_colour_mean(colours + 4 * i, &cell->sums);
        colours[4 * i + 3] = NPG_COLOUR_SEEN;
    }
}

size_t npg_colour_cells_memory(size_t most)
{
    return (2 * most + most / 2) * sizeof(colour_cell) + /* twice while it grows */
           ((size_t)1 << npg_cell_table_bits(most)) * sizeof(uint32_t);
}
