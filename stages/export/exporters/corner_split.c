/* Corner split: vertices doubled where their corners have more than one texture coordinate. */
#include "export/exporters/exporters_internal.h"

#include <string.h>

/* The copies of one vertex are a list: the vertex itself, then next[] until UINT32_MAX. */
typedef struct splitting {
    npg_corner_split *split;
    uint32_t *next;   /* one per copy                                */
    uint8_t *is_used; /* one per vertex: it has a texture coordinate */
} splitting;

static uint32_t copy_for(splitting *s, uint32_t vertex, const float uv[2])
{
    npg_corner_split *split = s->split;
    uint32_t at = vertex;
    if (!s->is_used[vertex]) {
        s->is_used[vertex] = 1;
        memcpy(split->uvs + 2 * (size_t)vertex, uv, 2 * sizeof *uv);
    }
    while (memcmp(split->uvs + 2 * (size_t)at, uv, 2 * sizeof *uv) != 0) {
        if (s->next[at] == UINT32_MAX) {
            uint32_t made = (uint32_t)split->count++;
            s->next[at] = made;
            s->next[made] = UINT32_MAX;
            split->vertex[made] = vertex;
            memcpy(split->uvs + 2 * (size_t)made, uv, 2 * sizeof *uv);
        }
        at = s->next[at];
    }
    return at;
}

static npg_status split_corners(npg_corner_split *split, size_t vert_count, const uint32_t *faces,
                                size_t face_count, const float *corner_uvs)
{
    splitting s = {.split = split};
    npg_status status = npg_alloc_array(&s.next, NPG_FOR_FILES, vert_count + 3 * face_count, sizeof *s.next);
    if (!status) status = npg_alloc_array(&s.is_used, NPG_FOR_FILES, vert_count, 1);
    if (!status) memset(s.next, 0xff, vert_count * sizeof *s.next);
    for (size_t i = 0; i < 3 * face_count && !status; i++)
        split->indices[i] = copy_for(&s, faces[i], corner_uvs + 2 * i);
    npg_release(&s.next);
    npg_release(&s.is_used);
    return status;
}

npg_status npg_corner_split_make(npg_corner_split *split, size_t vert_count, const uint32_t *faces,
                                 size_t face_count, const float *uvs, const float *corner_uvs)
{
    size_t most = vert_count + (corner_uvs ? 3 * face_count : 0);
    *split = (npg_corner_split){.count = vert_count};
    NPG_REQUIRE(most < UINT32_MAX);
    npg_status status = npg_alloc_array(&split->vertex, NPG_FOR_FILES, most, sizeof *split->vertex);
    if (!status)
        status = npg_alloc_array(&split->indices, NPG_FOR_FILES, face_count, 3 * sizeof *split->indices);
    if (!status && (uvs || corner_uvs))
        status = npg_alloc_array(&split->uvs, NPG_FOR_FILES, most, 2 * sizeof *split->uvs);
    for (size_t i = 0; i < vert_count && !status; i++) split->vertex[i] = (uint32_t)i;
    if (!status && corner_uvs) status = split_corners(split, vert_count, faces, face_count, corner_uvs);
    if (!status && !corner_uvs) memcpy(split->indices, faces, face_count * 3 * sizeof *faces);
    if (!status && !corner_uvs && uvs) memcpy(split->uvs, uvs, vert_count * 2 * sizeof *uvs);
    if (status) npg_corner_split_clear(split);
    return status;
}

void npg_corner_split_clear(npg_corner_split *split)
{
    npg_release(&split->vertex);
    npg_release(&split->uvs);
    npg_release(&split->indices);
    *split = (npg_corner_split){0};
}
