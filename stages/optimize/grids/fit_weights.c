/* Weights: the confidence, and how it opens. */
#include <math.h>

#include "optimize/grids/fit.h"

void npg_weights_begin(npg_weights *weights, npg_confidence confidence, double progress, int64_t key,
                       size_t frame_count)
{
    *weights = (npg_weights){.confidence = confidence,
                             .delta = 1 - sqrt(progress),
                             .key = key,
                             .key_cd = NAN,
                             .before = 1,
                             .after = 1,
                             .share = 1 / (double)frame_count};
}

double npg_weights_next(npg_weights *weights, int64_t index, double cd, bool has_points)
{
    if (!has_points) return 0;
    if (isnan(weights->key_cd)) weights->key_cd = cd;
    if (weights->confidence == NPG_CONFIDENCE_CONSTANT) return weights->share;
    double *product = index < weights->key ? &weights->before : &weights->after;
    *product *= 1 / (1 + fmax(0, cd - weights->key_cd));
    return weights->share * pow(*product, weights->delta);
}
