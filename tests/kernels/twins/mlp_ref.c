/* mlp: the plain twins of mlp.cl and time.cl, in double, written as the paper writes the network. */
#include "tests/kernels/twins/twins.h"

#define CHANNELS  NPG_LATENT_CHANNELS
#define WIDTH_MAX 4096 /* of a hidden layer: the most that options width-1 and width-2 take */

/* What the two hidden layers give. */
typedef struct layers {
    double h1[WIDTH_MAX], h2[WIDTH_MAX];
} layers;

/* Where element (row, column) of a packed matrix with `rows` rows lies. */
static size_t packed(size_t rows, size_t row, size_t column)
{
    return column / NPG_PANEL * NPG_PANEL * rows + row * NPG_PANEL + column % NPG_PANEL;
}

static double leaky(double x)
{
    return x > 0 ? x : NPG_MLP_SLOPE * x;
}

static double leaky_back(double d, double y)
{
    return y > 0 ? d : NPG_MLP_SLOPE * d;
}

static void first_layer(double *h, const double *z, const double *code, const double *params,
                        const npg_mlp_shape *s)
{
    const double *w1z = params + npg_mlp_places_of(s).w1z, *w1t = params + npg_mlp_places_of(s).w1t,
                 *b1 = params + npg_mlp_places_of(s).b1;
    for (size_t n = 0; n < s->w1; n++) {
        double sum = b1[n];
        for (size_t c = 0; c < CHANNELS; c++) sum += z[c] * w1z[packed(CHANNELS, c, n)];
        for (size_t j = 0; j < s->code_size; j++) sum += code[j] * w1t[j * s->w1 + n];
        h[n] = leaky(sum);
    }
}

static void hidden(layers *to, const double *z, const double *code, const double *params,
                   const npg_mlp_shape *s)
{
    const double *b2 = params + npg_mlp_places_of(s).b2;
    first_layer(to->h1, z, code, params, s);
    for (size_t n = 0; n < s->w2; n++) {
        double sum = b2[n];
        for (size_t k = 0; k < s->w1; k++) sum += to->h1[k] * params[packed(s->w1, k, n)];
        to->h2[n] = leaky(sum);
    }
}

void npg_mlp_forward_ref(double *out, const double *z, const double *code, const double *params,
                         const npg_mlp_shape *s)
{
    layers in;
    const double *head = params + npg_mlp_places_of(s).head, *bias = params + npg_mlp_places_of(s).head_bias;
    hidden(&in, z, code, params, s);
    for (size_t o = 0; o < NPG_MLP_USED; o++) {
        out[o] = bias[o];
        for (size_t k = 0; k < s->w2; k++) out[o] += in.h2[k] * head[k * NPG_MLP_HEAD_ROW + o];
    }
}

/* d2: gradient before the rectifier of the second layer; grad of the head. */
static void head_back(double *d2, double *grad, const double *dout, const double *h2, const double *params,
                      const npg_mlp_shape *s)
{
    size_t at = npg_mlp_places_of(s).head;
    for (size_t k = 0; k < s->w2; k++) {
        double sum = 0;
        for (size_t o = 0; o < NPG_MLP_USED; o++) {
            sum += dout[o] * params[at + k * NPG_MLP_HEAD_ROW + o];
            grad[at + k * NPG_MLP_HEAD_ROW + o] += dout[o] * h2[k];
        }
        d2[k] = leaky_back(sum, h2[k]);
    }
    for (size_t o = 0; o < NPG_MLP_USED; o++) grad[npg_mlp_places_of(s).head_bias + o] += dout[o];
}

/* d1: gradient before the rectifier of the first layer; grad of the second. */
static void second_back(double *d1, double *grad, const double *d2, const double *h1, const double *params,
                        const npg_mlp_shape *s)
{
    for (size_t k = 0; k < s->w1; k++) {
        double sum = 0;
        for (size_t n = 0; n < s->w2; n++) {
            sum += d2[n] * params[packed(s->w1, k, n)];
            grad[packed(s->w1, k, n)] += h1[k] * d2[n];
        }
        d1[k] = leaky_back(sum, h1[k]);
    }
    for (size_t n = 0; n < s->w2; n++) grad[npg_mlp_places_of(s).b2 + n] += d2[n];
}

static void first_back(double *grad, double *dz, const double *d1, const double *z, const double *code,
                       const double *params, const npg_mlp_shape *s)
{
    size_t at_z = npg_mlp_places_of(s).w1z, at_t = npg_mlp_places_of(s).w1t;
    for (size_t n = 0; n < s->w1; n++) {
        for (size_t c = 0; c < CHANNELS; c++) {
            size_t at = at_z + packed(CHANNELS, c, n);
            dz[c] += d1[n] * params[at];
            grad[at] += d1[n] * z[c];
        }
        for (size_t j = 0; j < s->code_size; j++) {
            grad[at_t + j * s->w1 + n] += d1[n] * code[j];
        }
        grad[npg_mlp_places_of(s).b1 + n] += d1[n];
    }
}

void npg_mlp_backward_ref(double *grad, double *dz, const double *dout, const double *z, const double *code,
                          const double *params, const npg_mlp_shape *s)
{
    layers in;
    double d1[WIDTH_MAX], d2[WIDTH_MAX];
    hidden(&in, z, code, params, s);
    head_back(d2, grad, dout, in.h2, params, s);
    second_back(d1, grad, d2, in.h1, params, s);
    first_back(grad, dz, d1, z, code, params, s);
}
