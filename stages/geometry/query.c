/* Query: nearest surface point and rays, by Embree on a bounding volume hierarchy that is refitted when the
 * vertices move. */
#include "geometry/geometry.h"

#include <embree3/rtcore.h>
#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "pipeline/memory.h"
#include "pipeline/parallel.h"

#define BATCH_MIN 512 /* fewer queries are not worth a thread; set by trial */

typedef float lanes __attribute__((vector_size(4 * sizeof(float))));
typedef int32_t mask __attribute__((vector_size(4 * sizeof(float))));

struct npg_surface {
    RTCDevice device;
    RTCScene scene;
    RTCGeometry geometry;
    size_t vert_count, face_count;
    float *vert_pos;        /* V x 3 and 16 bytes that Embree may read beyond them */
    uint32_t *faces;        /* F x 3 */
    lanes (*boxes)[2];      /* F: lowest and highest corner of each; the last lane means nothing */
    atomic_ptrdiff_t bytes; /* what Embree holds, as it reports */
};

/* ---- Embree's memory and errors ---- */

static bool on_memory(void *user, ssize_t bytes, bool post)
{
    npg_surface *surface = user;
    (void)post;
    if (npg_memory_count(NPG_FOR_QUERY, bytes)) return false;
    atomic_fetch_add(&surface->bytes, bytes);
    return true;
}

/* The error that Embree has noted for this thread, as our status. */
static npg_status embree_status(const npg_surface *surface, const char *what)
{
    enum RTCError error = rtcGetDeviceError(surface->device);
    if (error == RTC_ERROR_NONE) return NPG_OK;
    if (error == RTC_ERROR_OUT_OF_MEMORY || error == RTC_ERROR_CANCELLED)
        return npg_error(NPG_MEMORY, "no memory for %s (Embree, %zu faces)", what, surface->face_count);
    return npg_error(NPG_FAILED, "Embree failed while %s: error %d", what, (int)error);
}

/* ---- open, move, close ---- */

static npg_status check_vertices(const float *vertices, size_t vert_count)
{
    for (size_t i = 0; i < 3 * vert_count; i++)
        if (!isfinite(vertices[i])) return npg_error(NPG_USAGE, "surface: vertex %zu is not finite", i / 3);
    return NPG_OK;
}

static npg_status check_faces(const uint32_t *faces, size_t face_count, size_t vert_count)
{
    for (size_t i = 0; i < 3 * face_count; i++)
        if (faces[i] >= vert_count)
            return npg_error(NPG_USAGE, "surface: face %zu uses vertex %u of %zu", i / 3, faces[i],
                             vert_count);
    return NPG_OK;
}

/* Of each lane, without a branch: which it is nobody could foresee. */
static inline lanes higher(lanes a, lanes b)
{
    mask is_a = a > b;
    return (lanes)((is_a & (mask)a) | (~is_a & (mask)b));
}

/* A vertex and what lies behind it. */
static inline lanes vertex(const npg_surface *surface, uint32_t v)
{
    lanes at;
    memcpy(&at, surface->vert_pos + 3 * (size_t)v, sizeof at);
    return at;
}

static void set_boxes(npg_surface *surface)
{
    for (size_t f = 0; f < surface->face_count; f++) {
        const uint32_t *corners = surface->faces + 3 * f;
        lanes a = vertex(surface, corners[0]), b = vertex(surface, corners[1]),
              c = vertex(surface, corners[2]);
        surface->boxes[f][0] = -higher(higher(-a, -b), -c);
        surface->boxes[f][1] = higher(higher(a, b), c);
    }
}

static npg_status copy_arrays(npg_surface *surface, const float *vertices, const uint32_t *faces)
{
    size_t v = surface->vert_count, f = surface->face_count;
    NPG_TRY(npg_alloc_array(&surface->vert_pos, NPG_FOR_QUERY, 3 * v + 4, sizeof(float)));
    NPG_TRY(npg_alloc_array(&surface->faces, NPG_FOR_QUERY, f, 3 * sizeof(uint32_t)));
    NPG_TRY(npg_alloc_array(&surface->boxes, NPG_FOR_QUERY, f, sizeof *surface->boxes));
    memcpy(surface->vert_pos, vertices, v * 3 * sizeof(float));
    memcpy(surface->faces, faces, f * 3 * sizeof(uint32_t));
    set_boxes(surface);
    return NPG_OK;
}

