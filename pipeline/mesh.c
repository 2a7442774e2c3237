/* Mesh: vertices and triangles as plain arrays, shared by counted references. */
#include "pipeline/mesh.h"

#include <string.h>

npg_status npg_mesh_open(npg_mesh **out, size_t vert_count, size_t face_count)
{
    npg_mesh *mesh;
    NPG_TRY(npg_alloc(&mesh, NPG_FOR_MESH, sizeof *mesh));
    mesh->references = 1;
    mesh->vert_count = vert_count;
    mesh->face_count = face_count;
    npg_status status =
        npg_alloc_array(&mesh->vert_pos, NPG_FOR_MESH, vert_count, 3 * sizeof *mesh->vert_pos);
    if (!status) status = npg_alloc_array(&mesh->faces, NPG_FOR_MESH, face_count, 3 * sizeof *mesh->faces);
    if (status) npg_mesh_unref(&mesh);
    *out = mesh;
    return status;
}

npg_mesh *npg_mesh_ref(npg_mesh *mesh)
{
    /* Builtins, not <stdatomic.h>: C++ reads the struct, too.  Relaxed: who makes a reference holds one
     * already.  The last to go must see what all others wrote. */
    __atomic_fetch_add(&mesh->references, 1, __ATOMIC_RELAXED);
    return mesh;
}

void npg_mesh_unref(npg_mesh **slot)
{
    npg_mesh *mesh = *slot;
    *slot = NULL;
    if (!mesh || __atomic_fetch_sub(&mesh->references, 1, __ATOMIC_ACQ_REL) > 1) return;
    npg_release(&mesh->vert_pos);
    npg_release(&mesh->vert_normals);
    npg_release(&mesh->faces);
    npg_release(&mesh->vert_colours);
    npg_release(&mesh->vert_unseen);
    npg_release(&mesh->vert_uvs);
    npg_release(&mesh->corner_uvs);
    npg_release(&mesh);
}

static npg_status copy_bytes(void *out, const void *from, size_t count, size_t size)
{
    if (!from || !count) return NPG_OK;
    NPG_TRY(npg_alloc_array(out, NPG_FOR_MESH, count, size));
    memcpy(*(void **)out, from, count * size);
    return NPG_OK;
}

npg_status npg_mesh_copy(npg_mesh **out, const npg_mesh *mesh)
{
    npg_mesh *copy;
    size_t v = mesh->vert_count;
    NPG_TRY(npg_mesh_open(&copy, v, mesh->face_count));
    memcpy(copy->vert_pos, mesh->vert_pos, v * 3 * sizeof(float));
    memcpy(copy->faces, mesh->faces, mesh->face_count * 3 * sizeof(uint32_t));
    npg_status status = copy_bytes(&copy->vert_normals, mesh->vert_normals, v, 3 * sizeof(float));
    if (!status) status = copy_bytes(&copy->vert_colours, mesh->vert_colours, v, 4);
    if (!status) status = copy_bytes(&copy->vert_unseen, mesh->vert_unseen, v, 1);
    if (!status) status = copy_bytes(&copy->vert_uvs, mesh->vert_uvs, v, 2 * sizeof(float));
    if (!status)
        status = copy_bytes(&copy->corner_uvs, mesh->corner_uvs, mesh->face_count, 6 * sizeof(float));
    if (status) npg_mesh_unref(&copy);
    *out = copy;
    return status;
}
