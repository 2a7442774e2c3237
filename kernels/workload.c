/* Workload: the ops opened on made-up parameters, and what one call of each takes at least. */
#include "kernels/workload.h"

#include <math.h>

#include "kernels/adam.h"
#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "kernels/motion.h"
#include "kernels/sobolev.h"

/* The default settings of the fit (options of the optimize stage). */
enum { POSITION_LEVELS = 8, BATCH = 4, TIME_CODE = 8 };
static const npg_mlp_shape decoder = {512, 512, 2, TIME_CODE, 0.01f};

/* Whom the work is handed to. */
typedef struct visitor {
    npg_work_visit *visit;
    void *user;
} visitor;

static npg_status hand_over(const visitor *to, const char *name, npg_status (*call)(void *), void *user,
                            double flops, double bytes)
{
    npg_work work = {.name = name, .call = call, .user = user, .flops = flops, .bytes = bytes};
    return to->visit(to->user, &work);
}

/* ---- grids: latent, sobolev, adam ---- */

typedef struct grids {
    npg_levels levels;
    npg_latent latent;
    npg_sobolev sobolev;
    npg_adam adam;
    npg_buffer u, nodes, dnodes, z, dz;
} grids;

static npg_status latent_sample(void *user)
{
    grids *g = user;
    return npg_latent_sample(&g->latent, &g->z, &g->nodes);
}
static npg_status latent_back(void *user)
{
    grids *g = user;
    return npg_latent_back(&g->latent, &g->dnodes, &g->dz, &g->z);
}
static npg_status sobolev(void *user)
{
    grids *g = user;
    return npg_sobolev_solve(&g->sobolev, &g->nodes, &g->u);
}
static npg_status adam(void *user)
{
    grids *g = user;
    return npg_adam_step(&g->adam, &g->u, &g->dnodes);
}

/* The grids of the default settings: 2, 5, 8, ... nodes an axis for positions, 4 for normals. */
static void add_levels(npg_levels *levels)
{
    for (int l = 0; l < POSITION_LEVELS; l++)
        npg_levels_add(levels,
                       (npg_level){.kind = NPG_LEVEL_POSITION,
                                   .nodes = 2 + 3 * l,
                                   .channel_end = 30,
                                   .share = 1.0 / POSITION_LEVELS,
                                   .lambda = 0.4 * pow(1.5, l),
                                   .screen = 3.4,
                                   .degree = 1,
                                   .rate = 1},
                       0);
    npg_levels_add(levels,
                   (npg_level){.kind = NPG_LEVEL_NORMAL,
                               .nodes = 4,
                               .channel_first = 30,
                               .channel_end = NPG_LATENT_CHANNELS,
                               .share = 1,
                               .lambda = 0.4,
                               .screen = 3.4,
                               .degree = 1,
                               .rate = 1},
                   0);
}

static npg_status open_latent(grids *g, npg_device *device, const npg_workload *load, size_t rows)
{
    npg_samples samples;
    NPG_TRY(
        npg_samples_open(&samples, &g->levels, load->vert_pos, load->vert_normals, load->vert_count, rows));
    npg_status status = npg_latent_open(&g->latent, device, &samples);
    npg_samples_close(&samples);
    return status;
}

static npg_status open_grids(grids *g, npg_device *device, const npg_workload *load, size_t rows)
{
    const float rate = 1e-3f;
    add_levels(&g->levels);
    NPG_TRY(open_latent(g, device, load, rows));
    size_t count = g->levels.row_count * NPG_LATENT_CHANNELS, bytes = count * sizeof(float);
    size_t z_bytes = rows * NPG_LATENT_CHANNELS * sizeof(float);
    NPG_TRY(npg_sobolev_open(&g->sobolev, device, &g->levels));
    NPG_TRY(npg_adam_open(&g->adam, device, &rate, count, count));
    NPG_TRY(npg_buffer_open(&g->u, device, bytes));
    NPG_TRY(npg_buffer_open(&g->nodes, device, bytes));
    NPG_TRY(npg_buffer_open(&g->dnodes, device, bytes));
    NPG_TRY(npg_buffer_open(&g->z, device, z_bytes));
    return npg_buffer_open(&g->dz, device, z_bytes);
}

static void close_grids(grids *g)
{
    npg_latent_close(&g->latent);
    npg_sobolev_close(&g->sobolev);
    npg_adam_close(&g->adam);
    npg_buffer *all[] = {&g->u, &g->nodes, &g->dnodes, &g->z, &g->dz};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_buffer_close(all[i]);
}

