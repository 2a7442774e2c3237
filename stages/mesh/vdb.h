/* Volumes (OpenVDB). */
#ifndef NPG_VDB_H
#define NPG_VDB_H

#include "pipeline/mesh.h"
#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Rebuild a closed mesh through its narrow-band level set of this voxel size: every place outside-in is
 * decided by the sign of the distance, so folds, slivers and inner walls go and triangles get even.  *mesh is
 * replaced (without normals, colours, UVs) or left as it was on failure.  NPG_FAILED when no surface comes
 * out, NPG_MEMORY. */
npg_status npg_vdb_remesh(npg_mesh **mesh, double voxel);

#ifdef __cplusplus
}
#endif
#endif
