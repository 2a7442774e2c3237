/* mlp: the plain twins of mlp.cl and time.cl, in double, written as the paper writes the network. */
#include "kernels/mlp.h"

#define CHANNELS  NPG_LATENT_CHANNELS
#define WIDTH_MAX 4096 /* of a hidden layer: the most that options width-1 and width-2 take */

static double leaky(double x, double slope)
{
    return x > 0 ? x : slope * x;
}

/* Hidden layers h1 (W1) and h2 (W2). */
static void hidden(double *h1, double *h2, const double *z, const double *code, const double *params,
                   const npg_mlp_shape *s)
{
    const double *w1z = params + npg_mlp_at_w1z(s), *w1t = params + npg_mlp_at_w1t(s),
                 *b1 = params + npg_mlp_at_b1(s);
    const double *b2 = params + npg_mlp_at_b2(s);
    for (size_t n = 0; n < s->w1; n++) {
        double sum = b1[n];
        for (size_t c = 0; c < CHANNELS; c++) sum += z[c] * w1z[npg_mlp_packed(CHANNELS, c, n)];
        for (size_t j = 0; j < s->code_size; j++) sum += code[j] * w1t[j * s->w1 + n];
        h1[n] = leaky(sum, (double)s->slope);
    }
    for (size_t n = 0; n < s->w2; n++) {
        double sum = b2[n];
        for (size_t k = 0; k < s->w1; k++) sum += h1[k] * params[npg_mlp_packed(s->w1, k, n)];
        h2[n] = leaky(sum, (double)s->slope);
    }
}

void npg_mlp_forward_ref(double *out, const double *z, const double *code, const double *params,
                         const npg_mlp_shape *s)
{
    double h1[WIDTH_MAX], h2[WIDTH_MAX];
    const double *w3 = params + npg_mlp_at_w3(s), *b3 = params + npg_mlp_at_b3(s);
    hidden(h1, h2, z, code, params, s);
    for (size_t o = 0; o < NPG_MLP_USED; o++) {
        out[o] = b3[o];
        for (size_t k = 0; k < s->w2; k++) out[o] += h2[k] * w3[k * NPG_MLP_W3_ROW + o];
    }
}

/* d2: gradient before the second rectifier; grad of head and b2. */
static void head_back(double *d2, double *grad, const double *dout, const double *h2, const double *params,
                      const npg_mlp_shape *s)
{
    const double *w3 = params + npg_mlp_at_w3(s);
    for (size_t k = 0; k < s->w2; k++) {
        double d = 0;
        for (size_t o = 0; o < NPG_MLP_USED; o++) {
            d += dout[o] * w3[k * NPG_MLP_W3_ROW + o];
            grad[npg_mlp_at_w3(s) + k * NPG_MLP_W3_ROW + o] += dout[o] * h2[k];
        }
        d2[k] = h2[k] > 0 ? d : (double)s->slope * d;
        grad[npg_mlp_at_b2(s) + k] += d2[k];
    }
    for (size_t o = 0; o < NPG_MLP_USED; o++) grad[npg_mlp_at_b3(s) + o] += dout[o];
}

static void second_back(double *d1, double *grad, const double *d2, const double *h1, const double *params,
                        const npg_mlp_shape *s)
{
    for (size_t k = 0; k < s->w1; k++) {
        double d = 0;
        for (size_t n = 0; n < s->w2; n++) {
            d += d2[n] * params[npg_mlp_packed(s->w1, k, n)];
            grad[npg_mlp_packed(s->w1, k, n)] += h1[k] * d2[n];
        }
        d1[k] = h1[k] > 0 ? d : (double)s->slope * d;
    }
}

static void first_back(double *grad, double *dz, double *dcode, const double *d1, const double *z,
                       const double *code, const double *params, const npg_mlp_shape *s)
{
    size_t at_z = npg_mlp_at_w1z(s), at_t = npg_mlp_at_w1t(s);
    for (size_t n = 0; n < s->w1; n++) {
        for (size_t c = 0; c < CHANNELS; c++) {
            size_t at = at_z + npg_mlp_packed(CHANNELS, c, n);
            dz[c] += d1[n] * params[at];
            grad[at] += d1[n] * z[c];
        }
        for (size_t j = 0; j < s->code_size; j++) {
            dcode[j] += d1[n] * params[at_t + j * s->w1 + n];
            grad[at_t + j * s->w1 + n] += d1[n] * code[j];
        }
        grad[npg_mlp_at_b1(s) + n] += d1[n];
    }
}

void npg_mlp_backward_ref(double *grad, double *dz, double *dcode, const double *dout, const double *z,
                          const double *code, const double *params, const npg_mlp_shape *s)
{
    double h1[WIDTH_MAX], h2[WIDTH_MAX], d1[WIDTH_MAX], d2[WIDTH_MAX];
    hidden(h1, h2, z, code, params, s);
    head_back(d2, grad, dout, h2, params, s);
    second_back(d1, grad, d2, h1, params, s);
    first_back(grad, dz, dcode, d1, z, code, params, s);
}
