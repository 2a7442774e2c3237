/* Loop fill: the triangulation of least area. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

typedef struct filling {
    npg_loop loop;
    const float *vert_pos;
    const uint32_t (*edges)[2];
    size_t edge_count;
    double *area;    /* n x n: least area of the part of the loop from i to j */
    uint16_t *third; /* n x n: the corner of the triangle on i and j          */
} filling;

static bool is_edge(const filling *f, size_t i, size_t j)
{
    uint32_t a = f->loop.verts[i], b = f->loop.verts[j];
    uint32_t pair[2] = {a < b ? a : b, a < b ? b : a};
    return bsearch(pair, f->edges, f->edge_count, sizeof *f->edges, npg_order_pair) != NULL;
}

static void find_third(filling *f, size_t i, size_t j)
{
    size_t n = f->loop.count;
    double best = INFINITY;
    for (size_t k = i + 1; k < j; k++) {
        double sides = f->area[i * n + k] + f->area[k * n + j];
        if (!(sides < best)) continue;
        const uint32_t face[3] = {f->loop.verts[i], f->loop.verts[k], f->loop.verts[j]};
        double area = sides + npg_face_area(f->vert_pos, face);
        if (!(area < best)) continue;
        best = area;
        f->third[i * n + j] = (uint16_t)k;
    }
    f->area[i * n + j] = best;
}

static void find_all(filling *f)
{
    size_t n = f->loop.count;
    for (size_t length = 2; length < n; length++)
        for (size_t i = 0; i + length < n; i++) {
            size_t j = i + length;
            if (length < n - 1 && is_edge(f, i, j))
                f->area[i * n + j] = INFINITY;
            else
                find_third(f, i, j);
        }
}

static void emit(uint32_t *faces, const filling *f)
{
    size_t n = f->loop.count, depth = 0, count = 0;
    uint16_t stack[NPG_LOOP_MOST][2];
    stack[depth][0] = 0;
    stack[depth++][1] = (uint16_t)(n - 1);
    while (depth) {
        uint16_t i = stack[--depth][0], j = stack[depth][1];
        if (j - i < 2) continue;
        uint16_t k = f->third[i * n + j];
        uint32_t *face = faces + 3 * count++;
        face[0] = f->loop.verts[i];
        face[1] = f->loop.verts[k];
        face[2] = f->loop.verts[j];
        stack[depth][0] = i;
        stack[depth++][1] = k;
        stack[depth][0] = k;
        stack[depth++][1] = j;
    }
}

npg_status npg_loop_fill(uint32_t *faces, double *area, bool *is_filled, npg_loop loop, const float *vert_pos,
                         const uint32_t (*edges)[2], size_t edge_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    filling f = {.loop = loop, .vert_pos = vert_pos, .edges = edges, .edge_count = edge_count};
    size_t n = loop.count;
    *is_filled = false;
    *area = 0;
    if (n < 3 || n > NPG_LOOP_MOST) return NPG_OK;
    f.area = npg_arena_take(&scratch, n * n, sizeof *f.area);
    f.third = npg_arena_take(&scratch, n * n, sizeof *f.third);
    npg_status status = npg_arena_status(&scratch);
    if (!status) {
        find_all(&f);
        *area = f.area[n - 1];
        *is_filled = isfinite(*area);
        if (*is_filled) emit(faces, &f);
    }
    npg_arena_release(&scratch);
    return status;
}
