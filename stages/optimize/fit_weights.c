/* Weights: confidence and catch-up. */
#include "optimize/fit.h"

#include <math.h>

static double delta_of(int catch_up, double progress)
{
    switch ((npg_catch_up)catch_up) {
    case NPG_CATCH_UP_ROOT: return 1 - sqrt(progress);
    case NPG_CATCH_UP_LINEAR: return 1 - progress;
    case NPG_CATCH_UP_EXPONENTIAL: return exp(-5 * progress);
    case NPG_CATCH_UP_CONSTANT:
    case NPG_CATCH_UP_INTERPOLATED: break;
    }
    return 1;
}

void npg_weights_begin(npg_weights *weights, const npg_fit_settings *settings, double progress, int64_t key,
                       size_t frame_count)
{
    *weights = (npg_weights){.confidence = settings->confidence,
                             .catch_up = settings->catch_up,
                             .progress = progress,
                             .delta = delta_of(settings->catch_up, progress),
                             .key = key,
                             .key_cd = NAN,
                             .before = 1,
                             .after = 1,
                             .share = 1 / (double)frame_count};
}

static double omega_of(npg_weights *weights, int64_t index, double cd)
{
    double single = 1 / (1 + fmax(0, cd - weights->key_cd));
    switch ((npg_confidence)weights->confidence) {
    case NPG_CONFIDENCE_CUMULATIVE: {
        double *product = index < weights->key ? &weights->before : &weights->after;
        return *product *= single;
    }
    case NPG_CONFIDENCE_SINGLE: return single;
    case NPG_CONFIDENCE_DELTA: return 0.5;
    case NPG_CONFIDENCE_CONSTANT: break;
    }
    return 1;
}

double npg_weights_next(npg_weights *weights, int64_t index, double cd, bool has_points)
{
    if (!has_points) return 0;
    if (isnan(weights->key_cd)) weights->key_cd = cd;
    double omega = omega_of(weights, index, cd);
    double weight = weights->catch_up == NPG_CATCH_UP_INTERPOLATED
                        ? (1 - weights->progress) * omega + weights->progress
                        : pow(omega, weights->delta);
    return weights->share * weight;
}