static npg_status build(npg_surface *surface)
{
    surface->device = rtcNewDevice(NULL);
    if (!surface->device)
        return npg_error(NPG_FAILED, "Embree gave no device: error %d", (int)rtcGetDeviceError(NULL));
    rtcSetDeviceMemoryMonitorFunction(surface->device, on_memory, surface);
    surface->scene = rtcNewScene(surface->device);
    surface->geometry = rtcNewGeometry(surface->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!surface->scene || !surface->geometry) return embree_status(surface, "making a scene");
    rtcSetSceneFlags(surface->scene, RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_ROBUST);
    /* Only scenes of low quality ask a geometry for its own, and so refit it;
     * others are built anew each time. */
    rtcSetSceneBuildQuality(surface->scene, RTC_BUILD_QUALITY_LOW);
    rtcSetGeometryBuildQuality(surface->geometry, RTC_BUILD_QUALITY_REFIT);
    rtcSetSharedGeometryBuffer(surface->geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                               surface->vert_pos, 0, 3 * sizeof(float), surface->vert_count);
    rtcSetSharedGeometryBuffer(surface->geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, surface->faces,
                               0, 3 * sizeof(uint32_t), surface->face_count);
    rtcCommitGeometry(surface->geometry);
    rtcAttachGeometry(surface->scene, surface->geometry);
    rtcCommitScene(surface->scene);
    return embree_status(surface, "building the search tree");
}

npg_status npg_surface_open(npg_surface **out, const float *vertices, size_t vertex_count,
                            const uint32_t *faces, size_t face_count)
{
    npg_surface *surface;
    NPG_REQUIRE(out);
    *out = NULL;
    NPG_REQUIRE(vertices && faces && vertex_count && face_count);
    NPG_REQUIRE(vertex_count < UINT32_MAX && face_count < UINT32_MAX);
    NPG_TRY(check_faces(faces, face_count, vertex_count));
    NPG_TRY(check_vertices(vertices, vertex_count));
    NPG_TRY(npg_alloc(&surface, NPG_FOR_QUERY, sizeof *surface));
    surface->vert_count = vertex_count;
    surface->face_count = face_count;
    npg_status status = copy_arrays(surface, vertices, faces);
    if (!status) status = build(surface);
    if (status) npg_surface_close(&surface);
    *out = surface;
    return status;
}

npg_status npg_surface_move(npg_surface *surface, const float *vertices)
{
    NPG_REQUIRE(surface && vertices);
    NPG_TRY(check_vertices(vertices, surface->vert_count));
    memcpy(surface->vert_pos, vertices, surface->vert_count * 3 * sizeof(float));
    set_boxes(surface);
    rtcUpdateGeometryBuffer(surface->geometry, RTC_BUFFER_TYPE_VERTEX, 0);
    rtcCommitGeometry(surface->geometry);
    rtcCommitScene(surface->scene);
    return embree_status(surface, "refitting the search tree");
}

void npg_surface_close(npg_surface **slot)
{
    if (!slot || !*slot) return;
    npg_surface *surface = *slot;
    if (surface->geometry) rtcReleaseGeometry(surface->geometry);
    if (surface->scene) rtcReleaseScene(surface->scene);
    if (surface->device) rtcReleaseDevice(surface->device);
    npg_memory_count(NPG_FOR_QUERY, -atomic_load(&surface->bytes));
    npg_release(&surface->vert_pos);
    npg_release(&surface->faces);
    npg_release(&surface->boxes);
    npg_release(slot);
}

/* ---- a batch over several threads ---- */

typedef struct batch {
    void (*one)(const struct batch *batch, size_t i);
    const npg_surface *surface;
    const float *points;
    const uint32_t *start_face;
    npg_surface_hit *hits;
    const npg_ray *rays;
    npg_ray_hit *ray_hits;
    size_t count, parts;
} batch;

static npg_status run_part(void *user, size_t part)
{
    const batch *b = user;
    for (size_t i = b->count * part / b->parts; i < b->count * (part + 1) / b->parts; i++) b->one(b, i);
    return NPG_OK;
}

static npg_status run_batch(batch b, int threads)
{
    b.parts = npg_parallel_parts(b.count, BATCH_MIN, threads > 0 ? (size_t)threads : 0);
    return npg_parallel(run_part, &b, b.parts);
}

/* ---- closest points ---- */

typedef struct search {
    const npg_surface *surface;
    const float *point;
    lanes at; /* the point */
    npg_surface_hit best;
} search;

static void try_face(search *s, uint32_t face)
{
    npg_surface_hit hit;
    npg_face_closest(&hit, s->surface->vert_pos, s->surface->faces, face, s->point);
    if (hit.dist_sq < s->best.dist_sq || (hit.dist_sq == s->best.dist_sq && hit.face < s->best.face))
        s->best = hit;
}

/* A little more than the best distance, more than floats round by, so that faces at an equal distance are all
 * seen and the lowest wins; 1e-18: at distance 0, too. */
static float radius_of(const search *s)
{
    return sqrtf(s->best.dist_sq) * 1.00001f + 1e-18f;
}

