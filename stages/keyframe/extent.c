#include "keyframe/keyframe_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/surface.h"
#include "pipeline/memory.h"

#define GRID       512 /* cells per axis at most: the paper's */
#define GRID_WORDS ((size_t)GRID * GRID * GRID / 64)
#define BLOCK      1024 /* points turned into unit coordinates at a time */

/* Set by trial on captures from sensors: samba and two others, tests/bed/decisions.md. */
#define PLACES     8
#define ASKED_MOST 20000 /* points for their spacing; a denser cloud's cells are NPG_DETAIL_SHARE */

struct npg_extent {
    npg_frame_box box;
    double area_cells_per_unit;
    uint64_t *cells; /* GRID_WORDS, a bit per cell, all 0 between frames; owned */
};

/* ---- cells of the capture ---- */

static npg_status find_spacing(double *spacing, const npg_frame *frame)
{
    float *points;
    size_t count = 0;
    *spacing = 0;
    NPG_TRY(npg_alloc_array(&points, NPG_FOR_RUN, frame->point_count, 3 * sizeof *points));
    for (size_t i = 0; i < frame->point_count; i++) {
        if (!npg_vec3_is_finitef(frame->pos_local + 3 * i)) continue;
        for (size_t a = 0; a < 3; a++) points[3 * count + a] = frame->pos_local[3 * i + a];
        count++;
    }
    if (count > ASKED_MOST) {
        npg_points_spread(points, NULL, ASKED_MOST, points, NULL, count);
        count = ASKED_MOST;
    }
    npg_status status = count > 1 ? npg_cloud_spacing(spacing, points, count) : NPG_OK;
    npg_release(&points);
    return status;
}

npg_status npg_extent_open(npg_extent **out, const npg_frame_box *box, const npg_frame *first)
{
    npg_extent *e;
    double spacing = 0;
    *out = NULL;
    NPG_TRY(npg_alloc(&e, NPG_FOR_RUN, sizeof *e));
    e->box = *box;
    npg_status status = npg_alloc_array(&e->cells, NPG_FOR_RUN, GRID_WORDS, sizeof *e->cells);
    if (!status) status = find_spacing(&spacing, first);
    if (status) npg_extent_close(&e);
    *out = e;
    if (status) return status;
    double side = box->scale * fmax(NPG_SAMPLED * spacing, NPG_DETAIL_SHARE * box->diagonal);
    double most = (double)(GRID - 1) / 2; /* a grid that is shifted has one cell more */
    e->area_cells_per_unit = side * most > 1 ? 1 / side : most;
    return NPG_OK;
}

void npg_extent_close(npg_extent **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->cells);
    npg_release(slot);
}

/* ---- cells of a frame ---- */

static size_t cell_of(const float *unit, double cells_per_unit, double shift)
{
    size_t cell = 0;
    for (int a = 0; a < 3; a++) {
        double at = floor(((double)unit[a] + 1) * cells_per_unit + shift);
        cell = cell * GRID + (size_t)fmin(fmax(at, 0), GRID - 1);
    }
    return cell;
}

/* Set or clear the cells of all finite points; the result is the number of bits that changed. */
static size_t mark_cells(npg_extent *e, const npg_frame *frame, double cells_per_unit, double shift, bool on)
{
    float unit[3 * BLOCK];
    size_t changed = 0;
    for (size_t first = 0; first < frame->point_count; first += BLOCK) {
        size_t count = frame->point_count - first < BLOCK ? frame->point_count - first : BLOCK;
        npg_box_local_to_unit(&e->box, unit, frame->pos_local + 3 * first, count);
        for (size_t i = 0; i < count; i++) {
            if (!npg_vec3_is_finitef(unit + 3 * i)) continue;
            size_t cell = cell_of(unit + 3 * i, cells_per_unit, shift);
            uint64_t bit = UINT64_C(1) << (cell % 64), *word = &e->cells[cell / 64];
            changed += on ? !(*word & bit) : (*word & bit) != 0;
            *word = on ? *word | bit : *word & ~bit;
        }
    }
    return changed;
}

static size_t count_cells(npg_extent *e, const npg_frame *frame, double cells_per_unit, double shift)
{
    size_t count = mark_cells(e, frame, cells_per_unit, shift, true);
    mark_cells(e, frame, cells_per_unit, shift, false);
    return count;
}

size_t npg_extent_papers(npg_extent *e, const npg_frame *frame)
{
    return count_cells(e, frame, GRID / 2, 0);
}

size_t npg_extent_area(npg_extent *e, const npg_frame *frame)
{
    size_t sum = 0;
    for (int i = 0; i < PLACES; i++) sum += count_cells(e, frame, e->area_cells_per_unit, (double)i / PLACES);
    return sum;
}
