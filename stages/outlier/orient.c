/* Orient: which side of a surface is out, decided for all points of a npg_sided_cloud together.
 *
 * Neighbours say how their sides go together: reflected at the plane halfway between two points,
 * a normal comes to lie on its neighbour's where the surface curves like a circle, and the two sides
 * of a thin sheet come to agree as opposite.  The winding number says which side is out: the solid angle
 * that the whole oriented npg_sided_cloud covers, seen from a point on it, is positive where the point's
 * surroundings face out.
 *
 * Based on: H. Hoppe et al., Surface Reconstruction from Unorganized Points, 1992 (spanning tree); A.
 * Jacobson et al., Robust Inside-Outside Segmentation Using Generalized Winding Numbers, 2013. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "outlier/outlier_internal.h"
#include "pipeline/memory.h"
#include "pipeline/parallel.h"

/* All set by trial. */
#define CORE_MAX       8000 /* points oriented together: the winding number takes all their pairs  */
#define FOLLOWED       5    /* core points that each other point asks for its side                 */
#define POINT_ROUNDS   30   /* of turning single points by the vote, until none is left            */
#define WINDING_WEIGHT 0.6  /* of the winding number beside the neighbours' vote, of single points */
#define GIVEN_TRUST    0.08 /* gain without which a patch keeps the side it was given              */

/* ---- neighbours ---- */

/* The area that each point stands for, and the softening of the winding number that goes with it. */
static void set_areas(npg_sided_cloud *c, const float *dist_sq)
{
    double mean = 0;
    for (size_t i = 0; i < c->count; i++) {
        size_t last = c->count < NPG_NEIGHBOURS ? c->count - 1 : NPG_NEIGHBOURS - 1;
        /* The disc that reaches to the last neighbour is the surface of that many points. */
        c->area[i] = 3.14159265f * dist_sq[NPG_NEIGHBOURS * i + last] / (float)last;
        mean += (double)c->area[i] / (double)c->count;
    }
    /* Far outliers have a large disc around them: no point may outweigh many. */
    for (size_t i = 0; i < c->count; i++) c->area[i] = fminf(c->area[i], 3 * (float)mean);
    c->soft_sq = 0.5f * (float)mean; /* 1 / d^2 grows without bound for near points; set by trial */
}

static npg_status find_neighbours(npg_sided_cloud *c)
{
    npg_kdtree *tree;
    size_t n = c->count;
    c->index = npg_arena_take(&c->arena, n, NPG_NEIGHBOURS * sizeof *c->index);
    c->area = npg_arena_take(&c->arena, n, sizeof *c->area);
    c->winding = npg_arena_take(&c->arena, n, sizeof *c->winding);
    float *dist_sq = npg_arena_take(&c->arena, n, NPG_NEIGHBOURS * sizeof *dist_sq);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_kdtree_open(&tree, c->points, n));
    npg_status status = npg_kdtree_nearest(tree, c->index, dist_sq, c->points, n, NPG_NEIGHBOURS, 0);
    if (!status) set_areas(c, dist_sq);
    npg_kdtree_close(&tree);
    return status;
}

