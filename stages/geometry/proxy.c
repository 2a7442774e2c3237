/* Proxy: decimation that only leaves vertices out. */
#include "geometry/geometry.h"

#include <string.h>

#include <meshoptimizer.h>

/* Faces that remain, still over the whole's vertices. */
static npg_status decimate(uint32_t **faces, size_t *face_count, const npg_mesh *whole, size_t vert_target)
{
    size_t indices = 3 * whole->face_count, wanted = 6 * vert_target; /* two faces a vertex, by Euler */
    NPG_TRY(npg_alloc_array(faces, NPG_FOR_MESH, indices, sizeof **faces));
    if (!vert_target || vert_target + vert_target / 5 >= whole->vert_count || wanted >= indices) {
        memcpy(*faces, whole->faces, indices * sizeof **faces);
        *face_count = whole->face_count;
        return NPG_OK;
    }
    float error;
    size_t kept = meshopt_simplify(*faces, whole->faces, indices, whole->vert_pos, whole->vert_count,
                                   3 * sizeof(float), wanted, 1.0f, 0, &error);
    *face_count = kept / 3;
    return kept ? NPG_OK
                : npg_error(NPG_FAILED, "the reference mesh can't be decimated to %zu vertices", vert_target);
}

static npg_status renumber_faces(npg_proxy *proxy, const npg_mesh *whole, const uint32_t *faces,
                                 size_t face_count)
{
    uint32_t *place;
    size_t count = 0;
    NPG_TRY(npg_alloc_array(&place, NPG_FOR_MESH, whole->vert_count, sizeof *place));
    for (size_t i = 0; i < 3 * face_count; i++) place[faces[i]] = 1;
    for (size_t v = 0; v < whole->vert_count; v++) place[v] = place[v] ? (uint32_t)count++ : UINT32_MAX;
    npg_status status = npg_mesh_open(&proxy->mesh, count, face_count);
    if (!status) status = npg_alloc_array(&proxy->vertex, NPG_FOR_MESH, count, sizeof *proxy->vertex);
    for (size_t v = 0; v < whole->vert_count && !status; v++)
        if (place[v] != UINT32_MAX) proxy->vertex[place[v]] = (uint32_t)v;
    for (size_t i = 0; i < 3 * face_count && !status; i++) proxy->mesh->faces[i] = place[faces[i]];
    npg_release(&place);
    return status;
}

static npg_status copy_vertices(npg_proxy *proxy, const npg_mesh *whole)
{
    npg_proxy_gather(proxy, proxy->mesh->vert_pos, whole->vert_pos);
    if (whole->vert_unseen)
        NPG_TRY(npg_alloc(&proxy->mesh->vert_unseen, NPG_FOR_MESH, proxy->mesh->vert_count));
    for (size_t i = 0; whole->vert_unseen && i < proxy->mesh->vert_count; i++)
        proxy->mesh->vert_unseen[i] = whole->vert_unseen[proxy->vertex[i]];
    if (!whole->vert_normals) return NPG_OK;
    NPG_TRY(npg_alloc_array(&proxy->mesh->vert_normals, NPG_FOR_MESH, proxy->mesh->vert_count,
                            3 * sizeof(float)));
    npg_proxy_gather(proxy, proxy->mesh->vert_normals, whole->vert_normals);
    return NPG_OK;
}

npg_status npg_proxy_open(npg_proxy **out, const npg_mesh *whole, size_t vert_target)
{
    npg_proxy *proxy;
    uint32_t *faces = NULL;
    size_t face_count = 0;
    *out = NULL;
    NPG_TRY(npg_alloc(&proxy, NPG_FOR_MESH, sizeof *proxy));
    npg_status status = decimate(&faces, &face_count, whole, vert_target);
    if (!status) status = renumber_faces(proxy, whole, faces, face_count);
    if (!status) status = copy_vertices(proxy, whole);
    npg_release(&faces);
    if (status) npg_proxy_close(&proxy);
    *out = proxy;
    return status;
}

void npg_proxy_close(npg_proxy **slot)
{
    if (!slot || !*slot) return;
    npg_mesh_unref(&(*slot)->mesh);
    npg_release(&(*slot)->vertex);
    npg_release(slot);
}

void npg_proxy_gather(const npg_proxy *proxy, float *out, const float *rows)
{
    npg_rows_gather(out, rows, proxy->vertex, proxy->mesh->vert_count);
}
