/* Judge: a surface followed through the sampled frames, and what held-out points say of it. */
#include "reference/reference.h"

#include <math.h>

#include "geometry/geometry.h"

/* Times the other's figure, which is a tenth worse: tests/bed/decisions.md, "The judge". */
#define CLEARLY 0.91

/* Coarse: what a finer one forgives shows. */
static const npg_tracker_settings judge_tracking = {
    .nodes = 150, .samples = 800, .steps = 8, .stiffness = 0.01, .along = 0.1};

/* Before one depth camera, whose images show what is forgiven: tests/bed/decisions.md, "The judge". */
static const npg_tracker_settings side_tracking = {
    .nodes = 400, .samples = 2000, .steps = 12, .stiffness = 0.006, .along = 0.001};

struct npg_judging {
    npg_arena arena;
    npg_judge_settings settings;
    const npg_candidate_clouds *clouds;
    const npg_candidate_cloud *own; /* the frame that the surface was made from */
    const npg_mesh *mesh;
    npg_judgement judgement;
    double tau_sq; /* of the points' spacing: farther is no worse */
    npg_surface *surface;
    float *normals;   /* V x 3: of the posed surface                    */
    double *areas;    /* V: a third of those of the faces around        */
    float *dist_sq;   /* V: to the nearest point                        */
    uint32_t *near;   /* V */
    uint8_t *is_seen; /* V */
    npg_visible visible;
};

/* One camera sees a side that seldom is the whole body's: what points say of its detail is more than what they say of a
 * limb that it lacks.  So there counts what its images call wrong, as the verdict has it. */
bool npg_judge_is_by_images(const npg_candidate_cloud *cloud)
{
    return cloud->space && cloud->sensor_count == 1;
}

/* ---- both directions ---- */

static npg_status points_off(double *mean, const npg_judging *j, const npg_candidate_cloud *cloud)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    size_t n = cloud->held_count;
    npg_surface_hit *hits = npg_arena_take(&scratch, n, sizeof *hits);
    npg_status status = npg_arena_status(&scratch);
    double sum = 0;
    if (!status) status = npg_surface_closest_near(j->surface, hits, cloud->held, n, NULL, 1);
    for (size_t i = 0; i < n && !status; i++) sum += fmin(1, (double)hits[i].dist_sq / j->tau_sq);
    *mean = n ? sum / (double)n : 0;
    if (!status && npg_judge_is_by_images(cloud))
        *mean = npg_free_space_lost_share(cloud->space, cloud->held, hits, n);
    npg_arena_release(&scratch);
    return status;
}

/* Towards the sensor from far enough before a held-out point that its own surface is behind. */
static void aim_at(npg_ray *ray, const npg_judging *j, const float sensor[3], const float point[3])
{
    double length = 0;
    for (int a = 0; a < 3; a++) {
        ray->origin[a] = point[a];
        ray->direction[a] = sensor[a] - point[a];
        length += (double)ray->direction[a] * (double)ray->direction[a];
    }
    ray->t_min = (float)fmin(1, sqrt(j->tau_sq / length));
    ray->t_max = 1;
}

/* Some sensor saw each point: no surface stands between it and all of them. */
static npg_status points_behind(double *share, const npg_judging *j, const npg_candidate_cloud *cloud)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    size_t n = cloud->held_count, behind = 0;
    bool is_asked = false;
    *share = 0;
    if (!cloud->sensor_count || !n) return NPG_OK;
    npg_ray *rays = npg_arena_take(&scratch, n, sizeof *rays);
    npg_ray_hit *hits = npg_arena_take(&scratch, n, sizeof *hits);
    uint8_t *is_free = npg_arena_take(&scratch, n, 1);
    npg_status status = npg_arena_status(&scratch);
    for (size_t s = 0; s < cloud->sensor_count && !status; s++) {
        const float *sensor = cloud->sensors + 3 * s;
        if (!isfinite(sensor[0] + sensor[1] + sensor[2])) continue;
        is_asked = true;
        for (size_t i = 0; i < n; i++) aim_at(&rays[i], j, sensor, cloud->held + 3 * i);
        status = npg_surface_rays(j->surface, hits, rays, n, 1);
        for (size_t i = 0; i < n && !status; i++) is_free[i] |= hits[i].face == UINT32_MAX;
    }
    for (size_t i = 0; i < n && !status; i++) behind += !is_free[i];
    if (is_asked) *share = (double)behind / (double)n;
    npg_arena_release(&scratch);
    return status;
}

