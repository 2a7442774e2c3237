/* Synthetic captures: from an exact surface to the points a scanner would have seen. */
#include "tools/synth/synth.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/frame_box.h"
#include "pipeline/random.h"

/* Keys of the random streams of a frame. */
enum { FOR_SAMPLES = 1, FOR_COUNT, FOR_NOISE, FOR_OUTLIERS, FOR_HOLES, FOR_CHOICE }; /* and NPG_FOR_CAMERAS */

void npg_scanned_close(npg_scanned *points)
{
    npg_release(&points->pos);
    npg_release(&points->normals);
    *points = (npg_scanned){0};
}

static npg_status make_room(npg_scanned *points, size_t count)
{
    NPG_TRY(npg_grow(&points->pos, &points->room_pos, count, 3 * sizeof(float), NPG_FOR_FRAMES));
    return npg_grow(&points->normals, &points->room_normals, count, 3 * sizeof(float), NPG_FOR_FRAMES);
}

npg_status npg_scanned_add(npg_scanned *points, const double pos[3], const double normal[3])
{
    NPG_TRY(make_room(points, points->count + 1));
    for (size_t k = 0; k < 3; k++) {
        points->pos[3 * points->count + k] = (float)pos[k];
        points->normals[3 * points->count + k] = (float)normal[k];
    }
    points->count++;
    return NPG_OK;
}

static void copy_point(npg_scanned *points, size_t to, size_t from)
{
    memcpy(points->pos + 3 * to, points->pos + 3 * from, 3 * sizeof(float));
    memcpy(points->normals + 3 * to, points->normals + 3 * from, 3 * sizeof(float));
}

/* Keep `count` of the points, drawn evenly, in their order. */
static void choose(npg_scanned *points, size_t count, npg_random random)
{
    size_t kept = 0, left = points->count;
    for (size_t i = 0; i < points->count && kept < count; i++, left--)
        if (npg_random_below(&random, left) < count - kept) copy_point(points, kept++, i);
    points->count = kept;
}

static void cut_holes(npg_scanned *points, const npg_scan *capture, uint64_t frame)
{
    npg_random random = npg_random_stream(capture->seed, frame, FOR_HOLES);
    double radius = 0.06 * capture->diagonal; /* as the help of --holes says */
    for (int64_t hole = 0; hole < capture->holes && points->count; hole++) {
        size_t kept = 0, at = (size_t)npg_random_below(&random, points->count);
        float middle[3];
        memcpy(middle, points->pos + 3 * at, sizeof middle);
        for (size_t i = 0; i < points->count; i++) {
            double dist_sq = 0;
            for (size_t k = 0; k < 3; k++) {
                double d = (double)points->pos[3 * i + k] - (double)middle[k];
                dist_sq += d * d;
            }
            if (dist_sq > radius * radius) copy_point(points, kept++, i);
        }
        points->count = kept;
    }
}

static void add_noise(npg_scanned *points, const npg_scan *capture, uint64_t frame)
{
    npg_random random = npg_random_stream(capture->seed, frame, FOR_NOISE);
    double deviation = 0.01 * capture->noise * capture->diagonal;
    for (size_t i = 0; i < 3 * points->count; i++)
        points->pos[i] = (float)((double)points->pos[i] + deviation * npg_random_gauss(&random));
}

static void add_outliers(npg_scanned *points, const npg_scan *capture, uint64_t frame)
{
    npg_random random = npg_random_stream(capture->seed, frame, FOR_OUTLIERS);
    npg_bounds box = npg_bounds_empty();
    npg_bounds_add_points(&box, points->pos, points->count);
    size_t count = (size_t)llround(0.01 * capture->outliers * (double)points->count);
    for (size_t i = 0; i < count; i++) {
        size_t at = (size_t)npg_random_below(&random, points->count);
        double normal[3], length = 0;
        for (size_t k = 0; k < 3; k++) {
            double middle = 0.5 * (box.lo[k] + box.hi[k]), half = 0.6 * (box.hi[k] - box.lo[k]);
            points->pos[3 * at + k] = (float)(middle + half * (2 * npg_random_real(&random) - 1));
            normal[k] = npg_random_gauss(&random);
            length += normal[k] * normal[k];
        }
        for (size_t k = 0; k < 3; k++) points->normals[3 * at + k] = (float)(normal[k] / sqrt(length));
    }
}

static npg_status sample_surface(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh,
                                 size_t count, uint64_t frame)
{
    NPG_TRY(make_room(points, count));
    points->count = count;
    return npg_mesh_sample(points->pos, points->normals, NULL, mesh, count, capture->seed, frame,
                           FOR_SAMPLES);
}

npg_status npg_scan_frame(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh, uint64_t frame)
{
    npg_random random = npg_random_stream(capture->seed, frame, FOR_COUNT);
    size_t count = (size_t)capture->point_count;
    if (capture->vary) count = count / 2 + (size_t)npg_random_below(&random, count - count / 2 + 1);
    points->count = 0;
    if (capture->cameras) {
        NPG_TRY(npg_cameras_see(points, capture, mesh, frame));
        if (!points->count) return npg_error(NPG_BAD_INPUT, "frame %d: no camera sees the body", (int)frame);
        cut_holes(points, capture, frame);
        choose(points, count, npg_random_stream(capture->seed, frame, FOR_CHOICE));
    } else {
        NPG_TRY(sample_surface(points, capture, mesh, count, frame));
        cut_holes(points, capture, frame);
        if (capture->noise > 0) add_noise(points, capture, frame);
    }
    if (capture->outliers > 0 && points->count) add_outliers(points, capture, frame);
    return NPG_OK;
}
