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
    uint64_t *cells; /* GRID_WORDS, a bit per cell, all 0 between frames; owned  */
    size_t *found;   /* cells of a piece whose neighbours are to be asked for; owned */
    size_t found_room;
};

/* ---- cells of the capture ---- */

static npg_status find_spacing(double *spacing, const npg_frame *frame)
{
    float *points;
    *spacing = 0;
    NPG_TRY(npg_alloc_array(&points, NPG_FOR_RUN, ASKED_MOST, 3 * sizeof *points));
    size_t count = npg_spread_finite(points, ASKED_MOST, frame->pos_local, frame->point_count);
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
    npg_release(&(*slot)->found);
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

/* Set or clear a cell; whether that changed it. */
static bool turn_cell(npg_extent *e, size_t cell, bool on)
{
    uint64_t bit = UINT64_C(1) << (cell % 64), *word = &e->cells[cell / 64];
    bool was_on = *word & bit;
    *word = on ? *word | bit : *word & ~bit;
    return was_on != on;
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
            changed += turn_cell(e, cell_of(unit + 3 * i, cells_per_unit, shift), on);
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

/* Clear the cells that hang together with one that was cleared, by faces, edges or corners, and count all of them. */
static npg_status clear_piece(size_t *cell_count, npg_extent *e, size_t first)
{
    size_t waiting = 0, next = first;
    for (*cell_count = 1;; ++*cell_count) {
        size_t x = next / GRID / GRID, y = next / GRID % GRID, z = next % GRID;
        NPG_TRY(npg_grow(&e->found, &e->found_room, waiting + 27, sizeof *e->found, NPG_FOR_RUN));
        for (size_t k = 0; k < 27; k++) {
            size_t at[3] = {x + k / 9 - 1, y + k / 3 % 3 - 1, z + k % 3 - 1}; /* below 0 it wraps */
            if (at[0] >= GRID || at[1] >= GRID || at[2] >= GRID) continue;
            next = (at[0] * GRID + at[1]) * GRID + at[2];
            if (turn_cell(e, next, false)) e->found[waiting++] = next;
        }
        if (!waiting) return NPG_OK;
        next = e->found[--waiting];
    }
}

npg_status npg_extent_pieces(size_t *count, npg_extent *e, const npg_frame *frame)
{
    size_t all = mark_cells(e, frame, e->area_cells_per_unit, 0, true), cell_count;
    *count = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        float unit[3];
        npg_box_local_to_unit(&e->box, unit, frame->pos_local + 3 * i, 1);
        size_t cell = cell_of(unit, e->area_cells_per_unit, 0);
        if (!npg_vec3_is_finitef(unit) || !turn_cell(e, cell, false)) continue;
        NPG_TRY(clear_piece(&cell_count, e, cell));
        *count += (double)cell_count >= NPG_PIECE_SHARE * (double)all;
    }
    return NPG_OK;
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
