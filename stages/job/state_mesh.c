/* State mesh: the reference mesh as blocks of a state on disk. */
#include "job/job_internal.h"

#include <stddef.h>

enum { ARRAYS = 7 };

static void list_arrays(npg_store_array list[ARRAYS], size_t v, size_t f)
{
    const npg_store_array arrays[ARRAYS] = {
        {"reference.vertices", offsetof(npg_mesh, vert_pos), v, 3 * sizeof(float)},
        {"reference.normals", offsetof(npg_mesh, vert_normals), v, 3 * sizeof(float)},
        {"reference.faces", offsetof(npg_mesh, faces), f, 3 * sizeof(uint32_t)},
        {"reference.colours", offsetof(npg_mesh, vert_colours), v, 4},
        {"reference.unseen", offsetof(npg_mesh, vert_unseen), v, 1},
        {"reference.uvs", offsetof(npg_mesh, vert_uvs), v, 2 * sizeof(float)},
        {"reference.corner_uvs", offsetof(npg_mesh, corner_uvs), f, 6 * sizeof(float)}};
    for (int i = 0; i < ARRAYS; i++) list[i] = arrays[i];
}

npg_status npg_state_put_mesh(npg_store *out, const npg_mesh *mesh)
{
    const uint64_t counts[2] = {mesh->vert_count, mesh->face_count};
    npg_store_array arrays[ARRAYS];
    list_arrays(arrays, mesh->vert_count, mesh->face_count);
    NPG_TRY(npg_store_put(out, "reference", counts, sizeof counts));
    return npg_store_put_arrays(out, mesh, arrays, ARRAYS);
}

static npg_status fill(npg_mesh *mesh, const npg_record *in, const uint64_t counts[2])
{
    npg_store_array arrays[ARRAYS];
    list_arrays(arrays, counts[0], counts[1]);
    NPG_TRY(npg_record_get_arrays(in, mesh, arrays, ARRAYS, NPG_FOR_MESH));
    if (!mesh->vert_pos || !mesh->faces) return npg_error(NPG_BAD_INPUT, "the reference is not whole");
    mesh->vert_count = counts[0];
    mesh->face_count = counts[1];
    for (size_t i = 0; i < 3 * mesh->face_count; i++)
        if (mesh->faces[i] >= mesh->vert_count)
            return npg_error(NPG_BAD_INPUT, "face %zu of the reference uses vertex %u of %zu", i / 3,
                             mesh->faces[i], mesh->vert_count);
    return NPG_OK;
}

npg_status npg_state_get_mesh(npg_mesh **out, const npg_record *in)
{
    uint64_t counts[2];
    *out = NULL;
    NPG_TRY(npg_record_get(in, "reference", counts, sizeof counts));
    NPG_TRY(npg_mesh_open(out, 0, 0));
    npg_status status = fill(*out, in, counts);
    if (status) npg_mesh_unref(out);
    return status;
}
