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

npg_status npg_proxy_open(npg_proxy **out, const npg_mesh *whole, size_t vert_target)
{
    npg_proxy *proxy;
    uint32_t *faces = NULL;
    size_t face_count = 0;
    *out = NULL;
    NPG_TRY(npg_alloc(&proxy, NPG_FOR_MESH, sizeof *proxy));
    npg_status status = decimate(&faces, &face_count, whole, vert_target);
    if (!status) status = npg_mesh_of_faces(&proxy->mesh, &proxy->vertex, whole, faces, face_count);
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
