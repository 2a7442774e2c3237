/* Misfit: finds where in a frame the surface fails in one place, which is how a change of topology shows:
 * noise, outliers and a poor fit are spread all over.
 *
 *   far       points further from the surface than `reach`, near each other: something is there that the
 *             reference does not have (what lies just beyond its border, where it has one, its frame did not
 *             see)
 *   bare      connected surface further than `reach` from all points: something is gone
 *   torn      connected surface that is stretched, its edges more than 1.5 times as long as in the reference,
 *             and further than 0.6 x reach from all points: a web between parts that went apart
 *   deserted  a part of the reference (one that hangs together) with fewer than 60 % of the points that are
 *             its share by area: it is gone, though its surface has found a place on another part's points,
 *             where it is neither bare nor torn.  A point is its nearest part's; the share counts what is
 *             missing
 *
 * reach = max(3 x spacing of the points on the surface, 1.5 % of the reference's diagonal), with noise
 * 5 x the median distance of the points, but no more than twice as far; the places are the largest ones.
 *
 * What sampling can explain is nothing: a place of fewer than 12 points, and one on the surface
 * where fewer than 20 points would be expected or that has fewer than 6 vertices' share of the area.
 * A reference with a border, or one that saw only a part of its frame, is never bare, torn or deserted:
 * what cameras see differs.  Where it is known what of the surface they could see in a frame, the rest of it
 * is neither bare nor torn, and has no share of the points. */
#ifndef NPG_MISFIT_H
#define NPG_MISFIT_H

#include "pipeline/chunk.h"
#include "pipeline/mesh.h"

typedef struct npg_misfit_finder npg_misfit_finder;

/* The mesh is a loan that must outlive the finder.  unseen_share: of its area that no point of its frame saw;
 * above 2 % the capture is of cameras that see other parts in each frame. */
npg_status npg_misfit_open(npg_misfit_finder **finder, const npg_mesh *reference, double unseen_share);
void npg_misfit_close(npg_misfit_finder **finder);

/* What is measured of a frame, in units. */
typedef struct npg_misfit_frame {
    const float *points;         /* N x 3                  */
    const npg_surface_hit *hits; /* N, the closest surface */
    size_t point_count;
    double point_dist_median;
    const float *vert_unit;    /* V x 3                           */
    const float *vert_dist_sq; /* V, to the nearest point         */
    const double *vert_areas;  /* V, in this frame, and their sum */
    double area;
    const uint8_t *is_in_sight; /* V: of a sensor, or NULL: no sensor is known */
} npg_misfit_frame;

/* Fill misfits[NPG_MISFITS]; `at` in units.  far's share is of the points, the others'
 * of the area.  NPG_MEMORY. */
npg_status npg_misfit_find(npg_misfit_finder *finder, npg_misfit *misfits, const npg_misfit_frame *frame);

#endif
