/* The mesh room: what others use of it. */
#ifndef NPG_MESH_SURFACE_H
#define NPG_MESH_SURFACE_H

#include "outlier/normals.h"
#include "pipeline/mesh.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"

/* Fused: what all frames saw of the body, in the pose of the reference.  Stage fuse makes it, stage mesh
 * takes a surface from it. */

#define NPG_FUSED_MOST 120000 /* points at most: 20 000 faces hold no more detail, with reserve */

/* The points of all frames, carried back to the keyframe's pose, averaged and thinned. */
typedef struct npg_fused {
    float *points, *normals; /* N x 3 each, unit coordinates, unit normals outward; owned */
    size_t count;            /* N */
    double spacing_unit;     /* side of the cells that points were averaged over */
    double key_spacing_unit; /* of the keyframe's points                            */
    double key_noise_unit;   /* of the same, across the surface                     */
    /* Their colours, where they have any: points of their own, M x 3, M x 3 and M x 4; owned, or NULL. */
    float *colour_points, *colour_normals;
    uint8_t *colours;
    size_t colour_count; /* M */
    /* Cubes near the reference that was followed which sensors, or viewpoints, saw to be empty, their middles; not there
     * where there are none. */
    float *empty; /* K x 3, owned, or NULL */
    size_t empty_count;
    double empty_side;
} npg_fused;

/* Written by stage fuse at the end of a fusing pass; stage mesh takes it in the pass that follows. */
extern const npg_fact_kind npg_fact_fused;

void npg_fused_close(npg_fused **fused);

/* Poisson: a closed surface from oriented points, by PCL's screened Poisson reconstruction
 * in a child process.
 *
 * PCL's code gives an empty mesh without an error for some inputs, garbage without an error for badly
 * oriented normals, and may crash or exit: so the input is checked before, the process has limits, and the
 * answer is checked after. */

/* Of the octree of a surface that is to carry frames, no more. */
#define NPG_DRAFT_DEPTH 7

typedef struct npg_poisson_settings {
    int depth;           /* of the octree                         */
    double point_weight; /* of the screening term, 10             */
    bool holds_apart;    /* npg_poisson_apart(): parts that nearly touch */
    double time_limit_s;
    size_t memory_limit; /* bytes of address space of the child; 0: none */
    const char *program; /* NULL: neupig-poisson                         */
    bool (*should_stop)(void *user);
    void *user;
} npg_poisson_settings;

/* As the mesh stage's options say (poisson-*, hold-apart); whom to ask for a stop is left to the caller. */
npg_poisson_settings npg_poisson_settings_of(const npg_options *options);

/* *mesh (owned by the caller, without normals, faces counter-clockwise from outside) through N points with
 * outward unit normals (N x 3 each).  The same input gives the same mesh.
 * NPG_BAD_INPUT: too few points, not finite, no extent in some direction, normals that are not unit or that
 * contradict each other.  NPG_FAILED: the child failed, or its mesh is empty, far from the points, in pieces
 * or inside out.  NPG_MEMORY, NPG_STOPPED. */
npg_status npg_poisson(npg_mesh **mesh, const float *points, const float *normals, size_t point_count,
                       const npg_poisson_settings *settings);

/* As npg_poisson(), and parts that nearly touch are kept from being joined (gap widening): *moved counts the points
 * that were moved for it.  spacing: npg_cloud_spacing(). */
npg_status npg_poisson_apart(npg_mesh **mesh, size_t *moved, const float *points, const float *normals,
                             size_t point_count, double spacing, const npg_poisson_settings *settings);

/* Whether of points no surface can be made.  Of a frame that is tried as the keyframe that is no failure of the run. */
static inline bool npg_mesh_is_none(npg_status status)
{
    return status == NPG_BAD_INPUT || status == NPG_FAILED || status == NPG_DIVERGED;
}

/* Draft: a coarse surface with normals, as npg_poisson_apart() makes it of few cells, in its main pieces.
 * is_side: sensors saw the points, and what they did not see is none of it.  The same errors. */
