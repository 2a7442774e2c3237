/* latent: grid features sampled at fixed points; kernels in latent.cl. */
#ifndef NPG_LATENT_H
#define NPG_LATENT_H

#include "kernels/levels.h"
#include "kernels/runtime/device.h"

/* The constant sparse matrix, by rows (K entries each) and transposed (row lists by node). */
typedef struct npg_samples {
    size_t rows, node_count, per_row;   /* K = 8 x levels                       */
    npg_arena arrays;                   /* holds these                          */
    int32_t *index;                     /* rows x K                             */
    float *weight;                      /* rows x K                             */
    int32_t *start, *vertex, *channels; /* node_count + 1, real x K, node_count */
    float *weight_back;                 /* real x K                             */
} npg_samples;

/* For `real` points (positions and normals, real x 3), padded to `rows` by repeating the last; padding takes
 * no part in the transpose. */
npg_status npg_samples_open(npg_samples *samples, const npg_levels *levels, const float *positions,
                            const float *normals, size_t real, size_t rows);
void npg_samples_close(npg_samples *samples);

typedef struct npg_latent {
    npg_program *program;
    npg_buffer index, weight, start, vertex, weight_back, channels;
    size_t rows, node_count, per_row;
} npg_latent;

npg_status npg_latent_open(npg_latent *latent, npg_device *device, const npg_samples *samples);
void npg_latent_close(npg_latent *latent);

/* z [rows][32] = tanh(samples x nodes [node_count][32]). */
npg_status npg_latent_sample(const npg_latent *latent, const npg_buffer *z, const npg_buffer *nodes);

/* dnodes = samples^T (dz (1 - z^2)); dz is overwritten with the product in brackets. */
npg_status npg_latent_back(const npg_latent *latent, const npg_buffer *dnodes, const npg_buffer *dz,
                           const npg_buffer *z);

#endif
