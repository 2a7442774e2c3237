/* Joint window: the joint fit (joint.h) of a window's frames, over the thinned surface that carries the whole
 * reference.
 *
 * It replaces the aligned positions of the frames that no earlier window has solved; those that one has are
 * fixed and bind the motion, so that windows meet without a seam. */
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

/* Move frame.vert_unit of the held frames (in order of time) that are not solved; the points of frame i begin
 * at point_start[i] of points (x 3, unit). */
npg_status npg_joint_window_move(npg_joint_window *window, npg_joint_result *result, npg_held *const *held,
                                 size_t count, const float *points, const size_t *point_start);

/* Bytes that it takes at most. */
size_t npg_joint_window_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
