/* Warm start: windows of frames that come without alignment.
 *
 * A window starts from what the fit knew after the window it borders on in time.  Its new frames are brought
 * near their pose first, one by one, outward from those that are solved (in the first window: from the
 * keyframe, which is the reference): the last pose moved on by its velocity is fitted to as a known target
 * (vertices against vertices, no search), then the frame's points pull at the surface, matched again and
 * again.  Few samples of the reference do for that.  Then all frames of the window are fitted together: by
 * the paper's distance over all vertices, with the frames that the window shares tied to where they are
 * solved, until the loss has settled; or by the distance to the surface over the samples, whose result the
 * field of the decoder gives for every vertex.
 *
 * A capture of one window by the paper's distance is solved as in the paper, without any of this. */
#ifndef NPG_WARM_START_H
#define NPG_WARM_START_H

#include "optimize/fit_copy.h"
#include "optimize/match.h"
#include "pipeline/stage.h"

/* What a fit without alignment brings down. */
typedef enum npg_distance {
    NPG_DISTANCE_VERTICES, /* all vertices against points (paper) */
    NPG_DISTANCE_SURFACE   /* the surface against points          */
} npg_distance;

typedef struct npg_warm_settings {
    int distance;    /* npg_distance                                   */
    int64_t samples; /* of the reference, 0: the usual number          */
    int64_t rounds;  /* times that the last fit by the surface is matched */
    npg_match_settings match;
} npg_warm_settings;

/* The frames of a window as the solver has them, in order of time; loans. */
typedef struct npg_warm_frames {
    npg_fit_frame *frames;       /* points, no bases; ties and bases are filled in here  */
    const float *const *normals; /* of the points, or NULL for a frame                   */
    const float *const *solved;  /* V x 3 where an earlier window solved the frame, else NULL */
    size_t count;
} npg_warm_frames;

typedef struct npg_warm npg_warm;

/* Called between steps from which the window's fit could be continued: it may save that (npg_warm_save). */
typedef npg_status npg_warm_keep(void *user);

/* device and facts outlive it. */
npg_status npg_warm_open(npg_warm **warm, npg_device *device, const npg_warm_settings *settings,
                         const npg_fit_settings *fit, const npg_facts *facts, uint64_t seed);
void npg_warm_close(npg_warm **warm);

/* Bytes that it takes at most. */
size_t npg_warm_memory(const npg_warm_settings *settings, const npg_fit_settings *fit, size_t vert_count,
                       size_t frames);

/* keep gets the user of npg_warm_solve. */
void npg_warm_set_keep(npg_warm *warm, npg_warm_keep *keep);

/* The Chamfer distance that windows before came to (0: unknown), for npg_warm_solve; and the factor by which
 * the last window failed to get there with the epochs of a warm start, so that it had those of a cold one
 * then (0: it did not). */
void npg_warm_set_usual(npg_warm *warm, double chamfer);
double npg_warm_lost_by(const npg_warm *warm);

/* Solve a window with `fit`, over all vertices: it then holds the frames' positions. */
npg_status npg_warm_solve(npg_warm *warm, npg_fit *fit, const npg_warm_frames *frames,
                          const npg_window *window, npg_fit_watch *watch, void *user);

/* How far the window at work is: during a keep, as blocks of a store; and back, before npg_warm_solve of
 * the same window, which then continues there. */
npg_status npg_warm_save(npg_warm *warm, npg_store *store);
npg_status npg_warm_restore(npg_warm *warm, npg_fit *fit, const npg_record *store);

/* What the fit knew after the window around the keyframe, while a later window may start from it. */
npg_fit_copy *npg_warm_first(npg_warm *warm);

#endif
