/* Sights: points of a few frames on the grids of their images, and the point that another sensor has for one.
 *
 * A point is looked up where it projects to in the other's image (projective association): between the four
 * pixels around it lies the other's surface, at the density of its image.  A pair is a symmetric
 * point-to-plane one: the distance is taken along the normals of both, which curved surfaces do not bias.
 *
 * Based on: Blais, Levine, Registering multiview range data to create 3D computer objects, 1995 (projective
 * association); Rusinkiewicz, A symmetric objective function for ICP, 2019. */
#include "ingest/rig/rig_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/parallel.h"

#define POINTS_MAX 30000 /* of a sight; images with more are thinned to every 2nd, 3rd ... row and column */
#define AGREE      0.8   /* cosine of two normals of one surface                                          */
#define FACING     0.3   /* cosine of normal and ray: seen flatter, depths and normals are poor           */

const npg_rig_sight *npg_rig_sights_of(const npg_rig_sights *s, size_t f, size_t sensor)
{
    return &s->of[f * s->sensor_count + sensor];
}

/* ---- reading ---- */

static void turn(double out[3], const double pose[12], const double v[3])
{
    for (size_t r = 0; r < 3; r++) out[r] = npg_vec3_dot(pose + 4 * r, v);
}

static void get3(double out[3], const float *from)
{
    for (size_t a = 0; a < 3; a++) out[a] = (double)from[a];
}

/* The least step at which no more than POINTS_MAX points are left. */
static size_t step_for(size_t count)
{
    size_t step = 1;
    while (count / (step * step) > POINTS_MAX) step++;
    return step;
}

static npg_status reserve(npg_rig_sight *sight, size_t count, size_t height)
{
    sight->row_count = (height + sight->step - 1) / sight->step;
    sight->pos = npg_arena_take(&sight->arena, count, 3 * sizeof(float));
    sight->normals = npg_arena_take(&sight->arena, count, 3 * sizeof(float));
    sight->columns = npg_arena_take(&sight->arena, count, sizeof *sight->columns);
    sight->rows = npg_arena_take(&sight->arena, sight->row_count + 1, sizeof *sight->rows);
    return npg_arena_status(&sight->arena);
}

/* Points come row by row. */
static npg_status fill_sight(npg_rig_sight *sight, const npg_depth_points *points, const npg_camera *camera)
{
    size_t step = sight->step = step_for(points->count), row = 0;
    NPG_TRY(reserve(sight, points->count, camera->height));
    for (size_t i = 0; i < points->count; i++) {
        size_t x = points->pixels[i] % camera->width, y = points->pixels[i] / camera->width,
               to = sight->count;
        if (x % step || y % step) continue;
        while (row < y / step) sight->rows[++row] = (uint32_t)to;
        memcpy(sight->pos + 3 * to, points->pos + 3 * i, 3 * sizeof(float));
        memcpy(sight->normals + 3 * to, points->normals + 3 * i, 3 * sizeof(float));
        sight->columns[to] = (uint16_t)(x / step);
        sight->count++;
    }
    while (row < sight->row_count) sight->rows[++row] = (uint32_t)sight->count;
    return NPG_OK;
}

typedef struct reading {
    npg_rig_sights *sights;
    npg_rig *rig;
    const size_t *frames;
    size_t at;
} reading;

static npg_status read_sight(void *user, size_t s)
{
    const reading *r = user;
    npg_rig_sight *sight = &r->sights->of[r->at * r->sights->sensor_count + s];
    const npg_rig_shot *shot = npg_rig_shot_of(r->rig, r->frames[r->at], s);
    npg_depth_points points;
    if (!shot) return NPG_OK;
    npg_status status = npg_depth_points_read(&points, r->rig, s, shot);
    sight->arena.purpose = NPG_FOR_FILES;
    if (!status) {
        npg_rig_pose(r->rig, sight->pose, s, shot);
        sight->is_there = true;
        sight->point_count = points.count;
        status = fill_sight(sight, &points, &r->rig->sensors[s].camera);
    }
    npg_arena_release(&points.arena);
    return status == NPG_BAD_INPUT ? NPG_OK : status; /* who reads the frame itself reports it */
}

static void measure(npg_rig_sights *s)
{
    size_t count = 0;
    for (size_t v = 0; v < s->frame_count * s->sensor_count; v++) {
        const npg_rig_sight *sight = &s->of[v];
        for (size_t i = 0; i < sight->count; i++) {
            double p[3], world[3];
            get3(p, sight->pos + 3 * i);
            npg_pose_apply(world, sight->pose, p);
            for (size_t a = 0; a < 3; a++) s->centre[a] += world[a];
            s->depth += p[2];
        }
        count += sight->count;
    }
    for (size_t a = 0; a < 3 && count; a++) s->centre[a] /= (double)count;
    if (count) s->depth /= (double)count;
}

