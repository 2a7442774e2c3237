/* What the files of the evaluate stage share. */
#ifndef NPG_EVALUATE_H
#define NPG_EVALUATE_H

#include "pipeline/chunk.h"
#include "pipeline/mesh.h"
#include "pipeline/stage.h"

/* ---- how a deformed mesh differs from its reference ---- */

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

/* A third of the area of the faces around each vertex (V), and their sum. */
double npg_vertex_areas(double *areas, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                        size_t face_count);

/* ---- ground truth ---- */

typedef struct npg_truth npg_truth;

/* The meshes (PLY or OBJ) of a folder, found by the last number in their names.  NPG_BAD_INPUT when there are
 * none or two have one number, and with is_confined when one leads out of the folder. */
npg_status npg_truth_open(npg_truth **truth, const char *folder, bool is_confined);
void npg_truth_close(npg_truth **truth);

/* Fill truth_cd, truth_nc, truth_f and truth_corr of a frame by geometry/metrics.h; they are NaN when the
 * folder has no mesh of the frame's number.  Lengths are in diagonals of the box of the truth's mesh of the
 * run's lowest number, or of the first there is.  Corr ties vertices in the first frame that is asked for,
 * the keyframe of a run (neupig eval ties them in the first in time, which this pass sees last). */
npg_status npg_truth_compare(npg_truth *truth, npg_frame *frame, const npg_facts *facts, uint64_t seed);

#endif
