/* Sides: what orient.c (the order of the steps) and sides.c (tree, patches, winding number) share: a
 * npg_sided_cloud whose normals have a direction each, and are to be turned to the side that is out. */
#ifndef NPG_SIDES_H
#define NPG_SIDES_H

#include <math.h>
#include <stdbool.h>

#include "geometry/vec3.h"
#include "pipeline/memory.h"

#define NPG_SIDE_NEIGHBOURS 12 /* of a point, itself among them; set by trial */

typedef struct npg_link { /* two neighbours and how well their sides agree, -1..1 */
    uint32_t a, b;
    float agreement;
} npg_link;

typedef struct npg_sided_cloud { /* the points that are oriented together */
    npg_arena arena;             /* of what is said to be its own, and of all scratch until it is released */
    size_t count;
    const float *points;
    float *normals;
    uint32_t *index;       /* count x NPG_SIDE_NEIGHBOURS, itself among them; its own */
    float *area, *winding; /* count; its own */
    bool is_wound;         /* winding is that of the normals as they are */
    float soft_sq;         /* squared length below which the winding number is softened */
    npg_link *links;       /* link_count; its own */
    size_t link_count;
} npg_sided_cloud;

/* n_a . (n_b reflected at the plane halfway between the two points): 1 where the two lie on a circle and face
 * the same way, -1 where one of them is turned over. */
static inline float agreement(const npg_sided_cloud *c, uint32_t a, uint32_t b)
{
    const float *p = c->points + 3 * (size_t)a, *q = c->points + 3 * (size_t)b;
    const float *m = c->normals + 3 * (size_t)a, *n = c->normals + 3 * (size_t)b;
    float e[3] = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
    float length_sq = npg_vec3_dotf(e, e), mn = npg_vec3_dotf(m, n);
    if (!(length_sq > 0)) return mn;
    float me = npg_vec3_dotf(m, e), ne = npg_vec3_dotf(n, e);
    return mn - 2 * me * ne / length_sq;
}

static inline void turn_normal(npg_sided_cloud *c, size_t i)
{
    for (size_t a = 0; a < 3; a++) c->normals[3 * i + a] = -c->normals[3 * i + a];
}

/* How far the winding number at a point is from that of a surface that faces out;
 * spikes count no more than 2. */
static inline double winding_misfit(float winding)
{
    double off = fmax(-2, fmin(2, (double)winding - 0.5));
    return off * off;
}

/* The winding number at every point:
 * w(p_i) = 1/4pi sum_j A_j (p_j - p_i) . n_j / (|p_j - p_i|^2 + soft^2)^(3/2): about +1/2 on a closed surface
 * that faces out, -1/2 on one that faces in.  All pairs of points are summed, and only where c->is_wound says
 * that it has to be.  NPG_MEMORY. */
npg_status npg_sided_winding(npg_sided_cloud *c);

/* The same after these points (ascending) were turned, from what it was before.  NPG_MEMORY. */
npg_status npg_sided_rewind(npg_sided_cloud *c, const uint32_t *turned, size_t count);

/* Sides by the spanning tree of c->links, the surest links first. */
npg_status npg_sided_grow_tree(npg_sided_cloud *c);

/* Patches: points whose sides, as they are now, agree with a neighbour's by more than `sure`; patch_of is the
 * lowest point of the patch.  Only points of `among` (NULL: all), UINT32_MAX for the others. */
npg_status npg_sided_patches(uint32_t *patch_of, const npg_sided_cloud *c, const uint8_t *among, float sure);

/* Turn patch after patch where that brings the winding number nearer to that of a surface that faces out, by
 * more than the bar. */
npg_status npg_sided_turn_patches(npg_sided_cloud *c, const uint32_t *patch_of, double bar);

#endif
