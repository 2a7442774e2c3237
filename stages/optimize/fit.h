#ifndef NPG_OPTIMIZE_FIT_H
#define NPG_OPTIMIZE_FIT_H

#include <stddef.h>
#include <stdint.h>

#include "geometry/geometry.h"
#include "kernels/levels.h"
#include "kernels/motion.h"
#include "kernels/runtime/device.h"
#include "pipeline/mesh.h"
#include "pipeline/stage.h"
#include "pipeline/status.h"
#include "pipeline/store.h"

/* Time code: what the decoder is told about time (paper: "Fourier Time Encoding" and the table
 * on time functions). */

typedef enum npg_time_kind {
    NPG_TIME_FOURIER,    /* sin(pi 2^j t), j = 0 .. M - 1, then cos                         */
    NPG_TIME_POLYNOMIAL, /* t^j, j = 1 .. 2 M                                               */
    NPG_TIME_GAUSSIAN,   /* sin(2 pi b_j t), then cos, b_j drawn from a normal distribution */
    NPG_TIME_LEARNED     /* a two-layer network of t, trained along                         */
} npg_time_kind;

typedef struct npg_time_code npg_time_code;

/* frequencies: M, so that a code has 2 M values. */
npg_status npg_time_code_open(npg_time_code **code, npg_time_kind kind, size_t frequencies, uint64_t seed);
void npg_time_code_close(npg_time_code **code);

/* codes [count][2 M] of the times [count] (0 is the first frame, 1 the last). */
void npg_time_code_fill(const npg_time_code *code, float *codes, const double *times, size_t count);

/* Parameters and moments of a learned code (*count doubles) and its steps so far, for saving and restoring;
 * NULL and 0 for the others. */
double *npg_time_code_parts(npg_time_code *code, size_t *count, int64_t **step);

/* Whether the code has parameters to train; and one step of Adam for them with dcodes [count][2 M]. */
int npg_time_code_learns(const npg_time_code *code);
npg_status npg_time_code_step(npg_time_code *code, const float *dcodes, const double *times, size_t count,
                              double rate);

/* Fit: the joint optimisation of one window (paper, sections on latent grids to objectives),
 * on the OpenCL device.
 *
 * A fit keeps grids, decoder and optimiser from window to window; a window brings its frames.  Everything is
 * in unit coordinates.  Not for several threads at a time. */

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

/* Copy: what a fit knows (grids, decoder, time code and their optimisers) on the host: to start a window from
 * another than the one before it, and to let two fits of the same settings over different points of the
 * surface share one state. */

/* {0} is none yet. */
typedef struct npg_fit_copy {
    char *bytes; /* all parts one behind the other, owned; NULL: none */
    size_t size;
} npg_fit_copy;

/* The present state, between steps. */
npg_status npg_fit_copy_take(npg_fit_copy *copy, npg_fit *fit);
npg_status npg_fit_copy_give(const npg_fit_copy *copy, npg_fit *fit);
void npg_fit_copy_clear(npg_fit_copy *copy);

/* Grids, decoder and time code from one fit to another, whose optimiser stays its own: the moments of another
 * loss would shorten or lengthen its steps for hundreds of epochs. */
npg_status npg_fit_hand_over(npg_fit *to, npg_fit *from);

/* As a block of a store; loading a block that is missing leaves none. */
npg_status npg_fit_copy_save(const npg_fit_copy *copy, npg_store *store, const char *block);
npg_status npg_fit_copy_load(npg_fit_copy *copy, const npg_record *store, const char *block);

/* The present state of a fit as a block, and back into one of the same settings and reference: NPG_BAD_INPUT
 * where the block is missing or has another size. */
npg_status npg_fit_save(npg_fit *fit, npg_store *store, const char *block);
npg_status npg_fit_restore(npg_fit *fit, const npg_record *record, const char *block);

/* Fit levels: which latent grids a fit has, from its settings (paper, latent grids). */

/* levels: all zero before. */
void npg_fit_levels(npg_levels *levels, const npg_fit_settings *settings);

/* Weights: the confidence of each frame (paper, eq. confidence, and the table on stability terms). */

