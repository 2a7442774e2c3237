/* State mesh: the reference mesh as blocks of a state on disk. */
#include "job/state_mesh.h"

npg_status npg_state_put_mesh(npg_store *out, const npg_mesh *mesh)
{
    const uint64_t counts[2] = {mesh->vert_count, mesh->face_count};
    size_t v = mesh->vert_count;
    NPG_TRY(npg_store_put(out, "reference", counts, sizeof counts));
    NPG_TRY(npg_store_put(out, "reference.vertices", mesh->vert_pos, v * 3 * sizeof(float)));
    NPG_TRY(npg_store_put(out, "reference.normals", mesh->vert_normals, v * 3 * sizeof(float)));
    NPG_TRY(npg_store_put(out, "reference.faces", mesh->faces, mesh->face_count * 3 * sizeof(uint32_t)));
    if (mesh->vert_colours) NPG_TRY(npg_store_put(out, "reference.colours", mesh->vert_colours, v * 4));
    if (mesh->vert_unseen) NPG_TRY(npg_store_put(out, "reference.unseen", mesh->vert_unseen, v));
    if (mesh->vert_uvs) NPG_TRY(npg_store_put(out, "reference.uvs", mesh->vert_uvs, v * 2 * sizeof(float)));
    if (mesh->corner_uvs)
        NPG_TRY(npg_store_put(out, "reference.corner_uvs", mesh->corner_uvs,
                              mesh->face_count * 6 * sizeof(float)));
    return NPG_OK;
}

/* Whether the block has `count` rows of `size` bytes. */
static npg_status check_block(const npg_record *in, const char *name, uint64_t count, size_t size)
{
    size_t found;
    if (npg_record_find(in, name, &found) && found % size == 0 && found / size == count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "the block %s has not the size of %llu rows", name,
                     (unsigned long long)count);
}

static npg_status get_optional(const npg_record *in, const char *name, void *array, size_t count, size_t size)
{
    size_t found;
    if (!npg_record_find(in, name, &found)) return NPG_OK;
    NPG_TRY(check_block(in, name, count, size));
    NPG_TRY(npg_alloc_array(array, NPG_FOR_MESH, count, size));
    return npg_record_get(in, name, *(void **)array, count * size);
}

static npg_status fill(npg_mesh *mesh, const npg_record *in)
{
    size_t v = mesh->vert_count, f = mesh->face_count;
    NPG_TRY(npg_record_get(in, "reference.vertices", mesh->vert_pos, v * 3 * sizeof(float)));
    NPG_TRY(npg_record_get(in, "reference.faces", mesh->faces, f * 3 * sizeof(uint32_t)));
    for (size_t i = 0; i < 3 * f; i++)
        if (mesh->faces[i] >= v)
            return npg_error(NPG_BAD_INPUT,
                             "face %zu of the reference uses vertex %u, but there are only %zu", i / 3,
                             mesh->faces[i], v);
    NPG_TRY(get_optional(in, "reference.normals", &mesh->vert_normals, v, 3 * sizeof(float)));
    NPG_TRY(get_optional(in, "reference.colours", &mesh->vert_colours, v, 4));
    NPG_TRY(get_optional(in, "reference.unseen", &mesh->vert_unseen, v, 1));
    NPG_TRY(get_optional(in, "reference.corner_uvs", &mesh->corner_uvs, mesh->face_count, 6 * sizeof(float)));
    return get_optional(in, "reference.uvs", &mesh->vert_uvs, v, 2 * sizeof(float));
}

npg_status npg_state_get_mesh(npg_mesh **out, const npg_record *in)
{
    uint64_t counts[2];
    *out = NULL;
    NPG_TRY(npg_record_get(in, "reference", counts, sizeof counts));
    NPG_TRY(check_block(in, "reference.vertices", counts[0], 3 * sizeof(float)));
    NPG_TRY(check_block(in, "reference.faces", counts[1], 3 * sizeof(uint32_t)));
    NPG_TRY(npg_mesh_open(out, counts[0], counts[1]));
    npg_status status = fill(*out, in);
    if (status) npg_mesh_unref(out);
    return status;
}