static void spread_areas(const npg_judging *j, const float *vert_unit)
{
    for (size_t v = 0; v < j->mesh->vert_count; v++) j->areas[v] = 0;
    for (size_t f = 0; f < j->mesh->face_count; f++) {
        const uint32_t *face = j->mesh->faces + 3 * f;
        double third = npg_face_area(vert_unit, face) / 3;
        for (int k = 0; k < 3; k++) j->areas[face[k]] += third;
    }
}

/* Of the points that a sensor would have of a place, for its area: what it sees aslant it has few of. */
static double expected(const npg_judging *j, const npg_candidate_cloud *cloud, const float *vert_unit,
                       size_t v)
{
    double most = 0;
    if (!j->is_seen[v]) return 0;
    if (!cloud->sensor_count) return 1;
    for (size_t s = 0; s < cloud->sensor_count; s++) {
        double along = 0, length = 0;
        for (size_t a = 0; a < 3; a++) {
            double way = (double)cloud->sensors[3 * s + a] - (double)vert_unit[3 * v + a];
            along += way * (double)j->normals[3 * v + a];
            length += way * way;
        }
        if (isfinite(length)) most = fmax(most, along / sqrt(length));
    }
    return most;
}

/* To all points, those that were held out among them: fewer would leave gaps.  *seen: of what has points alone. */
static npg_status surface_off(double *mean, double *seen, npg_judging *j, const npg_candidate_cloud *cloud,
                              const float *vert_unit)
{
    size_t v = j->mesh->vert_count;
    double sum = 0, area = 0, seen_sum = 0, seen_area = 0;
    spread_areas(j, vert_unit);
    npg_mesh_vertex_normals(j->normals, vert_unit, v, j->mesh->faces, j->mesh->face_count);
    NPG_TRY(npg_visible_find(&j->visible, j->is_seen, j->surface, cloud->sensors, cloud->sensor_count,
                             vert_unit, NULL, j->normals, v, NPG_SEEN_OFFSET));
    NPG_TRY(npg_points_nearest(j->near, j->dist_sq, cloud->points, cloud->point_count, vert_unit, v, 1));
    for (size_t i = 0; i < v; i++) {
        bool is_nowhere = npg_free_space_is_empty(cloud->space, vert_unit + 3 * i);
        double weight = j->areas[i] * (is_nowhere ? 1 : expected(j, cloud, vert_unit, i));
        double off = weight * (is_nowhere ? 1 : fmin(1, (double)j->dist_sq[i] / j->tau_sq));
        sum += off;
        area += weight;
        if (off < weight) seen_sum += off;
        if (off < weight) seen_area += weight;
    }
    *seen = seen_area > 0 ? seen_sum / seen_area : 0;
    *mean = area > 0 ? sum / area : 1;
    return NPG_OK;
}

/* Share of the surface where images show that nothing is. */
static double nowhere(const npg_judging *j, const npg_candidate_cloud *cloud, const float *vert_unit)
{
    double empty = 0, area = 0;
    spread_areas(j, vert_unit);
    for (size_t v = 0; v < j->mesh->vert_count; v++) {
        area += j->areas[v];
        if (npg_free_space_is_empty(cloud->space, vert_unit + 3 * v)) empty += j->areas[v];
    }
    return area > 0 ? empty / area : 1;
}

/* *own: of what has points there. */
static npg_status judge_frame(double *figure, double *own, npg_judging *j, const npg_candidate_cloud *cloud,
                              const float *vert_unit)
{
    double points, surface, seen, behind;
    NPG_TRY(points_off(&points, j, cloud));
    if (npg_judge_is_by_images(cloud)) {
        *figure = *own = points + 2 * nowhere(j, cloud, vert_unit);
        return NPG_OK;
    }
    NPG_TRY(surface_off(&surface, &seen, j, cloud, vert_unit));
    NPG_TRY(points_behind(&behind, j, cloud));
    *figure = points + surface + behind;
    *own = points + seen + behind;
    return NPG_OK;
}