/* What a call takes, from its formula: 2 operations a multiply-add, 4 bytes a float, every operand read and
 * every result written once. */
static npg_status visit_grids(const visitor *to, grids *g, size_t rows)
{
    const double C = NPG_LATENT_CHANNELS, nodes = (double)g->levels.row_count, V = (double)rows;
    const double entries = V * (double)g->latent.per_row;
    double solves = 0;
    /* six passes (three axes, there and back), each an n x n matrix times n^2 lines of n nodes */
    for (int l = 0; l < g->levels.count; l++) solves += 6 * 2 * C * pow(g->levels.level[l].nodes, 4);
    NPG_TRY(
        hand_over(to, "latent_sample", latent_sample, g, 2 * C * entries, 8 * entries + 4 * C * (V + nodes)));
    NPG_TRY(
        hand_over(to, "latent_back", latent_back, g, 2 * C * entries, 8 * entries + 4 * C * (4 * V + nodes)));
    NPG_TRY(hand_over(to, "sobolev", sobolev, g, solves, 6 * 8 * C * nodes));
    return hand_over(to, "adam", adam, g, 12 * C * nodes, 28 * C * nodes);
}

static npg_status work_on_grids(npg_device *device, const npg_workload *load, size_t rows, const visitor *to)
{
    grids g = {0};
    npg_status status = open_grids(&g, device, load, rows);
    if (!status) status = visit_grids(to, &g, rows);
    close_grids(&g);
    return status;
}

/* ---- decoder and motion, on a batch of frames ---- */

typedef struct moves {
    npg_mlp mlp;
    npg_motion motion;
    size_t count; /* frames of the batch */
} moves;

static npg_status mlp_input(void *user)
{
    return npg_mlp_begin(&((moves *)user)->mlp);
}
static npg_status mlp_forward(void *user)
{
    moves *m = user;
    return npg_mlp_forward(&m->mlp, 0, m->count);
}
static npg_status mlp_backward(void *user)
{
    moves *m = user;
    return npg_mlp_backward(&m->mlp, 0, m->count);
}
static npg_status mlp_input_back(void *user)
{
    return npg_mlp_end(&((moves *)user)->mlp);
}
static npg_status transform(void *user)
{
    moves *m = user;
    return npg_motion_apply(&m->motion, &m->mlp.out, 0, m->count);
}
static npg_status nearest_and_chamfer(void *user)
{
    moves *m = user;
    return npg_motion_chamfer(&m->motion, 0.3, 0, m->count);
}
static npg_status isometry_and_transform_back(void *user)
{
    static const float gains[BATCH] = {1, 1, 1, 1};
    moves *m = user;
    return npg_motion_back(&m->motion, &m->mlp.dout, &m->mlp.out, gains, 100, 0, m->count);
}

static npg_status open_moves(moves *m, npg_device *device, const npg_workload *load, size_t rows)
{
    npg_target targets[BATCH];
    m->count = load->frame_count < BATCH ? load->frame_count : BATCH;
    for (size_t t = 0; t < m->count; t++) targets[t] = (npg_target){load->points[t], load->point_count};
    NPG_TRY(npg_mlp_open(&m->mlp, device, &decoder, rows, m->count, m->count));
    return npg_motion_open(&m->motion, device, NPG_ROTATION_QUATERNION, load->vert_pos, load->vert_count,
                           rows, load->edges, load->edge_count, targets, m->count);
}

/* Both ways through the decoder behind its first layer, for all frames of the batch.  In or out go p, each
 * kept layer, what the decoder gives, and backward dp twice. */
static npg_status visit_decoder(const visitor *to, moves *m, const char *forward, const char *backward,
                                size_t rows)
{
    const npg_mlp_shape *s = &m->mlp.shape;
    const double samples = (double)m->count * (double)rows, W = (double)s->w1, L = (double)s->layers;
    const double layers = samples * npg_mlp_multiply_adds(s);
    NPG_TRY(hand_over(to, forward, mlp_forward, m, 2 * layers, 4 * samples * (L * W + 8)));
    return hand_over(to, backward, mlp_backward, m, 4 * layers, 4 * samples * ((L + 2) * W + 8));
}

/* As above; nearest neighbours are not counted in operations, how many the search takes depends on the
 * data. */