/* State of one epoch; frames are asked for from the key outward, so that each product
 * is ready when needed. */
typedef struct npg_weights {
    int confidence, catch_up;
    double progress; /* e / e_max */
    double delta;
    int64_t key;
    double key_cd;        /* NaN before the first frame with points */
    double before, after; /* product of omega on either side of the key so far */
    double share;         /* 1 / T */
} npg_weights;

void npg_weights_begin(npg_weights *weights, const npg_fit_settings *settings, double progress, int64_t key,
                       size_t frame_count);

/* The weight of the next frame outward, times 1 / T; 0 for a frame without points. */
double npg_weights_next(npg_weights *weights, int64_t index, double cd, bool has_points);

/* Skinning: few well-spread vertices of the reference that are optimised, and how they carry
 * the rest of the surface.
 *
 *     x(v) = y(v) + sum_i b_i(v) (x_i - y_i)
 *
 * y: positions before the fit (the coarse alignment), x_i: fitted samples, b(v): barycentric weights of v's
 * closest point on the mesh of the samples.  What is carried is the difference, which is smooth: the surface
 * keeps its detail, and the distance to it is not biased by the spacing of the samples (method: few samples
 * fitted, dense mesh as the result). */

typedef struct npg_skin_weights {
    int32_t sample[3];
    float share[3];
} npg_skin_weights;

typedef struct npg_skinning {
    npg_proxy *surface;                /* W vertices: the surface that points are matched with */
    npg_proxy *samples;                /* S: vertices of that surface                          */
    uint32_t *vertex;                  /* S: which vertex of the reference each sample is      */
    npg_skin_weights *surface_weights; /* W                                                    */
    npg_surface *rest;                 /* of the samples, at rest                              */
    npg_arena arrays;                  /* holds the two                                        */
    size_t vert_count;                 /* V                                                    */
} npg_skinning;

/* About sample_target samples (0, or more than there are: all vertices of the surface, which has about
 * surface_target, or, with 0, all).  reference has normals; it is a loan. */
npg_status npg_skinning_open(npg_skinning **skinning, const npg_mesh *reference, size_t sample_target,
                             size_t surface_target);
void npg_skinning_close(npg_skinning **skinning);

/* Which vertices of `mesh`, whose surface at rest is `rest`, carry points (N x 3).  threads: 0 for one per
 * core. */
npg_status npg_skin_bind(npg_skin_weights *weights, const npg_mesh *mesh, npg_surface *rest,
                         const float *points, size_t count, int threads);

/* samples (S x 3) = the samples' rows of vert_pos (V x 3). */
void npg_skinning_gather(const npg_skinning *skinning, float *samples, const float *vert_pos);

/* vert_pos (N x 3), the y of the formula on entry, becomes x for the N vertices that the weights are of:
 * samples_before are the y_i, samples the x_i (S x 3). */
void npg_skin_move(const npg_skin_weights *weights, size_t vert_count, float *vert_pos,
                   const float *samples_before, const float *samples);

/* Match: which point of the surface belongs to which point of a frame, as pulls for the fit
 * (kernels/pull.cl). */

typedef struct npg_matcher npg_matcher;

typedef struct npg_match_settings {
    int64_t points; /* most points of a frame that pull                      */
    double along;   /* share of distances along the surface, 0..1            */
    double reverse; /* weight of surface -> points against points -> surface */
    double total;   /* sum of the weights of a frame's points                */
    double tie;     /* weight of keeping solved positions, for a whole frame */
} npg_match_settings;

/* skinning is a loan that outlives the matcher.  A matcher works in its caller's thread;
 * several may share it. */
npg_status npg_matcher_open(npg_matcher **matcher, const npg_skinning *skinning,
                            const npg_match_settings *settings);
void npg_matcher_close(npg_matcher **matcher);

/* Distances that count in full (unit), where that is more than three times the frame's median: for surfaces
 * that may be far from where they belong.  0 at first. */
void npg_matcher_widen(npg_matcher *matcher, double width);

/* The most pulls of one frame. */
size_t npg_matcher_most(const npg_matcher *matcher);

