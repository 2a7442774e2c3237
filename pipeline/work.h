/* Work: one call that `neupig bench` and `neupig tune` time, with what it takes at least.
 *
 * The rooms whose code is worth timing hand such calls out one by one (npg_kernels_work, npg_align_work,
 * npg_carry_work), so that a tool can time them without knowing how they are set up. */
#ifndef NPG_WORK_H
#define NPG_WORK_H

#include <stdbool.h>

#include "pipeline/status.h"

typedef struct npg_work {
    const char *name; /* row of the table */
    npg_status (*call)(void *user);
    void *user;
    double flops, bytes;  /* operations and bytes of one call, at least; flops 0: not counted */
    double points;        /* of a cloud that one call goes through; 0: not its purpose       */
    double vertex_frames; /* vertices placed in a frame by one call; 0: not its purpose       */
    bool on_host;         /* in threads of the host, not on the device                        */
} npg_work;

/* Given each piece of work in turn; the work is valid until it returns.  A failure ends the visit. */
typedef npg_status npg_work_visit(void *user, const npg_work *work);

#endif
