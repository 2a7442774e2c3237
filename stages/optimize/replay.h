/* Replay: the deformation of a finished run at any time, from the records of its windows alone (record.h).
 *
 * Where frames come aligned it is what the run has written at frames, and between them the cubic through the
 * frames around (Catmull-Rom).  Without alignment
 *
 *     x(t) = x + share_w(t) (x_w(t) - x) for the windows w around t, one after the other in the order they
 *            were solved
 *
 * x_w(t): the reference, moved by w's decoder, which is asked for that very time, at frames and between them.
 * At frames that is what the run has written, but for rounding; in overlaps the windows fade as they do
 * there, so the motion is continuous.
 *
 * Memory: the reference, and the records of a few windows.  Threads: one at a time. */
#ifndef NPG_REPLAY_H
#define NPG_REPLAY_H

#include "kernels/runtime/device.h"

typedef struct npg_replay npg_replay;

/* The records in a folder (OUT/job); the device is a loan.  NPG_END when there are none, NPG_BAD_INPUT names
 * one that is damaged or does not belong to the others. */
npg_status npg_replay_open(npg_replay **replay, npg_device *device, const char *folder);
void npg_replay_close(npg_replay **replay);

size_t npg_replay_vert_count(const npg_replay *replay);

/* The reference, V x 3, unit coordinates; a loan. */
const float *npg_replay_rest(const npg_replay *replay);

/* Frames that have a motion: first <= index <= last. */
void npg_replay_range(const npg_replay *replay, int64_t *first, int64_t *last);

/* vert_unit (V x 3) at a frame or between two: index is a real number in that range.  NPG_BAD_INPUT outside,
 * and where a record on the way is missing. */
npg_status npg_replay_vertices(npg_replay *replay, float *vert_unit, double index);

#endif
