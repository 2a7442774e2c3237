#ifndef NPG_OPTIMIZE_FIT_H
#define NPG_OPTIMIZE_FIT_H

#include "kernels/levels.h"
#include "kernels/motion.h"
#include "optimize/solver.h"

/* Fit: the optimisation of one window's field (paper, sections on latent grids to objectives), on the OpenCL
 * device.
 *
 * A fit keeps grids, decoder and optimiser from window to window; a window brings its frames.  Everything is
 * in unit coordinates.  Not for several threads at a time. */

typedef enum npg_confidence {
    NPG_CONFIDENCE_CUMULATIVE, /* product from the key outward, which opens with the epochs (paper) */
    NPG_CONFIDENCE_CONSTANT    /* 1                                                                 */
} npg_confidence;

typedef struct npg_fit_settings {
    npg_grid_settings grid;
    npg_paper_settings paper;
    bool is_of_ways;      /* the field gives ways of the vertices, else it turns and moves the reference   */
    double rate_end;      /* learning rates at the last epoch, as a share; they fall by half a cosine       */
    double feature_start; /* grid features begin evenly spread over +- this before smoothing; paper: 0      */
} npg_fit_settings;

/* One frame of a window, which follows its points by Chamfer distance.  Tied frames follow their tie; they are
 * nearer to the key than all others: what an earlier window solved. */
typedef struct npg_fit_frame {
    int64_t index;       /* place in time; |index - key| orders the confidence        */
    double time;         /* what the time code is a function of, 0..1 over the window */
    const float *points; /* N x 3, unit, finite; a loan during npg_fit_begin          */
    size_t count;        /* N; 0: no points, the frame follows from the others        */
    const float *tie;    /* V x 3: known positions, or NULL; a loan likewise          */
    const float *base;   /* V x 3: what the field moves there; a loan; NULL in all frames: the reference */
} npg_fit_frame;

typedef struct npg_fit npg_fit;

/* How an epoch went: mean unweighted Chamfer of the frames with points, and the isometry term. */
typedef struct npg_fit_step {
    int64_t epoch, epochs;
    double chamfer, isometry, loss;
} npg_fit_step;

/* Asked after each epoch; anything but NPG_OK ends the fit with that status. */
typedef npg_status npg_fit_watch(void *user, const npg_fit_step *step);

/* In place of distances: the loss where the field has the frames now, and its gradient (both T x V x 3, frames
 * and vertices in the caller's order). */
typedef npg_status npg_fit_measure(void *user, double *loss, float *gradient, const float *now);

/* The device is a loan.  reference: unit coordinates with normals; a loan. */
npg_status npg_fit_open(npg_fit **fit, npg_device *device, const npg_fit_settings *settings,
                        const npg_mesh *reference, uint64_t seed);
void npg_fit_close(npg_fit **fit);

/* Begin a window.  key: index of the frame where the confidence is 1 (the window's frame nearest to it counts
 * as the key when it is not among them).  measure: NULL, or frames have times alone, and their loss is its. */
npg_status npg_fit_begin(npg_fit *fit, const npg_fit_frame *frames, size_t count, int64_t key,
                         npg_fit_measure *measure, void *user);

/* Before a window: the field is at rest, zero or the reference, whatever it knows: the decoder's head is zero. */
void npg_fit_rest(npg_fit *fit);

/* Epochs first .. end - 1 of the rates and the confidence that are laid out for `end` (first > 0 continues a
 * run that was broken off); afterwards npg_fit_vertices() gives the result.  With none of them it is what the
 * field has now.  NPG_DIVERGED names epoch and frame. */
npg_status npg_fit_run(npg_fit *fit, int64_t first, int64_t end, npg_fit_watch *watch, void *user);

/* Positions or ways (V x 3, in the order of the reference) of the i-th frame of the last window. */
npg_status npg_fit_vertices(npg_fit *fit, float *vert_unit, size_t i);

/* Device and host bytes that a window of `frames` frames of at most `points` points takes. */
size_t npg_fit_memory(const npg_fit_settings *settings, size_t vert_count, size_t frames, size_t points);

/* What a fit knows (grids, decoder and their optimisers) goes from window to window; loans of the fit's own. */
typedef struct npg_fit_parts {
    const struct npg_levels *levels;
    npg_buffer *u; /* [row_count][32] */
    struct npg_adam *grid_adam, *mlp_adam;
    float *params; /* of the decoder after the last run */
    size_t param_count;
} npg_fit_parts;

npg_fit_parts npg_fit_open_parts(npg_fit *fit);

/* While a window is begun its decoder is on the device: into parts.params, and from there.  Nothing to do
 * without a window. */
npg_status npg_fit_read_params(npg_fit *fit);
npg_status npg_fit_write_params(npg_fit *fit);

/* The present state as a block of a store, and back into a fit of the same settings and reference: NPG_BAD_INPUT
 * where it has another size. */
npg_status npg_fit_save(npg_fit *fit, npg_store *store);
npg_status npg_fit_restore(npg_fit *fit, const npg_record *record);

/* Which latent grids a fit has, from its settings (paper, latent grids); all zero before. */
void npg_fit_levels(npg_levels *levels, const npg_grid_settings *settings);

/* codes [count][2 M] of the times: sin(pi 2^j t), j = 0 .. M - 1, then cos (paper, "Fourier Time Encoding"). */
void npg_time_code(float *codes, const double *times, size_t count, size_t frequencies);

/* Weights: the confidence of each frame (paper, eq. confidence). */

/* State of one epoch; frames are asked for from the key outward, so that each product
 * is ready when needed. */
typedef struct npg_weights {
    npg_confidence confidence;
    double delta; /* 1 - sqrt(e / e_max) */
    int64_t key;
    double key_cd;        /* NaN before the first frame with points */
    double before, after; /* product of omega on either side of the key so far */
    double share;         /* 1 / T */
} npg_weights;

void npg_weights_begin(npg_weights *weights, npg_confidence confidence, double progress, int64_t key,
                       size_t frame_count);

/* The weight of the next frame outward, times 1 / T; 0 for a frame without points. */
double npg_weights_next(npg_weights *weights, int64_t index, double cd, bool has_points);

/* What the two solvers over a fit share (grids.c). */

#define NPG_GRIDS_RATE_END 0.1 /* of windows' learning rates: those of the paper's own fit do not fall */
#define NPG_GRIDS_SPAN     0.8 /* of windows' time code: that of 1 is nearly that of 0; of the paper's own: 1 */

/* What the time code is a function of: the absolute frame with a fixed period, the length of the first window,
 * so that frames which two windows share mean the same to both.  That window goes from 0 to span. */
double npg_grids_time(const npg_plan *plan, double span, int64_t index);

/* A fit to a state, with the latent grids (VDB) beside it. */
npg_status npg_grids_save(npg_fit *fit, const npg_facts *facts, npg_store *store,
                          const npg_solver_moment *moment);

#endif
