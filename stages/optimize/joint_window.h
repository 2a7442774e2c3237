/* Joint window: the joint fit (joint.h) of a window's frames, over the thinned surface that carries the whole
 * reference.
 *
 *     x(v) = y(v) + sum_i b_i(v) (x_i - y_i)
 *
 * y: positions before the fit, x_i: fitted vertices of the thinned surface, b(v): barycentric weights of v's
 * closest point on it.  What is carried is the difference, which is smooth: the surface keeps its detail.
 *
 * Frames that an earlier window has solved go only the share of the way that this window has in them
 * (npg_window_share), so that windows meet without a seam. */
#ifndef NPG_JOINT_WINDOW_H
#define NPG_JOINT_WINDOW_H

#include "optimize/joint.h"
#include "optimize/window.h"

typedef struct npg_joint_window npg_joint_window;

/* The points of a window's frames: those of frame i begin at start[i] of all (x 3, unit).  Loans. */
typedef struct npg_joint_points {
    const float *all;
    const size_t *start;
} npg_joint_points;

/* reference: unit coordinates; a loan during the call. */
npg_status npg_joint_window_open(npg_joint_window **window, const npg_mesh *reference,
                                 const npg_joint_settings *settings);
void npg_joint_window_close(npg_joint_window **window);

/* Solve the held frames (in order of time), which are those of `at`: `solved` of each is filled, or moved
 * where it is there already.  A frame that is solved for the first time gives its vert_unit for it.  Where
 * this fails nothing has changed. */
npg_status npg_joint_window_solve(npg_joint_window *window, npg_joint_result *result, npg_held *const *held,
                                  const npg_window *at, const npg_joint_points *points, npg_fit_watch *watch,
                                  void *user);

/* npg_joint_set_noise(). */
void npg_joint_window_set_noise(npg_joint_window *window, double noise);

/* Bytes that it takes at most. */
size_t npg_joint_window_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
