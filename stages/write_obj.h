/* What the two OBJ writers share: numbers as text. */
#ifndef NPG_WRITE_OBJ_H
#define NPG_WRITE_OBJ_H

#include "writer.h"

/* Digits after the point that keep 1e-7 of the extent, and 9 digits where the extent is unknown. */
int npg_obj_decimals_for(const npg_mesh_view *mesh);

/* Append " <number>" for each value to a line of `size` bytes, with a decimal point in every locale. */
void npg_obj_add_numbers(char *line, size_t size, int decimals, const double *values, int count);

#endif
