/* Sides: spanning tree, patches and winding number of a npg_sided_cloud. */
#include "outlier/outlier_internal.h"

#include <string.h>

#include "pipeline/memory.h"
#include "pipeline/parallel.h"

#define BORDER_WEIGHT 0.1         /* of a patch's border beside its winding number; set by trial         */
#define FULL_ANGLE    12.5663706f /* 4 pi: the winding number is a solid angle in units of it            */

/* ---- winding number ---- */

#define LANES 16 /* sums side by side: what a wide processor adds at once */

/* Points and their normals times area, each coordinate by itself, filled up with points without area. */
typedef struct panel {
    float *x, *y, *z, *nx, *ny, *nz; /* in one allocation           */
    size_t padded;                   /* a multiple of LANES          */
} panel;

static npg_status open_panel(panel *p, npg_arena *arena, size_t count_max)
{
    size_t room = (count_max + LANES - 1) / LANES * LANES;
    p->x = npg_arena_take(arena, room, 6 * sizeof(float));
    NPG_TRY(npg_arena_status(arena));
    p->y = p->x + room;
    p->z = p->y + room;
    p->nx = p->z + room;
    p->ny = p->nx + room;
    p->nz = p->ny + room;
    return NPG_OK;
}

/* The points with these indices; NULL: all. */
static void fill_panel(panel *p, const npg_sided_cloud *c, const uint32_t *index, size_t count)
{
    p->padded = (count + LANES - 1) / LANES * LANES;
    for (size_t i = 0; i < p->padded; i++) {
        size_t j = i >= count ? 0 : index ? index[i] : i;
        float area = i < count ? c->area[j] : 0;
        p->x[i] = c->points[3 * j];
        p->y[i] = c->points[3 * j + 1];
        p->z[i] = c->points[3 * j + 2];
        p->nx[i] = area * c->normals[3 * j];
        p->ny[i] = area * c->normals[3 * j + 1];
        p->nz[i] = area * c->normals[3 * j + 2];
    }
}

/* sum_j A_j (p_j - at) . n_j / (|p_j - at|^2 + soft^2)^(3/2). */
NPG_WIDE static float sum_panel(const panel *p, const float *at, float soft_sq)
{
    const float *x = p->x, *y = p->y, *z = p->z, *nx = p->nx, *ny = p->ny, *nz = p->nz;
    float sums[LANES] = {0}, ax = at[0], ay = at[1], az = at[2];
    double all = 0;
    for (size_t first = 0; first < p->padded; first += LANES)
        for (size_t lane = 0; lane < LANES; lane++) {
            size_t j = first + lane;
            float dx = x[j] - ax, dy = y[j] - ay, dz = z[j] - az;
            float d_sq = dx * dx + dy * dy + dz * dz + soft_sq;
            sums[lane] += (dx * nx[j] + dy * ny[j] + dz * nz[j]) / (d_sq * sqrtf(d_sq));
        }
    for (size_t lane = 0; lane < LANES; lane++) all += (double)sums[lane];
    return (float)all;
}

npg_status npg_sided_winding(npg_sided_cloud *c)
{
    panel all;
    if (c->is_wound) return NPG_OK;
    NPG_TRY(open_panel(&all, &c->arena, c->count));
    fill_panel(&all, c, NULL, c->count);
    for (size_t i = 0; i < c->count; i++)
        c->winding[i] = sum_panel(&all, c->points + 3 * i, c->soft_sq) / FULL_ANGLE;
    c->is_wound = true;
    return NPG_OK;
}

npg_status npg_sided_rewind(npg_sided_cloud *c, const uint32_t *turned, size_t count)
{
    panel some;
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    NPG_TRY(open_panel(&some, &scratch, count));
    fill_panel(&some, c, turned, count);
    for (size_t i = 0; i < c->count; i++)
        c->winding[i] += 2 * sum_panel(&some, c->points + 3 * i, c->soft_sq) / FULL_ANGLE;
    npg_arena_release(&scratch);
    return NPG_OK;
}

/* ---- spanning tree ---- */

typedef struct forest { /* union-find whose members know their side relative to the root */
    npg_arena arena;
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

/* The older (lower) root stays, so the result has one form; paths are shortened
 * by hanging i under its root. */
static void join(forest *f, const npg_link *l)
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
    f->arena = (npg_arena){.purpose = NPG_FOR_FRAMES};
    f->parent = npg_arena_take(&f->arena, count, sizeof *f->parent);
    f->is_turned = npg_arena_take(&f->arena, count, 1);
    for (uint32_t k = 0; k < count && f->parent; k++) f->parent[k] = k;
    return npg_arena_status(&f->arena);
}

npg_status npg_sided_grow_tree(npg_sided_cloud *c)
{
    forest f;
    uint8_t turned;
    npg_status status = open_forest(&f, c->count);
    for (size_t i = 0; i < c->link_count && !status; i++) join(&f, &c->links[i]);
    for (uint32_t k = 0; k < c->count && !status; k++) {
        root_of(&f, k, &turned);
        if (turned) turn_normal(c, k);
    }
    c->is_wound = false;
    npg_arena_release(&f.arena);
    return status;
}

