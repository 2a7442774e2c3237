/* Cells: cubes of space by key, a table of them, and a set of cubes with a value in between. */
#ifndef NPG_CELLS_H
#define NPG_CELLS_H

#include "pipeline/memory.h"

/* In which cube of this side a point of a surface lies and which octant it faces, as 63 bits: two sides of a
 * thin part have cells of their own.  Coordinates have 20 bits: the unit box in cells of 4e-6 fits. */
uint64_t npg_cell_key(const float point[3], const float facing[3], double side);

/* The key of the cube of twice the side around a cell. */
uint64_t npg_cell_key_of_double(uint64_t key);

/* Keys, numbered in the order in which they were met (open addressing). */
typedef struct npg_cell_table {
    uint64_t *keys;  /* count                                             */
    uint32_t *place; /* 2^bits places: the number of a key, NPG_CELL_NONE */
    size_t count, most;
    int bits;
    npg_arena arena; /* of both; the owner's arrays by number may be taken from it, too */
} npg_cell_table;

#define NPG_CELL_NONE UINT32_MAX

/* Room for `most` keys.  NPG_MEMORY; the table is then to be closed all the same. */
npg_status npg_cell_table_open(npg_cell_table *table, size_t most);
void npg_cell_table_close(npg_cell_table *table);

/* The number of a key, NPG_CELL_NONE where it is new. */
uint32_t npg_cell_find(const npg_cell_table *table, uint64_t key);

/* The number of a key, the next one where it is new; there must be room. */
uint32_t npg_cell_add(npg_cell_table *table, uint64_t key);

/* Bytes of one. */
size_t npg_cell_table_memory(size_t most);

/* Cube set: cubes of one size, with a value in between: 1 in the middle of a cube of the set, 0 in the middle
 * of any other, linear along each axis from middle to middle. */
typedef struct npg_cube_set npg_cube_set;

/* middles: K x 3, of cubes [i side, (i + 1) side) of whole i.  NPG_MEMORY. */
npg_status npg_cube_set_open(npg_cube_set **set, const float *middles, size_t count, double side);
void npg_cube_set_close(npg_cube_set **set);

double npg_cube_set_side(const npg_cube_set *set);

/* 0..1 */
double npg_cube_set_value(const npg_cube_set *set, const float place[3]);

#endif
