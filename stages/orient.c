/* Orient: which side of a surface is out, decided for all points of a cloud together.
 *
 * Neighbours say how their sides go together: reflected at the plane halfway between two points, a normal
 * comes to lie on its neighbour's where the surface curves like a circle, and the two sides of a thin sheet
 * come to agree as opposite.  The winding number says which side is out: the solid angle that the whole
 * oriented cloud covers, seen from a point on it, is positive where the point's surroundings face out.
 *
 * Based on: H. Hoppe et al., Surface Reconstruction from Unorganized Points, 1992 (spanning tree); A.
 * Jacobson et al., Robust Inside-Outside Segmentation Using Generalized Winding Numbers, 2013. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kdtree.h"
#include "memory.h"
#include "normals.h"

#define NEIGHBOURS     12
#define CORE_MAX       8000 /* points that are oriented together: pairs of them are looked at */
#define PATCH_ROUNDS   4
#define POINT_ROUNDS   30
#define MEND_ROUNDS    6
#define DOUBT_ROUNDS   4
#define GIVEN_TRUST    0.08 /* gain without which a patch keeps the side it was given */
#define BORDER_WEIGHT  0.1  /* of a patch's border beside its winding number */
#define MISFIT_WEIGHT  4.0
#define WINDING_WEIGHT 0.6 /* of the winding number beside the neighbours' vote, for single points */

typedef struct link { /* two neighbours and how well their sides agree, -1..1 */
    uint32_t a, b;
    float agreement;
} link;

typedef struct cloud { /* the points that are oriented together */
    size_t count;
    const float *points;
    float *normals;
    uint32_t *index;       /* count x NEIGHBOURS, itself among them */
    float *area, *winding; /* count */
    float soft_sq;         /* squared length below which the winding number is softened */
    link *links;           /* link_count, owned */
    size_t link_count;
} cloud;

/* ---- neighbours ---- */

/* n_a . (n_b reflected at the plane between the two points) */
static float agreement(const cloud *c, uint32_t a, uint32_t b)
{
    const float *p = c->points + 3 * (size_t)a, *q = c->points + 3 * (size_t)b;
    const float *m = c->normals + 3 * (size_t)a, *n = c->normals + 3 * (size_t)b;
    float e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    float length_sq = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
    float mn = m[0] * n[0] + m[1] * n[1] + m[2] * n[2];
    if (!(length_sq > 0)) return mn;
    float me = m[0] * e[0] + m[1] * e[1] + m[2] * e[2], ne = n[0] * e[0] + n[1] * e[1] + n[2] * e[2];
    return mn - 2 * me * ne / length_sq;
}

static npg_status find_neighbours(cloud *c)
{
    npg_kdtree *tree = NULL;
    float *dist_sq = NULL;
    npg_status status;
    double mean = 0;
    NPG_TRY(npg_kdtree_open(&tree, c->points, c->count));
    NPG_TRY_OR(done, status,
               npg_alloc_array(&c->index, NPG_FOR_FRAMES, c->count, NEIGHBOURS * sizeof *c->index));
    NPG_TRY_OR(done, status, npg_alloc_array(&c->area, NPG_FOR_FRAMES, c->count, sizeof *c->area));
    NPG_TRY_OR(done, status, npg_alloc_array(&c->winding, NPG_FOR_FRAMES, c->count, sizeof *c->winding));
    NPG_TRY_OR(done, status,
               npg_alloc_array(&dist_sq, NPG_FOR_FRAMES, c->count, NEIGHBOURS * sizeof *dist_sq));
    NPG_TRY_OR(done, status, npg_kdtree_nearest(tree, c->index, dist_sq, c->points, c->count, NEIGHBOURS, 0));
    for (size_t i = 0; i < c->count; i++) {
        size_t last = c->count < NEIGHBOURS ? c->count - 1 : NEIGHBOURS - 1;
        c->area[i] = 3.14159265f * dist_sq[NEIGHBOURS * i + last] / (float)last;
        mean += (double)c->area[i] / (double)c->count;
    }
    /* Far outliers have a large disc around them: no point may outweigh many. */
    for (size_t i = 0; i < c->count; i++) c->area[i] = fminf(c->area[i], 3 * (float)mean);
    c->soft_sq = 0.5f * (float)mean;
done:
    npg_kdtree_close(&tree);
    npg_release(&dist_sq);
    return status;
}

