/* Cell keys: in which cube of space a point of a surface lies and which octant it faces, as 63 bits, and
 * where such a key is looked for first in an open-addressed table of 2^bits places. */
#ifndef NPG_CELL_KEY_H
#define NPG_CELL_KEY_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

#define NPG_CELL_COORDS_BITS 20  /* of a key, per axis; the unit box in cells of 1e-5 fits */
#define NPG_CELL_FULL        0.6 /* of a table's places, at most */
#define NPG_CELL_NONE        UINT32_MAX

/* A coordinate in cells of one side (units); 0 is in the middle of the range. */
static inline uint64_t npg_cell_coordinate(double x, double side)
{
    double at = floor(x / side) + (double)(1 << (NPG_CELL_COORDS_BITS - 1));
    return (uint64_t)fmin(fmax(at, 0), (double)((1 << NPG_CELL_COORDS_BITS) - 1));
}

static inline uint64_t npg_cell_key(const float point[3], const float facing[3], double side)
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++)
        key = key << NPG_CELL_COORDS_BITS | npg_cell_coordinate((double)point[a], side);
    for (int a = 0; a < 3; a++) key = key << 1 | (facing[a] < 0);
    return key;
}

/* Bits of a table that holds `most` cells. */
static inline int npg_cell_table_bits(size_t most)
{
    int bits = 4;
    while ((double)((size_t)1 << bits) * NPG_CELL_FULL < (double)most + 1) bits++;
    return bits;
}

/* Fibonacci hashing. */
static inline size_t npg_cell_place(uint64_t key, int bits)
{
    return (size_t)((key * UINT64_C(0x9e3779b97f4a7c15)) >> (64 - bits));
}

#endif
