#ifndef NPG_OPTIMIZE_WINDOW_H
#define NPG_OPTIMIZE_WINDOW_H

#include "job/job.h"
#include "optimize/solver.h"

/* Window: the motion of consecutive frames, and what goes from one window to the next.
 *
 * With poses (stage align) the window's surface is the thinned reference, which carries the whole one (carry.h);
 * a solver moves it from the smoothed poses (energy.h).  Without poses a solver gives the whole reference's
 * positions.  Frames that an earlier window has solved go only the share of the way that this window has in them
 * (share_of in window.c), so that windows meet without a seam. */

/* A frame in hand. */
typedef struct npg_held {
    npg_frame frame; /* owned; where frames come aligned, vert_unit are those positions until it is solved */
    float *solved;   /* V x 3 once a window has solved it, owned, or NULL                                  */
} npg_held;

/* How a window went, lengths in units. */
typedef struct npg_window_result {
    npg_solved solved;
    double
        noise; /* median distance of points from the smoothed poses, as a standard deviation; 0 without poses */
    double
        moved; /* mean way of a vertex from its pose                                                          */
    double
        bridged; /* share of the surface that had no points in its frame and went where the frames around it say */
} npg_window_result;

typedef struct npg_window_solver npg_window_solver;

/* The device (NULL where the row needs none) and facts are loans that outlive the solver; facts->reference and
 * box are known. */
npg_status npg_window_solver_open(npg_window_solver **solver, const npg_solver *row,
                                  struct npg_device *device, const npg_solver_settings *settings,
                                  const npg_facts *facts, uint64_t seed);
void npg_window_solver_close(npg_window_solver **solver);

/* Bytes that it takes at most, with windows of `frames` frames of at most `points` points. */
size_t npg_window_memory(const npg_solver *row, const npg_solver_settings *settings, size_t vert_count,
                         size_t frames, size_t points);

/* Solve a window: held[i] are its frames in order of time; `solved` of each is filled, or moved where it is there
 * already.  A frame that is solved for the first time gives its vert_unit for it.  Where this fails nothing has
 * changed. */
npg_status npg_window_solve(npg_window_solver *solver, npg_window_result *result, npg_held *const *held,
                            const npg_window *window, npg_solver_watch *watch, void *user);

/* What goes to the next window, or how far this one is, to a state and back. */
npg_status npg_window_save(npg_window_solver *solver, npg_store *store, const npg_solver_moment *moment);
npg_status npg_window_restore(npg_window_solver *solver, const npg_record *record);

/* Checkpoint: what stage optimize adds to the state of a run after a solved window, and takes back (job/job.h). */

/* What the optimize stage has in hand. */
typedef struct npg_hand {
    npg_held *held; /* owned by the stage, grown here when it is restored */
    size_t held_count, held_capacity;
    int64_t window_at; /* the window that was just solved, of facts.plan */
    int64_t emitted;   /* frames passed on before it closed              */
    int64_t total;     /* frames of the capture, -1 until a live source has ended */
    npg_solved last;   /* of the last window                                      */
} npg_hand;

/* Write the state after window hand->window_at was solved and before its frames are passed on; or inside the
 * window after it (-1: the first), which is not solved yet.  Waits until all frames passed on before are on disk,
 * so that what is solved is never lost.  Held frames that no window has solved yet are read again by a resumed
 * run.  NPG_DISK, NPG_ABORTED. */
npg_status npg_checkpoint_save(npg_worker *worker, const npg_hand *hand, npg_window_solver *solver,
                               bool is_inside);

/* Restore what the optimize stage had in hand; with appended frames only those which the first new window
 * shares.  facts.plan has which.  The solver is restored by npg_window_restore(). */
npg_status npg_checkpoint_restore(npg_worker *worker, npg_hand *hand);

#endif
