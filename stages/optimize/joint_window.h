/* Joint window: the joint fit (joint.h) of a window's frames, over the thinned surface that carries the whole
 * reference.
 *
 * It moves the aligned positions of all frames; those that an earlier window has solved go only the share of
 * the way that this window has in them (npg_window_share), and their solved positions go with them: windows
 * meet without a seam. */
#ifndef NPG_JOINT_WINDOW_H
#define NPG_JOINT_WINDOW_H

#include "optimize/carry.h"
#include "optimize/joint.h"
#include "optimize/window.h"

typedef struct npg_joint_window npg_joint_window;

/* surface: of the reference (both loans that outlive it). */
npg_status npg_joint_window_open(npg_joint_window **window, const npg_thin *surface,
                                 const npg_mesh *reference, const npg_joint_settings *settings);
void npg_joint_window_close(npg_joint_window **window);

/* Move frame.vert_unit of the held frames (in order of time), which are those of `at`; the points of frame i
 * begin at point_start[i] of points (x 3, unit). */
npg_status npg_joint_window_move(npg_joint_window *window, npg_joint_result *result, npg_held *const *held,
                                 const npg_window *at, const float *points, const size_t *point_start);

/* Bytes that it takes at most. */
size_t npg_joint_window_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
