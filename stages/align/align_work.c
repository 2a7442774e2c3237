/* Align as work to be timed: posing a dense surface. */
#include "align/align.h"
#include "align/graph.h"

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
