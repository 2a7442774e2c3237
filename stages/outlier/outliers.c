/* Outliers: mean distances in one walk over a k-d tree, and rounds of taking away. */
#include "outlier/outlier_internal.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "pipeline/parallel.h"

#define ROUNDS 8 /* of the filter, each on what the one before has left; set by trial */

typedef struct filter {
    const float *points;
    size_t count, left, neighbours;
    npg_kdtree *tree;
    float *mean, *far_sq; /* N each, owned: of the distances to the neighbours; to the last of them */
    uint8_t *is_asked;    /* N, owned: a neighbour of the point is gone */
    uint8_t *keep;        /* N, a loan */
    int threads;
} filter;

static npg_status open_filter(filter *f)
{
    NPG_TRY(npg_alloc_array(&f->mean, NPG_FOR_FRAMES, f->count, sizeof *f->mean));
    NPG_TRY(npg_alloc_array(&f->far_sq, NPG_FOR_FRAMES, f->count, sizeof *f->far_sq));
    NPG_TRY(npg_alloc(&f->is_asked, NPG_FOR_FRAMES, f->count));
    return npg_kdtree_open(&f->tree, f->points, f->count);
}

static void close_filter(filter *f)
{
    npg_kdtree_close(&f->tree);
    npg_release(&f->mean);
    npg_release(&f->far_sq);
    npg_release(&f->is_asked);
}

/* An npg_kdtree_visit: the point itself is the first of its neighbours. */
static void measure(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const filter *f = user;
    double sum = 0;
    (void)index;
    for (size_t k = 1; k <= f->neighbours; k++) sum += sqrt((double)dist_sq[k]);
    f->mean[point] = (float)(sum / (double)f->neighbours);
    f->far_sq[point] = dist_sq[f->neighbours];
}

/* The mean distance above which a point is isolated. */
static double threshold_of(const filter *f, double ratio)
{
    double sum = 0, sum_sq = 0, n = (double)f->left;
    for (size_t i = 0; i < f->count; i++) {
        if (!f->keep[i]) continue;
        sum += (double)f->mean[i];
        sum_sq += (double)(f->mean[i] * f->mean[i]);
    }
    double variance = (sum_sq - sum * sum / n) / (n - 1);
    return sum / n + ratio * sqrt(variance > 0 ? variance : 0);
}

/* Ask again for the points that had one of those `gone` (G x 3) among their neighbours. */
static npg_status ask_again(filter *f, const float *gone, size_t gone_count)
{
    npg_kdtree *tree;
    NPG_TRY(npg_kdtree_open(&tree, gone, gone_count));
    npg_kdtree_any_within(tree, f->is_asked, f->points, f->far_sq, f->count);
    npg_kdtree_close(&tree);
    return NPG_OK;
}

/* Take the points above the threshold away; *dropped counts them. */
static npg_status drop(filter *f, size_t *dropped, double threshold)
{
    float *gone;
    size_t count = 0;
    for (size_t i = 0; i < f->count; i++) count += f->keep[i] && (double)f->mean[i] > threshold;
    *dropped = count;
    if (!count) return NPG_OK;
    NPG_TRY(npg_alloc_array(&gone, NPG_FOR_FRAMES, count, 3 * sizeof *gone));
    count = 0;
    for (size_t i = 0; i < f->count; i++) {
        if (!f->keep[i] || !((double)f->mean[i] > threshold)) continue;
        f->keep[i] = 0;
        memcpy(gone + 3 * count++, f->points + 3 * i, 3 * sizeof *gone);
    }
    f->left -= count;
    npg_kdtree_leave_out(f->tree, f->keep);
    npg_status status = ask_again(f, gone, count);
    npg_release(&gone);
    return status;
}

npg_status npg_find_isolated(uint8_t *keep, const float *points, size_t count, int neighbours, double ratio,
                             int threads)
{
    filter f = {.points = points,
                .count = count,
                .left = count,
                .neighbours = (size_t)neighbours,
                .keep = keep,
                .threads = threads};
    size_t dropped = 1;
    NPG_REQUIRE(neighbours >= 1 && neighbours < NPG_KDTREE_NEIGHBOURS && ratio >= 0);
    memset(keep, 1, count);
    if (count <= f.neighbours) return NPG_OK;
    npg_status status = open_filter(&f);
    for (int round = 0; round < ROUNDS && dropped && f.left > f.neighbours && !status; round++) {
        status = npg_kdtree_each(f.tree, f.neighbours + 1, round ? f.is_asked : NULL, measure, &f, threads);
        if (!status) status = drop(&f, &dropped, threshold_of(&f, ratio));
    }
    close_filter(&f);
    return status;
}

size_t npg_find_isolated_memory(size_t count)
{
    return npg_kdtree_memory(count) + count * (2 * sizeof(float) + 1 + 3 * sizeof(float));
}

/* ---- several frames ---- */

typedef struct searches {
    npg_frame *const *frames;
    uint8_t **keep; /* of each frame's points; NULL: not searched */
    size_t count, parts;
    int neighbours;
    double ratio;
} searches;

static npg_status filter_share(void *user, size_t part)
{
    const searches *s = user;
    int threads = s->parts > 1 ? 1 : 0; /* one frame is searched by all cores */
    for (size_t i = part; i < s->count; i += s->parts) {
        const npg_frame *frame = s->frames[i];
        if (!s->keep[i]) continue;
        npg_status status = npg_find_isolated(s->keep[i], frame->pos_local, frame->point_count, s->neighbours,
                                              s->ratio, threads);
        if (status) return npg_error_prefix(status, "frame %" PRId64, frame->number);
    }
    return NPG_OK;
}

static void drop_from(npg_frame *frame, const uint8_t *keep)
{
    size_t before = frame->point_count;
    if (memchr(keep, 0, before)) npg_frame_keep(frame, keep);
    frame->cleaning.isolated += before - frame->point_count;
}

npg_status npg_isolated_drop(npg_frame *const *frames, size_t count, int neighbours, double ratio)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    searches s = {frames,     npg_arena_take(&scratch, count, sizeof *s.keep),
                  count,      npg_parallel_parts(count, 1, count),
                  neighbours, ratio};
    for (size_t i = 0; i < count && s.keep; i++)
        if (!frames[i]->is_skipped && frames[i]->point_count)
            s.keep[i] = npg_arena_take(&scratch, frames[i]->point_count, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status && s.parts) status = npg_parallel(filter_share, &s, s.parts);
    for (size_t i = 0; i < count && !status; i++)
        if (s.keep[i]) drop_from(frames[i], s.keep[i]);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_frame_clean(npg_frame *frame, uint8_t **keep, size_t point_max, double ratio)
{
    *keep = NULL;
    NPG_TRY(npg_clean_points(frame, point_max));
    if (!frame->point_count) return NPG_OK;
    NPG_TRY(npg_alloc(keep, NPG_FOR_FRAMES, frame->point_count));
    memset(*keep, 1, frame->point_count);
    if (!(ratio > 0)) return NPG_OK;
    return npg_find_isolated(*keep, frame->pos_local, frame->point_count, NPG_NEIGHBOURS, ratio, 0);
}
