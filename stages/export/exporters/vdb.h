/* Level sets of surfaces as OpenVDB files, for other programs. */
#ifndef NPG_EXPORTERS_VDB_H
#define NPG_EXPORTERS_VDB_H

#include "export/files.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct npg_vdb_surface { /* what is written, with what the file says about it */
    const float *points;         /* V x 3 */
    size_t vert_count;
    const uint32_t *faces; /* F x 3, closed */
    size_t face_count;
    double voxel; /* in the unit of the points */
    int64_t index, number;
    double fps, metres_per_unit;
    bool is_z_up;
} npg_vdb_surface;

/* Write the narrow-band level set (half width three voxels, negative inside) of a closed surface to a file,
 * as the grid "surface"; the file's metadata has npg_index, npg_number, npg_fps, npg_metres_per_unit, npg_up.
 * NPG_FAILED when nothing of it is inside, so that no surface would come out; NPG_MEMORY. */
npg_status npg_vdb_save_surface(const char *path, const npg_vdb_surface *surface);

#ifdef __cplusplus
}
#endif
#endif
