/* Carry: choosing samples, and carrying the dense surface along. */
#include "optimize/carry.h"

#include "geometry/mesh_tools.h"
#include "geometry/query.h"

static npg_status find_carriers(npg_carry *carry)
{
    const npg_mesh *samples = carry->samples->mesh, *surface = carry->surface->mesh;
    size_t s = samples->vert_count, w = surface->vert_count;
    carry->arrays.purpose = NPG_FOR_MESH;
    carry->vertex = npg_arena_take(&carry->arrays, s, sizeof *carry->vertex);
    carry->surface_carriers = npg_arena_take(&carry->arrays, w, sizeof *carry->surface_carriers);
    NPG_TRY(npg_arena_status(&carry->arrays));
    for (size_t i = 0; i < s; i++) carry->vertex[i] = carry->surface->vertex[carry->samples->vertex[i]];
    NPG_TRY(npg_surface_open(&carry->rest, samples->vert_pos, s, samples->faces, samples->face_count));
    return npg_carriers_find(carry->surface_carriers, samples, carry->rest, surface->vert_pos, w, 0);
}

npg_status npg_carry_open(npg_carry **out, const npg_mesh *reference, size_t sample_target,
                          size_t surface_target)
{
    npg_carry *carry;
    *out = NULL;
    NPG_TRY(npg_alloc(&carry, NPG_FOR_MESH, sizeof *carry));
    carry->vert_count = reference->vert_count;
    npg_status status = npg_thin_open(&carry->surface, reference, surface_target);
    if (!status) status = npg_thin_open(&carry->samples, carry->surface->mesh, sample_target);
    if (!status) status = find_carriers(carry);
    if (status) npg_carry_close(&carry);
    *out = carry;
    return status;
}

void npg_carry_close(npg_carry **slot)
{
    if (!slot || !*slot) return;
    npg_surface_close(&(*slot)->rest);
    npg_thin_close(&(*slot)->surface);
    npg_thin_close(&(*slot)->samples);
    npg_arena_release(&(*slot)->arrays);
    npg_release(slot);
}

npg_status npg_carriers_find(npg_carrier *carriers, const npg_mesh *mesh, npg_surface *rest,
                             const float *points, size_t count, int threads)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, count, sizeof *hits));
    npg_status status = npg_surface_closest_near(rest, hits, points, count, NULL, NULL, threads);
    for (size_t i = 0; i < count && !status; i++)
        for (size_t c = 0; c < 3; c++) {
            carriers[i].sample[c] = (int32_t)mesh->faces[3 * (size_t)hits[i].face + c];
            carriers[i].share[c] = hits[i].weights[c];
        }
    npg_release(&hits);
    return status;
}

void npg_carry_gather(const npg_carry *carry, float *samples, const float *vert_pos)
{
    npg_rows_gather(samples, vert_pos, carry->vertex, carry->samples->mesh->vert_count);
}

void npg_carriers_move(const npg_carrier *carriers, size_t vert_count, float *vert_pos, const float *before,
                       const float *samples)
{
    for (size_t v = 0; v < vert_count; v++)
        for (int c = 0; c < 3; c++) {
            size_t s = 3 * (size_t)carriers[v].sample[c];
            float share = carriers[v].share[c];
            for (size_t i = 0; i < 3; i++) vert_pos[3 * v + i] += share * (samples[s + i] - before[s + i]);
        }
}
