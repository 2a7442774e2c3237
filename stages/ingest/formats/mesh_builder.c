/* Mesh builder: what a reader collects a mesh in. */
#include "ingest/ingest_internal.h"

npg_status npg_builder_reserve(npg_mesh_builder *b, size_t vertices, size_t triangles)
{
    if (vertices > UINT32_MAX - b->vert_count || triangles > UINT32_MAX - b->face_count)
        return npg_error(NPG_MEMORY, "a mesh of more than %u vertices or faces", UINT32_MAX);
    size_t v = b->vert_count + vertices, f = b->face_count + triangles;
    NPG_TRY(npg_grow(&b->vert_pos, &b->pos_capacity, v, 3 * sizeof(float), NPG_FOR_MESH));
    if (b->has_normals)
        NPG_TRY(npg_grow(&b->vert_normals, &b->normal_capacity, v, 3 * sizeof(float), NPG_FOR_MESH));
    if (b->has_colours) NPG_TRY(npg_grow(&b->vert_colours, &b->colour_capacity, v, 4, NPG_FOR_MESH));
    if (b->has_uvs) NPG_TRY(npg_grow(&b->vert_uvs, &b->uv_capacity, v, 2 * sizeof(float), NPG_FOR_MESH));
    return npg_grow(&b->faces, &b->face_capacity, f, 3 * sizeof(uint32_t), NPG_FOR_MESH);
}

size_t npg_builder_vertex(npg_mesh_builder *b, const double world[3])
{
    npg_local_of(b->vert_pos + 3 * b->vert_count, b->origin, world);
    return b->vert_count++;
}

npg_status npg_builder_polygon(npg_mesh_builder *b, const uint32_t *corners, size_t corner_count)
{
    NPG_TRY(npg_builder_reserve(b, 0, corner_count - 2));
    for (size_t i = 2; i < corner_count; i++) {
        uint32_t *face = b->faces + 3 * b->face_count++;
        face[0] = corners[0];
        face[1] = corners[i - 1];
        face[2] = corners[i];
    }
    return NPG_OK;
}

static npg_status check_faces(const npg_mesh_builder *b, const char *name)
{
    if (!b->vert_count) return npg_error(NPG_BAD_INPUT, "%s: the mesh has no vertices", name);
    if (!b->face_count && !b->may_be_points)
        return npg_error(NPG_BAD_INPUT, "%s: no faces, so it is not a mesh", name);
    for (size_t i = 0; i < 3 * b->face_count; i++)
        if (b->faces[i] >= b->vert_count)
            return npg_error(NPG_BAD_INPUT, "%s: triangle %zu uses vertex %u, but there are only %zu", name,
                             i / 3, b->faces[i], b->vert_count);
    return NPG_OK;
}

npg_status npg_builder_finish(npg_mesh **out, npg_mesh_builder *b, const char *name)
{
    npg_mesh *mesh;
    NPG_TRY(check_faces(b, name));
    NPG_TRY(npg_mesh_open(&mesh, 0, 0));
    mesh->vert_count = b->vert_count;
    mesh->face_count = b->face_count;
    mesh->vert_pos = b->vert_pos;
    mesh->vert_normals = b->vert_normals;
    mesh->vert_colours = b->vert_colours;
    mesh->vert_uvs = b->vert_uvs;
    mesh->corner_uvs = b->corner_uvs;
    mesh->faces = b->faces;
    *b = (npg_mesh_builder){0};
    *out = mesh;
    return NPG_OK;
}

void npg_builder_clear(npg_mesh_builder *b)
{
    npg_release(&b->vert_pos);
    npg_release(&b->vert_normals);
    npg_release(&b->vert_colours);
    npg_release(&b->vert_uvs);
    npg_release(&b->corner_uvs);
    npg_release(&b->faces);
    *b = (npg_mesh_builder){0};
}
