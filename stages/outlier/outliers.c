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

#define ROUNDS 8 /* of the filter, each on what the one before has left; set by trial */

typedef struct filter {
    const float *points;
    size_t count, left, neighbours;
    npg_kdtree *tree;
    npg_arena scratch;    /* holds the arrays of N that follow */
    float *mean, *far_sq; /* of the distances to the neighbours; to the last of them */
    float *spread;        /* 1 / the dimension of the points around */
    float *sorted;        /* of those that are left, the mean */
    uint8_t *is_asked;    /* a neighbour of the point is gone */
    uint8_t *keep;        /* N, a loan */
} filter;

static npg_status open_filter(filter *f)
{
    npg_arena *a = &f->scratch;
    a->purpose = NPG_FOR_FRAMES;
    f->mean = npg_arena_take(a, f->count, sizeof *f->mean);
    f->far_sq = npg_arena_take(a, f->count, sizeof *f->far_sq);
    f->spread = npg_arena_take(a, f->count, sizeof *f->spread);
    f->sorted = npg_arena_take(a, f->count, sizeof *f->sorted);
    f->is_asked = npg_arena_take(a, f->count, 1);
    NPG_TRY(npg_arena_status(a));
    return npg_kdtree_open(&f->tree, f->points, f->count);
}

static void close_filter(filter *f)
{
    npg_kdtree_close(&f->tree);
    npg_arena_release(&f->scratch);
}

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
    f->far_sq[point] = dist_sq[f->neighbours];
    f->spread[point] = (float)(log(farther) / 2 / fmax(1, (double)f->neighbours - 2));
}

/* The mean distance beyond which points are scattered in space, if there are such: what lies clearly farther from each
 * other than most do, and not on a surface.  Many of them make each other look usual. */
static double scattered_from(const filter *f)
{
    double spread = 0;
    size_t count = 0;
    for (size_t i = 0; i < f->count; i++)
        if (f->keep[i]) f->sorted[count++] = f->mean[i];
    qsort(f->sorted, count, sizeof *f->sorted, npg_order_float);
    double far = NPG_CLEARLY * (double)f->sorted[count / 2];
    count = 0;
    for (size_t i = 0; i < f->count; i++)
        if (f->keep[i] && (double)f->mean[i] > far) spread += (double)f->spread[i], count++;
    return (2 + 3) * spread < 2 * (double)count ? far : (double)INFINITY; /* nearer to space's 3 than to 2 */
}

/* The mean distance above which a point is isolated. */
static double threshold_of(const filter *f, double ratio)
{
    double sum = 0, sum_sq = 0, n = 0, far = scattered_from(f);
    for (size_t i = 0; i < f->count; i++) {
        if (!f->keep[i] || (double)f->mean[i] > far) continue;
        sum += (double)f->mean[i];
        sum_sq += (double)(f->mean[i] * f->mean[i]);
        n++;
    }
    double variance = n > 1 ? (sum_sq - sum * sum / n) / (n - 1) : 0;
    return sum / n + ratio * sqrt(variance > 0 ? variance : 0);
}

/* Take the points above the threshold away (*dropped counts them), and ask again for those that had one of them among
 * their neighbours. */
static npg_status drop(filter *f, size_t *dropped, double threshold)
{
    npg_kdtree *tree;
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
    npg_status status = npg_kdtree_open(&tree, gone, count);
    if (!status) npg_kdtree_any_within(tree, f->is_asked, f->points, f->far_sq, f->count);
    npg_kdtree_close(&tree);
    npg_release(&gone);
    return status;
}

npg_status npg_find_isolated(uint8_t *keep, const float *points, size_t count, int neighbours, double ratio,
                             int threads)
{
    filter f = {
        .points = points, .count = count, .left = count, .neighbours = (size_t)neighbours, .keep = keep};
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
    return npg_kdtree_memory(count) + count * (4 * sizeof(float) + 1 + 3 * sizeof(float));
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

/* Points of depth images are told from mixed pixels by those beside them in the image (ingest/rig/depth_points.c): in
 * space the few of a hand that reaches to the sensor lie apart, too, and the motion is to follow it.  Speckles do not
 * lie apart in the image, and would be spikes of a surface. */
static npg_status drop_from(npg_frame *frame, const uint8_t *keep)
{
    size_t before = frame->point_count;
    if (!memchr(keep, 0, before)) return NPG_OK;
    if (!frame->views) {
        npg_frame_keep(frame, keep);
        frame->cleaning.isolated += before - frame->point_count;
        return NPG_OK;
    }
    NPG_TRY(npg_alloc(&frame->isolated, NPG_FOR_FRAMES, before));
    for (size_t i = 0; i < before; i++) frame->isolated[i] = !keep[i];
    return NPG_OK;
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
        if (s.keep[i]) status = drop_from(frames[i], s.keep[i]);
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
