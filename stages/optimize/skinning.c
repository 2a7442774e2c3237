/* Skinning: choosing samples, and moving the dense surface with them. */
#include "optimize/fit.h"

#include "geometry/geometry.h"

static npg_status bind(npg_skinning *skinning)
{
    const npg_mesh *samples = skinning->samples->mesh, *surface = skinning->surface->mesh;
    size_t s = samples->vert_count, w = surface->vert_count;
    skinning->arrays.purpose = NPG_FOR_MESH;
    skinning->vertex = npg_arena_take(&skinning->arrays, s, sizeof *skinning->vertex);
    skinning->surface_weights = npg_arena_take(&skinning->arrays, w, sizeof *skinning->surface_weights);
    NPG_TRY(npg_arena_status(&skinning->arrays));
    for (size_t i = 0; i < s; i++)
        skinning->vertex[i] = skinning->surface->vertex[skinning->samples->vertex[i]];
    NPG_TRY(npg_surface_open(&skinning->rest, samples->vert_pos, s, samples->faces, samples->face_count));
    return npg_skin_bind(skinning->surface_weights, samples, skinning->rest, surface->vert_pos, w, 0);
}

npg_status npg_skinning_open(npg_skinning **out, const npg_mesh *reference, size_t sample_target,
                             size_t surface_target)
{
    npg_skinning *skinning;
    *out = NULL;
    NPG_TRY(npg_alloc(&skinning, NPG_FOR_MESH, sizeof *skinning));
    skinning->vert_count = reference->vert_count;
    npg_status status = npg_proxy_open(&skinning->surface, reference, surface_target);
    if (!status) status = npg_proxy_open(&skinning->samples, skinning->surface->mesh, sample_target);
    if (!status) status = bind(skinning);
    if (status) npg_skinning_close(&skinning);
    *out = skinning;
    return status;
}

void npg_skinning_close(npg_skinning **slot)
{
    if (!slot || !*slot) return;
    npg_surface_close(&(*slot)->rest);
    npg_proxy_close(&(*slot)->surface);
    npg_proxy_close(&(*slot)->samples);
    npg_arena_release(&(*slot)->arrays);
    npg_release(slot);
}

npg_status npg_skin_bind(npg_skin_weights *weights, const npg_mesh *mesh, npg_surface *rest,
                         const float *points, size_t count, int threads)
{
    npg_surface_hit *hits;
    NPG_TRY(npg_alloc_array(&hits, NPG_FOR_FIT, count, sizeof *hits));
    npg_status status = npg_surface_closest_near(rest, hits, points, count, NULL, NULL, threads);
    for (size_t i = 0; i < count && !status; i++)
        for (size_t c = 0; c < 3; c++) {
            weights[i].sample[c] = (int32_t)mesh->faces[3 * (size_t)hits[i].face + c];
            weights[i].share[c] = hits[i].weights[c];
        }
    npg_release(&hits);
    return status;
}

void npg_skinning_gather(const npg_skinning *skinning, float *samples, const float *vert_pos)
{
    npg_rows_gather(samples, vert_pos, skinning->vertex, skinning->samples->mesh->vert_count);
}

void npg_skin_move(const npg_skin_weights *weights, size_t vert_count, float *vert_pos, const float *before,
                   const float *samples)
{
    for (size_t v = 0; v < vert_count; v++)
        for (int c = 0; c < 3; c++) {
            size_t s = 3 * (size_t)weights[v].sample[c];
            float share = weights[v].share[c];
            for (size_t i = 0; i < 3; i++) vert_pos[3 * v + i] += share * (samples[s + i] - before[s + i]);
        }
}
