/* latent: the plain twins of latent.cl, in double. */
#include <math.h>
#include <string.h>

#include "tests/kernels/twins/twins.h"

void npg_latent_sample_ref(double *z, const double *nodes, const npg_samples *samples)
{
    for (size_t v = 0; v < samples->rows; v++)
        for (size_t c = 0; c < NPG_LATENT_CHANNELS; c++) {
            double sum = 0;
            for (size_t k = v * samples->per_row; k < (v + 1) * samples->per_row; k++)
                sum +=
                    (double)samples->weight[k] * nodes[(size_t)samples->index[k] * NPG_LATENT_CHANNELS + c];
            z[v * NPG_LATENT_CHANNELS + c] = tanh(sum);
        }
}

void npg_latent_back_ref(double *dnodes, const double *dz, const double *z, const npg_samples *samples)
{
    memset(dnodes, 0, samples->node_count * NPG_LATENT_CHANNELS * sizeof *dnodes);
    for (size_t n = 0; n < samples->node_count; n++)
        for (int32_t k = samples->start[n]; k < samples->start[n + 1]; k++)
            for (int c = NPG_CHANNEL_FIRST(samples->channels[n]); c < NPG_CHANNEL_END(samples->channels[n]);
                 c++) {
                size_t at = (size_t)samples->vertex[k] * NPG_LATENT_CHANNELS + (size_t)c;
                dnodes[n * NPG_LATENT_CHANNELS + (size_t)c] +=
                    (double)samples->weight_back[k] * dz[at] * (1 - z[at] * z[at]);
            }
}
