/* System: products with the energy's matrix. */
#include <string.h>

#include "optimize/energy.h"

/* Row t of B = D^T D for T frames: coefficient of frame t + k, k = -2 .. 2. */
static float bend_of(size_t frames, size_t t, int k)
{
    static const float second[3] = {1, -2, 1};
    float sum = 0;
    if (frames < 3) return 0;
    for (int a = 0; a < 3; a++) { /* the difference in which t is the a-th and t + k the (a + k)-th */
        int64_t first = (int64_t)t - a;
        if (first < 0 || first + 2 >= (int64_t)frames || a + k < 0 || a + k > 2) continue;
        sum += second[a] * second[a + k];
    }
    return sum;
}

void npg_energy_bend(float *image, const npg_energy_system *s, const float *x, size_t t, float sign)
{
    size_t w = s->vert_count;
    for (int k = -2; k <= 2; k++) {
        int64_t at = (int64_t)t + k;
        if (at < 0 || at >= (int64_t)s->frame_count) continue;
        float share = sign * bend_of(s->frame_count, t, k);
        const float *from = x + (size_t)at * w * 3;
        for (size_t i = 0; i < 3 * w; i++) image[i] += share * s->lambda[i / 3] * from[i];
    }
}

void npg_energy_tie(float *image, const npg_energy_system *s, const float *x, size_t t, float sign)
{
    const float *from = x + t * 3 * s->vert_count;
    for (size_t i = 0; i < 3 * s->vert_count; i++) image[i] += sign * s->shares[t] * s->ties[i / 3] * from[i];
}

void npg_energy_diagonal(float *diagonal, size_t stride, const npg_energy_system *s, size_t t)
{
    for (size_t v = 0; v < s->vert_count; v++)
        diagonal[stride * v] = (float)s->shape * (float)(s->ring.start[v + 1] - s->ring.start[v]) +
                               s->shares[t] * s->ties[v] + 1e-6f;
    for (size_t i = 0; i < s->pull_counts[t]; i++) {
        const npg_point_pull *p = &s->pulls[t * s->most + i];
        for (size_t c = 0; c < 3; c++) /* a third: the mean over the directions */
            diagonal[stride * p->corner[c]] += p->strength / 3 * p->weight[c] * p->weight[c];
    }
}

void npg_energy_band(npg_band *band, const npg_energy_system *s, size_t v, const float *diagonal,
                     size_t stride)
{
    for (size_t t = 0; t < band->count; t++) {
        band->main[t] = (double)diagonal[stride * t];
        band->near[t] = band->far[t] = 0;
    }
    npg_band_add_bend(band, (double)s->lambda[v]);
    npg_band_factor(band);
}

static void add_shape(float *restrict image, const npg_energy_system *s, const float *restrict x)
{
    float shape = (float)s->shape;
    for (size_t v = 0; v < s->vert_count; v++) {
        float degree = (float)(s->ring.start[v + 1] - s->ring.start[v]);
        float sum[3] = {degree * x[3 * v], degree * x[3 * v + 1], degree * x[3 * v + 2]};
        for (uint32_t k = s->ring.start[v]; k < s->ring.start[v + 1]; k++) {
            const float *other = x + 3 * (size_t)s->ring.of[k];
            for (int a = 0; a < 3; a++) sum[a] -= other[a];
        }
        for (size_t a = 0; a < 3; a++) image[3 * v + a] += shape * sum[a];
    }
}

static void add_pull(float *image, const npg_point_pull *p, const float *x)
{
    float at[3] = {0}, across = 0;
    for (size_t c = 0; c < 3; c++)
        for (size_t a = 0; a < 3; a++) at[a] += p->weight[c] * x[3 * (size_t)p->corner[c] + a];
    for (int a = 0; a < 3; a++) across += p->normal[a] * at[a];
    across *= p->strength;
    for (size_t c = 0; c < 3; c++)
        for (size_t a = 0; a < 3; a++)
            image[3 * (size_t)p->corner[c] + a] += p->weight[c] * across * p->normal[a];
}

void npg_energy_multiply(float *image, const npg_energy_system *s, const float *d, size_t t)
{
    size_t size = 3 * s->vert_count;
    const float *x = d + t * size;
    image += t * size;
    memset(image, 0, size * sizeof *image);
    add_shape(image, s, x);
    npg_energy_bend(image, s, d, t, 1);
    npg_energy_tie(image, s, d, t, 1);
    for (size_t i = 0; i < s->pull_counts[t]; i++) add_pull(image, &s->pulls[t * s->most + i], x);
}
