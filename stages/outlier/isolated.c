/* Isolated: the statistical filter, asked once per frame. */
#include "outlier/outlier_internal.h"

#include <inttypes.h>
#include <xxhash.h>

#include "pipeline/parallel.h"

typedef struct known_frame {
    uint64_t hash; /* of the points before; 0: no result is kept */
    uint32_t *dropped, count;
} known_frame;

struct npg_isolated {
    known_frame *frames; /* by index */
    size_t frame_count, capacity, bytes, byte_max;
};

npg_status npg_isolated_open(npg_isolated **out, size_t byte_max)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_FRAMES, sizeof **out));
    (*out)->byte_max = byte_max;
    return NPG_OK;
}

void npg_isolated_close(npg_isolated **slot)
{
    if (!slot || !*slot) return;
    for (size_t i = 0; i < (*slot)->frame_count; i++) npg_release(&(*slot)->frames[i].dropped);
    npg_release(&(*slot)->frames);
    npg_release(slot);
}

/* ---- one frame ---- */

typedef struct search {
    npg_frame *frame;
    uint64_t hash;
    uint8_t *keep; /* per point, owned */
    bool is_known;
} search;

static known_frame *known_result(npg_isolated *isolated, const search *l)
{
    size_t index = (size_t)l->frame->index;
    bool is_there = l->frame->index >= 0 && index < isolated->frame_count;
    return is_there && isolated->frames[index].hash == l->hash ? &isolated->frames[index] : NULL;
}

static npg_status begin_search(npg_isolated *isolated, search *l, npg_frame *frame)
{
    l->frame = frame;
    /* | 1: a hash is never 0, which stands for no result. */
    l->hash = XXH3_64bits(frame->pos_local, frame->point_count * 3 * sizeof *frame->pos_local) | 1;
    NPG_TRY(npg_alloc(&l->keep, NPG_FOR_FRAMES, frame->point_count));
    known_frame *known = known_result(isolated, l);
    l->is_known = known != NULL;
    for (size_t i = 0; known && i < frame->point_count; i++) l->keep[i] = 1;
    for (size_t i = 0; known && i < known->count; i++) l->keep[known->dropped[i]] = 0;
    return NPG_OK;
}

static size_t dropped_count(const search *l)
{
    size_t count = 0;
    for (size_t i = 0; i < l->frame->point_count; i++) count += !l->keep[i];
    return count;
}

static npg_status keep_result(npg_isolated *isolated, const search *l, size_t dropped)
{
    size_t index = (size_t)l->frame->index, count = 0;
    size_t bytes = dropped * sizeof(uint32_t) + sizeof(known_frame);
    if (l->is_known || l->frame->index < 0 || isolated->bytes + bytes > isolated->byte_max) return NPG_OK;
    if (index >= isolated->frame_count) {
        NPG_TRY(npg_grow(&isolated->frames, &isolated->capacity, index + 1, sizeof *isolated->frames,
                         NPG_FOR_FRAMES));
        while (isolated->frame_count <= index) isolated->frames[isolated->frame_count++] = (known_frame){0};
    }
    known_frame *m = &isolated->frames[index];
    npg_release(&m->dropped);
    *m = (known_frame){.count = (uint32_t)dropped};
    if (dropped) NPG_TRY(npg_alloc_array(&m->dropped, NPG_FOR_FRAMES, dropped, sizeof *m->dropped));
    for (size_t i = 0; i < l->frame->point_count; i++)
        if (!l->keep[i]) m->dropped[count++] = (uint32_t)i;
    m->hash = l->hash;
    isolated->bytes += bytes;
    return NPG_OK;
}

static npg_status end_search(npg_isolated *isolated, const search *l)
{
    size_t dropped = dropped_count(l);
    NPG_TRY(keep_result(isolated, l, dropped));
    if (dropped) npg_frame_keep(l->frame, l->keep);
    l->frame->cleaning.isolated += dropped;
    return NPG_OK;
}

/* ---- several ---- */

typedef struct searches {
    search *all;
    size_t count, parts;
    int neighbours;
    double ratio;
} searches;

static npg_status filter_share(void *user, size_t part)
{
    const searches *s = user;
    int threads = s->parts > 1 ? 1 : 0; /* one frame is searched by all cores */
    for (size_t i = part; i < s->count; i += s->parts) {
        const search *l = &s->all[i];
        if (l->is_known) continue;
        npg_status status = npg_find_isolated(l->keep, l->frame->pos_local, l->frame->point_count,
                                              s->neighbours, s->ratio, threads);
        if (status) return npg_error_prefix(status, "frame %" PRId64, l->frame->number);
    }
    return NPG_OK;
}

npg_status npg_isolated_drop(npg_isolated *isolated, npg_frame *const *frames, size_t count, int neighbours,
                             double ratio)
{
    searches s = {.neighbours = neighbours, .ratio = ratio};
    npg_status status = npg_alloc_array(&s.all, NPG_FOR_FRAMES, count + 1, sizeof *s.all);
    for (size_t i = 0; i < count && !status; i++)
        if (!frames[i]->is_skipped && frames[i]->point_count)
            status = begin_search(isolated, &s.all[s.count++], frames[i]);
    s.parts = npg_parallel_parts(s.count, 1, s.count);
    if (!status && s.parts) status = npg_parallel(filter_share, &s, s.parts);
    for (size_t i = 0; i < s.count && !status; i++) status = end_search(isolated, &s.all[i]);
    for (size_t i = 0; i < s.count; i++) npg_release(&s.all[i].keep);
    npg_release(&s.all);
    return status;
}