npg_status npg_judging_see(void *user, const npg_candidate_cloud *cloud, const float *vert_unit)
{
    npg_judging *j = user;
    npg_judgement *out = &j->judgement;
    double figure, own;
    if (j->settings.should_stop && j->settings.should_stop(j->settings.user))
        return npg_error(NPG_STOPPED, "stopped while a reference was judged");
    NPG_TRY(npg_surface_move(j->surface, vert_unit));
    NPG_TRY(judge_frame(&figure, &own, j, cloud, vert_unit));
    if (cloud == j->own) out->own = own;
    out->of_frame[cloud - j->clouds->list] = figure;
    out->mean += (figure - out->mean) / (double)++out->count;
    return NPG_OK;
}

/* ---- the whole ---- */

static npg_status open_arrays(npg_judging *j)
{
    size_t v = j->mesh->vert_count;
    j->normals = npg_arena_take(&j->arena, v, 3 * sizeof *j->normals);
    j->areas = npg_arena_take(&j->arena, v, sizeof *j->areas);
    j->dist_sq = npg_arena_take(&j->arena, v, sizeof *j->dist_sq);
    j->near = npg_arena_take(&j->arena, v, sizeof *j->near);
    j->is_seen = npg_arena_take(&j->arena, v, 1);
    npg_visible_open(&j->visible, &j->arena, v);
    NPG_TRY(npg_arena_status(&j->arena));
    return npg_surface_open(&j->surface, j->mesh->vert_pos, v, j->mesh->faces, j->mesh->face_count);
}

npg_status npg_judging_open(npg_judging **out, const npg_candidate_clouds *clouds, size_t at,
                            const npg_mesh *mesh, const npg_judge_settings *settings)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_FIT, sizeof **out));
    npg_judging *j = *out;
    j->settings = *settings;
    j->clouds = clouds;
    j->own = &clouds->list[at];
    j->mesh = mesh;
    j->tau_sq = settings->spacing_unit * settings->spacing_unit;
    for (size_t i = 0; i < NPG_CHOICE_FRAMES; i++) j->judgement.of_frame[i] = (double)NAN;
    npg_status status = open_arrays(j);
    if (status) npg_judging_close(out);
    return status;
}

void npg_judging_close(npg_judging **slot)
{
    if (!*slot) return;
    npg_surface_close(&(*slot)->surface);
    npg_object_close(slot);
}

const npg_judgement *npg_judging_found(const npg_judging *judging)
{
    return &judging->judgement;
}

npg_status npg_judge(npg_judgement *judgement, const npg_candidate_clouds *clouds, size_t at, npg_mesh *mesh,
                     const npg_judge_settings *settings)
{
    npg_judging *j;
    NPG_TRY(npg_judging_open(&j, clouds, at, mesh, settings));
    const npg_tracker_settings *tracking = npg_judge_is_by_images(j->own) ? &side_tracking : &judge_tracking;
    npg_status status = settings->in_own_alone
                            ? npg_judging_see(j, j->own, mesh->vert_pos)
                            : npg_candidate_follow(clouds, at, mesh, tracking, npg_judging_see, j);
    *judgement = j->judgement;
    npg_judging_close(&j);
    return status;
}

double npg_judged_against(const npg_judgement *one, const npg_judgement *other)
{
    double mean = 0, squares = 0;
    size_t count = 0;
    for (size_t i = 0; i < NPG_CHOICE_FRAMES; i++) {
        double more = one->of_frame[i] - other->of_frame[i], before = mean;
        if (isnan(more)) continue;
        mean += (more - mean) / (double)++count; /* Welford */
        squares += (more - before) * (more - mean);
    }
    if (count < 3) return 0;
    double error = sqrt(squares / (double)(count - 1) / (double)count);
    return error > 0 ? mean / error : 0;
}

bool npg_judged_clearly(const npg_judgement *one, const npg_judgement *other)
{
    return one->mean < CLEARLY * other->mean;
}

bool npg_judged_least(const npg_judgement *one)
{
    return !(one->own < CLEARLY * one->mean);
}

bool npg_judged_better(const npg_judgement *one, const npg_judgement *other)
{
    return npg_judged_against(one, other) < -2 && npg_judged_clearly(one, other);
}

bool npg_judged_worse(const npg_judgement *one, const npg_judgement *other)
{
    return npg_judged_against(one, other) > 2;
}
