/* Fit: the joint optimisation of one window (paper, sections on latent grids to objectives),
 * on the OpenCL device.
 *
 * A fit keeps grids, decoder and optimiser from window to window; a window brings its frames.  Everything is
 * in unit coordinates.  Not for several threads at a time. */
#ifndef NPG_FIT_H
#define NPG_FIT_H

#include "kernels/motion.h"
#include "kernels/runtime/device.h"
#include "optimize/time_code.h"
#include "pipeline/mesh.h"

typedef enum npg_confidence {
    NPG_CONFIDENCE_CUMULATIVE, /* product of omega from the key outward (paper) */
    NPG_CONFIDENCE_SINGLE,     /* omega of the frame alone                      */
    NPG_CONFIDENCE_DELTA,      /* omega = 0.5                                   */
    NPG_CONFIDENCE_CONSTANT    /* omega = 1                                     */
} npg_confidence;

typedef enum npg_catch_up {
    NPG_CATCH_UP_ROOT,        /* delta = 1 - sqrt(e) (paper) */
    NPG_CATCH_UP_CONSTANT,    /* delta = 1                   */
    NPG_CATCH_UP_LINEAR,      /* delta = 1 - e               */
    NPG_CATCH_UP_EXPONENTIAL, /* delta = exp(-5 e)           */
    NPG_CATCH_UP_INTERPOLATED /* w = (1 - e) omega + e       */
} npg_catch_up;

/* M of the Sobolev steps (I + lambda M)^-1; D counts a grid node's neighbours, A joins them. */
typedef enum npg_smoothing {
    NPG_SMOOTHING_GRAPH,    /* D - A                                             */
    NPG_SMOOTHING_SCREENED, /* 6 I + D - A: inside a grid 2 D - A                */
    NPG_SMOOTHING_DOUBLED   /* 2 D - A: the published code's, at the border, too */
} npg_smoothing;

typedef enum npg_encoding { NPG_ENCODING_GRID, NPG_ENCODING_SINGLE, NPG_ENCODING_HASH } npg_encoding;

typedef struct npg_fit_settings {
    int64_t epochs;
    int time_code, encoding, confidence, catch_up, smoothing; /* enums of these names */
    int64_t frequencies;
    double time_span; /* times of a window go from 0 to this: the code of 1 is nearly that of 0; paper: 1 */
    int64_t grid_base, grid_step, grid_levels, normal_nodes;
    int64_t position_channels, normal_channels; /* |z_p| and |z_n|, together NPG_LATENT_CHANNELS at most */
    bool normal_grid;
    double lambda, lambda_growth, grid_rate, grid_rate_growth;
    double mlp_rate, isometry, alpha;
    int64_t width_1, width_2; /* of the decoder: npg_mlp_shape */
    double rate_end;          /* learning rates at the last epoch, as a share; they fall by half a cosine */
    double feature_start;     /* grid features begin evenly spread over +- this before smoothing; paper: 0 */
} npg_fit_settings;

/* The values that the options have now (table of the optimize stage). */
void npg_fit_settings_fill(npg_fit_settings *settings, const npg_options *options);

/* One frame of a window.  All frames of a window have bases (and follow by pulls), or none has: then those
 * that are tied follow their tie, the others their points by Chamfer distance.  Tied frames are nearer to the
 * key than all others: what an earlier window solved. */
typedef struct npg_fit_frame {
    int64_t index;       /* place in time; |index - key| orders the confidence        */
    double time;         /* what the time code is a function of, 0..1 over the window */
    const float *points; /* N x 3, unit, finite; a loan during npg_fit_begin          */
    size_t count;        /* N; 0: no points, the frame follows from the others        */
    const float *base; /* V x 3: positions that the decoder moves, or NULL: the reference; a loan likewise */
    const float *tie;  /* V x 3: known positions, or NULL; a loan likewise                                 */
} npg_fit_frame;

typedef struct npg_fit npg_fit;

/* How an epoch went: mean unweighted Chamfer of the frames with points (or mean loss of the pulls), and the
 * isometry term. */
typedef struct npg_fit_step {
    int64_t epoch, epochs;
    double chamfer, isometry, loss;
} npg_fit_step;

/* Asked after each epoch; NPG_END ends the fit as if that had been the last epoch, anything else but NPG_OK
 * with that status. */
typedef npg_status npg_fit_watch(void *user, const npg_fit_step *step);

/* The device is a loan.  reference: unit coordinates with normals; a loan. */
npg_status npg_fit_open(npg_fit **fit, npg_device *device, const npg_fit_settings *settings,
                        const npg_mesh *reference, uint64_t seed);
void npg_fit_close(npg_fit **fit);

/* Begin a window.  key: index of the frame where the confidence is 1 (the window's frame nearest to it counts
 * as the key when it is not among them). */
npg_status npg_fit_begin(npg_fit *fit, const npg_fit_frame *frames, size_t count, int64_t key);

/* Correspondences of all frames, in the order of npg_fit_begin: frame i has
 * pulls[start[i]] .. pulls[start[i + 1]].  Their vertices are changed to the fit's own order. */
npg_status npg_fit_set_pulls(npg_fit *fit, npg_pull *pulls, const size_t *start);

/* The weight of isometry from now on. */
void npg_fit_set_isometry(npg_fit *fit, double weight);

/* The confidence and the last learning rates (as a share of the first) from now on. */
void npg_fit_set_confidence(npg_fit *fit, npg_confidence confidence);
void npg_fit_set_rate_end(npg_fit *fit, double share);

/* The length of the fit that the rates and the confidence of following epochs are laid out for. */
void npg_fit_set_epochs(npg_fit *fit, int64_t epochs);

/* Epochs first .. end - 1 of settings.epochs (first > 0 continues a run that was broken off, or the rounds of
 * one by pulls); afterwards npg_fit_vertices() gives the result.  NPG_DIVERGED
 * names epoch and frame. */
npg_status npg_fit_run(npg_fit *fit, int64_t first, int64_t end, npg_fit_watch *watch, void *user);

/* vert_unit (V x 3, in the order of the reference) of the i-th frame of the last window. */
npg_status npg_fit_vertices(npg_fit *fit, float *vert_unit, size_t i);

/* What goes from window to window, for saving and restoring: loans of the fit's own. */
typedef struct npg_fit_parts {
    const struct npg_levels *levels;
    npg_buffer *u; /* [row_count][32] */
    struct npg_adam *grid_adam, *mlp_adam;
    float *params; /* of the decoder after the last run */
    size_t param_count;
    npg_time_code *time_code;
} npg_fit_parts;

npg_fit_parts npg_fit_open_parts(npg_fit *fit);

/* While a window is begun its decoder is on the device: into parts.params, and from there.  Nothing to do
 * without a window. */
npg_status npg_fit_read_params(npg_fit *fit);
npg_status npg_fit_write_params(npg_fit *fit);

/* Device and host bytes that a window of `frames` frames of at most `points` points takes. */
size_t npg_fit_memory(const npg_fit_settings *settings, size_t vert_count, size_t frames, size_t points,
                      int units);

#endif
