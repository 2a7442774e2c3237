/* What the two OBJ writers share: numbers as text. */
#ifndef NPG_WRITE_OBJ_H
#define NPG_WRITE_OBJ_H

#include "export/forms/forms.h"
#include "export/forms/writer.h"

/* Digits after the point that keep 1e-7 of the extent, and 9 digits where the extent is unknown. */
int npg_obj_decimals_for(const npg_mesh_view *mesh);

/* Append " <number>" for each value to a line of `size` bytes, with a decimal point in every locale. */
void npg_obj_add_numbers(char *line, size_t size, int decimals, const double *values, int count);

/* One pose of a capture (V x 3; normals may be NULL; colours V x 4, NULL: the reference's) as OBJ, with the
 * lines of facts->like where there is one. */
npg_status npg_write_obj_pose(const char *path, const npg_form_facts *facts, const float *pos,
                              const float *normals, const uint8_t *colours);

#endif
