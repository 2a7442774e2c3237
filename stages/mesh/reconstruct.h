/* Reconstruct: from a point set to one clean mesh that can be deformed.
 *
 * In this order:
 *
 *     noisy points are smoothed (denoise.h), and Poisson's surface drawn through them, in which parts that
 *         nearly touch are held apart (resurface.h)
 *     of its pieces the main one is kept, and what belongs to it
 *     what lies far from every point is trimmed off; of what no point saw, all of it, or it is drawn tight
 *         between what was seen and out of empty space (flatten.h)
 *     faces are decimated and mended (mesh_clean.h); those of noisy points follow the points' normals
 *         (follow_normals.h)
 *
 * Where that leaves folds and the whole surface is closed, it is taken through a level set (vdb.h), trimmed
 * and decimated once more. */
#ifndef NPG_RECONSTRUCT_H
#define NPG_RECONSTRUCT_H

#include "mesh/point_set.h"
#include "mesh/poisson.h"

/* Surface that no point saw: drawn tight, or trimmed where it is a whole side; kept as Poisson closed it;
 * trimmed.  The words of --unseen, in their order. */
typedef enum npg_unseen_way { NPG_UNSEEN_AUTO, NPG_UNSEEN_KEEP, NPG_UNSEEN_TRIM } npg_unseen_way;

#define NPG_FACES_PER_POINT 4 /* at most: more would be the mesher's, not the points' */

typedef struct npg_reconstruct_settings {
    int unseen;                   /* npg_unseen_way                                                         */
    bool smooth;                  /* the points, where they are noisy                                       */
    int64_t face_max;             /* and no more faces than NPG_FACES_PER_POINT for each point given        */
    npg_poisson_settings poisson; /* with whom to ask for a stop                                            */
} npg_reconstruct_settings;

/* *mesh (unit coordinates, without normals, faces counter-clockwise from outside; owned by the caller, NULL
 * on failure) from the set, whose points and normals may be smoothed and turned in place.  *invented_share
 * gets the share of the area, 0..1, that no point saw and that was kept, as measured before decimation.
 * Of the facts it asks whether the reference grows (growing_passes, is_growing): while it does, the mesh is
 * coarser and has nothing that was not seen.
 * Figures and warnings go to the report and the log of the worker's stage; called on its thread.  It uses all
 * cores, and the same input gives the same mesh.
 * NPG_BAD_INPUT: the set has no normals, or is one that npg_poisson() refuses.  NPG_FAILED: npg_poisson()
 * failed, no surface lies near the points or nothing but shreds, or it can't be taken through a level set.
 * NPG_MEMORY, NPG_STOPPED.  Faces that are still turned over after all mending are a warning. */
npg_status npg_reconstruct(npg_mesh **mesh, double *invented_share, npg_worker *worker, npg_point_set *set,
                           const npg_reconstruct_settings *settings);

#endif
