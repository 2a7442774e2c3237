/* Outliers: mean distances in one walk over a k-d tree, and rounds of taking away. */
#include "outlier/outlier_internal.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"
#include "pipeline/parallel.h"

#define ROUNDS 8 /* of searches, each in what the one before has left; set by trial */

typedef struct filter {
    npg_arena arena;
    size_t count, neighbours;
    float *mean;   /* N: of the distances to the neighbours    */
    float *spread; /* N: 1 / the dimension of the points around */
    float *sorted; /* N */
    uint8_t *keep; /* N, a loan */
} filter;

/* An npg_kdtree_visit: the point itself is the first of its neighbours.  Around a point of a set of dimension d the
 * number of others grows with the distance to the power of d; of K neighbours
 *     1 / d = sum_k ln(r_K / r_k) / (K - 2)
 * (Levina and Bickel 2004, their equation 8 without its bias), to be averaged over points. */
static void measure(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const filter *f = user;
    double sum = 0, farther = 1;
    (void)index;
    for (size_t k = 1; k <= f->neighbours; k++) {
        sum += sqrt((double)dist_sq[k]);
        farther *= (double)dist_sq[f->neighbours] / (double)dist_sq[k];
    }
    f->mean[point] = (float)(sum / (double)f->neighbours);
    f->spread[point] = (float)(log(farther) / 2 / fmax(1, (double)f->neighbours - 2));
}

/* The mean distance beyond which points are scattered in space, if there are such: what lies clearly farther from each
 * other than most do, and not on a surface.  Many of them make each other look usual. */
static double scattered_from(const filter *f)
{
    double spread = 0;
    size_t count = 0;
    memcpy(f->sorted, f->mean, f->count * sizeof *f->sorted);
    qsort(f->sorted, f->count, sizeof *f->sorted, npg_order_float);
    double far = NPG_CLEARLY * (double)f->sorted[f->count / 2];
    for (size_t i = 0; i < f->count; i++) {
        if (!((double)f->mean[i] > far)) continue;
        spread += (double)f->spread[i];
        count++;
    }
    return (2 + 3) * spread < 2 * (double)count ? far : (double)INFINITY; /* nearer to space's 3 than to 2 */
}

/* The mean distance above which a point is isolated: of points no farther apart than `far`. */
static double threshold_of(const filter *f, double far, double ratio)
{
    double sum = 0, sum_sq = 0, n = 0;
    for (size_t i = 0; i < f->count; i++) {
        if (!f->keep[i] || (double)f->mean[i] > far) continue;
        sum += (double)f->mean[i];
        sum_sq += (double)(f->mean[i] * f->mean[i]);
        n++;
    }
    double variance = n > 1 ? (sum_sq - sum * sum / n) / (n - 1) : 0;
    return sum / n + ratio * sqrt(variance > 0 ? variance : 0);
}

/* Take the points above the threshold away; returns how many. */
static size_t drop(filter *f, double threshold)
{
    size_t dropped = 0;
    for (size_t i = 0; i < f->count; i++) {
        bool drops = f->keep[i] && (double)f->mean[i] > threshold;
        if (drops) f->keep[i] = 0;
        dropped += drops;
    }
    return dropped;
}

/* *again: scattered points were among the neighbours of others. */
static npg_status search(filter *f, bool *again, const float *points, double ratio, int threads)
{
    npg_kdtree *tree;
    f->mean = npg_arena_take(&f->arena, f->count, sizeof *f->mean);
    f->spread = npg_arena_take(&f->arena, f->count, sizeof *f->spread);
    f->sorted = npg_arena_take(&f->arena, f->count, sizeof *f->sorted);
    NPG_TRY(npg_arena_status(&f->arena));
    NPG_TRY(npg_kdtree_open(&tree, points, f->count));
    npg_status status = npg_kdtree_each(tree, f->neighbours + 1, measure, f, threads);
    npg_kdtree_close(&tree);
    NPG_TRY(status);
    double far = scattered_from(f);
    size_t left = f->count;
    for (size_t dropped = 1; dropped; left -= dropped) dropped = drop(f, threshold_of(f, far, ratio));
    *again = isfinite(far) && left < f->count;
    return NPG_OK;
}

/* One search in the points that are left; in their places. */
static npg_status search_left(uint8_t *keep, bool *again, const float *points, size_t count,
                              size_t neighbours, double ratio, int threads)
{
    filter f = {.arena.purpose = NPG_FOR_FRAMES, .neighbours = neighbours};
    float *left = npg_arena_take(&f.arena, count, 3 * sizeof *left);
    f.keep = npg_arena_take(&f.arena, count, 1);
    npg_status status = npg_arena_status(&f.arena);
    for (size_t i = 0; i < count && !status; i++)
        if (keep[i]) memcpy(left + 3 * f.count++, points + 3 * i, 3 * sizeof *left);
    if (!status) memset(f.keep, 1, f.count);
    *again = false;
    if (!status && f.count > neighbours) status = search(&f, again, left, ratio, threads);
    for (size_t i = 0, k = 0; i < count && !status; i++)
        if (keep[i]) keep[i] = f.keep[k++];
    npg_arena_release(&f.arena);
    return status;
}

npg_status npg_find_isolated(uint8_t *keep, const float *points, size_t count, int neighbours, double ratio,
                             int threads)
{
    npg_status status = NPG_OK;
    bool again = true;
    NPG_REQUIRE(neighbours >= 1 && neighbours < NPG_KDTREE_NEIGHBOURS && ratio >= 0);
    memset(keep, 1, count);
    for (int round = 0; round < ROUNDS && again && !status; round++)
        status = search_left(keep, &again, points, count, (size_t)neighbours, ratio, threads);
    return status;
}

size_t npg_find_isolated_memory(size_t count)
{
    return npg_kdtree_memory(count) + count * (6 * sizeof(float) + 1);
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
