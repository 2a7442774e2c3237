/* Apply: another mesh, or points, carried through all frames of a finished run. */
#ifndef NPG_APPLY_H
#define NPG_APPLY_H

#include <stdbool.h>

#include "pipeline/status.h"

typedef struct npg_apply_settings {
    const char *job;  /* output folder of the run; its meshes are still there                              */
    const char *mesh; /* a file of a mesh or of points, in the coordinates of the job's reference.ply      */
    const char
        *output; /* folder for <prefix>_<number>.<ending>, and done.json, which comes last            */
    const char *prefix,
        *ending;       /* ending: "ply", "obj", or NULL: as the mesh's own, ply for other points   */
    int64_t fps_scale; /* steps from each frame to the next; above 1 the files are numbered 0, 1, 2 ...     */
    double far_share;  /* of the reference's diagonal: points farther from it are counted                   */
    bool overwrite;    /* files of the same prefix that lie there are removed; else they are refused        */
} npg_apply_settings;

typedef struct npg_applied {
    size_t frames;                  /* written                                           */
    size_t point_count, far_count;  /* of the mesh; those too far from the reference     */
    size_t worst;                   /* the farthest, and how far it is: in the reference's */
    double worst_dist, worst_share; /* unit, and in its diagonals                        */
} npg_applied;

/* Filled as far as it got, also on failure.  NPG_USAGE, NPG_BAD_INPUT, NPG_DISK, NPG_MEMORY. */
npg_status npg_apply(npg_applied *applied, const npg_apply_settings *settings);

#endif
