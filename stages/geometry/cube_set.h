/* Cube set: cubes of one size, with a value in between: 1 in the middle of a cube of the set, 0 in the middle
 * of any other, linear along each axis from middle to middle. */
#ifndef NPG_CUBE_SET_H
#define NPG_CUBE_SET_H

#include "pipeline/status.h"

typedef struct npg_cube_set npg_cube_set;

/* middles: K x 3, of cubes [i side, (i + 1) side) of whole i.  NPG_MEMORY. */
npg_status npg_cube_set_open(npg_cube_set **set, const float *middles, size_t count, double side);
void npg_cube_set_close(npg_cube_set **set);

double npg_cube_set_side(const npg_cube_set *set);

/* 0..1 */
double npg_cube_set_value(const npg_cube_set *set, const float place[3]);

#endif
