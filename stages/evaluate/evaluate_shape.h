/* Shape: how a deformed mesh differs from its reference. */
#ifndef NPG_EVALUATE_SHAPE_H
#define NPG_EVALUATE_SHAPE_H

#include "pipeline/chunk.h"
#include "pipeline/mesh.h"

typedef struct npg_shape npg_shape;

/* What is needed of the reference; the mesh is a loan that must outlive the shape. */
npg_status npg_shape_open(npg_shape **shape, const npg_mesh *reference);
void npg_shape_close(npg_shape **shape);

/* Fill flipped_share, stretched_share and edge_change for V x 3 deformed vertices.
 *
 * A face is flipped when its normal points against the mean normal of the faces that share a vertex with it
 * (weighted by their areas in the reference; cosine below -0.2) although it did not in the reference (cosine
 * above 0.2): it was turned over against the rotation of its neighbourhood.  Faces that stand across a crease
 * of the reference are not judged.  A face is stretched when its area is more than 10 or less than 0.1 times
 * that in the reference.  edge_change is the mean of |length / reference length - 1|. */
void npg_shape_measure(const npg_shape *shape, npg_figures *figures, const float *vert_unit);

#endif
