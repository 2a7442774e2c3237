/* A body for tests: a trunk and two legs, capsules, whose feet can touch.  Points lie on the union's surface,
 * as a scanner would see it. */
#ifndef NPG_TEST_LEGS_H
#define NPG_TEST_LEGS_H

#include <math.h>
#include <string.h>

#include "pipeline/chunk.h"

#define LEGS_POINTS 3000

typedef struct test_capsule {
    double a[3], b[3], radius;
} test_capsule;

static inline void legs_at(test_capsule out[3], double feet)
{
    out[0] = (test_capsule){{-0.45, 0.7, 0}, {0.45, 0.7, 0}, 0.2};
    out[1] = (test_capsule){{-0.45, 0.65, 0}, {-feet, -0.6, 0}, 0.15};
    out[2] = (test_capsule){{0.45, 0.65, 0}, {feet, -0.6, 0}, 0.15};
}

/* Distance of p from a capsule's axis, and the direction away from it. */
static inline double legs_axis_dist(const test_capsule *c, const double p[3], double away[3])
{
    double along = 0, length_sq = 0, dist = 0;
    for (int i = 0; i < 3; i++) {
        along += (p[i] - c->a[i]) * (c->b[i] - c->a[i]);
        length_sq += (c->b[i] - c->a[i]) * (c->b[i] - c->a[i]);
    }
    along = fmin(1, fmax(0, along / length_sq));
    for (int i = 0; i < 3; i++) {
        away[i] = p[i] - c->a[i] - along * (c->b[i] - c->a[i]);
        dist += away[i] * away[i];
    }
    dist = sqrt(dist);
    for (int i = 0; i < 3; i++) away[i] /= fmax(dist, 1e-12);
    return dist;
}

static inline double legs_random(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (double)(*state >> 11) / 9007199254740992.0;
}

/* Points evenly over the union: thrown into a thin shell around each capsule, then put onto its surface. */
static inline npg_status legs_frame(npg_frame *frame, double feet, uint64_t seed)
{
    test_capsule body[3];
    legs_at(body, feet);
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, LEGS_POINTS, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, LEGS_POINTS, 3 * sizeof(float)));
    while (frame->point_count < LEGS_POINTS) {
        double p[3], n[3], other[3];
        p[0] = 2 * legs_random(&seed) - 1;
        p[1] = 1.9 * legs_random(&seed) - 0.85;
        p[2] = 0.6 * legs_random(&seed) - 0.3;
        for (int c = 0; c < 3 && frame->point_count < LEGS_POINTS; c++) {
            double dist = legs_axis_dist(&body[c], p, n), q[3];
            if (fabs(dist - body[c].radius) > 0.04) continue;
            for (int i = 0; i < 3; i++) q[i] = p[i] + (body[c].radius - dist) * n[i];
            bool inside = false;
            for (int k = 0; k < 3; k++)
                inside |= k != c && legs_axis_dist(&body[k], q, other) < body[k].radius;
            if (inside) continue;
            for (int i = 0; i < 3; i++) {
                frame->pos_local[3 * frame->point_count + (size_t)i] = (float)q[i];
                frame->normals[3 * frame->point_count + (size_t)i] = (float)n[i];
            }
            frame->point_count++;
        }
    }
    return NPG_OK;
}

#endif
