/* Align as work to be timed: posing a dense surface, and aligning a frame. */
#include "align/align.h"
#include "align/tracker.h"

enum { NODES = 1000 }; /* of the graph; how many there are makes no difference to the cost of a vertex */

typedef struct dense {
    const npg_mesh *mesh; /* loan */
    npg_graph *graph;
    double *pose;        /* K x 12        */
    float *rows, *verts; /* K x 16, V x 3 */
} dense;

static npg_status pose(void *user)
{
    dense *d = user;
    npg_pose_rows(d->rows, d->graph, d->pose);
    npg_pose_vertices(d->verts, d->graph, d->rows, d->mesh->vert_pos);
    return NPG_OK;
}

static npg_status open_dense(dense *d)
{
    NPG_TRY(npg_graph_open(&d->graph, d->mesh, NODES));
    NPG_TRY(npg_alloc_array(&d->pose, NPG_FOR_RUN, d->graph->node_count, NPG_POSE_SIZE * sizeof(double)));
    npg_pose_rest(d->pose, d->graph->node_count);
    NPG_TRY(npg_alloc_array(&d->rows, NPG_FOR_RUN, d->graph->node_count, NPG_POSE_ROW * sizeof(float)));
    return npg_alloc_array(&d->verts, NPG_FOR_RUN, d->mesh->vert_count, 3 * sizeof(float));
}

npg_status npg_align_work(const npg_mesh *mesh, npg_work_visit *visit, void *user)
{
    dense d = {.mesh = mesh};
    const double V = (double)mesh->vert_count;
    /* a vertex: the weighted sum of four 3 x 4 matrices, and one product with it; its own data in and out */
    npg_work work = {.name = "dense_pose",
                     .call = pose,
                     .user = &d,
                     .flops = V * (NPG_GRAPH_BIND * 24 + 21),
                     .bytes = V * (24 + 32),
                     .vertex_frames = V,
                     .on_host = true};
    npg_status status = open_dense(&d);
    if (!status) status = visit(user, &work);
    npg_graph_close(&d.graph);
    npg_release(&d.pose);
    npg_release(&d.rows);
    npg_release(&d.verts);
    return status;
}

/* ---- a frame ---- */

/* The options' defaults. */
static const npg_tracker_settings usual = {
    .nodes = 1600, .samples = 5000, .steps = 12, .stiffness = 0.006, .along = 0.001};

typedef struct aligning {
    npg_tracker *tracker;
    double *pose;        /* K x 12 */
    const float *points; /* loan */
    size_t point_count;
} aligning;

static npg_status align_frame(void *user)
{
    aligning *a = user;
    npg_tracked tracked;
    npg_pose_rest(a->pose, npg_tracker_node_count(a->tracker));
    const npg_tracker_cloud cloud = {.points = a->points, .count = a->point_count};
    return npg_tracker_fit(a->tracker, &tracked, a->pose, &cloud, NULL, NULL);
}

npg_status npg_align_frame_work(npg_mesh *reference, const float *points, size_t point_count,
                                npg_work_visit *visit, void *user)
{
    aligning a = {.points = points, .point_count = point_count};
    const double N = (double)point_count, S = (double)usual.samples;
    const double unknowns = NPG_GRAPH_BIND * NPG_POSE_SIZE;
    /* In each step every point and every sample adds a row of the nodes that carry it to the normal
     * equations, whose half is kept; their solution is not counted, it depends on the graph. */
    npg_work work = {.name = "align_frame",
                     .call = align_frame,
                     .user = &a,
                     .flops = usual.steps * (N + S) * unknowns * (unknowns + 1),
                     .bytes = N * 12,
                     .points = N,
                     .on_host = true};
    npg_status status = npg_tracker_open(&a.tracker, reference, &usual);
    if (!status)
        status = npg_alloc_array(&a.pose, NPG_FOR_RUN, npg_tracker_node_count(a.tracker),
                                 NPG_POSE_SIZE * sizeof *a.pose);
    if (!status) status = visit(user, &work);
    npg_tracker_close(&a.tracker);
    npg_release(&a.pose);
    return status;
}