npg_status npg_rig_sights_open(npg_rig_sights *sights, npg_rig *rig, const size_t *frames, size_t count)
{
    *sights = (npg_rig_sights){.rig = rig, .frame_count = count, .sensor_count = rig->sensor_count};
    reading r = {.sights = sights, .rig = rig, .frames = frames};
    npg_status status =
        npg_alloc_array(&sights->of, NPG_FOR_FILES, count * rig->sensor_count, sizeof *sights->of);
    for (; r.at < count && !status; r.at++) status = npg_parallel(read_sight, &r, rig->sensor_count);
    if (status)
        npg_rig_sights_close(sights);
    else
        measure(sights);
    return status;
}

void npg_rig_sights_close(npg_rig_sights *s)
{
    for (size_t v = 0; s->of && v < s->frame_count * s->sensor_count; v++) npg_arena_release(&s->of[v].arena);
    npg_release(&s->of);
}

/* ---- looking up ---- */

/* The points at column x and x + 1 of a row, the first of them; SIZE_MAX where they are not both there. */
static size_t two_of_row(const npg_rig_sight *s, size_t row, size_t x)
{
    size_t lo = s->rows[row], hi = s->rows[row + 1], end = hi;
    while (lo < hi) {
        size_t middle = (lo + hi) / 2;
        if (s->columns[middle] < x)
            lo = middle + 1;
        else
            hi = middle;
    }
    return lo + 1 < end && s->columns[lo] == x && s->columns[lo + 1] == x + 1 ? lo : SIZE_MAX;
}

/* Place and normal of a sight's surface at a pixel, in its axes; false where it has no surface there. */
static bool surface_at(double pos[3], double normal[3], const npg_rig_sight *s, const double pixel[2])
{
    double u = pixel[0] / (double)s->step, v = pixel[1] / (double)s->step, column = floor(u), row = floor(v);
    if (!(column >= 0 && column < UINT16_MAX && row >= 0 && row + 1 < (double)s->row_count)) return false;
    size_t top = two_of_row(s, (size_t)row, (size_t)column);
    size_t bottom = top == SIZE_MAX ? SIZE_MAX : two_of_row(s, (size_t)row + 1, (size_t)column);
    if (bottom == SIZE_MAX) return false;
    double right = u - column, below = v - row;
    const size_t at[4] = {top, top + 1, bottom, bottom + 1};
    const double weight[4] = {(1 - right) * (1 - below), right * (1 - below), (1 - right) * below,
                              right * below};
    for (size_t a = 0; a < 3; a++) pos[a] = normal[a] = 0;
    for (size_t k = 0; k < 4; k++)
        for (size_t a = 0; a < 3; a++) {
            pos[a] += weight[k] * (double)s->pos[3 * at[k] + a];
            normal[a] += weight[k] * (double)s->normals[3 * at[k] + a];
        }
    return npg_vec3_make_unit(normal);
}

static bool is_facing(const double pos[3], const double normal[3])
{
    return -npg_vec3_dot(pos, normal) > FACING * npg_vec3_length(pos);
}

bool npg_rig_sight_match(npg_rig_sight_pair *pair, const npg_rig_sight *a, size_t i, const double pose_a[12],
                         const npg_rig_sight *b, const npg_camera *camera_b, const double pose_b[12],
                         double reach)
{
    double own[3], own_normal[3], inverse[12], in_b[3], pixel[2], pos[3], normal[3], d[3];
    get3(own, a->pos + 3 * i);
    get3(d, a->normals + 3 * i);
    if (!is_facing(own, d)) return false;
    turn(own_normal, pose_a, d);
    npg_pose_apply(pair->own, pose_a, own);
    npg_pose_invert(inverse, pose_b);
    npg_pose_apply(in_b, inverse, pair->own);
    if (!npg_camera_project(camera_b, pixel, in_b) || !surface_at(pos, normal, b, pixel)) return false;
    if (!is_facing(pos, normal)) return false;
    npg_pose_apply(pair->other, pose_b, pos);
    turn(pair->normal, pose_b, normal);
    if (npg_vec3_dot(pair->normal, own_normal) < AGREE) return false;
    for (size_t k = 0; k < 3; k++) pair->normal[k] += own_normal[k];
    npg_vec3_make_unit(pair->normal);
    npg_vec3_sub(d, pair->own, pair->other);
    pair->off = npg_vec3_dot(pair->normal, d);
    return fabs(pair->off) <= reach;
}

/* ---- distances ---- */

void npg_rig_bins_add(npg_rig_bins *bins, double size)
{
    double bin = size / bins->reach * NPG_RIG_BINS;
    bins->count[bin < NPG_RIG_BINS ? (size_t)bin : NPG_RIG_BINS - 1]++;
}

double npg_rig_bins_deviation(const npg_rig_bins *bins)
{
    uint64_t all = 0, below = 0;
    for (size_t b = 0; b < NPG_RIG_BINS; b++) all += bins->count[b];
    for (size_t b = 0; b < NPG_RIG_BINS && all; b++) {
        if (2 * (below + bins->count[b]) >= all) {
            double share = (0.5 * (double)all - (double)below) / (double)bins->count[b];
            return 1.4826 * bins->reach * ((double)b + share) / NPG_RIG_BINS;
        }
        below += bins->count[b];
    }
    return 0;
}
