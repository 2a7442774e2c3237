/* Synthetic captures: from an exact surface to the points a scanner would have seen. */
#include "tools/synth/synth.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
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
    return npg_mesh_sample(points->pos, points->normals, mesh, count, capture->seed, frame, FOR_SAMPLES);
}

/* ---- a ring of depth cameras around the body, each with its own depth buffer ---- */

#define PI 3.14159265358979323846

typedef npg_synth_camera camera;
typedef npg_synth_picture picture;

/* The i-th of a ring at half the diagonal's height above the middle, turned to the middle. */
camera npg_synth_camera_of_ring(const npg_scan *capture, int64_t i)
{
    /* Far enough that the whole body is in the picture; at two heights, so that tops of limbs are seen. */
    const double distance = 1.3 * capture->diagonal, lift = i % 2 ? 0.10 : 0.35;
    double angle = 2 * PI * (double)i / (double)capture->cameras;
    int64_t height = capture->height ? capture->height : capture->width;
    int64_t side = height < capture->width ? height : capture->width;
    camera c = {.width = capture->width, .height = height, .focal = 0.95 * (double)side};
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

/* Pixel coordinates (x, y) and depth (z) of a point. */
static void project(double out[3], const camera *c, const float *p)
{
    double from_eye[3] = {(double)p[0] - c->eye[0], (double)p[1] - c->eye[1], (double)p[2] - c->eye[2]};
    out[2] = npg_vec3_dot(from_eye, c->ahead);
    out[0] = 0.5 * (double)c->width + c->focal * npg_vec3_dot(from_eye, c->right) / out[2];
    out[1] = 0.5 * (double)c->height + c->focal * npg_vec3_dot(from_eye, c->up) / out[2];
}

static double cross_2d(const double a[3], const double b[3], double x, double y)
{
    return (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0]);
}

/* Draw one face into the depth buffer; pixel centres, 1 / depth is linear on the picture. */
static void draw_face(picture *out, const camera *c, const npg_mesh *mesh, uint32_t f)
{
    double v[3][3], lo[2], hi[2];
    for (int k = 0; k < 3; k++) {
        project(v[k], c, mesh->vert_pos + 3 * (size_t)mesh->faces[3 * (size_t)f + (size_t)k]);
        if (v[k][2] <= 0) return;
    }
    double area = cross_2d(v[0], v[1], v[2][0], v[2][1]);
    if (area == 0) return;
    for (int k = 0; k < 2; k++) {
        lo[k] = fmax(ceil(fmin(fmin(v[0][k], v[1][k]), v[2][k]) - 0.5), 0);
        hi[k] = fmin(floor(fmax(fmax(v[0][k], v[1][k]), v[2][k]) - 0.5),
                     (double)((k ? c->height : c->width) - 1));
    }
    for (int64_t y = (int64_t)lo[1]; y <= (int64_t)hi[1]; y++)
        for (int64_t x = (int64_t)lo[0]; x <= (int64_t)hi[0]; x++) {
            double px = (double)x + 0.5, py = (double)y + 0.5;
            double a = cross_2d(v[1], v[2], px, py) / area, b = cross_2d(v[2], v[0], px, py) / area;
            if (a < 0 || b < 0 || a + b > 1) continue;
            double depth = 1 / (a / v[0][2] + b / v[1][2] + (1 - a - b) / v[2][2]);
            size_t at = (size_t)(y * c->width + x);
            if (depth >= out->depth[at]) continue;
            out->depth[at] = depth;
            out->face[at] = f;
        }
}

picture npg_synth_picture_take(npg_arena *arena, const camera *c)
{
    size_t pixels = (size_t)(c->width * c->height);
    return (picture){npg_arena_take(arena, pixels, sizeof(double)),
                     npg_arena_take(arena, pixels, sizeof(uint32_t))};
}

void npg_synth_draw(picture *out, const camera *c, const npg_mesh *mesh)
{
    for (int64_t p = 0; p < c->width * c->height; p++) out->depth[p] = INFINITY;
    for (size_t f = 0; f < mesh->face_count; f++) draw_face(out, c, mesh, (uint32_t)f);
}

void npg_synth_unproject(double pos[3], const camera *c, int64_t at, double depth)
{
    double x = ((double)(at % c->width) + 0.5 - 0.5 * (double)c->width) / c->focal;
    double y = ((double)(at / c->width) + 0.5 - 0.5 * (double)c->height) / c->focal;
    for (int k = 0; k < 3; k++) pos[k] = c->eye[k] + depth * (c->ahead[k] + x * c->right[k] + y * c->up[k]);
}

bool npg_synth_is_front(double normal[3], const camera *c, const npg_mesh *mesh, uint32_t face,
                        const double pos[3])
{
    double facing = 0;
    npg_face_normal(normal, mesh->vert_pos, mesh->faces + 3 * (size_t)face);
    for (int k = 0; k < 3; k++) facing += normal[k] * (c->eye[k] - pos[k]);
    return facing > 0;
}

/* The surface point behind every pixel that sees a front side, with noise along its ray. */
static npg_status add_seen_points(npg_scanned *points, const picture *seen, const camera *c,
                                  const npg_mesh *mesh, double noise, npg_random *random)
{
    for (int64_t at = 0; at < c->width * c->height; at++) {
        double depth = seen->depth[at], pos[3], normal[3];
        if (isinf(depth)) continue;
        if (noise > 0) depth += noise * npg_random_gauss(random);
        npg_synth_unproject(pos, c, at, depth);
        if (npg_synth_is_front(normal, c, mesh, seen->face[at], pos)) NPG_TRY(add_point(points, pos, normal));
    }
    return NPG_OK;
}

/* All surface points that the ring sees, one per pixel, in the order of cameras and pixels. */
static npg_status see_points(npg_scanned *points, const npg_scan *capture, const npg_mesh *mesh,
                             uint64_t frame)
{
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    npg_random random = npg_random_stream(capture->seed, frame, NPG_FOR_CAMERAS);
    camera first = npg_synth_camera_of_ring(capture, 0);
    picture seen = npg_synth_picture_take(&scratch, &first);
    npg_status status = npg_arena_status(&scratch);
    for (int64_t i = 0; i < capture->cameras && !status; i++) {
        camera c = npg_synth_camera_of_ring(capture, i);
        npg_synth_draw(&seen, &c, mesh);
        status = add_seen_points(points, &seen, &c, mesh, 0.01 * capture->noise * capture->diagonal, &random);
    }
    npg_arena_release(&scratch);
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
        NPG_TRY(sample_surface(points, capture, mesh, count, frame));
        cut_holes(points, capture, frame);
        if (capture->noise > 0) add_noise(points, capture, frame);
    }
    if (capture->outliers > 0 && points->count) add_outliers(points, capture, frame);
    return NPG_OK;
}
