/* Checkpoint: what stage optimize adds to the state of a run after a solved window,
 * and takes back (job/job.h). */
#ifndef NPG_CHECKPOINT_H
#define NPG_CHECKPOINT_H

#include "job/job.h"
#include "optimize/window.h"

/* What the optimize stage has in hand. */
typedef struct npg_hand {
    npg_held *held; /* owned by the stage, grown here when it is restored */
    size_t held_count, held_capacity;
    int64_t window_at; /* the window that was just solved, of facts.plan */
    int64_t emitted;   /* frames passed on before it closed              */
    double last_chamfer, last_isometry;
    bool is_aligned;
    npg_warm *warm;     /* of windows without alignment, or NULL; a loan */
    double usual;       /* Chamfer distance that those came to, or 0     */
    int64_t lost_count; /* of them, those that a warm start did not bring there */
    double noise;       /* of aligned frames: npg_joint_result's            */
    int64_t total;      /* frames of the capture, -1 until a live source has ended */
} npg_hand;

/* Write the state after window hand->window_at was solved and before its frames are passed on.  Waits until
 * all frames passed on before are on disk, so that what is solved is never lost.  fit: NULL where frames come
 * aligned.  Held frames that no window
 * has solved yet are read again by a resumed run.  NPG_DISK, NPG_ABORTED. */
npg_status npg_checkpoint_save(npg_worker *worker, const npg_hand *hand, npg_fit *fit);

/* The same inside the window after hand->window_at (-1: the first), which is not solved yet. */
npg_status npg_checkpoint_save_inside(npg_worker *worker, const npg_hand *hand);

/* Restore what the fit knew, and how far the window at work was. */
npg_status npg_checkpoint_restore_fit(npg_worker *worker, npg_fit *fit, npg_warm *warm);

/* Restore what the optimize stage had in hand; with appended frames only those which the first new window
 * shares.  facts.plan has which. */
npg_status npg_checkpoint_restore_hand(npg_worker *worker, npg_hand *hand);

#endif