static void close_cloud(cloud *c)
{
    npg_release(&c->index);
    npg_release(&c->area);
    npg_release(&c->winding);
    npg_release(&c->links);
}

static int surest_first(const void *left, const void *right)
{
    const link *a = left, *b = right;
    float x = fabsf(a->agreement), y = fabsf(b->agreement);
    if (x != y) return x > y ? -1 : 1;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

static npg_status make_links(cloud *c)
{
    NPG_TRY(npg_alloc_array(&c->links, NPG_FOR_FRAMES, c->count, NEIGHBOURS * sizeof *c->links));
    c->link_count = 0;
    for (uint32_t i = 0; i < c->count; i++)
        for (size_t k = 0; k < NEIGHBOURS; k++) {
            uint32_t j = c->index[NEIGHBOURS * (size_t)i + k];
            if (j == UINT32_MAX || j == i) continue;
            c->links[c->link_count++] = (link){i, j, agreement(c, i, j)};
        }
    qsort(c->links, c->link_count, sizeof *c->links, surest_first);
    return NPG_OK;
}

/* ---- winding number ---- */

static void turn(cloud *c, size_t i)
{
    for (size_t a = 0; a < 3; a++) c->normals[3 * i + a] = -c->normals[3 * i + a];
}

/* w(p_i) = 1/4pi sum_j A_j (p_j - p_i) . n_j / (|p_j - p_i|^2 + soft^2)^(3/2): about +1/2 on a closed surface
 * that faces out, -1/2 on one that faces in. */
static void find_winding(cloud *c)
{
    for (size_t i = 0; i < c->count; i++) {
        float x = c->points[3 * i], y = c->points[3 * i + 1], z = c->points[3 * i + 2];
        double sum = 0;
        for (size_t first = 0; first < c->count; first += 256) {
            size_t last = first + 256 < c->count ? first + 256 : c->count;
            float part = 0;
            for (size_t j = first; j < last; j++) {
                float dx = c->points[3 * j] - x, dy = c->points[3 * j + 1] - y, dz = c->points[3 * j + 2] - z;
                float d_sq = dx * dx + dy * dy + dz * dz + c->soft_sq;
                float d_n = dx * c->normals[3 * j] + dy * c->normals[3 * j + 1] + dz * c->normals[3 * j + 2];
                part += c->area[j] * d_n / (d_sq * sqrtf(d_sq));
            }
            sum += (double)part;
        }
        c->winding[i] = (float)(sum / 12.566370614359172);
    }
}

static double total_winding(const cloud *c)
{
    double sum = 0;
    for (size_t i = 0; i < c->count; i++) sum += (double)c->area[i] * (double)c->winding[i];
    return sum;
}

/* ---- spanning tree ---- */

typedef struct forest { /* union-find whose members know their side relative to the root */
    uint32_t *parent;
    uint8_t *is_turned; /* against the parent */
} forest;

static uint32_t root_of(const forest *f, uint32_t i, uint8_t *is_turned)
{
    uint8_t turned = 0;
    for (; f->parent[i] != i; i = f->parent[i]) turned ^= f->is_turned[i];
    *is_turned = turned;
    return i;
}

/* The older (lower) root stays, so the result has one form; paths are shortened by hanging i under its root.
 */
static void join(forest *f, const link *l)
{
    uint8_t side_a, side_b;
    uint32_t a = root_of(f, l->a, &side_a), b = root_of(f, l->b, &side_b);
    if (l->a != a) {
        f->parent[l->a] = a;
        f->is_turned[l->a] = side_a;
    }
    if (l->b != b) {
        f->parent[l->b] = b;
        f->is_turned[l->b] = side_b;
    }
    if (a == b) return;
    uint32_t lo = a < b ? a : b, hi = a < b ? b : a;
    f->parent[hi] = lo;
    f->is_turned[hi] = side_a ^ side_b ^ (l->agreement < 0);
}

static npg_status open_forest(forest *f, size_t count)
{
    f->is_turned = NULL;
    NPG_TRY(npg_alloc_array(&f->parent, NPG_FOR_FRAMES, count, sizeof *f->parent));
    for (uint32_t k = 0; k < count; k++) f->parent[k] = k;
    return npg_alloc(&f->is_turned, NPG_FOR_FRAMES, count);
}

static void close_forest(forest *f)
{
    npg_release(&f->parent);
    npg_release(&f->is_turned);
}

/* Sides by the tree, the surest links first. */
static npg_status grow_tree(cloud *c)
{
    forest f = {NULL, NULL};
    uint8_t turned;
    npg_status status = open_forest(&f, c->count);
    for (size_t i = 0; i < c->link_count && !status; i++) join(&f, &c->links[i]);
    for (uint32_t k = 0; k < c->count && !status; k++) {
        root_of(&f, k, &turned);
        if (turned) turn(c, k);
    }
    close_forest(&f);
    return status;
}

/* Patches: points whose sides, as they are now, agree with a neighbour's by more than `sure`; patch_of is the
 * lowest point of the patch.  Only points of `among` (NULL: all), UINT32_MAX for the others. */
static npg_status find_patches(uint32_t *patch_of, const cloud *c, const uint8_t *among, float sure)
{
    forest f = {NULL, NULL};
    uint8_t turned;
    npg_status status = open_forest(&f, c->count);
    for (uint32_t i = 0; i < c->count && !status; i++)
        for (size_t k = 0; k < NEIGHBOURS && (!among || among[i]); k++) {
            uint32_t j = c->index[NEIGHBOURS * (size_t)i + k];
            if (j == UINT32_MAX || (among && !among[j]) || !(agreement(c, i, j) > sure)) continue;
            join(&f, &(link){i, j, 1});
        }
    for (uint32_t k = 0; k < c->count && !status; k++)
        patch_of[k] = !among || among[k] ? root_of(&f, k, &turned) : UINT32_MAX;
    close_forest(&f);
    return status;
}

/* ---- patches, whole cloud, single points ---- */

typedef struct patches { /* sets of points that can only be turned together */
    uint32_t *members;   /* point indices, patch after patch */
    size_t *first;       /* patch_count + 1 */
    size_t count;
    float *change; /* of the winding number at every point, room for one patch at a time */
} patches;

static void close_patches(patches *p)
{
    npg_release(&p->members);
    npg_release(&p->first);
    npg_release(&p->change);
}

/* From the lowest member of each point's patch; points with UINT32_MAX belong to none. */
static npg_status open_patches(patches *p, const uint32_t *patch_of, size_t n)
{
    uint32_t *number = NULL;
    npg_status status;
    NPG_TRY_OR(done, status, npg_alloc_array(&p->members, NPG_FOR_FRAMES, n, sizeof *p->members));
    NPG_TRY_OR(done, status, npg_alloc_array(&p->first, NPG_FOR_FRAMES, n + 2, sizeof *p->first));
    NPG_TRY_OR(done, status, npg_alloc_array(&p->change, NPG_FOR_FRAMES, n, sizeof *p->change));
    NPG_TRY_OR(done, status, npg_alloc_array(&number, NPG_FOR_FRAMES, n, sizeof *number));
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] == i) number[i] = (uint32_t)p->count++;
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] != UINT32_MAX) p->first[number[patch_of[i]] + 2]++;
    for (size_t k = 2; k < p->count + 2; k++) p->first[k] += p->first[k - 1];
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] != UINT32_MAX) p->members[p->first[number[patch_of[i]] + 1]++] = (uint32_t)i;
done:
    npg_release(&number);
    if (status) close_patches(p);
    return status;
}

