/* Window: the joint fit of consecutive frames, and what goes from one window to the next.
 *
 * With aligned frames (stage align) the decoder moves the aligned positions of a few samples that carry the
 * dense surface (carry.h), drawn by correspondences that are renewed a few times (match.h); frames that an
 * earlier window solved stay tied to that and are cross-faded.  Without, it is the paper's fit: all vertices
 * from the reference by Chamfer distance. */
#ifndef NPG_WINDOW_H
#define NPG_WINDOW_H

#include "optimize/fit.h"
#include "optimize/match.h"
#include "optimize/warm_start.h"
#include "pipeline/stage.h"

typedef struct npg_window_settings {
    npg_fit_settings fit;
    npg_match_settings match;
    int64_t samples;     /* 0: all vertices                                             */
    int64_t rounds;      /* times the matches are made                                  */
    double aligned_rate; /* share of the fit's learning rates where frames come aligned */
    npg_warm_settings warm;
} npg_window_settings;

/* A frame in hand. */
typedef struct npg_held {
    npg_frame frame; /* owned; vert_unit are the aligned positions while is_aligned */
    float *solved;   /* V x 3 once a window has solved it, owned, or NULL           */
} npg_held;

typedef struct npg_window_solver npg_window_solver;

/* Figure coordinates, in which aligned frames are fitted: (unit - centre) * scale.  scale lets the reference
 * fill the grids' cube; its centre is the middle of its box, that of a frame the mean of its aligned samples.
 * So the fit is the same wherever in the capture's box the surface is and however small in it: rotations turn
 * about the surface, not about the middle of the way that it has gone.  Without alignment: unit coordinates,
 * scale 1, centre 0. */
typedef struct npg_figure {
    double centre[3], scale;
} npg_figure;

/* Of the reference. */
npg_figure npg_window_figure(const npg_window_solver *solver);

/* The mean of S points: a frame's centre. */
void npg_figure_centre(double centre[3], const float *samples, size_t count);

/* count x 3; out may be the input. */
void npg_figure_from_unit(const npg_figure *figure, float *out, const float *unit, size_t count);
void npg_figure_to_unit(const npg_figure *figure, float *out, const float *points, size_t count);

/* The device and facts are loans that outlive the solver; facts->reference and box are known. */
npg_status npg_window_solver_open(npg_window_solver **solver, npg_device *device,
                                  const npg_window_settings *settings, const npg_facts *facts, uint64_t seed,
                                  bool is_aligned);
void npg_window_solver_close(npg_window_solver **solver);

/* Bytes that a solver takes at most, with windows of `frames` frames of at most `points` points. */
size_t npg_window_memory(const npg_window_settings *settings, bool is_aligned, size_t vert_count,
                         size_t frames, size_t points);
npg_fit *npg_window_fit(npg_window_solver *solver); /* a loan */
size_t npg_window_sample_count(const npg_window_solver *solver);

/* The samples that carry the surface; NULL where every vertex is decoded.  A loan. */
const npg_carry *npg_window_carry(const npg_window_solver *solver);

/* Windows without alignment (warm_start.h); NULL for aligned frames.  A loan. */
npg_warm *npg_window_warm(npg_window_solver *solver);

/* What the time code is a function of: the absolute frame with a fixed period,
 * the length of the first window, so that frames which two windows share mean the same to both.
 * Moments between frames have times, too. */
double npg_window_time(const npg_plan *plan, double index);

/* How much a window says of a frame, or of a moment between two, against what the windows before it have
 * said: 1 where it is the first to solve, less the farther into the overlap, 0 on the first frame outside. */
double npg_window_share(const npg_window *window, double index);

/* Solve a window: held[i] are its frames in order of time; fills `solved` of each. */
npg_status npg_window_solve(npg_window_solver *solver, npg_held *const *held, const npg_window *window,
                            npg_fit_watch *watch, void *user);

#endif
