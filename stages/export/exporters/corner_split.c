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

npg_status npg_corner_split_make(npg_corner_split *split, npg_arena *arena, size_t vert_count,
                                 const uint32_t *faces, size_t face_count, const float *uvs,
                                 const float *corner_uvs)
{
    size_t most = vert_count + (corner_uvs ? 3 * face_count : 0);
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    NPG_REQUIRE(most < UINT32_MAX);
    splitting s = {split, npg_arena_take(&scratch, most, sizeof *s.next),
                   npg_arena_take(&scratch, vert_count, 1)};
    *split = (npg_corner_split){.count = vert_count,
                                .vertex = npg_arena_take(arena, most, sizeof *split->vertex),
                                .indices = npg_arena_copy(arena, faces, face_count, 3 * sizeof *faces)};
    if (uvs || corner_uvs) split->uvs = npg_arena_take(arena, most, 2 * sizeof *split->uvs);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_arena_status(arena);
    for (size_t i = 0; i < vert_count && !status; i++) {
        split->vertex[i] = (uint32_t)i;
        s.next[i] = UINT32_MAX;
    }
    for (size_t i = 0; i < 3 * face_count && corner_uvs && !status; i++)
        split->indices[i] = copy_for(&s, faces[i], corner_uvs + 2 * i);
    if (!status && !corner_uvs && uvs) memcpy(split->uvs, uvs, vert_count * 2 * sizeof *uvs);
    npg_arena_release(&scratch);
    return status;
}