/* How far the winding number at a point is from that of a surface that faces out; spikes count no more
 * than 2. */
static double misfit(float winding)
{
    double off = fmax(-2, fmin(2, (double)winding - 0.5));
    return off * off;
}

/* p->change = what turning patch k adds to the winding number everywhere.  Returns the change of the misfit,
 * summed over all points by area, per area of the patch. */
static double try_patch(const cloud *c, const patches *p, size_t k)
{
    double sum = 0, area = 0;
    for (size_t i = 0; i < c->count; i++) {
        const float *at = c->points + 3 * i;
        float part = 0;
        for (size_t m = p->first[k]; m < p->first[k + 1]; m++) {
            size_t j = p->members[m];
            float dx = c->points[3 * j] - at[0], dy = c->points[3 * j + 1] - at[1],
                  dz = c->points[3 * j + 2] - at[2];
            float d_sq = dx * dx + dy * dy + dz * dz + c->soft_sq;
            float d_n = dx * c->normals[3 * j] + dy * c->normals[3 * j + 1] + dz * c->normals[3 * j + 2];
            part += c->area[j] * d_n / (d_sq * sqrtf(d_sq));
        }
        p->change[i] = -2 * part / 12.5663706f;
        sum += (double)c->area[i] * (misfit(c->winding[i] + p->change[i]) - misfit(c->winding[i]));
    }
    for (size_t m = p->first[k]; m < p->first[k + 1]; m++) area += (double)c->area[p->members[m]];
    return sum / area;
}

