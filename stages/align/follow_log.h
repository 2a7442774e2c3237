/* Log of what a fusing pass found, group of frames by group, so that a run which is stopped or killed in the
 * middle of one does not follow them again.  What comes before and behind in the pass is cheap, and the same
 * when it is done again: only the alignment is read back, to the bit.
 *
 *     64 bytes: "NPGFOLLW", key of the job, hash of the reference, nodes, bytes of a state; the rest 0
 *     per group: bytes of what follows, its XXH3; then frames (uint64), the stage's state behind the group,
 *     and per frame its index (int64) and pose (K x 12 double)
 *
 * In the machine's byte order.  A group that is not whole, as the last one may be, ends the log. */
#ifndef NPG_FOLLOW_LOG_H
#define NPG_FOLLOW_LOG_H

#include <stdbool.h>

#include "align/tracker.h"

typedef struct npg_follow_log npg_follow_log;

/* What must be the same for poses to be taken over. */
typedef struct npg_follow_key {
    uint64_t job;              /* of options and input                                    */
    const npg_mesh *reference; /* that the poses are of; a loan for the call              */
    size_t node_count;         /* K                                                       */
    size_t state_bytes;        /* of what the stage needs behind a group                  */
} npg_follow_key;

/* The log at `path` (kept as a copy), read from its begin; one of another key is begun anew.  *groups: how
 * many whole ones it holds.  NPG_DISK. */
npg_status npg_follow_log_open(npg_follow_log **log, int64_t *groups, const char *path,
                               const npg_follow_key *key);
void npg_follow_log_close(npg_follow_log **log);

/* Whether there is a group left to read.  While there is, frames are read; then they are added. */
bool npg_follow_log_has_group(const npg_follow_log *log);

/* The next frame of the group at hand: pose gets K x 12.  NPG_BAD_INPUT where it is not `index`. */
npg_status npg_follow_log_read(npg_follow_log *log, int64_t index, double *pose);

/* The group's end: its state, a loan until the next call.  NPG_BAD_INPUT where frames of it are left. */
npg_status npg_follow_log_end_group(npg_follow_log *log, const void **state);

/* Add frames, and with the state the group is whole and on disk.  NPG_DISK, NPG_MEMORY. */
npg_status npg_follow_log_add(npg_follow_log *log, int64_t index, const double *pose);
npg_status npg_follow_log_commit_group(npg_follow_log *log, const void *state);

#endif
