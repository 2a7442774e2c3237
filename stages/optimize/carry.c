/* Carry: there and back. */
#include "optimize/carry.h"

void npg_carry(float *to, const npg_mesh *coarse, const npg_surface_hit *hits, size_t count,
               const float *ways)
{
    for (size_t v = 0; v < count; v++)
        for (size_t c = 0; c < 3; c++) {
            const float *way = ways + 3 * (size_t)coarse->faces[3 * (size_t)hits[v].face + c];
            for (size_t i = 0; i < 3; i++) to[3 * v + i] += hits[v].weights[c] * way[i];
        }
}

void npg_carry_back(float *ways, const npg_mesh *coarse, const npg_surface_hit *hits, size_t count,
                    const float *values)
{
    for (size_t v = 0; v < count; v++)
        for (size_t c = 0; c < 3; c++) {
            float *way = ways + 3 * (size_t)coarse->faces[3 * (size_t)hits[v].face + c];
            for (size_t i = 0; i < 3; i++) way[i] += hits[v].weights[c] * values[3 * v + i];
        }
}
