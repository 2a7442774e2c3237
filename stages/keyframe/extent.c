#include "keyframe/keyframe_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"

#define GRID       512 /* cells per axis */
#define GRID_WORDS ((size_t)GRID * GRID * GRID / 64)
#define BLOCK      1024 /* points turned into unit coordinates at a time */

struct npg_extent {
    const npg_frame_box *box; /* a loan */
    uint64_t *cells;          /* GRID_WORDS, a bit per cell, all 0 between frames; owned */
};

npg_status npg_extent_open(npg_extent **out, const npg_frame_box *box)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_RUN, sizeof **out));
    (*out)->box = box;
    npg_status status = npg_alloc_array(&(*out)->cells, NPG_FOR_RUN, GRID_WORDS, sizeof *(*out)->cells);
    if (status) npg_extent_close(out);
    return status;
}

void npg_extent_close(npg_extent **slot)
{
    if (!*slot) return;
    npg_release(&(*slot)->cells);
    npg_release(slot);
}

static size_t cell_of(const float *unit)
{
    size_t cell = 0;
    for (int a = 0; a < 3; a++) {
        double at = floor(((double)unit[a] + 1) * (GRID / 2));
        cell = cell * GRID + (size_t)fmin(fmax(at, 0), GRID - 1);
    }
    return cell;
}

/* Set or clear the cells of all finite points; the result is the number of bits that changed. */
static size_t mark_cells(npg_extent *e, const npg_frame *frame, bool on)
{
    float unit[3 * BLOCK];
    size_t changed = 0;
    for (size_t first = 0; first < frame->point_count; first += BLOCK) {
        size_t count = frame->point_count - first < BLOCK ? frame->point_count - first : BLOCK;
        npg_box_local_to_unit(e->box, unit, frame->pos_local + 3 * first, count);
        for (size_t i = 0; i < count; i++) {
            if (!npg_vec3_is_finitef(unit + 3 * i)) continue;
            size_t cell = cell_of(unit + 3 * i);
            uint64_t bit = UINT64_C(1) << (cell % 64), *word = &e->cells[cell / 64];
            changed += on ? !(*word & bit) : (*word & bit) != 0;
            *word = on ? *word | bit : *word & ~bit;
        }
    }
    return changed;
}

size_t npg_extent_cells(npg_extent *e, const npg_frame *frame)
{
    size_t count = mark_cells(e, frame, true);
    mark_cells(e, frame, false);
    return count;
}
