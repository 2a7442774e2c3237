/* Bench rows: the rooms' work, timed and handed over. */
#include "tools/bench/bench_rows.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "align/align.h"
#include "export/export.h"
#include "geometry/geometry.h"
#include "mesh/mesh.h"
#include "optimize/optimize.h"
#include "outlier/outlier.h"
#include "pipeline/file.h"
#include "pipeline/memory.h"

typedef struct bench {
    npg_meter *meter;
    const char *only;
    npg_bench_visit *visit;
    void *user;
} bench;

double npg_bench_share(const npg_bench_row *row, bool *by_bytes)
{
    double flops = row->work.flops / row->timing.in_flops.median;
    double bytes = row->work.bytes / row->timing.in_bytes.median;
    *by_bytes = bytes > flops;
    return fmax(flops, bytes);
}

bool npg_bench_wants(const char *only, const char *name)
{
    for (const char *word = only; *word; word += strspn(word, ",")) {
        size_t length = strcspn(word, ",");
        if (!strncmp(name, word, length)) return true;
        word += length;
    }
    return !*only;
}

/* An npg_work_visit. */
static npg_status time_row(void *user, const npg_work *work)
{
    bench *b = user;
    npg_bench_row row = {.work = *work};
    if (!npg_bench_wants(b->only, work->name)) return NPG_OK;
    NPG_TRY(
        npg_error_prefix(npg_meter_time(&row.timing, b->meter, work->call, work->user), "%s", work->name));
    return b->visit(b->user, &row);
}

npg_status npg_bench_kernels(npg_meter *meter, const npg_bench_body *body, const char *only,
                             npg_bench_visit *visit, void *user)
{
    bench b = {meter, only, visit, user};
    const npg_mesh *mesh = body->mesh;
    uint32_t(*edges)[2];
    size_t edge_count;
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, mesh->faces, mesh->face_count));
    npg_workload load = {.vert_pos = mesh->vert_pos,
                         .vert_normals = mesh->vert_normals,
                         .vert_count = mesh->vert_count,
                         .edges = (const uint32_t(*)[2])edges,
                         .edge_count = edge_count,
                         .points = (const float *const *)body->points,
                         .frame_count = body->frame_count,
                         .point_count = body->point_count};
    npg_status status = npg_kernels_work(meter->device, &load, time_row, &b);
    npg_release(&edges);
    return status;
}

npg_status npg_bench_dense(npg_meter *meter, const char *only, size_t vertices, npg_bench_visit *visit,
                           void *user)
{
    bench b = {meter, only, visit, user};
    npg_bench_body body;
    NPG_TRY(npg_bench_body_open(&body, vertices, 1, 1));
    npg_status status = npg_align_work(body.mesh, time_row, &b);
    if (!status) status = npg_carry_work(body.mesh, time_row, &b);
    if (!status)
        status = npg_decoder_work(meter->device, body.mesh->vert_pos, body.mesh->vert_count, time_row, &b);
    npg_bench_body_close(&body);
    return status;
}

npg_status npg_bench_clouds(npg_meter *meter, const char *only, size_t points, npg_bench_visit *visit,
                            void *user)
{
    enum { BODY_VERTICES = 10000, POISSON_POINTS = 20000 };
    bench b = {meter, only, visit, user};
    npg_bench_body body;
    size_t few = points < POISSON_POINTS ? points : POISSON_POINTS;
    bool has_poisson = npg_bench_wants(only, "poisson"); /* its normals take a while */
    NPG_TRY(npg_bench_body_open(&body, BODY_VERTICES, points, 1));
    npg_status status = npg_outlier_work(body.points[0], points, time_row, &b);
    if (!status) status = npg_query_work(body.mesh, body.points[0], points, time_row, &b);
    npg_bench_body_close(&body);
    if (status || !has_poisson) return status;
    NPG_TRY(npg_bench_body_open(&body, BODY_VERTICES, few, 1));
    status = npg_mesh_work(body.points[0], few, time_row, &b);
    npg_bench_body_close(&body);
    return status;
}

/* An empty folder for temporary files.  NPG_DISK. */
static npg_status make_folder(char **out)
{
    const char *parent = getenv("TMPDIR");
    NPG_TRY(npg_join_path(out, parent && *parent ? parent : "/tmp", "neupig-bench-XXXXXX"));
    if (mkdtemp(*out)) return NPG_OK;
    npg_status status = npg_error_errno(NPG_DISK, "can't make %s", *out);
    npg_release(out);
    return status;
}

static npg_status time_export(bench *b, const npg_mesh *mesh)
{
    char *folder, *path = NULL;
    NPG_TRY(make_folder(&folder));
    npg_status status = npg_join_path(&path, folder, "frame.ply");
    if (!status) status = npg_export_work(mesh, path, time_row, b);
    if (path) unlink(path);
    rmdir(folder);
    npg_release(&path);
    npg_release(&folder);
    return status;
}

npg_status npg_bench_frame(npg_meter *meter, const char *only, npg_bench_visit *visit, void *user)
{
    enum { VERTICES = 10000, POINTS = 5000, FRAMES = 17, NEXT = 9 }; /* the body is at rest in frame 8 */
    bench b = {meter, only, visit, user};
    npg_bench_body body;
    NPG_TRY(npg_bench_body_open(&body, VERTICES, POINTS, FRAMES));
    npg_status status = NPG_OK;
    if (npg_bench_wants(only, "align_frame"))
        status = npg_align_frame_work(body.mesh, body.points[NEXT], POINTS, time_row, &b);
    if (!status && npg_bench_wants(only, "export_ply")) status = time_export(&b, body.mesh);
    npg_bench_body_close(&body);
    return status;
}
