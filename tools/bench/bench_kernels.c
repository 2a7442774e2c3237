/* Bench kernels: grids, decoder, motion, dense surfaces. */
#include "tools/bench/bench_kernels.h"

#include <math.h>
#include <string.h>

#include "align/graph.h"
#include "geometry/mesh_tools.h"
#include "kernels/adam.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "kernels/sobolev.h"
#include "optimize/carry.h"

typedef struct bench {
    npg_meter *meter;
    const npg_bench_body *body;
    const char *only;
    npg_bench_take *take;
    void *user;
} bench;

double npg_bench_share(const npg_bench_row *row, bool *by_bytes)
{
    double flops = row->flops / row->timing.in_flops.median, bytes = row->bytes / row->timing.in_bytes.median;
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

static npg_status note_row(bench *b, npg_bench_row row, npg_work *call, void *user)
{
    if (!npg_bench_wants(b->only, row.name)) return NPG_OK;
    NPG_TRY(npg_error_prefix(npg_meter_time(&row.timing, b->meter, call, user), "%s", row.name));
    return b->take(b->user, &row);
}

static npg_status note(bench *b, const char *name, npg_work *call, void *user, double flops, double bytes)
{
    return note_row(b, (npg_bench_row){.name = name, .flops = flops, .bytes = bytes}, call, user);
}

/* ---- grids: latent, sobolev, adam ---- */

typedef struct grids {
    npg_levels levels;
    npg_latent latent;
    npg_sobolev sobolev;
    npg_adam adam;
    npg_buffer u, nodes, dnodes, z, dz;
} grids;

static npg_status sample(void *user)
{
    grids *g = user;
    return npg_latent_sample(&g->latent, &g->z, &g->nodes);
}
static npg_status sample_back(void *user)
{
    grids *g = user;
    return npg_latent_back(&g->latent, &g->dnodes, &g->dz, &g->z);
}
static npg_status solve(void *user)
{
    grids *g = user;
    return npg_sobolev_solve(&g->sobolev, &g->nodes, &g->u);
}
static npg_status step(void *user)
{
    grids *g = user;
    return npg_adam_step(&g->adam, &g->u, &g->dnodes);
}

static npg_status open_grids(grids *g, const bench *b, size_t rows)
{
    const npg_mesh *mesh = b->body->mesh;
    const float rate = 1e-3f;
    npg_samples samples;
    for (int l = 0; l < 8; l++)
        npg_levels_add(
            &g->levels,
            (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 0.125, 0.4 * pow(1.5, l), 3.4, 1, 1}, 0);
    npg_levels_add(&g->levels, (npg_level){NPG_LEVEL_NORMAL, 4, 0, 0, 30, 32, 1, 0.4, 3.4, 1, 1}, 0);
    NPG_TRY(
        npg_samples_open(&samples, &g->levels, mesh->vert_pos, mesh->vert_normals, mesh->vert_count, rows));
    npg_status status = npg_latent_open(&g->latent, b->meter->device, &samples);
    npg_samples_close(&samples);
    NPG_TRY(status);
    size_t count = g->levels.row_count * NPG_LATENT_CHANNELS, bytes = count * sizeof(float);
    size_t z_bytes = rows * NPG_LATENT_CHANNELS * sizeof(float);
    NPG_TRY(npg_sobolev_open(&g->sobolev, b->meter->device, &g->levels));
    NPG_TRY(npg_adam_open(&g->adam, b->meter->device, &rate, count, count));
    NPG_TRY(npg_buffer_open(&g->u, b->meter->device, bytes));
    NPG_TRY(npg_buffer_open(&g->nodes, b->meter->device, bytes));
    NPG_TRY(npg_buffer_open(&g->dnodes, b->meter->device, bytes));
    NPG_TRY(npg_buffer_open(&g->z, b->meter->device, z_bytes));
    return npg_buffer_open(&g->dz, b->meter->device, z_bytes);
}

static npg_status note_grids(bench *b, const grids *g, size_t rows)
{
    const double C = NPG_LATENT_CHANNELS, nodes = (double)g->levels.row_count, V = (double)rows;
    const double entries = V * (double)g->latent.per_row;
    double solves = 0;
    for (int l = 0; l < g->levels.count; l++) solves += 6 * 2 * C * pow(g->levels.level[l].nodes, 4);
    NPG_TRY(note(b, "latent_sample", sample, (void *)g, 2 * C * entries, 8 * entries + 4 * C * (V + nodes)));
    NPG_TRY(note(b, "latent_back", sample_back, (void *)g, 2 * C * entries,
                 8 * entries + 4 * C * (4 * V + nodes)));
    NPG_TRY(note(b, "sobolev", solve, (void *)g, solves, 6 * 8 * C * nodes));
    return note(b, "adam", step, (void *)g, 12 * C * nodes, 28 * C * nodes);
}

static npg_status bench_grids(bench *b, size_t rows)
{
    grids g = {0};
    npg_status status = open_grids(&g, b, rows);
    if (!status) status = note_grids(b, &g, rows);
    npg_latent_close(&g.latent);
    npg_sobolev_close(&g.sobolev);
    npg_adam_close(&g.adam);
    npg_buffer *all[] = {&g.u, &g.nodes, &g.dnodes, &g.z, &g.dz};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_buffer_close(all[i]);
    return status;
}

/* ---- decoder and motion, on a batch of frames ---- */

enum { BATCH = 4 };

typedef struct moves {
    npg_mlp mlp;
    npg_motion motion;
    size_t count;
} moves;

static npg_status begin(void *user)
{
    return npg_mlp_begin(&((moves *)user)->mlp);
}
static npg_status forward(void *user)
{
    moves *m = user;
    return npg_mlp_forward(&m->mlp, 0, m->count);
}
static npg_status backward(void *user)
{
    moves *m = user;
    return npg_mlp_backward(&m->mlp, 0, m->count);
}
static npg_status end(void *user)
{
    return npg_mlp_end(&((moves *)user)->mlp);
}
static npg_status apply(void *user)
{
    moves *m = user;
    return npg_motion_apply(&m->motion, &m->mlp.out, 0, m->count);
}
static npg_status chamfer(void *user)
{
    moves *m = user;
    return npg_motion_chamfer(&m->motion, 0.3, 0, m->count);
}
static npg_status back(void *user)
{
    static const float gains[BATCH] = {1, 1, 1, 1};
    moves *m = user;
    return npg_motion_back(&m->motion, &m->mlp.dout, &m->mlp.out, gains, 100, 0, m->count);
}

static npg_status open_moves(moves *m, const bench *b, size_t rows)
{
    const npg_mesh *mesh = b->body->mesh;
    const npg_mlp_shape shape = {512, 512, 8, 0.01f};
    npg_target targets[BATCH];
    uint32_t(*edges)[2];
    size_t edge_count;
    m->count = b->body->frame_count < BATCH ? b->body->frame_count : BATCH;
    for (size_t t = 0; t < m->count; t++)
        targets[t] = (npg_target){b->body->frames[t].points, b->body->frames[t].count};
    NPG_TRY(npg_mlp_open(&m->mlp, b->meter->device, &shape, rows, m->count, m->count));
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, mesh->faces, mesh->face_count));
    npg_status status =
        npg_motion_open(&m->motion, b->meter->device, NPG_ROTATION_QUATERNION, mesh->vert_pos,
                        mesh->vert_count, rows, (const uint32_t(*)[2])edges, edge_count, targets, m->count);
    npg_release(&edges);
    return status;
}

