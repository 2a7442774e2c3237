/* Window: the joint fit of consecutive frames, and what goes from one window to the next.
 *
 * Aligned frames (stage align) are moved together by the points of all of them (joint.h).  Without alignment
 * it is the paper's fit: all vertices from the reference by Chamfer distance.  Frames that an earlier window
 * has solved are cross-faded. */
#ifndef NPG_WINDOW_H
#define NPG_WINDOW_H

#include "optimize/fit.h"
#include "optimize/joint.h"
#include "optimize/warm_start.h"
#include "pipeline/stage.h"

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

#endif