static int surest_first(const void *left, const void *right)
{
    const npg_link *a = left, *b = right;
    float x = fabsf(a->agreement), y = fabsf(b->agreement);
    if (x != y) return x > y ? -1 : 1;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

static npg_status make_links(npg_sided_cloud *c)
{
    c->links = npg_arena_take(&c->arena, c->count, NPG_NEIGHBOURS * sizeof *c->links);
    NPG_TRY(npg_arena_status(&c->arena));
    c->link_count = 0;
    for (uint32_t i = 0; i < c->count; i++)
        for (size_t k = 0; k < NPG_NEIGHBOURS; k++) {
            uint32_t j = c->index[NPG_NEIGHBOURS * (size_t)i + k];
            if (j == UINT32_MAX || j == i) continue;
            c->links[c->link_count++] = (npg_link){i, j, agreement(c, i, j)};
        }
    qsort(c->links, c->link_count, sizeof *c->links, surest_first);
    return NPG_OK;
}

/* ---- whole npg_sided_cloud, single points ---- */

static double total_winding(const npg_sided_cloud *c)
{
    double sum = 0;
    for (size_t i = 0; i < c->count; i++) sum += (double)c->area[i] * (double)c->winding[i];
    return sum;
}

static npg_status face_out(npg_sided_cloud *c)
{
    NPG_TRY(npg_sided_winding(c));
    if (total_winding(c) >= 0) return NPG_OK;
    for (size_t i = 0; i < c->count; i++) turn_normal(c, i);
    for (size_t i = 0; i < c->count; i++) c->winding[i] = -c->winding[i];
    return NPG_OK;
}

/* What neighbours and winding number say about one point's side: negative means the other. */
static double vote(const npg_sided_cloud *c, uint32_t i)
{
    double sum = 0, weight = 0;
    for (size_t k = 0; k < NPG_NEIGHBOURS; k++) {
        uint32_t j = c->index[NPG_NEIGHBOURS * (size_t)i + k];
        if (j == UINT32_MAX || j == i) continue;
        double a = (double)agreement(c, i, j);
        sum += a * fabs(a);
        weight += fabs(a);
    }
    double winding = 2 * (double)c->winding[i]; /* 1 on a surface that faces out */
    return (weight > 0 ? sum / weight : 0) + WINDING_WEIGHT * fmax(-1, fmin(1, winding));
}

/* Turn single points that their surroundings vote against, until none is left; was_turned: which in all. */
static void turn_points(npg_sided_cloud *c, uint8_t *was_turned)
{
    memset(was_turned, 0, c->count);
    for (int round = 0; round < POINT_ROUNDS; round++) {
        size_t turned = 0;
        double bar = round < 3 ? -0.5 : round < 6 ? -0.25 : 0; /* the clear cases first; set by trial */
        for (uint32_t i = 0; i < c->count; i++)
            if (vote(c, i) < bar) {
                turn_normal(c, i);
                was_turned[i] ^= 1;
                turned++;
            }
        if (!turned && bar >= 0) break;
    }
}

static size_t list_turned(uint32_t *list, const uint8_t *was_turned, size_t n)
{
    size_t count = 0;
    for (uint32_t i = 0; i < n; i++)
        if (was_turned[i]) list[count++] = i;
    return count;
}

/* Single points against their surroundings, and the sign of the whole. */
static npg_status settle_points(npg_sided_cloud *c)
{
    size_t count = 1;
    uint8_t *was_turned = npg_arena_take(&c->arena, c->count, 1);
    uint32_t *list = npg_arena_take(&c->arena, c->count, sizeof *list);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(npg_sided_winding(c));
    for (int round = 0; round < NPG_SIDE_ROUNDS && count; round++) {
        turn_points(c, was_turned);
        count = list_turned(list, was_turned, c->count);
        if (count) NPG_TRY(npg_sided_rewind(c, list, count));
    }
    return face_out(c);
}

/* Sides from directions alone. */
static npg_status orient_from_nothing(npg_sided_cloud *c)
{
    /* Of the agreement that holds a patch together: large patches first, then their parts; set by trial. */
    static const float sure[] = {0.3f, 0.6f, 0.8f, 0.92f};
    uint32_t *patch_of = npg_arena_take(&c->arena, c->count, sizeof *patch_of);
    NPG_TRY(make_links(c));
    NPG_TRY(npg_sided_grow_tree(c));
    NPG_TRY(face_out(c));
    for (size_t i = 0; i < sizeof sure / sizeof *sure; i++) {
        NPG_TRY(npg_sided_patches(patch_of, c, NULL, sure[i]));
        NPG_TRY(npg_sided_turn_patches(c, patch_of, 0));
    }
    return settle_points(c);
}

/* ---- given sides ---- */

/* Points whose given side is not the one they would get from nothing are in doubt; sides stay as given. */
static npg_status find_doubts(uint8_t *in_doubt, float *given, npg_sided_cloud *c)
{
    size_t n = c->count;
    memcpy(given, c->normals, n * 3 * sizeof *given);
    NPG_TRY(orient_from_nothing(c));
    for (size_t i = 0; i < n; i++)
        in_doubt[i] = memcmp(given + 3 * i, c->normals + 3 * i, 3 * sizeof *given) != 0;
    memcpy(c->normals, given, n * 3 * sizeof *given);
    c->is_wound = false;
    return NPG_OK;
}

/* Keep given sides unless a whole patch, or then a single point, is clearly on the wrong one: points whose
 * side comes out differently when it is found from nothing are in doubt, and are turned in patches. */
static npg_status orient_from_given(npg_sided_cloud *c)
{
    float *given = npg_arena_take(&c->arena, c->count, 3 * sizeof *given);
    uint32_t *patch_of = npg_arena_take(&c->arena, c->count, sizeof *patch_of);
    uint8_t *in_doubt = npg_arena_take(&c->arena, c->count, 1);
    NPG_TRY(npg_arena_status(&c->arena));
    NPG_TRY(face_out(c));
    NPG_TRY(find_doubts(in_doubt, given, c));
    NPG_TRY(npg_sided_patches(patch_of, c, in_doubt, 0.5f));
    NPG_TRY(npg_sided_turn_patches(c, patch_of, GIVEN_TRUST));
    return settle_points(c);
}

/* How well the sides fit together, larger is better: agreement of neighbours less the misfit of the winding
 * number. */
static npg_status score_of(double *score, npg_sided_cloud *c)
{
    double lost = 0, area = 0, votes = 0;
    NPG_TRY(npg_sided_winding(c));
    for (uint32_t i = 0; i < c->count; i++) {
        lost += (double)c->area[i] * winding_misfit(c->winding[i]);
        area += (double)c->area[i];
        votes += vote(c, i);
    }
    *score = votes / (double)c->count - lost / area;
    return NPG_OK;
}

static npg_status orient_core(npg_sided_cloud *c, bool from_given, double *score)
{
    c->arena.purpose = NPG_FOR_FRAMES;
    npg_status status = find_neighbours(c);
    if (!status) status = from_given ? orient_from_given(c) : orient_from_nothing(c);
    if (!status && score) status = score_of(score, c);
    npg_arena_release(&c->arena);
    return status;
}

/* ---- large clouds: a core is oriented, the rest follows ---- */

/* `count` of n points, spread by index: clouds come in scan or random order, and either is spread over the
 * surface. */
static void list_core(uint32_t *from, size_t count, size_t n)
{
    for (size_t i = 0; i < count; i++) from[i] = (uint32_t)npg_spread_index(i, count, n);
}

/* Turn a normal to the side that the core points around it agree on. */
static void follow_neighbours(float *normal, const float *core_normals, const uint32_t *index,
                              const float *dist_sq)
{
    float sum = 0;
    for (size_t k = 0; k < FOLLOWED; k++) {
        float along = npg_vec3_dotf(normal, core_normals + 3 * (size_t)index[k]);
        /* Near points and clear agreement count more; 1e-37: a core point is at distance 0 itself, and other
         * distances are as small as the capture (NPG_SIDE_MIN). */
        sum += along * fabsf(along) / (dist_sq[k] + 1e-37f);
    }
    for (size_t a = 0; a < 3 && sum < 0; a++) normal[a] = -normal[a];
}

/* Every other point takes the side its nearest core points agree on. */
static npg_status follow_core(float *all_normals, const float *all_points, size_t n, const float *points,
                              const float *normals, size_t core_count)
{
    enum { BATCH = 4096 };
    npg_kdtree *tree = NULL;
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    uint32_t *index = npg_arena_take(&scratch, BATCH, FOLLOWED * sizeof *index);
    float *dist_sq = npg_arena_take(&scratch, BATCH, FOLLOWED * sizeof *dist_sq);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_kdtree_open(&tree, points, core_count);
    for (size_t first = 0; first < n && !status; first += BATCH) {
        size_t count = n - first < BATCH ? n - first : BATCH;
        status = npg_kdtree_nearest(tree, index, dist_sq, all_points + 3 * first, count, FOLLOWED, 0);
        for (size_t i = 0; i < count && !status; i++)
            follow_neighbours(all_normals + 3 * (first + i), normals, index + FOLLOWED * i,
                              dist_sq + FOLLOWED * i);
    }
    npg_kdtree_close(&tree);
    npg_arena_release(&scratch);
    return status;
}

/* Without given sides: a spanning tree over neighbours, surest agreement first, then whole patches and single
 * points by the winding number, then the sign of the whole.  *score says how well the sides fit together. */
static npg_status orient(float *normals, double *score, const float *points, size_t n, bool from_given)
{
    npg_sided_cloud whole = {.count = n, .points = points, .normals = normals};
    if (n < 4) return NPG_OK; /* no closed surface has fewer */
    if (n <= CORE_MAX) return orient_core(&whole, from_given, score);
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    float *core_points = npg_arena_take(&scratch, CORE_MAX, 3 * sizeof *core_points);
    float *core_normals = npg_arena_take(&scratch, CORE_MAX, 3 * sizeof *core_normals);
    uint32_t *from = npg_arena_take(&scratch, CORE_MAX, sizeof *from);
    npg_status status = npg_arena_status(&scratch);
    if (!status) list_core(from, CORE_MAX, n);
    if (!status) npg_rows_gather(core_points, points, from, CORE_MAX);
    if (!status) npg_rows_gather(core_normals, normals, from, CORE_MAX);
    npg_sided_cloud core = {.count = CORE_MAX, .points = core_points, .normals = core_normals};
    if (!status) status = orient_core(&core, from_given, score);
    if (!status) status = follow_core(normals, points, n, core_points, core_normals, CORE_MAX);
    npg_arena_release(&scratch);
    return status;
}

/* ---- several numbers of neighbours ---- */

static const int trial_neighbours[] = {10, 12, 16, 24}; /* see normals.h for what they trade */
enum { TRIALS = sizeof trial_neighbours / sizeof *trial_neighbours };

typedef struct trials {     /* of the same points with several numbers of neighbours */
    float *normals[TRIALS]; /* count x 3 each */
    double score[TRIALS];
    const float *points; /* count x 3 */
    size_t count, parts;
} trials;

static npg_status open_trials(trials *t, npg_arena *scratch, const float *points, size_t count)
{
    *t = (trials){.points = points, .count = count, .parts = npg_parallel_parts(TRIALS, 1, TRIALS)};
    for (size_t i = 0; i < TRIALS; i++) t->normals[i] = npg_arena_take(scratch, count, 3 * sizeof(float));
    return npg_arena_status(scratch);
}

static npg_status orient_share(void *user, size_t part)
{
    trials *t = user;
    for (size_t i = part; i < TRIALS; i += t->parts)
        NPG_TRY(orient(t->normals[i], &t->score[i], t->points, t->count, false));
    return NPG_OK;
}

/* Orient all and say which has the best score. */
static npg_status run_trials(trials *t, size_t *best)
{
    NPG_TRY(npg_parallel(orient_share, t, t->parts));
    *best = 0;
    for (size_t i = 1; i < TRIALS; i++)
        if (t->score[i] > t->score[*best]) *best = i;
    return NPG_OK;
}

/* The core (of a small cloud all points) decides on the number of neighbours, and all others are estimated with
 * that one alone. */
npg_status npg_normals_make(float *normals, const float *points, size_t n)
{
    trials t;
    size_t best, count = n < CORE_MAX ? n : CORE_MAX;
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    float *core = npg_arena_take(&scratch, count, 3 * sizeof *core);
    uint32_t *from = npg_arena_take(&scratch, count, sizeof *from);
    npg_status status = open_trials(&t, &scratch, core, count);
    if (!status) {
        list_core(from, count, n);
        npg_rows_gather(core, points, from, count);
        status = npg_normals_estimate_at(t.normals, from, count, points, n, trial_neighbours, TRIALS);
    }
    if (!status) status = run_trials(&t, &best);
    if (!status && count == n) memcpy(normals, t.normals[best], n * 3 * sizeof *normals);
    if (!status && count < n) status = npg_normals_estimate(normals, points, n, trial_neighbours[best]);
    if (!status && count < n) status = follow_core(normals, points, n, core, t.normals[best], count);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_normals_mend(float *normals, size_t *flipped, const float *points, size_t n)
{
    float *before;
    *flipped = 0;
    NPG_TRY(npg_alloc_array(&before, NPG_FOR_FRAMES, n, 3 * sizeof *before));
    memcpy(before, normals, n * 3 * sizeof *before);
    npg_status status = orient(normals, NULL, points, n, true);
    for (size_t i = 0; i < n; i++)
        *flipped += memcmp(before + 3 * i, normals + 3 * i, 3 * sizeof *before) != 0;
    npg_release(&before);
    return status;
}
