/* Carry: binding, there and back. */
#include "optimize/carry.h"

#include "geometry/geometry.h"

npg_status npg_carriers_bind(npg_carrier *carriers, const npg_mesh *coarse, const float *points, size_t count)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, count, sizeof *hits));
    npg_status status = npg_mesh_closest(hits, coarse, points, count);
    for (size_t i = 0; i < count && !status; i++)
        for (size_t c = 0; c < 3; c++) {
            carriers[i].vertex[c] = coarse->faces[3 * (size_t)hits[i].face + c];
            carriers[i].share[c] = hits[i].weights[c];
        }
    npg_release(&hits);
    return status;
}

void npg_carry(const npg_carrier *carriers, size_t count, float *to, const float *ways)
{
    for (size_t v = 0; v < count; v++)
        for (int c = 0; c < 3; c++) {
            const float *way = ways + 3 * (size_t)carriers[v].vertex[c];
            for (size_t i = 0; i < 3; i++) to[3 * v + i] += carriers[v].share[c] * way[i];
        }
}

void npg_carry_back(const npg_carrier *carriers, size_t count, float *ways, const float *values)
{
    for (size_t v = 0; v < count; v++)
        for (int c = 0; c < 3; c++) {
            float *way = ways + 3 * (size_t)carriers[v].vertex[c];
            for (size_t i = 0; i < 3; i++) way[i] += carriers[v].share[c] * values[3 * v + i];
        }
}
