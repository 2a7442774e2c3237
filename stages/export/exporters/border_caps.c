/* Border caps: faces that close the openings of a surface. */
#include "export/exporters/exporters_internal.h"

#include <stdlib.h>

#include "geometry/geometry.h"

typedef struct border { /* an edge as a cap has it: against the face beside it */
    uint32_t from, to;
} border;

static int by_from(const void *left, const void *right)
{
    const border *a = left, *b = right;
    if (a->from != b->from) return a->from < b->from ? -1 : 1;
    return a->to < b->to ? -1 : a->to > b->to;
}

static npg_status find_border(npg_arena *scratch, border **edges, size_t *count, const uint32_t *faces,
                              size_t face_count)
{
    uint32_t *twin = npg_arena_take(scratch, face_count, 3 * sizeof *twin);
    *count = 0;
    NPG_TRY(npg_arena_status(scratch));
    NPG_TRY(npg_mesh_twins(twin, faces, face_count));
    for (size_t i = 0; i < 3 * face_count; i++) *count += twin[i] == UINT32_MAX;
    *edges = npg_arena_take(scratch, *count, sizeof **edges);
    NPG_TRY(npg_arena_status(scratch));
    for (size_t i = 0, k = 0; i < 3 * face_count; i++)
        if (twin[i] == UINT32_MAX) (*edges)[k++] = (border){faces[i - i % 3 + (i + 1) % 3], faces[i]};
    if (*count) qsort(*edges, *count, sizeof **edges, by_from);
    return NPG_OK;
}

/* The place of the first edge from a vertex on that is not used, count if there is none. */
static size_t next_edge(const border *edges, const uint8_t *is_used, size_t count, uint32_t from)
{
    size_t low = 0, high = count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (edges[middle].from < from)
            low = middle + 1;
        else
            high = middle;
    }
    while (low < count && edges[low].from == from && is_used[low]) low++;
    return low < count && edges[low].from == from ? low : count;
}

/* A fan around the first vertex of every loop. */
static size_t fill_loops(uint32_t *caps, const border *edges, uint8_t *is_used, size_t count)
{
    size_t made = 0;
    for (size_t start = 0; start < count; start++) {
        if (is_used[start]) continue;
        uint32_t first = edges[start].from;
        for (size_t at = start; at < count; at = next_edge(edges, is_used, count, edges[at].to)) {
            is_used[at] = 1;
            if (edges[at].from != first && edges[at].to != first) {
                uint32_t *cap = caps + 3 * made++;
                cap[0] = first;
                cap[1] = edges[at].from;
                cap[2] = edges[at].to;
            }
            if (edges[at].to == first) break;
        }
    }
    return made;
}

npg_status npg_border_caps(uint32_t **caps, size_t *cap_count, const uint32_t *faces, size_t face_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    border *edges;
    size_t count;
    *caps = NULL;
    *cap_count = 0;
    npg_status status = find_border(&scratch, &edges, &count, faces, face_count);
    uint8_t *is_used = status ? NULL : npg_arena_take(&scratch, count, 1);
    if (!status) status = npg_arena_status(&scratch);
    if (!status) status = npg_alloc_array(caps, NPG_FOR_FILES, count, 3 * sizeof **caps);
    if (!status) *cap_count = fill_loops(*caps, edges, is_used, count);
    npg_arena_release(&scratch);
    return status;
}
