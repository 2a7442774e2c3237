/* Joint window: the joint fit (joint.h) of a window's frames, over the thinned surface that carries the whole
 * reference.
 *
 * It replaces the aligned positions of the frames that no earlier window has solved; those that one has are
 * fixed and bind the motion, so that windows meet without a seam. */
#ifndef NPG_JOINT_WINDOW_H
#define NPG_JOINT_WINDOW_H

#include "optimize/carry.h"
#include "optimize/joint.h"
#include "pipeline/chunk.h"

typedef struct npg_joint_window npg_joint_window;

/* A frame in hand: vert_unit is moved where it is not solved; points: N x 3 unit. */
typedef struct npg_joint_part {
    npg_frame *frame;
    const float *points;
    bool is_solved;
} npg_joint_part;

/* surface: of the reference (both loans that outlive it). */
npg_status npg_joint_window_open(npg_joint_window **window, const npg_thin *surface,
                                 const npg_mesh *reference, const npg_joint_settings *settings);
void npg_joint_window_close(npg_joint_window **window);
npg_status npg_joint_window_move(npg_joint_window *window, npg_joint_result *result,
                                 const npg_joint_part *parts, size_t count);

/* Bytes that it takes at most. */
size_t npg_joint_window_memory(const npg_joint_settings *settings, size_t vert_count, size_t frames);

#endif
