#ifndef NPG_OPTIMIZE_WINDOW_H
#define NPG_OPTIMIZE_WINDOW_H

#include "job/job.h"
#include "optimize/fit.h"
#include "optimize/joint.h"
#include "pipeline/stage.h"

/* Window: the joint fit of consecutive frames, and what goes from one window to the next.
 *
 * Aligned frames (stage align) are moved together by the points of all of them (joint.h).  Without alignment
 * it is the paper's fit: all vertices from the reference by Chamfer distance.  Frames that an earlier window
 * has solved are cross-faded. */

typedef struct npg_window_settings {
    npg_fit_settings fit;     /* its epochs are the steps of aligned frames' fit, too */
    npg_joint_settings joint; /* its steps are filled in from there                   */
    npg_warm_settings warm;   /* without alignment                                    */
} npg_window_settings;

/* A frame in hand. */
typedef struct npg_held {
    npg_frame frame; /* owned; where frames come aligned, vert_unit are those positions until it is solved */
    float *solved;   /* V x 3 once a window has solved it, owned, or NULL                                  */
} npg_held;

typedef struct npg_window_solver npg_window_solver;

/* The device (NULL where frames come aligned) and facts are loans that outlive the solver; facts->reference
 * and box are known. */
npg_status npg_window_solver_open(npg_window_solver **solver, npg_device *device,
                                  const npg_window_settings *settings, const npg_facts *facts, uint64_t seed,
                                  bool is_aligned);
void npg_window_solver_close(npg_window_solver **solver);

/* Bytes that a solver takes at most, with windows of `frames` frames of at most `points` points. */
size_t npg_window_memory(const npg_window_settings *settings, bool is_aligned, size_t vert_count,
                         size_t frames, size_t points);

/* NULL where frames come aligned.  A loan. */
npg_fit *npg_window_fit(npg_window_solver *solver);

/* How the last window of aligned frames went; NULL without alignment.  A loan. */
const npg_joint_result *npg_window_result(const npg_window_solver *solver);

/* Of a resumed run: the noise of that window, as its state has it.  Nothing without alignment. */
void npg_window_set_noise(npg_window_solver *solver, double noise);

/* Windows without alignment (warm_start.h); NULL for aligned frames.  A loan. */
npg_warm *npg_window_warm(npg_window_solver *solver);

/* How much a window says of a frame against what the windows before it have said: 1 where it is the first to solve, less the farther into the overlap, 0 on the first frame outside. */
double npg_window_share(const npg_window *window, double index);

/* Solve a window: held[i] are its frames in order of time; fills `solved` of each. */
npg_status npg_window_solve(npg_window_solver *solver, npg_held *const *held, const npg_window *window,
                            npg_fit_watch *watch, void *user);

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

/* Checkpoint: what stage optimize adds to the state of a run after a solved window,
 * and takes back (job/job.h). */

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
