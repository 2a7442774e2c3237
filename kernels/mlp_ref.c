/* mlp: the plain twins of mlp.cl and time.cl, in double, written as the paper writes the network. */
#include "kernels/mlp.h"

#define CHANNELS  NPG_LATENT_CHANNELS
#define WIDTH_MAX 4096 /* of a hidden layer: the most that options width-1 and width-2 take */

/* What the hidden layers give, the first at [0]. */
typedef double layers[NPG_MLP_LAYERS_MAX][WIDTH_MAX];

static double leaky(double x, double slope)
{
    return x > 0 ? x : slope * x;
}

static double leaky_back(double d, double y, double slope)
{
    return y > 0 ? d : slope * d;
}

static void first_layer(double *h, const double *z, const double *code, const double *params,
                        const npg_mlp_shape *s)
{
    const double *w1z = params + npg_mlp_at_w1z(s), *w1t = params + npg_mlp_at_w1t(s),
                 *b1 = params + npg_mlp_at_b1(s);
    for (size_t n = 0; n < s->w1; n++) {
        double sum = b1[n];
        for (size_t c = 0; c < CHANNELS; c++) sum += z[c] * w1z[npg_mlp_packed(CHANNELS, c, n)];
        for (size_t j = 0; j < s->code_size; j++) sum += code[j] * w1t[j * s->w1 + n];
        h[n] = leaky(sum, (double)s->slope);
    }
}

static void hidden(layers h, const double *z, const double *code, const double *params,
                   const npg_mlp_shape *s)
{
    first_layer(h[0], z, code, params, s);
    for (size_t layer = 2; layer <= s->layers; layer++) {
        size_t inputs = npg_mlp_units(s, layer - 1);
        const double *w = params + npg_mlp_at_weights(s, layer), *b = params + npg_mlp_at_bias(s, layer);
        for (size_t n = 0; n < s->w2; n++) {
            double sum = b[n];
            for (size_t k = 0; k < inputs; k++) sum += h[layer - 2][k] * w[npg_mlp_packed(inputs, k, n)];
            h[layer - 1][n] = leaky(sum, (double)s->slope);
        }
    }
}

void npg_mlp_forward_ref(double *out, const double *z, const double *code, const double *params,
                         const npg_mlp_shape *s)
{
    layers h;
    const double *head = params + npg_mlp_at_head(s), *bias = params + npg_mlp_at_head_bias(s);
    hidden(h, z, code, params, s);
    for (size_t o = 0; o < NPG_MLP_USED; o++) {
        out[o] = bias[o];
        for (size_t k = 0; k < npg_mlp_last_units(s); k++)
            out[o] += h[s->layers - 1][k] * head[k * NPG_MLP_HEAD_ROW + o];
    }
}

/* d: gradient before the rectifier of the last hidden layer, h; grad of the head. */
static void head_back(double *d, double *grad, const double *dout, const double *h, const double *params,
                      const npg_mlp_shape *s)
{
    size_t at = npg_mlp_at_head(s);
    for (size_t k = 0; k < npg_mlp_last_units(s); k++) {
        double sum = 0;
        for (size_t o = 0; o < NPG_MLP_USED; o++) {
            sum += dout[o] * params[at + k * NPG_MLP_HEAD_ROW + o];
            grad[at + k * NPG_MLP_HEAD_ROW + o] += dout[o] * h[k];
        }
        d[k] = leaky_back(sum, h[k], (double)s->slope);
    }
    for (size_t o = 0; o < NPG_MLP_USED; o++) grad[npg_mlp_at_head_bias(s) + o] += dout[o];
}

/* From d before the rectifier of a layer to before, that of the layer under it, h; grad of the layer. */
static void hidden_back(double *before, double *grad, const double *d, const double *h, const double *params,
                        size_t layer, const npg_mlp_shape *s)
{
    size_t at = npg_mlp_at_weights(s, layer), inputs = npg_mlp_units(s, layer - 1);
    for (size_t k = 0; k < inputs; k++) {
        double sum = 0;
        for (size_t n = 0; n < s->w2; n++) {
            sum += d[n] * params[at + npg_mlp_packed(inputs, k, n)];
            grad[at + npg_mlp_packed(inputs, k, n)] += h[k] * d[n];
        }
        before[k] = leaky_back(sum, h[k], (double)s->slope);
    }
    for (size_t n = 0; n < s->w2; n++) grad[npg_mlp_at_bias(s, layer) + n] += d[n];
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
    layers h, d;
    hidden(h, z, code, params, s);
    head_back(d[s->layers - 1], grad, dout, h[s->layers - 1], params, s);
    for (size_t layer = s->layers; layer > 1; layer--)
        hidden_back(d[layer - 2], grad, d[layer - 1], h[layer - 2], params, layer, s);
    first_back(grad, dz, dcode, d[0], z, code, params, s);
}
