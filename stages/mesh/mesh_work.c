/* Mesh as work to be timed: the reconstruction of one cloud. */
#include "mesh/mesh.h"

#include "mesh/poisson.h"
#include "outlier/normals.h"
#include "pipeline/memory.h"

enum { DEPTH = 8, WEIGHT = 10 };

typedef struct cloud {
    const float *points;
    float *normals;
    size_t count;
} cloud;

static npg_status reconstruct(void *user)
{
    const cloud *c = user;
    const npg_poisson_settings settings = {.depth = DEPTH, .point_weight = WEIGHT, .time_limit_s = 600};
    npg_mesh *mesh;
    npg_status status = npg_poisson(&mesh, c->points, c->normals, c->count, &settings);
    npg_mesh_unref(&mesh);
    return status;
}

npg_status npg_mesh_work(const float *points, size_t point_count, npg_work_visit *visit, void *user)
{
    cloud c = {.points = points, .count = point_count};
    const double N = (double)point_count;
    /* What the sparse systems of the octree take is not counted; the points and the mesh, once. */
    npg_work work = {.name = "poisson",
                     .call = reconstruct,
                     .user = &c,
                     .bytes = N * (24 + 6 * 12),
                     .points = N,
                     .on_host = true};
    npg_status status = npg_alloc_array(&c.normals, NPG_FOR_RUN, point_count, 3 * sizeof(float));
    if (!status) status = npg_normals_make(c.normals, points, point_count);
    if (!status) status = visit(user, &work);
    npg_release(&c.normals);
    return status;
}