npg_status npg_sided_patches(uint32_t *patch_of, const npg_sided_cloud *c, const uint8_t *among, float sure)
{
    forest f;
    uint8_t turned;
    npg_status status = open_forest(&f, c->count);
    for (uint32_t i = 0; i < c->count && !status; i++)
        for (size_t k = 0; k < NPG_NEIGHBOURS && (!among || among[i]); k++) {
            uint32_t j = c->index[NPG_NEIGHBOURS * (size_t)i + k];
            if (j == UINT32_MAX || (among && !among[j]) || !(agreement(c, i, j) > sure)) continue;
            join(&f, &(npg_link){i, j, 1});
        }
    for (uint32_t k = 0; k < c->count && !status; k++)
        patch_of[k] = !among || among[k] ? root_of(&f, k, &turned) : UINT32_MAX;
    npg_arena_release(&f.arena);
    return status;
}

/* ---- patches ---- */

typedef struct patches { /* sets of points that can only be turned together */
    uint32_t *members;   /* point indices, patch after patch */
    size_t *first;       /* patch_count + 1 */
    size_t count;
    float *change; /* of the winding number at every point, room for one patch at a time */
    panel panel;   /* the members of one patch */
} patches;

/* Sort the points by patch (counting sort); number: room for n. */
static void fill_patches(patches *p, uint32_t *number, const uint32_t *patch_of, size_t n)
{
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] == i) number[i] = (uint32_t)p->count++;
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] != UINT32_MAX) p->first[number[patch_of[i]] + 2]++;
    for (size_t k = 2; k < p->count + 2; k++) p->first[k] += p->first[k - 1];
    for (size_t i = 0; i < n; i++)
        if (patch_of[i] != UINT32_MAX) p->members[p->first[number[patch_of[i]] + 1]++] = (uint32_t)i;
}

/* From the lowest member of each point's patch; points with UINT32_MAX belong to none. */
static npg_status open_patches(patches *p, npg_arena *scratch, const uint32_t *patch_of, size_t n)
{
    p->members = npg_arena_take(scratch, n, sizeof *p->members);
    p->first = npg_arena_take(scratch, n + 2, sizeof *p->first);
    p->change = npg_arena_take(scratch, n, sizeof *p->change);
    uint32_t *number = npg_arena_take(scratch, n, sizeof *number);
    NPG_TRY(open_panel(&p->panel, scratch, n));
    fill_patches(p, number, patch_of, n);
    return NPG_OK;
}

/* p->change = what turning patch k over adds to the winding number everywhere.  Returns the change of the
 * misfit, summed over all points by area, per area of the patch. */
static double misfit_change(const npg_sided_cloud *c, patches *p, size_t k)
{
    double sum = 0, area = 0;
    fill_panel(&p->panel, c, p->members + p->first[k], p->first[k + 1] - p->first[k]);
    for (size_t i = 0; i < c->count; i++) {
        p->change[i] = -2 * sum_panel(&p->panel, c->points + 3 * i, c->soft_sq) / FULL_ANGLE;
        sum += (double)c->area[i] *
               (winding_misfit(c->winding[i] + p->change[i]) - winding_misfit(c->winding[i]));
    }
    for (size_t m = p->first[k]; m < p->first[k + 1]; m++) area += (double)c->area[p->members[m]];
    return sum / area;
}

/* How well patch k agrees with its surroundings, -1..1. */
static double border_agreement(const npg_sided_cloud *c, const patches *p, size_t k, const uint32_t *patch_of)
{
    double sum = 0, weight = 0;
    for (size_t m = p->first[k]; m < p->first[k + 1]; m++)
        for (size_t n = 0; n < NPG_NEIGHBOURS; n++) {
            uint32_t i = p->members[m], j = c->index[NPG_NEIGHBOURS * (size_t)i + n];
            if (j == UINT32_MAX || patch_of[j] == patch_of[i]) continue;
            double a = (double)agreement(c, i, j);
            sum += a * fabs(a);
            weight += fabs(a);
        }
    return weight > 0 ? sum / weight : 0;
}

npg_status npg_sided_turn_patches(npg_sided_cloud *c, const uint32_t *patch_of, double bar)
{
    patches p = {0};
    size_t turned = 1;
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    npg_status status = open_patches(&p, &scratch, patch_of, c->count);
    if (!status) status = npg_sided_winding(c);
    for (int round = 0; round < NPG_SIDE_ROUNDS && turned && !status; round++) {
        turned = 0;
        for (size_t k = 0; k < p.count; k++) {
            /* More than half of the points: that is the sign of the whole, which face_out() decides. */
            if (2 * (p.first[k + 1] - p.first[k]) > c->count) continue;
            double border = border_agreement(c, &p, k, patch_of), gain = -misfit_change(c, &p, k);
            if (gain - BORDER_WEIGHT * border <= bar) continue;
            for (size_t m = p.first[k]; m < p.first[k + 1]; m++) turn_normal(c, p.members[m]);
            for (size_t i = 0; i < c->count; i++) c->winding[i] += p.change[i];
            turned++;
        }
    }
    npg_arena_release(&scratch);
    return status;
}