/* Pulls of a frame whose surface (skinning.c) is now at vert_unit (W x 3) with the samples at `samples` (S x 3).
 * Points: N x 3 unit, normals N x 3 or NULL.  Distances count less the more they exceed three times the
 * frame's median (Geman and McClure).  Appends to pulls and *count. */
npg_status npg_match_points(npg_matcher *matcher, npg_pull *pulls, size_t *count, const float *vert_unit,
                            const float *samples, const float *points, const float *normals,
                            size_t point_count);

/* Pulls that hold the samples at solved positions (S x 3); appends. */
void npg_match_tie(const npg_matcher *matcher, npg_pull *pulls, size_t *count, const float *solved);

/* Warm start: windows of frames that come without alignment.
 *
 * A window starts from what the fit knew after the window it borders on in time.  Its new frames are brought
 * near their pose first, one by one, outward from those that are solved (in the first window: from the
 * keyframe, which is the reference): the last pose moved on by its velocity is fitted to as a known target
 * (vertices against vertices, no search), then the frame's points pull at the surface, matched again and
 * again.  Few samples of the reference do for that.  Then all frames of the window are fitted together: by
 * the paper's distance over all vertices, with the frames that the window shares tied to where they are
 * solved, until the loss has settled; or by the distance to the surface over the samples, whose result the
 * field of the decoder gives for every vertex.
 *
 * A capture of one window by the paper's distance is solved as in the paper, without any of this. */

/* What a fit without alignment brings down. */
typedef enum npg_distance {
    NPG_DISTANCE_VERTICES, /* all vertices against points (paper) */
    NPG_DISTANCE_SURFACE   /* the surface against points          */
} npg_distance;

typedef struct npg_warm_settings {
    int distance;    /* npg_distance                                   */
    int64_t samples; /* of the reference, 0: the usual number          */
    int64_t rounds;  /* times that the last fit by the surface is matched */
    npg_match_settings match;
} npg_warm_settings;

/* The frames of a window as the solver has them, in order of time; loans. */
typedef struct npg_warm_frames {
    npg_fit_frame *frames;       /* points, no bases; ties and bases are filled in here  */
    const float *const *normals; /* of the points, or NULL for a frame                   */
    const float *const *solved;  /* V x 3 where an earlier window solved the frame, else NULL */
    size_t count;
} npg_warm_frames;

typedef struct npg_warm npg_warm;

/* Called between steps from which the window's fit could be continued: it may save that (npg_warm_save). */
typedef npg_status npg_warm_keep(void *user);

/* device and facts outlive it. */
npg_status npg_warm_open(npg_warm **warm, npg_device *device, const npg_warm_settings *settings,
                         const npg_fit_settings *fit, const npg_facts *facts, uint64_t seed);
void npg_warm_close(npg_warm **warm);

/* Bytes that it takes at most. */
size_t npg_warm_memory(const npg_warm_settings *settings, const npg_fit_settings *fit, size_t vert_count,
                       size_t frames);

/* keep gets the user of npg_warm_solve. */
void npg_warm_set_keep(npg_warm *warm, npg_warm_keep *keep);

/* The Chamfer distance that windows before came to (0: unknown), for npg_warm_solve; and the factor by which
 * the last window failed to get there with the epochs of a warm start, so that it had those of a cold one
 * then (0: it did not). */
void npg_warm_set_usual(npg_warm *warm, double chamfer);
double npg_warm_lost_by(const npg_warm *warm);

/* Solve a window with `fit`, over all vertices: it then holds the frames' positions. */
npg_status npg_warm_solve(npg_warm *warm, npg_fit *fit, const npg_warm_frames *frames,
                          const npg_window *window, npg_fit_watch *watch, void *user);

/* How far the window at work is: during a keep, as blocks of a store; and back, before npg_warm_solve of
 * the same window, which then continues there. */
npg_status npg_warm_save(npg_warm *warm, npg_store *store);
npg_status npg_warm_restore(npg_warm *warm, npg_fit *fit, const npg_record *store);

/* What the fit knew after the window around the keyframe, while a later window may start from it. */
npg_fit_copy *npg_warm_first(npg_warm *warm);

#endif