static npg_status visit_moves(const visitor *to, moves *m, const npg_workload *load, size_t rows)
{
    const double T = (double)m->count, V = (double)rows, N = (double)load->point_count;
    const double W = (double)decoder.w1, C = NPG_LATENT_CHANNELS;
    const double samples = T * V;
    NPG_TRY(hand_over(to, "mlp_input", mlp_input, m, 2 * V * C * W, 4 * V * (C + W)));
    NPG_TRY(visit_decoder(to, m, "mlp_forward", "mlp_backward", rows));
    NPG_TRY(hand_over(to, "mlp_input_back", mlp_input_back, m, 4 * V * C * W, 4 * V * (2 * C + W)));
    NPG_TRY(hand_over(to, "transform", transform, m, 60 * samples, 4 * samples * 11));
    NPG_TRY(hand_over(to, "nearest_and_chamfer", nearest_and_chamfer, m, 0, 4 * T * (V * 10 + N * 7)));
    return hand_over(to, "isometry_and_transform_back", isometry_and_transform_back, m, 150 * samples,
                     4 * samples * 24);
}

static npg_status work_on_moves(npg_device *device, const npg_workload *load, size_t rows, const visitor *to)
{
    moves m = {0};
    npg_status status = open_moves(&m, device, load, rows);
    if (!status) status = visit_moves(to, &m, load, rows);
    npg_mlp_close(&m.mlp);
    npg_motion_close(&m.motion);
    return status;
}

/* A decoder of three hidden layers: what the option hidden-layers costs. */
static npg_status work_on_deeper(npg_device *device, const npg_workload *load, size_t rows, const visitor *to)
{
    moves m = {.count = load->frame_count < BATCH ? load->frame_count : BATCH};
    npg_mlp_shape deeper = decoder;
    deeper.layers = 3;
    npg_status status = npg_mlp_open(&m.mlp, device, &deeper, rows, m.count, m.count);
    if (!status) status = visit_decoder(to, &m, "deeper_forward", "deeper_backward", rows);
    npg_mlp_close(&m.mlp);
    return status;
}

npg_status npg_kernels_work(npg_device *device, const npg_workload *load, npg_work_visit *visit, void *user)
{
    const visitor to = {visit, user};
    size_t rows = npg_mlp_rows(device, load->vert_count);
    NPG_TRY(work_on_grids(device, load, rows, &to));
    NPG_TRY(work_on_moves(device, load, rows, &to));
    return work_on_deeper(device, load, rows, &to);
}

/* ---- the decoder alone ---- */

typedef struct dense {
    npg_mlp mlp;
    npg_motion motion;
    float *verts; /* rows x 3 */
    size_t vert_count;
} dense;

static npg_status decode(void *user)
{
    dense *d = user;
    NPG_TRY(npg_mlp_forward(&d->mlp, 0, 1));
    NPG_TRY(npg_motion_apply(&d->motion, &d->mlp.out, 0, 1));
    return npg_buffer_read(&d->motion.x, 0, d->verts, d->vert_count * 3 * sizeof(float));
}

static npg_status open_dense(dense *d, npg_device *device, const float *vert_pos)
{
    size_t rows = npg_mlp_rows(device, d->vert_count);
    NPG_TRY(npg_alloc_array(&d->verts, NPG_FOR_RUN, rows, 3 * sizeof(float)));
    NPG_TRY(npg_mlp_open(&d->mlp, device, &decoder, rows, 1, 0));
    NPG_TRY(npg_mlp_begin(&d->mlp));
    return npg_motion_open(&d->motion, device, NPG_ROTATION_QUATERNION, vert_pos, d->vert_count, rows, NULL,
                           0, NULL, 1);
}

npg_status npg_decoder_work(npg_device *device, const float *vert_pos, size_t vert_count,
                            npg_work_visit *visit, void *user)
{
    dense d = {.vert_count = vert_count};
    const double V = (double)vert_count, W = (double)decoder.w1;
    npg_work work = {.name = "dense_decode",
                     .call = decode,
                     .user = &d,
                     .flops = 2 * V * npg_mlp_multiply_adds(&decoder),
                     .bytes = 4 * V * (W + 8 + 9),
                     .vertex_frames = V};
    npg_status status = open_dense(&d, device, vert_pos);
    if (!status) status = visit(user, &work);
    npg_release(&d.verts);
    npg_mlp_close(&d.mlp);
    npg_motion_close(&d.motion);
    return status;
}
