/* neupig bench: operations and bytes per second of each kernel beside the machine's peaks, and frames per
 * second of the whole fit.  Prints one JSON object. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#include "adam.h"
#include "bench_body.h"
#include "cli.h"
#include "clock.h"
#include "latent.h"
#include "mesh_tools.h"
#include "mlp.h"
#include "sobolev.h"

typedef struct settings {
    int64_t vertices, points, frames, epochs, repeat;
    const char *device;
} settings;

const npg_option npg_bench_options[] = {
    {"vertices", "vertices of the mesh", NPG_OPTION_INT, offsetof(settings, vertices), "10000", 16, 1e6, NULL,
     NULL},
    {"points", "points of each frame", NPG_OPTION_INT, offsetof(settings, points), "5000", 1, 1e6, NULL,
     NULL},
    {"frames", "frames of the window", NPG_OPTION_INT, offsetof(settings, frames), "17", 1, 1000, NULL, NULL},
    {"epochs", "epochs of the fit that is timed", NPG_OPTION_INT, offsetof(settings, epochs), "10", 1, 10000,
     NULL, NULL},
    {"repeat", "times each kernel runs; the median counts", NPG_OPTION_INT, offsetof(settings, repeat), "7",
     1, 1000, NULL, NULL},
    {"device", "OpenCL device: auto, cpu, gpu, a number or a part of its name", NPG_OPTION_TEXT,
     offsetof(settings, device), "auto", 0, 0, NULL, "NAME"},
    {0}};

typedef struct bench {
    settings s;
    npg_device *device;
    npg_bench_body body;
    json_t *kernels; /* loan */
    double peak_flops, peak_bytes;
} bench;

/* ---- timing ---- */

typedef npg_status work(void *user);

static int by_size(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median seconds of one call, after one that is not counted. */
static npg_status time_of(double *seconds, const bench *b, work *call, void *user)
{
    double *all;
    size_t n = (size_t)b->s.repeat;
    *seconds = 0;
    NPG_TRY(npg_alloc_array(&all, NPG_FOR_RUN, n, sizeof *all));
    npg_status status = call(user);
    if (!status) status = npg_device_finish(b->device);
    for (size_t i = 0; i < n && !status; i++) {
        double start = npg_clock_s();
        status = call(user);
        if (!status) status = npg_device_finish(b->device);
        all[i] = npg_clock_s() - start;
    }
    qsort(all, n, sizeof *all, by_size);
    *seconds = all[n / 2];
    npg_release(&all);
    return status;
}

/* Time a call that does so many operations and moves so many bytes at least, and note it. */
static npg_status note(bench *b, const char *name, work *call, void *user, double flops, double bytes)
{
    double seconds;
    NPG_TRY(npg_error_prefix(time_of(&seconds, b, call, user), "%s", name));
    json_object_set_new(b->kernels, name,
                        json_pack("{s:f, s:f, s:f, s:f, s:f}", "seconds", seconds, "gflops",
                                  flops / seconds / 1e9, "gbytes", bytes / seconds / 1e9,
                                  "share_of_multiply_add_peak", flops / seconds / b->peak_flops,
                                  "share_of_memory_peak", bytes / seconds / b->peak_bytes));
    return NPG_OK;
}

/* ---- the machine's peaks ---- */

typedef struct peak {
    npg_program *program;
    npg_buffer a, b;
    size_t items;
} peak;

enum { PEAK_ROUNDS = 4000000, COPY_VECTORS = 1 << 20 };

static npg_status multiply_add(void *user)
{
    peak *p = user;
    return NPG_LAUNCH_GROUPS(p->program, "peak_multiply_add", p->items, 1, NPG_BUF(&p->a),
                             NPG_INT(PEAK_ROUNDS), NPG_REAL(0.999), NPG_REAL(1e-3));
}

static npg_status copy(void *user)
{
    peak *p = user;
    return NPG_LAUNCH_GROUPS(p->program, "peak_copy", p->items, 1, NPG_BUF(&p->a), NPG_BUF(&p->b),
                             NPG_INT(COPY_VECTORS));
}

static npg_status measure_peaks(bench *b)
{
    peak p = {.items = (size_t)npg_device_facts(b->device)->units};
    double seconds, items = (double)p.items;
    size_t bytes = p.items * COPY_VECTORS * 64;
    npg_status status = npg_program_open(&p.program, b->device, "peak", "");
    if (!status) status = npg_buffer_open(&p.a, b->device, bytes);
    if (!status) status = npg_buffer_open(&p.b, b->device, bytes);
    if (!status) status = time_of(&seconds, b, multiply_add, &p);
    if (!status) b->peak_flops = items * PEAK_ROUNDS * 24.0 * 16 * 2 / seconds;
    if (!status) status = time_of(&seconds, b, copy, &p);
    if (!status) b->peak_bytes = 2.0 * (double)bytes / seconds;
    npg_buffer_close(&p.a);
    npg_buffer_close(&p.b);
    npg_program_close(&p.program);
    return status;
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
    const npg_mesh *mesh = b->body.mesh;
    const float rate = 1e-3f;
    npg_samples samples;
    for (int l = 0; l < 8; l++)
        npg_levels_add(
            &g->levels,
            (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 0.125, 0.4 * pow(1.5, l), true, 1}, 0);
    npg_levels_add(&g->levels, (npg_level){NPG_LEVEL_NORMAL, 4, 0, 0, 30, 32, 1, 0.4, true, 1}, 0);
    NPG_TRY(
        npg_samples_open(&samples, &g->levels, mesh->vert_pos, mesh->vert_normals, mesh->vert_count, rows));
    npg_status status = npg_latent_open(&g->latent, b->device, &samples);
    npg_samples_close(&samples);
    NPG_TRY(status);
    size_t count = g->levels.row_count * NPG_LATENT_CHANNELS, bytes = count * sizeof(float);
    size_t z_bytes = rows * NPG_LATENT_CHANNELS * sizeof(float);
    NPG_TRY(npg_sobolev_open(&g->sobolev, b->device, &g->levels));
    NPG_TRY(npg_adam_open(&g->adam, b->device, &rate, count, count));
    NPG_TRY(npg_buffer_open(&g->u, b->device, bytes));
    NPG_TRY(npg_buffer_open(&g->nodes, b->device, bytes));
    NPG_TRY(npg_buffer_open(&g->dnodes, b->device, bytes));
    NPG_TRY(npg_buffer_open(&g->z, b->device, z_bytes));
    return npg_buffer_open(&g->dz, b->device, z_bytes);
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
    const npg_mesh *mesh = b->body.mesh;
    const npg_mlp_shape shape = {512, 512, 8, 0.01f};
    npg_target targets[BATCH];
    uint32_t(*edges)[2];
    size_t edge_count;
    m->count = b->body.frame_count < BATCH ? b->body.frame_count : BATCH;
    for (size_t t = 0; t < m->count; t++)
        targets[t] = (npg_target){b->body.frames[t].points, b->body.frames[t].count};
    NPG_TRY(npg_mlp_open(&m->mlp, b->device, &shape, rows, m->count, m->count));
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, mesh->faces, mesh->face_count));
    npg_status status =
        npg_motion_open(&m->motion, b->device, NPG_ROTATION_QUATERNION, mesh->vert_pos, mesh->vert_count,
                        rows, (const uint32_t(*)[2])edges, edge_count, targets, m->count);
    npg_release(&edges);
    return status;
}

