/* Likeness: how near a user's own mesh is to a frame's points, where it was put.
 *
 *     d = mean_p |p - nearest vertex| + mean_v |v - nearest point|
 *
 * over at most about LOOKED_AT points p of the frame and as many vertices v.  The frame with the smallest d
 * is the one whose pose the mesh has: it is the keyframe that a run with the user's own mesh should have. */
#ifndef NPG_LIKENESS_H
#define NPG_LIKENESS_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

typedef struct npg_likeness npg_likeness;

/* Read the mesh (PLY or OBJ).  origin is known.  NPG_BAD_INPUT names the file. */
npg_status npg_likeness_open(npg_likeness **likeness, const char *path, const npg_origin *origin,
                             const npg_frame_box *box);
size_t npg_likeness_vert_count(const npg_likeness *likeness); /* of the whole mesh */
void npg_likeness_close(npg_likeness **likeness);

/* d of a frame with points, in units; infinity where no point is finite.  NPG_MEMORY. */
npg_status npg_likeness_dist(double *dist_unit, const npg_likeness *likeness, const npg_frame *frame,
                             const npg_frame_box *box);

#endif
