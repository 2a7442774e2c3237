/* Poisson: a closed surface from oriented points, by PCL's screened Poisson reconstruction
 * in a child process.
 *
 * PCL's code gives an empty mesh without an error for some inputs, garbage without an error for badly
 * oriented normals, and may crash or exit: so the input is checked before, the process has limits, and the
 * answer is checked after. */
#ifndef NPG_POISSON_H
#define NPG_POISSON_H

#include <stdbool.h>

#include "mesh/apart.h"
#include "pipeline/options.h"

typedef struct npg_poisson_settings {
    int depth;           /* of the octree, 10                     */
    double point_weight; /* of the screening term, 10             */
    int rounds_max;      /* npg_resurface(): drafts at most; 0: 4 */
    npg_apart_way apart; /* npg_resurface_apart(): how            */
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

/* The checks before, alone. */
npg_status npg_poisson_check(const float *points, const float *normals, size_t point_count);

/* Share of points whose normal points against most of those of its near neighbours on
 * the same sheet, 0..1. */
npg_status npg_normals_disagreement(double *share, const float *points, const float *normals,
                                    size_t point_count);

#endif
