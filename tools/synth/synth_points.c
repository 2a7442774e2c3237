/* Synthetic captures: from an exact surface to the points a scanner would have seen. */
#include "tools/synth/synth.h"

#include <math.h>
#include <string.h>

#include "pipeline/frame_box.h"
#include "pipeline/random.h"

/* Keys of the random streams of a frame. */
enum { FOR_SAMPLES = 1, FOR_COUNT, FOR_NOISE, FOR_OUTLIERS, FOR_HOLES, FOR_CHOICE };

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

static npg_status add_point(npg_scanned *points, const double pos[3], const double normal[3])
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
    npg_bounds box = npg_bounds_of(points->pos, points->count);
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

/* ---- a ring of depth cameras around the body ---- */

/* At half the diagonal's height above the middle, turned to the middle. */
npg_synth_camera npg_synth_camera_of_ring(const npg_scan *capture, int64_t i)
{
    /* Far enough that the whole body is in the picture; at two heights, so that tops of limbs are seen. */
    const double distance = 1.3 * capture->diagonal, lift = i % 2 ? 0.10 : 0.35;
    double angle = 2 * M_PI * (double)i / (double)capture->cameras;
    int64_t height = capture->height ? capture->height : capture->width;
    int64_t side = height < capture->width ? height : capture->width;
    npg_synth_camera c = {.width = capture->width, .height = height, .focal = 0.95 * (double)side};
    double ahead[3] = {-sin(angle), -lift, -cos(angle)}, length = npg_vec3_length(ahead);
    for (int k = 0; k < 3; k++) {
        c.ahead[k] = ahead[k] / length;
        c.eye[k] = capture->centre[k] - distance * c.ahead[k];
    }
    c.right[0] = -cos(angle);
    c.right[2] = sin(angle);
    npg_vec3_cross(c.up, c.right, c.ahead);
    return c;
}

/* From the eye to the point at a depth behind a pixel. */
static void look_through(double out[3], const npg_synth_camera *c, int64_t at, double depth)
{
    double x = ((double)(at % c->width) + 0.5 - 0.5 * (double)c->width) / c->focal;
    double y = ((double)(at / c->width) + 0.5 - 0.5 * (double)c->height) / c->focal;
    for (int k = 0; k < 3; k++) out[k] = depth * (c->ahead[k] + x * c->right[k] + y * c->up[k]);
}

npg_status npg_synth_look(npg_ray_hit *hits, const npg_surface *surface, const npg_synth_camera *c)
{
    npg_ray *rays;
    size_t pixels = (size_t)(c->width * c->height);
    NPG_TRY(npg_alloc_array(&rays, NPG_FOR_FRAMES, pixels, sizeof *rays));
    for (size_t at = 0; at < pixels; at++) {
        double direction[3];
        look_through(direction, c, (int64_t)at, 1);
        rays[at].t_max = INFINITY;
        for (int k = 0; k < 3; k++) {
            rays[at].origin[k] = (float)c->eye[k];
            rays[at].direction[k] = (float)direction[k];
        }
    }
    npg_status status = npg_surface_rays(surface, hits, rays, pixels, 0);
    npg_release(&rays);
    return status;
}

/* The surface point behind every pixel that sees a front side, with noise along its ray. */
static npg_status add_seen_points(npg_scanned *points, const npg_ray_hit *hits, const npg_synth_camera *c,
                                  const npg_mesh *mesh, double noise, npg_random *random)
{
    for (int64_t at = 0; at < c->width * c->height; at++) {
        double pos[3], normal[3];
        if (hits[at].face == UINT32_MAX || hits[at].is_back) continue;
        look_through(pos, c, at, (double)hits[at].t + (noise > 0 ? noise * npg_random_gauss(random) : 0));
        for (int k = 0; k < 3; k++) pos[k] += c->eye[k];
        npg_face_normal(normal, mesh->vert_pos, mesh->faces + 3 * (size_t)hits[at].face);
        NPG_TRY(add_point(points, pos, normal));
    }
    return NPG_OK;
}

/* All surface points that the ring sees, one per pixel, in the order of cameras and pixels. */
static npg_status see_points(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh,
                             uint64_t frame)
{
    npg_surface *surface = NULL;
    npg_ray_hit *hits = NULL;
    npg_random random = npg_random_stream(capture->seed, frame, NPG_FOR_CAMERAS);
    npg_status status =
        npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    for (int64_t i = 0; i < capture->cameras && !status; i++) {
        npg_synth_camera c = npg_synth_camera_of_ring(capture, i);
        if (!hits)
            status = npg_alloc_array(&hits, NPG_FOR_FRAMES, (size_t)(c.width * c.height), sizeof *hits);
        if (!status) status = npg_synth_look(hits, surface, &c);
        if (!status)
            status =
                add_seen_points(points, hits, &c, mesh, 0.01 * capture->noise * capture->diagonal, &random);
    }
    npg_surface_close(&surface);
    npg_release(&hits);
    return status;
}

/* ---- a frame ---- */

npg_status npg_scan_frame(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh, uint64_t frame)
{
    npg_random random = npg_random_stream(capture->seed, frame, FOR_COUNT);
    size_t count = (size_t)capture->point_count;
    if (capture->vary) count = count / 2 + (size_t)npg_random_below(&random, count - count / 2 + 1);
    points->count = 0;
    if (capture->cameras) {
        NPG_TRY(see_points(points, capture, mesh, frame));
        if (!points->count) return npg_error(NPG_BAD_INPUT, "frame %d: no camera sees the body", (int)frame);
        cut_holes(points, capture, frame);
        choose(points, count, npg_random_stream(capture->seed, frame, FOR_CHOICE));
    } else {
        NPG_TRY(make_room(points, count));
        points->count = count;
        NPG_TRY(
            npg_mesh_sample(points->pos, points->normals, mesh, count, capture->seed, frame, FOR_SAMPLES));
        cut_holes(points, capture, frame);
        if (capture->noise > 0) add_noise(points, capture, frame);
    }
    if (capture->outliers > 0 && points->count) add_outliers(points, capture, frame);
    return NPG_OK;
}
