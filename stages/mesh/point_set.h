/* Point set: the points that the reference is made from, of the keyframe or of all frames, and how dense they
 * are.  Unit coordinates throughout. */
#ifndef NPG_POINT_SET_H
#define NPG_POINT_SET_H

#include "geometry/cube_set.h"
#include "mesh/fused.h"
#include "pipeline/stage.h"

typedef struct npg_point_set {
    float *points;          /* N x 3, owned                                               */
    float *normals;         /* N x 3, outward, owned; NULL: the keyframe has none         */
    size_t count;           /* N                                                          */
    bool has_given_normals; /* the capture's own; false: estimated from the points       */
    size_t given;           /* points there were, before any was left out                 */
    bool is_fused;          /* of all frames; false: of the keyframe alone                */
    int64_t key_number;     /* the keyframe's, for the log                                */
    double spacing;         /* npg_cloud_spacing()                                        */
    double diagonal;        /* of the points' box                                         */
    double seen_dist;       /* a place was seen when a point is nearer than this          */
    double key_spacing;     /* where is_fused, of the keyframe's points; else 0           */
    double key_noise;       /* of the same, across the surface                            */
    npg_cube_set *empty;    /* space that sensors saw to be empty, owned; NULL: not known */
} npg_point_set;

/* The keyframe's points, an even choice of them where there are many; with `fused` (or NULL) those of all
 * frames, whose points and normals are taken from it.  While a side of the body grows into a whole
 * (facts.growing_passes), those in empty space are dropped.
 * Figures go into the report of the worker's stage; called on its thread.  The set is to be closed; after a
 * failure it owns nothing.  NPG_MEMORY. */
npg_status npg_point_set_open(npg_point_set *set, npg_worker *worker, const npg_frame *key, npg_fused *fused);
void npg_point_set_close(npg_point_set *set);

#endif
