/* Frame box: the one place where coordinates change. */
#include "pipeline/frame_box.h"

#include <float.h>
#include <math.h>

npg_bounds npg_bounds_empty(void)
{
    return (npg_bounds){{DBL_MAX, DBL_MAX, DBL_MAX}, {-DBL_MAX, -DBL_MAX, -DBL_MAX}};
}

void npg_bounds_add_points(npg_bounds *bounds, const float *points, size_t point_count)
{
    for (size_t i = 0; i < point_count; i++)
        for (int a = 0; a < 3; a++) {
            double x = (double)points[3 * i + (size_t)a];
            if (x < bounds->lo[a]) bounds->lo[a] = x;
            if (x > bounds->hi[a]) bounds->hi[a] = x;
        }
}

npg_bounds npg_bounds_of(const float *points, size_t point_count)
{
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, points, point_count);
    return bounds;
}

void npg_bounds_add(npg_bounds *bounds, const npg_bounds *other)
{
    for (int a = 0; a < 3; a++) {
        bounds->lo[a] = fmin(bounds->lo[a], other->lo[a]);
        bounds->hi[a] = fmax(bounds->hi[a], other->hi[a]);
    }
}

double npg_bounds_diagonal(const npg_bounds *bounds)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        double side = bounds->hi[a] - bounds->lo[a];
        if (side < 0) return 0;
        sum += side * side;
    }
    return sqrt(sum);
}

double npg_bounds_longest(const npg_bounds *bounds)
{
    double longest = 0;
    for (int a = 0; a < 3; a++) longest = fmax(longest, bounds->hi[a] - bounds->lo[a]);
    return longest;
}

void npg_origin_offer(npg_origin *origin, const double world[3])
{
    if (origin->known || !isfinite(world[0] + world[1] + world[2])) return;
    for (int a = 0; a < 3; a++) origin->world[a] = world[a];
    origin->known = true;
}

npg_status npg_frame_box_set(npg_frame_box *box, const npg_origin *origin, const npg_bounds *bounds)
{
    double longest = npg_bounds_longest(bounds);
    for (int a = 0; a < 3; a++) {
        double side = bounds->hi[a] - bounds->lo[a];
        if (!(side >= 0) || !isfinite(side)) return npg_error(NPG_BAD_INPUT, "no frame has a usable point");
        box->origin[a] = origin->world[a];
        box->centre[a] = bounds->lo[a] + side / 2;
    }
    if (!(longest > 0)) return npg_error(NPG_BAD_INPUT, "all points of all frames are in one place");
    if (longest < NPG_SIDE_MIN || longest > NPG_SIDE_MAX)
        return npg_error(
            NPG_BAD_INPUT,
            "the longest side of the box of all points is %g; it must be from %g to %g: the capture has "
            "to be written in another unit",
            longest, NPG_SIDE_MIN, NPG_SIDE_MAX);
    box->scale = NPG_UNIT_EXTENT / (longest / 2);
    box->diagonal = npg_bounds_diagonal(bounds);
    return NPG_OK;
}

void npg_box_local_to_unit(const npg_frame_box *box, float *unit, const float *local, size_t point_count)
{
    for (size_t i = 0; i < 3 * point_count; i++)
        unit[i] = (float)(((double)local[i] - box->centre[i % 3]) * box->scale);
}

void npg_box_unit_to_world(const npg_frame_box *box, double *world, const float *unit, size_t point_count)
{
    for (size_t i = 0; i < 3 * point_count; i++)
        world[i] = (double)unit[i] / box->scale + box->centre[i % 3] + box->origin[i % 3];
}