/* How well patch k agrees with its surroundings, -1..1. */
static double border_of(const cloud *c, const patches *p, size_t k, const uint32_t *patch_of)
{
    double sum = 0, weight = 0;
    for (size_t m = p->first[k]; m < p->first[k + 1]; m++)
        for (size_t n = 0; n < NEIGHBOURS; n++) {
            uint32_t i = p->members[m], j = c->index[NEIGHBOURS * (size_t)i + n];
            if (j == UINT32_MAX || patch_of[j] == patch_of[i]) continue;
            double a = (double)agreement(c, i, j);
            sum += a * fabs(a);
            weight += fabs(a);
        }
    return weight > 0 ? sum / weight : 0;
}

/* Turn patch after patch where that brings the winding number nearer to that of a surface that faces out, by
 * more than the bar. */
static npg_status turn_patches(cloud *c, const uint32_t *patch_of, double bar)
{
    patches p = {0};
    size_t turned = 1;
    NPG_TRY(open_patches(&p, patch_of, c->count));
    find_winding(c);
    for (int round = 0; round < PATCH_ROUNDS && turned; round++) {
        turned = 0;
        for (size_t k = 0; k < p.count; k++) {
            if (2 * (p.first[k + 1] - p.first[k]) > c->count)
                continue; /* the whole's sign is decided apart */
            double border = border_of(c, &p, k, patch_of), gain = -try_patch(c, &p, k);
            if (gain - BORDER_WEIGHT * border <= bar) continue;
            for (size_t m = p.first[k]; m < p.first[k + 1]; m++) turn(c, p.members[m]);
            for (size_t i = 0; i < c->count; i++) c->winding[i] += p.change[i];
            turned++;
        }
    }
    close_patches(&p);
    return NPG_OK;
}

static void face_out(cloud *c)
{
    find_winding(c);
    if (total_winding(c) >= 0) return;
    for (size_t i = 0; i < c->count; i++) turn(c, i);
    for (size_t i = 0; i < c->count; i++) c->winding[i] = -c->winding[i];
}

/* What neighbours and winding number say about one point's side: negative means the other. */
static double vote(const cloud *c, uint32_t i)
{
    double sum = 0, weight = 0;
    for (size_t k = 0; k < NEIGHBOURS; k++) {
        uint32_t j = c->index[NEIGHBOURS * (size_t)i + k];
        if (j == UINT32_MAX || j == i) continue;
        double a = (double)agreement(c, i, j);
        sum += a * fabs(a);
        weight += fabs(a);
    }
    double winding = 2 * (double)c->winding[i];
    return (weight > 0 ? sum / weight : 0) + WINDING_WEIGHT * fmax(-1, fmin(1, winding));
}

/* Turn single points that their surroundings vote against, until none is left. */
static size_t turn_points(cloud *c)
{
    size_t all = 0;
    for (int round = 0; round < POINT_ROUNDS; round++) {
        size_t turned = 0;
        double bar = round < 3 ? -0.5 : round < 6 ? -0.25 : 0; /* the clear cases first */
        for (uint32_t i = 0; i < c->count; i++)
            if (vote(c, i) < bar) {
                turn(c, i);
                turned++;
            }
        all += turned;
        if (!turned && bar >= 0) break;
    }
    return all;
}

