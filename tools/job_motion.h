/* Job motion: the reference of a finished run at any time, in the coordinates of its files, from the saved
 * windows alone (optimize/replay.h). */
#ifndef NPG_JOB_MOTION_H
#define NPG_JOB_MOTION_H

#include "pipeline/mesh.h"

typedef struct npg_job_motion npg_job_motion;

/* job: the run's output folder; reference: its reference.ply, whose coordinates poses then have; device: as
 * npg_device_open().  NPG_END where the run has left no windows (pulled from), NPG_BAD_INPUT where they are
 * damaged or not of this reference, NPG_DEVICE. */
npg_status npg_job_motion_open(npg_job_motion **motion, const char *job, const npg_mesh *reference,
                               const char *device);
void npg_job_motion_close(npg_job_motion **motion);

/* vert_pos (V x 3) at a frame's index, or between two. */
npg_status npg_job_motion_pose(npg_job_motion *motion, float *vert_pos, double index);

#endif