npg_status npg_mesh_draft(npg_mesh **mesh, const float *points, const float *normals, size_t point_count,
                          double spacing, bool is_side, const npg_poisson_settings *settings);

/* Denoise.  N x 3 arrays; NPG_MEMORY.
 *
 * Move every point onto the quadric z = a + bx + cy + dx^2 + exy + fy^2 fitted over its tangent plane to its
 * `neighbours` nearest points of the same side, weighted by distance; normals follow.  In place.  Points
 * without enough neighbours of their side stay.  Based on: F. Cazals, M. Pouget, Estimating Differential
 * Quantities Using Polynomial Fitting of Osculating Jets, 2005. */
npg_status npg_cloud_smooth(float *points, float *normals, size_t point_count, int neighbours);

/* Mesh clean: from a raw reconstruction to a reference mesh one can deform: trimmed, in one piece, decimated,
 * manifold, without flipped, degenerate or duplicate faces.
 *
 * All functions replace *mesh by a new one (its normals are dropped, they would be stale) or leave it as it
 * was on failure.  Nothing here is random and nothing depends on the number of threads.  NPG_MEMORY. */

/* Distance of each of V places to the nearest of N points.  dist: V. */
npg_status npg_points_dist(float *dist, const float *places, size_t place_count, const float *points,
                           size_t point_count);

/* Drop the faces of which a vertex is farther than dist_max from every point.  *share gets the share of the
 * area that went. */
npg_status npg_mesh_trim(npg_mesh **mesh, double *share, const float *points, size_t point_count,
                         double dist_max);

/* Drop the spikes and shreds along the open boundary of a surface that was trimmed, which are narrower than
 * about 2 `width`: a morphological opening.  What is farther than `width` from every vertex of the border is
 * the core; faces stay of which each vertex is within 1.5 `width` of it.  Faces should be smaller than
 * `width`.  A mesh without a border, or without a core, stays as it is. *share: of the area, what went.
 * NPG_MEMORY. */
npg_status npg_mesh_trim_shreds(npg_mesh **mesh, double *share, double width);

/* Share of the area that lies farther than dist_max from every point (by the mean of a face's vertices). */
npg_status npg_mesh_unseen(double *share, const npg_mesh *mesh, const float *points, size_t point_count,
                           double dist_max);

/* Of all area: what is smaller is a shred, and no piece. */
#define NPG_PIECE_SHARE 0.01

typedef struct npg_pieces {
    size_t found, kept; /* components */
    double lost_share;  /* share of the area that went */
} npg_pieces;

/* Keep the component of the largest area, and those with NPG_PIECE_SHARE of all area that come within a tenth of
 * `size` of it (a hand that a hole in the points cuts off belongs to the body; a ball beside it does not).
 * size 0: the largest alone; HUGE_VAL: wherever they are.  A mesh without faces stays as it is. */
npg_status npg_mesh_keep_main(npg_mesh **mesh, npg_pieces *pieces, double size);

/* At most face_max faces, by edge collapse (meshoptimizer). */
npg_status npg_mesh_decimate(npg_mesh **mesh, size_t face_max);

typedef struct npg_mending {
    size_t degenerate, duplicate, split_vertices, holes, flipped; /* what was found and mended */
} npg_mending;

/* Drop faces that use a vertex twice, repeat another or lie back to back with another; give each fan around a
 * vertex its own vertex; close holes of up to 32 edges; smooth where faces are turned over or have no area,
 * and collapse them where that does not help.  Of shreds no face may be left. */
npg_status npg_mesh_mend(npg_mesh **mesh, npg_mending *done);

/* Faces turned over against their surroundings: the normal points against the mean of the neighbours', or the
 * area is zero.  is_flipped (F) may be NULL. */
npg_status npg_mesh_flipped(size_t *count, uint8_t *is_flipped, const npg_mesh *mesh);

/* NPG_BAD_INPUT with the first edge that more than two faces use, or two in the same direction, or the first
 * degenerate face; name is what the text calls the mesh. */
npg_status npg_mesh_require_manifold(const npg_mesh *mesh, const char *name);

#endif