static npg_status note_moves(bench *b, moves *m, size_t rows)
{
    const double T = (double)m->count, V = (double)rows, N = (double)b->body->point_count, W = 512, C = 32;
    const double layers = W * W + 7 * W, samples = T * V;
    NPG_TRY(note(b, "mlp_input", begin, m, 2 * V * C * W, 4 * V * (C + W)));
    NPG_TRY(note(b, "mlp_forward", forward, m, 2 * samples * layers, 4 * samples * (2 * W + 8)));
    NPG_TRY(note(b, "mlp_backward", backward, m, 4 * samples * layers, 4 * samples * (4 * W + 8)));
    NPG_TRY(note(b, "mlp_input_back", end, m, 4 * V * C * W, 4 * V * (2 * C + W)));
    NPG_TRY(note(b, "transform", apply, m, 60 * samples, 4 * samples * 11));
    NPG_TRY(note(b, "nearest_and_chamfer", chamfer, m, 0, 4 * T * (V * 10 + N * 7)));
    return note(b, "isometry_and_transform_back", back, m, 150 * samples, 4 * samples * 24);
}

static npg_status bench_moves(bench *b, size_t rows)
{
    moves m = {0};
    npg_status status = open_moves(&m, b, rows);
    if (!status) status = note_moves(b, &m, rows);
    npg_mlp_close(&m.mlp);
    npg_motion_close(&m.motion);
    return status;
}

npg_status npg_bench_kernels(npg_meter *meter, const npg_bench_body *body, const char *only,
                             npg_bench_take *take, void *user)
{
    bench b = {meter, body, only, take, user};
    size_t rows = npg_mlp_rows(meter->device, body->mesh->vert_count);
    NPG_TRY(bench_grids(&b, rows));
    return bench_moves(&b, rows);
}

