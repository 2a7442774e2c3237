/* Time code: functions of time that the decoder takes as input. */
#include "optimize/fit.h"

#include <math.h>

#include "kernels/adam.h"
#include "pipeline/random.h"

#define HIDDEN 64 /* units of the learned code's hidden layer */

struct npg_time_code {
    npg_time_kind kind;
    size_t size;         /* 2 M                                                                 */
    double *frequencies; /* gaussian: M, owned                                                  */
    double *params;      /* learned: w1, b1 (HIDDEN each), w2 (HIDDEN x size), b2 (size); owned */
    double *first, *second, *gradient;
    size_t param_count;
    int64_t step;
};

static npg_status open_learned(npg_time_code *code, npg_random *random)
{
    size_t count = code->param_count = 2 * HIDDEN + (HIDDEN + 1) * code->size;
    NPG_TRY(npg_alloc_array(&code->params, NPG_FOR_FIT, 4 * count, sizeof(double)));
    code->first = code->params + count;
    code->second = code->first + count;
    code->gradient = code->second + count;
    double bound = 1 / sqrt(HIDDEN);
    for (size_t i = 0; i < count; i++)
        code->params[i] = (2 * npg_random_real(random) - 1) * (i < 2 * HIDDEN ? 1 : bound);
    return NPG_OK;
}

npg_status npg_time_code_open(npg_time_code **out, npg_time_kind kind, size_t frequencies, uint64_t seed)
{
    npg_time_code *code;
    npg_random random = npg_random_stream(seed, 1, 0);
    *out = NULL;
    NPG_TRY(npg_alloc(&code, NPG_FOR_FIT, sizeof *code));
    code->kind = kind;
    code->size = 2 * frequencies;
    npg_status status = npg_alloc_array(&code->frequencies, NPG_FOR_FIT, frequencies, sizeof(double));
    for (size_t j = 0; !status && j < frequencies; j++) code->frequencies[j] = npg_random_gauss(&random);
    if (!status && kind == NPG_TIME_LEARNED) status = open_learned(code, &random);
    if (status) npg_time_code_close(&code);
    *out = code;
    return status;
}

void npg_time_code_close(npg_time_code **slot)
{
    if (!slot || !*slot) return;
    npg_release(&(*slot)->frequencies);
    npg_release(&(*slot)->params);
    npg_release(slot);
}

static double leaky(double x)
{
    return x > 0 ? x : 0.01 * x;
}

static void fill_learned(const npg_time_code *code, float *out, double t)
{
    const double *w1 = code->params, *b1 = w1 + HIDDEN, *w2 = b1 + HIDDEN, *b2 = w2 + HIDDEN * code->size;
    for (size_t o = 0; o < code->size; o++) {
        double sum = b2[o];
        for (size_t h = 0; h < HIDDEN; h++) sum += leaky(w1[h] * t + b1[h]) * w2[h * code->size + o];
        out[o] = (float)sum;
    }
}

static void fill_one(const npg_time_code *code, float *out, double t)
{
    size_t half = code->size / 2;
    if (code->kind == NPG_TIME_LEARNED) {
        fill_learned(code, out, t);
        return;
    }
    for (size_t j = 0; j < code->size; j++) {
        double turn =
            code->kind == NPG_TIME_GAUSSIAN ? 2 * code->frequencies[j % half] : (double)(1 << j % half);
        if (code->kind == NPG_TIME_POLYNOMIAL)
            out[j] = (float)pow(t, (double)j + 1);
        else
            out[j] = (float)(j < half ? sin(M_PI * turn * t) : cos(M_PI * turn * t));
    }
}

void npg_time_code_fill(const npg_time_code *code, float *codes, const double *times, size_t count)
{
    for (size_t i = 0; i < count; i++) fill_one(code, codes + i * code->size, times[i]);
}

double *npg_time_code_parts(npg_time_code *code, size_t *count, int64_t **step)
{
    *count = 3 * code->param_count; /* the gradient after them is made anew */
    *step = &code->step;
    return code->params;
}

int npg_time_code_learns(const npg_time_code *code)
{
    return code->kind == NPG_TIME_LEARNED;
}

static void add_gradient(npg_time_code *code, const float *dcode, double t)
{
    const double *w1 = code->params, *b1 = w1 + HIDDEN, *w2 = b1 + HIDDEN;
    double *g1 = code->gradient, *gb1 = g1 + HIDDEN, *g2 = gb1 + HIDDEN, *gb2 = g2 + HIDDEN * code->size;
    for (size_t h = 0; h < HIDDEN; h++) {
        double before = w1[h] * t + b1[h], back = 0;
        for (size_t o = 0; o < code->size; o++) {
            g2[h * code->size + o] += leaky(before) * (double)dcode[o];
            back += w2[h * code->size + o] * (double)dcode[o];
        }
        if (before <= 0) back *= 0.01;
        g1[h] += back * t;
        gb1[h] += back;
    }
    for (size_t o = 0; o < code->size; o++) gb2[o] += (double)dcode[o];
}

npg_status npg_time_code_step(npg_time_code *code, const float *dcodes, const double *times, size_t count,
                              double rate)
{
    NPG_REQUIRE(code->kind == NPG_TIME_LEARNED);
    float rates[1] = {(float)rate};
    for (size_t i = 0; i < code->param_count; i++) code->gradient[i] = 0;
    for (size_t i = 0; i < count; i++) add_gradient(code, dcodes + i * code->size, times[i]);
    npg_adam_step_ref(code->params, code->first, code->second, code->gradient, rates, code->param_count,
                      code->param_count, ++code->step);
    return NPG_OK;
}