static npg_status note_moves(bench *b, moves *m, size_t rows)
{
    const double T = (double)m->count, V = (double)rows, N = (double)b->body.point_count, W = 512, C = 32;
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

/* ---- the whole ---- */

typedef struct epochs {
    double last_s, *seconds;
} epochs;

static npg_status watch(void *user, const npg_fit_step *step)
{
    epochs *e = user;
    double now = npg_clock_s();
    e->seconds[step->epoch] = now - e->last_s;
    e->last_s = now;
    return NPG_OK;
}

/* The method's own settings, from the tables. */
static npg_status fit_settings(npg_fit_settings *out, int64_t count)
{
    npg_options *options;
    NPG_TRY(npg_options_open(&options));
    npg_fit_settings_fill(out, options);
    out->epochs = count;
    npg_options_close(&options);
    return NPG_OK;
}

static npg_status bench_fit(bench *b, json_t *root)
{
    npg_fit_settings fit_with;
    npg_fit *fit = NULL;
    epochs e = {0};
    size_t n = (size_t)b->s.epochs;
    NPG_TRY(fit_settings(&fit_with, b->s.epochs));
    npg_status status = npg_alloc_array(&e.seconds, NPG_FOR_RUN, n, sizeof *e.seconds);
    if (!status) status = npg_fit_open(&fit, b->device, &fit_with, b->body.mesh, 1);
    if (!status)
        status = npg_fit_begin(fit, b->body.frames, b->body.frame_count, (int64_t)b->body.frame_count / 2);
    e.last_s = npg_clock_s();
    if (!status) status = npg_fit_run(fit, 0, b->s.epochs, watch, &e);
    npg_fit_close(&fit);
    if (!status) {
        qsort(e.seconds, n, sizeof *e.seconds, by_size);
        double epoch_s = e.seconds[n / 2], frames = (double)b->body.frame_count;
        json_object_set_new(root, "fit",
                            json_pack("{s:i, s:i, s:f, s:f, s:f}", "vertices", (int)b->body.mesh->vert_count,
                                      "frames", (int)b->body.frame_count, "seconds_per_epoch", epoch_s,
                                      "frame_epochs_per_second", frames / epoch_s,
                                      "frames_per_second_at_250_epochs", frames / (250 * epoch_s)));
    }
    npg_release(&e.seconds);
    return status;
}

static npg_status do_bench(bench *b, json_t *root)
{
    NPG_TRY(npg_device_open(&b->device, b->s.device));
    NPG_TRY(npg_bench_body_open(&b->body, (size_t)b->s.vertices, (size_t)b->s.points, (size_t)b->s.frames));
    NPG_TRY(measure_peaks(b));
    size_t rows = npg_mlp_rows(b->device, b->body.mesh->vert_count);
    const npg_device_info *info = npg_device_facts(b->device);
    json_object_set_new(root, "version", json_string(npg_version()));
    json_object_set_new(
        root, "device",
        json_pack("{s:s, s:s, s:i}", "name", info->name, "platform", info->platform, "units", info->units));
    json_object_set_new(root, "peak",
                        json_pack("{s:f, s:f}", "multiply_add_gflops", b->peak_flops / 1e9, "memory_gbytes",
                                  b->peak_bytes / 1e9));
    json_object_set(root, "kernels", b->kernels);
    NPG_TRY(bench_grids(b, rows));
    NPG_TRY(bench_moves(b, rows));
    return bench_fit(b, root);
}

int npg_verb_bench(int argc, char **argv)
{
    bench b = {0};
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &b.s, NULL, argc, argv);
    if (status) return npg_cli_end(argv[0], status);
    json_t *root = json_object();
    b.kernels = json_object();
    status = do_bench(&b, root);
    npg_bench_body_close(&b.body);
    npg_device_close(&b.device);
    if (!status && (json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6)) || puts("") < 0))
        status = npg_error(NPG_DISK, "standard output can't be written");
    json_decref(b.kernels);
    json_decref(root);
    return npg_cli_end(argv[0], status);
}