/* Whether the face's box is farther than the best, by more than floats round: most faces are, and the exact
 * distance takes many times as long. */
static bool is_beyond(const search *s, uint32_t face)
{
    const lanes *box = s->surface->boxes[face];
    lanes gap = higher(higher(box[0] - s->at, s->at - box[1]), (lanes){0});
    gap *= gap;
    return (gap[0] + gap[1] + gap[2]) * 0.99999f > s->best.dist_sq;
}

/* Embree also calls for faces outside the radius: the exact distance decides. */
static bool on_face(struct RTCPointQueryFunctionArguments *arguments)
{
    search *s = arguments->userPtr;
    float before = s->best.dist_sq;
    if (is_beyond(s, arguments->primID)) return false;
    try_face(s, arguments->primID);
    if (!(s->best.dist_sq < before)) return false;
    arguments->query->radius = radius_of(s);
    return true;
}

static void run_search(search *s, float radius)
{
    struct RTCPointQueryContext context;
    struct RTCPointQuery query = {
        .x = s->point[0], .y = s->point[1], .z = s->point[2], .time = 0, .radius = radius};
    rtcInitPointQueryContext(&context);
    rtcPointQuery(s->surface->scene, &query, &context, on_face, s);
}

static void closest_of(const batch *b, size_t i)
{
    const float *p = b->points + 3 * i;
    search s = {b->surface, p, {p[0], p[1], p[2], 0}, {UINT32_MAX, {0, 0, 0}, INFINITY}};
    float radius = INFINITY;
    if (b->start_face && b->start_face[i] < b->surface->face_count && npg_vec3_is_finitef(s.point)) {
        try_face(&s, b->start_face[i]);
        radius = radius_of(&s);
    }
    if (npg_vec3_is_finitef(s.point)) run_search(&s, radius);
    b->hits[i] = s.best;
}

npg_status npg_surface_closest_near(const npg_surface *surface, npg_surface_hit *hits, const float *points,
                                    size_t point_count, const uint32_t *start_face, int threads)
{
    NPG_REQUIRE(surface && ((hits && points) || !point_count));
    return run_batch((batch){.one = closest_of,
                             .surface = surface,
                             .points = points,
                             .start_face = start_face,
                             .hits = hits,
                             .count = point_count},
                     threads);
}

npg_status npg_surface_closest(const npg_surface *surface, npg_surface_hit *hits, const float *points,
                               size_t point_count)
{
    return npg_surface_closest_near(surface, hits, points, point_count, NULL, 1);
}

npg_status npg_mesh_closest(npg_surface_hit *hits, const npg_mesh *mesh, const float *points,
                            size_t point_count)
{
    npg_surface *surface;
    NPG_TRY(npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count));
    npg_status status = npg_surface_closest_near(surface, hits, points, point_count, NULL, 0);
    npg_surface_close(&surface);
    return status;
}

/* ---- rays ---- */

static void cast_ray(const batch *j, size_t i)
{
    const npg_ray *ray = &j->rays[i];
    struct RTCIntersectContext context;
    struct RTCRayHit cast = {.ray = {.org_x = ray->origin[0],
                                     .org_y = ray->origin[1],
                                     .org_z = ray->origin[2],
                                     .tnear = ray->t_min,
                                     .dir_x = ray->direction[0],
                                     .dir_y = ray->direction[1],
                                     .dir_z = ray->direction[2],
                                     .tfar = ray->t_max,
                                     .mask = UINT32_MAX},
                             .hit = {.geomID = RTC_INVALID_GEOMETRY_ID, .primID = RTC_INVALID_GEOMETRY_ID}};
    cast.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcInitIntersectContext(&context);
    rtcIntersect1(j->surface->scene, &context, &cast);
    npg_ray_hit *hit = &j->ray_hits[i];
    if (cast.hit.geomID == RTC_INVALID_GEOMETRY_ID) {
        *hit = (npg_ray_hit){.face = UINT32_MAX, .t = INFINITY};
        return;
    }
    float facing = cast.hit.Ng_x * ray->direction[0] + cast.hit.Ng_y * ray->direction[1] +
                   cast.hit.Ng_z * ray->direction[2];
    *hit = (npg_ray_hit){
        cast.hit.primID, {1 - cast.hit.u - cast.hit.v, cast.hit.u, cast.hit.v}, cast.ray.tfar, facing > 0};
}

npg_status npg_surface_rays(const npg_surface *surface, npg_ray_hit *hits, const npg_ray *rays,
                            size_t ray_count, int threads)
{
    NPG_REQUIRE(surface && ((hits && rays) || !ray_count));
    return run_batch(
        (batch){.one = cast_ray, .surface = surface, .rays = rays, .ray_hits = hits, .count = ray_count},
        threads);
}
