/* Carry: choosing samples by decimation, and carrying the dense surface along. */
#include "carry.h"

#include <math.h>
#include <string.h>

#include <meshoptimizer.h>

#include "mesh_tools.h"

/* Faces of a decimated reference, still over its own vertices. */
static npg_status decimate(uint32_t **faces, size_t *face_count, const npg_mesh *reference,
                           size_t sample_target)
{
    size_t indices = 3 * reference->face_count, wanted = 6 * sample_target;
    NPG_TRY(npg_alloc_array(faces, NPG_FOR_MESH, indices, sizeof **faces));
    if (!sample_target || sample_target >= reference->vert_count || wanted >= indices) {
        memcpy(*faces, reference->faces, indices * sizeof **faces);
        *face_count = reference->face_count;
        return NPG_OK;
    }
    float error;
    size_t kept = meshopt_simplify(*faces, reference->faces, indices, reference->vert_pos,
                                   reference->vert_count, 3 * sizeof(float), wanted, 1.0f, 0, &error);
    *face_count = kept / 3;
    return kept
               ? NPG_OK
               : npg_error(NPG_FAILED, "the reference mesh can't be decimated to %zu samples", sample_target);
}

static npg_status make_mesh(npg_carry *carry, const npg_mesh *reference, const uint32_t *faces,
                            size_t face_count)
{
    uint32_t *sample_of;
    size_t count = 0;
    NPG_TRY(npg_alloc_array(&sample_of, NPG_FOR_MESH, reference->vert_count, sizeof *sample_of));
    for (size_t i = 0; i < 3 * face_count; i++) sample_of[faces[i]] = 1;
    for (size_t v = 0; v < reference->vert_count; v++)
        sample_of[v] = sample_of[v] ? (uint32_t)count++ : UINT32_MAX;
    npg_status status = npg_mesh_open(&carry->mesh, count, face_count);
    if (!status) status = npg_alloc_array(&carry->vertex, NPG_FOR_MESH, count, sizeof *carry->vertex);
    if (!status) status = npg_alloc_array(&carry->mesh->vert_normals, NPG_FOR_MESH, count, 3 * sizeof(float));
    for (size_t v = 0; v < reference->vert_count && !status; v++) {
        if (sample_of[v] == UINT32_MAX) continue;
        carry->vertex[sample_of[v]] = (uint32_t)v;
        memcpy(carry->mesh->vert_pos + 3 * (size_t)sample_of[v], reference->vert_pos + 3 * v,
               3 * sizeof(float));
        memcpy(carry->mesh->vert_normals + 3 * (size_t)sample_of[v], reference->vert_normals + 3 * v,
               3 * sizeof(float));
    }
    for (size_t i = 0; i < 3 * face_count && !status; i++) carry->mesh->faces[i] = sample_of[faces[i]];
    npg_release(&sample_of);
    return status;
}

npg_status npg_carry_open(npg_carry **out, const npg_mesh *reference, size_t sample_target)
{
    npg_carry *carry;
    uint32_t *faces = NULL;
    size_t face_count = 0;
    *out = NULL;
    NPG_TRY(npg_alloc(&carry, NPG_FOR_MESH, sizeof *carry));
    carry->vert_count = reference->vert_count;
    npg_status status = decimate(&faces, &face_count, reference, sample_target);
    if (!status) status = make_mesh(carry, reference, faces, face_count);
    npg_release(&faces);
    if (!status)
        status = npg_surface_open(&carry->surface, carry->mesh->vert_pos, carry->mesh->vert_count,
                                  carry->mesh->faces, carry->mesh->face_count);
    if (!status)
        status =
            npg_alloc_array(&carry->carriers, NPG_FOR_MESH, reference->vert_count, sizeof *carry->carriers);
    if (!status) status = npg_carry_find(carry, carry->carriers, reference->vert_pos, reference->vert_count);
    if (status) npg_carry_close(&carry);
    *out = carry;
    return status;
}

void npg_carry_close(npg_carry **slot)
{
    if (!slot || !*slot) return;
    npg_surface_close(&(*slot)->surface);
    npg_mesh_unref(&(*slot)->mesh);
    npg_release(&(*slot)->vertex);
    npg_release(&(*slot)->carriers);
    npg_release(slot);
}

npg_status npg_carry_find(const npg_carry *carry, npg_carrier *carriers, const float *rest, size_t count)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, count, sizeof *hits));
    npg_status status = npg_surface_closest(carry->surface, hits, rest, count);
    for (size_t i = 0; i < count && !status; i++)
        for (int c = 0; c < 3; c++) {
            carriers[i].sample[c] = (int32_t)carry->mesh->faces[3 * (size_t)hits[i].face + (size_t)c];
            carriers[i].share[c] = hits[i].weights[c];
        }
    npg_release(&hits);
    return status;
}

void npg_carry_gather(const npg_carry *carry, float *samples, const float *vert_pos)
{
    for (size_t s = 0; s < carry->mesh->vert_count; s++)
        memcpy(samples + 3 * s, vert_pos + 3 * (size_t)carry->vertex[s], 3 * sizeof(float));
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

void npg_carry_move(const npg_carry *carry, float *vert_pos, const float *before, const float *samples)
{
    npg_carriers_move(carry->carriers, carry->vert_count, vert_pos, before, samples);
}
