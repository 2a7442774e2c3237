/* Carry: choosing samples, and carrying the dense surface along. */
#include "optimize/carry.h"

#include "geometry/mesh_tools.h"
#include "geometry/query.h"

static npg_status find_vertices(npg_carry *carry)
{
    const npg_thin *samples = carry->samples;
    NPG_TRY(npg_alloc_array(&carry->vertex, NPG_FOR_MESH, samples->mesh->vert_count, sizeof *carry->vertex));
    for (size_t s = 0; s < samples->mesh->vert_count; s++)
        carry->vertex[s] = carry->surface->vertex[samples->vertex[s]];
    return NPG_OK;
}

static npg_status find_carriers(npg_carry *carry, const npg_mesh *reference)
{
    const npg_mesh *samples = carry->samples->mesh;
    size_t v = carry->vert_count, w = carry->surface->mesh->vert_count;
    NPG_TRY(npg_surface_open(&carry->rest, samples->vert_pos, samples->vert_count, samples->faces,
                             samples->face_count));
    NPG_TRY(npg_alloc_array(&carry->carriers, NPG_FOR_MESH, v, sizeof *carry->carriers));
    NPG_TRY(npg_alloc_array(&carry->surface_carriers, NPG_FOR_MESH, w, sizeof *carry->surface_carriers));
    NPG_TRY(npg_carry_find(carry, carry->carriers, reference->vert_pos, v, 0));
    for (size_t i = 0; i < w; i++) carry->surface_carriers[i] = carry->carriers[carry->surface->vertex[i]];
    return NPG_OK;
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
    if (!status) status = find_vertices(carry);
    if (!status) status = find_carriers(carry, reference);
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
    npg_release(&(*slot)->vertex);
    npg_release(&(*slot)->carriers);
    npg_release(&(*slot)->surface_carriers);
    npg_release(slot);
}

npg_status npg_carry_find(const npg_carry *carry, npg_carrier *carriers, const float *rest, size_t count,
                          int threads)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, count, sizeof *hits));
    npg_status status = npg_surface_closest_near(carry->rest, hits, rest, count, NULL, NULL, threads);
    for (size_t i = 0; i < count && !status; i++)
        for (int c = 0; c < 3; c++) {
            carriers[i].sample[c] =
                (int32_t)carry->samples->mesh->faces[3 * (size_t)hits[i].face + (size_t)c];
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
