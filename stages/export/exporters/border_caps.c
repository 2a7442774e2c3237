/* Border caps: faces that close the openings of a surface. */
#include "export/exporters/exporters_internal.h"

#include <string.h>

#include "geometry/geometry.h"

/* The border's edges as faces with two equal corners: from, from, to, against the face beside each. */
static size_t list_edges(uint32_t *flat, const uint32_t *twin, const uint32_t *faces, size_t face_count)
{
    size_t count = 0;
    for (size_t i = 0; i < 3 * face_count; i++) {
        if (twin[i] != UINT32_MAX) continue;
        flat[3 * count] = flat[3 * count + 1] = faces[i - i % 3 + (i + 1) % 3];
        flat[3 * count++ + 2] = faces[i];
    }
    return count;
}

/* A fan around one vertex of every piece of the border. */
static size_t fill(uint32_t *caps, uint32_t *first, const uint32_t *piece, const uint32_t *flat, size_t count)
{
    size_t made = 0;
    for (size_t e = 0; e < count; e++) {
        uint32_t from = flat[3 * e], to = flat[3 * e + 2], *apex = &first[piece[from]];
        if (*apex == UINT32_MAX) *apex = from;
        if (from != *apex && to != *apex)
            memcpy(caps + 3 * made++, (uint32_t[]){*apex, from, to}, 3 * sizeof *caps);
    }
    return made;
}

npg_status npg_border_caps(uint32_t **caps, size_t *cap_count, size_t vert_count, const uint32_t *faces,
                           size_t face_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    size_t pieces = 0, count = 0;
    uint32_t *twin = npg_arena_take(&scratch, face_count, 3 * sizeof *twin);
    uint32_t *flat = npg_arena_take(&scratch, 3 * face_count, 3 * sizeof *flat);
    uint32_t *piece = npg_arena_take(&scratch, vert_count, sizeof *piece);
    uint32_t *first = npg_arena_take(&scratch, vert_count, sizeof *first);
    *caps = NULL;
    *cap_count = 0;
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_mesh_twins(twin, faces, face_count);
    if (!status) count = list_edges(flat, twin, faces, face_count);
    if (!status) status = npg_mesh_components(piece, &pieces, vert_count, flat, count);
    if (!status) memset(first, 0xff, vert_count * sizeof *first);
    if (!status) status = npg_alloc_array(caps, NPG_FOR_FILES, count, 3 * sizeof **caps);
    if (!status) *cap_count = fill(*caps, first, piece, flat, count);
    npg_arena_release(&scratch);
    return status;
}
