/* Query as work to be timed. */
#include "geometry/query_work.h"

#include "geometry/query.h"
#include "pipeline/memory.h"

typedef struct asked {
    npg_surface *surface;
    npg_surface_hit *hits;
    const float *points;
    size_t count;
} asked;

static npg_status ask(void *user)
{
    const asked *a = user;
    return npg_surface_closest_near(a->surface, a->hits, a->points, a->count, NULL, NULL, 0);
}

npg_status npg_query_work(const npg_mesh *mesh, const float *points, size_t point_count,
                          npg_work_visit *visit, void *user)
{
    asked a = {.points = points, .count = point_count};
    const double N = (double)point_count;
    /* At least: one triangle a point, and the points and answers once. */
    npg_work work = {.name = "surface_closest",
                     .call = ask,
                     .user = &a,
                     .flops = N * 60,
                     .bytes = N * (12 + sizeof *a.hits),
                     .points = N,
                     .on_host = true};
    npg_status status = npg_alloc_array(&a.hits, NPG_FOR_RUN, point_count, sizeof *a.hits);
    if (!status)
        status =
            npg_surface_open(&a.surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    if (!status) status = visit(user, &work);
    npg_surface_close(&a.surface);
    npg_release(&a.hits);
    return status;
}