/* Single points against their surroundings, and the sign of the whole. */
static void settle_points(cloud *c)
{
    for (int round = 0; round < MEND_ROUNDS; round++) {
        find_winding(c);
        if (!turn_points(c)) break;
    }
    face_out(c);
}

/* Sides from directions alone. */
static npg_status orient_from_nothing(cloud *c)
{
    static const float sure[] = {0.3f, 0.6f, 0.8f, 0.92f}; /* large patches first, then their parts */
    uint32_t *patch_of;
    NPG_TRY(npg_alloc_array(&patch_of, NPG_FOR_FRAMES, c->count, sizeof *patch_of));
    npg_status status = make_links(c);
    if (!status) status = grow_tree(c);
    if (!status) face_out(c);
    for (size_t i = 0; i < sizeof sure / sizeof *sure && !status; i++) {
        status = find_patches(patch_of, c, NULL, sure[i]);
        if (!status) status = turn_patches(c, patch_of, 0);
    }
    if (!status) settle_points(c);
    npg_release(&patch_of);
    return status;
}

/* ---- given sides ---- */

/* Keep given sides unless a whole patch, or then a single point, is clearly on the wrong one. */
static npg_status orient_from_given(cloud *c)
{
    float *given = NULL;
    uint8_t *in_doubt = NULL;
    uint32_t *patch_of = NULL;
    npg_status status;
    size_t n = c->count;
    face_out(c);
    NPG_TRY_OR(done, status, npg_alloc_array(&given, NPG_FOR_FRAMES, n, 3 * sizeof *given));
    NPG_TRY_OR(done, status, npg_alloc_array(&patch_of, NPG_FOR_FRAMES, n, sizeof *patch_of));
    NPG_TRY_OR(done, status, npg_alloc(&in_doubt, NPG_FOR_FRAMES, n));
    memcpy(given, c->normals, n * 3 * sizeof *given);
    NPG_TRY_OR(done, status, orient_from_nothing(c));
    for (size_t i = 0; i < n; i++)
        in_doubt[i] = memcmp(given + 3 * i, c->normals + 3 * i, 3 * sizeof *given) != 0;
    memcpy(c->normals, given, n * 3 * sizeof *given);
    NPG_TRY_OR(done, status, find_patches(patch_of, c, in_doubt, 0.5f));
    NPG_TRY_OR(done, status, turn_patches(c, patch_of, GIVEN_TRUST));
    settle_points(c);
done:
    npg_release(&given);
    npg_release(&in_doubt);
    npg_release(&patch_of);
    return status;
}

/* How well the sides fit together, larger is better: agreement of neighbours less the misfit of the winding
 * number.  Its weight is such that a limb turned inside out costs more than rough normals. */
static double score_of(cloud *c)
{
    double lost = 0, area = 0, votes = 0;
    find_winding(c);
    for (uint32_t i = 0; i < c->count; i++) {
        lost += (double)c->area[i] * misfit(c->winding[i]);
        area += (double)c->area[i];
        votes += vote(c, i);
    }
    return votes / (double)c->count - MISFIT_WEIGHT * lost / area;
}

static npg_status orient_core(cloud *c, bool from_given, double *score)
{
    npg_status status = find_neighbours(c);
    if (!status) status = from_given ? orient_from_given(c) : orient_from_nothing(c);
    if (!status && score) *score = score_of(c);
    close_cloud(c);
    return status;
}

/* ---- large clouds: a core is oriented, the rest follows ---- */

/* Evenly spread by index: clouds come in scan or random order, both spread over the surface. */
static void take_core(float *points, float *normals, uint32_t *from, size_t core_count,
                      const float *all_points, const float *all_normals, size_t n)
{
    for (size_t i = 0; i < core_count; i++) {
        from[i] = (uint32_t)((uint64_t)n * i / core_count);
        memcpy(points + 3 * i, all_points + 3 * (size_t)from[i], 3 * sizeof *points);
        memcpy(normals + 3 * i, all_normals + 3 * (size_t)from[i], 3 * sizeof *normals);
    }
}

