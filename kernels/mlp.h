/* mlp: the decoder, forward and backward, for many vertices in many frames; kernels in mlp.cl and time.cl.
 *
 * Parameters, gradient and Adam's moments are one list of floats, in the order
 *     W_2 (packed W1 x W2) | head (W2 x 16) | b_2 (W2) | bias of the head (16) | W1z (packed 32 x W1) |
 *     W1t (M x W1) | b1 (W1)
 * "packed K x C" is [C / 32][K][32]. */
#ifndef NPG_MLP_H
#define NPG_MLP_H

#include "kernels/layout.h"
#include "kernels/runtime/device.h"

#define NPG_MLP_SLOPE 0.01 /* of the leaky rectifier below 0 */

typedef struct npg_mlp_shape {
    size_t w1, w2;    /* units of the two hidden layers, multiples of 32 */
    size_t code_size; /* M, length of the time code                      */
} npg_mlp_shape;

/* Where parts of the list begin, but for W_2, which is first; and its end, which is how many there are. */
typedef struct npg_mlp_places {
    size_t head, b2, head_bias, w1z, w1t, b1, end;
} npg_mlp_places;
npg_mlp_places npg_mlp_places_of(const npg_mlp_shape *shape);

typedef struct npg_mlp {
    npg_program *program, *time;
    npg_mlp_shape shape;
    size_t rows, blocks, frames, batch, span, local, groups; /* groups of local work-items */
    npg_buffer params, grad; /* [param count]                                    */
    npg_buffer code;         /* [frames][M]                                      */
    npg_buffer z, dz;        /* [rows][32]: input of all frames and its gradient */
    npg_buffer out, dout;    /* [frames][rows][8]                                */
    npg_buffer p, dp;        /* [blocks][W1 panels]: z W1z and its gradient      */
    npg_buffer c, dc;        /* [frames][W1], [groups][frames][W1]               */
    npg_buffer h2;           /* [batch][blocks][W2 panels]                       */
    npg_buffer sums, transposed, scratch;
} npg_mlp;

/* The rows that so many vertices take: whole blocks of the device's tuning. */
size_t npg_mlp_rows(const npg_device *device, size_t vertices);

/* Floats of a group's own memory for `block` vertices: h of the first layer, and the gradient of the second. */
size_t npg_mlp_scratch(const npg_mlp_shape *shape, size_t block);

/* rows: from npg_mlp_rows; frames: T; batch: frames whose second hidden layer is kept between forward and
 * backward.  Device memory in bytes: about 4 (rows (2 W1 + batch W2) + groups W1 W2). */
npg_status npg_mlp_open(npg_mlp *mlp, npg_device *device, const npg_mlp_shape *shape, size_t rows,
                        size_t frames, size_t batch);
void npg_mlp_close(npg_mlp *mlp);

/* What depends on z, code and params alone: p, c and, for the backward pass, the transposes; sums to 0. */
npg_status npg_mlp_begin(npg_mlp *mlp);

/* out for the frames first .. first + count - 1, count <= batch. */
npg_status npg_mlp_forward(npg_mlp *mlp, size_t first, size_t count);

/* From dout of the same frames, right after their forward pass: adds to the gradient. */
npg_status npg_mlp_backward(npg_mlp *mlp, size_t first, size_t count);

/* grad and dz, after all frames have gone backward. */
npg_status npg_mlp_end(npg_mlp *mlp);

#endif
