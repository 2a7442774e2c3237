/* Winding sums: what dipoles, or weights, at some places come to at others.
 *
 * Places lie in groups.  For the places of a group that is far off for its size, another stands as the sum of its
 * dipoles and their first moments about its middle c, M = sum m, Q = sum m_j (p_j - c)^T: with d = c - p and
 * q = |d|^2 + s^2
 *
 *     number   (M . d + tr Q - 3 d^T Q d / q) / q^(3/2)
 *     outward  (M - 3 (Q d + Q^T d) / q - (3 (M . d + tr Q) - 15 d^T Q d / q) d / q) / q^(3/2)
 *     adjoint  (3 (d . v) d / q - w d - v) / q^(3/2)            of weights: w = sum w_i, v = sum w_i (p_i - c)
 *
 * so the time goes with N log N.  Based on: G. Barill et al., Fast Winding Numbers for Soups and Clouds, 2018. */
#ifndef NPG_WINDING_SUMS_H
#define NPG_WINDING_SUMS_H

#include "pipeline/memory.h"

typedef struct npg_vectors { /* each coordinate by itself, as wide processors add */
    float *x, *y, *z;
} npg_vectors;

void npg_vectors_take(npg_vectors *v, npg_arena *arena, size_t count);

/* Where lengths begin, and their unit. */
typedef struct npg_winding_frame {
    double middle[3], unit;
} npg_winding_frame;

typedef struct npg_places {
    size_t count, group_count;
    npg_vectors at;     /* count, by groups            */
    uint32_t *order;    /* which point is the i-th     */
    uint32_t *first;    /* group_count + 1: places first[g] .. are those of g */
    npg_vectors middle; /* group_count                 */
    float *radius;      /* of the group around it      */
} npg_places;

/* N points (N x 3) as places; arrays are the arena's.  NPG_MEMORY. */
npg_status npg_places_open(npg_places *places, npg_arena *arena, const float *points, size_t count,
                           const npg_winding_frame *frame);

/* out (by places) = rows (by points, x 3). */
void npg_places_sort(npg_vectors *out, const npg_places *places, const float *rows);

typedef enum npg_winding_what {
    NPG_WINDING_NUMBER,  /* w, which is out.x alone                      */
    NPG_WINDING_ADJOINT, /* its adjoint, of weights: dipoles.x alone     */
    NPG_WINDING_OUTWARD  /* against w's gradient                         */
} npg_winding_what;

/* out (by places `to`) of dipoles (by places `from`) of this width s, each times 4 pi.  All cores; the same bits
 * however many.  NPG_MEMORY. */
npg_status npg_winding_sum(npg_vectors *out, npg_winding_what what, const npg_places *to,
                           const npg_places *from, const npg_vectors *dipoles, double width);

#endif