/* Every other point takes the side its nearest core points agree on. */
static npg_status follow_core(float *all_normals, const float *all_points, size_t n, const float *points,
                              const float *normals, size_t core_count)
{
    enum { NEAR = 5, BATCH = 4096 };
    npg_kdtree *tree = NULL;
    uint32_t *index = NULL;
    float *dist_sq = NULL;
    npg_status status;
    NPG_TRY(npg_kdtree_open(&tree, points, core_count));
    NPG_TRY_OR(done, status, npg_alloc_array(&index, NPG_FOR_FRAMES, BATCH, NEAR * sizeof *index));
    NPG_TRY_OR(done, status, npg_alloc_array(&dist_sq, NPG_FOR_FRAMES, BATCH, NEAR * sizeof *dist_sq));
    for (size_t first = 0; first < n; first += BATCH) {
        size_t count = n - first < BATCH ? n - first : BATCH;
        NPG_TRY_OR(done, status,
                   npg_kdtree_nearest(tree, index, dist_sq, all_points + 3 * first, count, NEAR, 0));
        for (size_t i = 0; i < count; i++) {
            float *m = all_normals + 3 * (first + i), sum = 0;
            for (size_t k = 0; k < NEAR; k++) {
                const float *o = normals + 3 * (size_t)index[NEAR * i + k];
                float along = m[0] * o[0] + m[1] * o[1] + m[2] * o[2];
                sum += along * fabsf(along) / (dist_sq[NEAR * i + k] + 1e-20f);
            }
            for (size_t a = 0; a < 3 && sum < 0; a++) m[a] = -m[a];
        }
    }
done:
    npg_kdtree_close(&tree);
    npg_release(&index);
    npg_release(&dist_sq);
    return status;
}

static npg_status orient(float *normals, double *score, const float *points, size_t n, bool from_given)
{
    float *core_points = NULL, *core_normals = NULL;
    uint32_t *from = NULL;
    npg_status status;
    cloud whole = {.count = n, .points = points, .normals = normals};
    if (n < 4) return NPG_OK;
    if (n <= CORE_MAX) return orient_core(&whole, from_given, score);
    NPG_TRY_OR(done, status, npg_alloc_array(&core_points, NPG_FOR_FRAMES, CORE_MAX, 3 * sizeof(float)));
    NPG_TRY_OR(done, status, npg_alloc_array(&core_normals, NPG_FOR_FRAMES, CORE_MAX, 3 * sizeof(float)));
    NPG_TRY_OR(done, status, npg_alloc_array(&from, NPG_FOR_FRAMES, CORE_MAX, sizeof *from));
    take_core(core_points, core_normals, from, CORE_MAX, points, normals, n);
    cloud core = {.count = CORE_MAX, .points = core_points, .normals = core_normals};
    NPG_TRY_OR(done, status, orient_core(&core, from_given, score));
    status = follow_core(normals, points, n, core_points, core_normals, CORE_MAX);
done:
    npg_release(&core_points);
    npg_release(&core_normals);
    npg_release(&from);
    return status;
}

npg_status npg_normals_orient(float *normals, double *score, const float *points, size_t point_count)
{
    *score = 0;
    return orient(normals, score, points, point_count, false);
}

npg_status npg_normals_make(float *normals, const float *points, size_t n)
{
    static const int neighbours[] = {10, 12, 16, 24};
    float *trial;
    double best = -INFINITY;
    npg_status status = NPG_OK;
    NPG_TRY(npg_alloc_array(&trial, NPG_FOR_FRAMES, n, 3 * sizeof *trial));
    for (size_t i = 0; i < sizeof neighbours / sizeof *neighbours && !status; i++) {
        double score;
        status = npg_normals_estimate(trial, points, n, neighbours[i]);
        if (!status) status = npg_normals_orient(trial, &score, points, n);
        if (status || !(score > best)) continue;
        best = score;
        memcpy(normals, trial, n * 3 * sizeof *normals);
    }
    npg_release(&trial);
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