/* ---- dense surfaces ---- */

enum { SAMPLES = 1500, NODES = 1000 };

typedef struct dense {
    const npg_mesh *mesh; /* loan */
    npg_carry *carry;
    npg_graph *graph;
    double *pose;
    float *verts, *before, *samples, *rows;
    npg_mlp mlp;
    npg_motion motion;
} dense;

static npg_status carry(void *user)
{
    dense *d = user;
    npg_carriers_move(d->carry->carriers, d->carry->vert_count, d->verts, d->before, d->samples);
    return NPG_OK;
}

static npg_status pose(void *user)
{
    dense *d = user;
    npg_pose_rows(d->rows, d->graph, d->pose);
    npg_pose_vertices(d->verts, d->graph, d->rows, d->mesh->vert_pos);
    return NPG_OK;
}

static npg_status decode(void *user)
{
    dense *d = user;
    NPG_TRY(npg_mlp_forward(&d->mlp, 0, 1));
    NPG_TRY(npg_motion_apply(&d->motion, &d->mlp.out, 0, 1));
    return npg_buffer_read(&d->motion.x, 0, d->verts, d->carry->vert_count * 3 * sizeof(float));
}

static npg_status open_dense(dense *d, npg_device *device, const npg_mesh *mesh)
{
    const npg_mlp_shape shape = {512, 512, 8, 0.01f};
    size_t rows = npg_mlp_rows(device, mesh->vert_count);
    d->mesh = mesh;
    NPG_TRY(npg_graph_open(&d->graph, mesh, NODES));
    NPG_TRY(npg_alloc_array(&d->pose, NPG_FOR_RUN, d->graph->node_count, NPG_POSE_SIZE * sizeof(double)));
    npg_pose_rest(d->pose, d->graph->node_count);
    NPG_TRY(npg_alloc_array(&d->rows, NPG_FOR_RUN, d->graph->node_count, NPG_POSE_ROW * sizeof(float)));
    NPG_TRY(npg_carry_open(&d->carry, mesh, SAMPLES, NPG_THIN_SURFACE));
    size_t count = d->carry->samples->mesh->vert_count;
    NPG_TRY(npg_alloc_array(&d->verts, NPG_FOR_RUN, rows, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&d->before, NPG_FOR_RUN, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&d->samples, NPG_FOR_RUN, count, 3 * sizeof(float)));
    NPG_TRY(npg_mlp_open(&d->mlp, device, &shape, rows, 1, 0));
    NPG_TRY(npg_mlp_begin(&d->mlp));
    return npg_motion_open(&d->motion, device, NPG_ROTATION_QUATERNION, mesh->vert_pos, mesh->vert_count,
                           rows, NULL, 0, NULL, 1);
}

static npg_status note_dense(bench *b, dense *d)
{
    const double V = (double)d->carry->vert_count, W = 512, S = (double)d->carry->samples->mesh->vert_count;
    npg_bench_row posed = {.name = "dense_pose",
                           .on_host = true,
                           .flops = V * (4 * 24 + 21),
                           .bytes = V * (24 + 32),
                           .vertex_frames = V};
    npg_bench_row carried = {.name = "dense_carry",
                             .on_host = true,
                             .flops = 27 * V,
                             .bytes = V * (24 + 24) + S * 24,
                             .vertex_frames = V};
    npg_bench_row decoded = {.name = "dense_decode",
                             .flops = 2 * V * (W * W + 7 * W),
                             .bytes = 4 * V * (W + 8 + 9),
                             .vertex_frames = V};
    NPG_TRY(note_row(b, posed, pose, d));
    NPG_TRY(note_row(b, carried, carry, d));
    return note_row(b, decoded, decode, d);
}

npg_status npg_bench_dense(npg_meter *meter, const char *only, size_t vertices, npg_bench_take *take,
                           void *user)
{
    dense d = {0};
    npg_bench_body body;
    bench b = {meter, &body, only, take, user};
    NPG_TRY(npg_bench_body_open(&body, vertices, 1, 1));
    npg_status status = open_dense(&d, meter->device, body.mesh);
    if (!status) status = note_dense(&b, &d);
    npg_carry_close(&d.carry);
    npg_graph_close(&d.graph);
    npg_release(&d.pose);
    npg_release(&d.rows);
    npg_release(&d.verts);
    npg_release(&d.before);
    npg_release(&d.samples);
    npg_mlp_close(&d.mlp);
    npg_motion_close(&d.motion);
    npg_bench_body_close(&body);
    return status;
}
