/* neupig bench: how long the parts that a run spends its time in take on this machine, as a table or as JSON. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "kernels/mlp.h"
#include "kernels/motion.h"
#include "mesh/surface.h"
#include "optimize/solver.h"
#include "pipeline/clock.h"
#include "pipeline/order.h"
#include "tools/cli.h"
#include "tools/synth/synth.h"
#include "track/track.h"

typedef struct settings {
    int64_t vertices, points, frames, repeat;
    const char *device, *only;
    bool json;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_bench_options[] = {
    /* type      name        place         default  least  most  shown as */
    NPG_ROW_FLAG("json",     AT(json),     "no",
        "print JSON instead of a table"),
    NPG_ROW_TEXT("only",     AT(only),     "",      "NAME",
        "time only rows whose names begin so"),
    NPG_ROW_INT ("vertices", AT(vertices), "10000", 2500,  5e5,  NULL,
        "vertices of the walking figure, about"),
    NPG_ROW_INT ("points",   AT(points),   "5000",  50,    1e6,  NULL,
        "points of each frame"),
    NPG_ROW_INT ("frames",   AT(frames),   "24",    2,     1000, NULL,
        "frames of the window that is solved at once"),
    NPG_ROW_INT ("repeat",   AT(repeat),   "9",     1,     1000, NULL,
        "times each row is taken; the median counts"),
    NPG_ROW_TEXT("device",   AT(device),   "auto",  "NAME",
        "OpenCL device: auto, cpu, gpu, a number or a part of its name"),
    {0}};
/* clang-format on */

/* All that the rows work on; what belongs to some of them is opened when the first of these is timed. */
typedef struct bench {
    settings s;
    json_t *rows;
    npg_arena arena;
    npg_moving figure;
    npg_mesh *mesh;      /* its, as it is in the first frame, unit coordinates */
    float **poses;       /* T: its vertices in each frame                   */
    npg_scanned *clouds; /* T                                               */
    npg_device *device;  /* kernels */
    npg_mlp mlp;
    npg_motion motion;
    size_t batch;         /* frames that the kernels take at once */
    npg_surface *surface; /* closest */
    npg_surface_hit *hits;
    npg_tracker *tracker; /* track */
    double *pose;
    npg_energy *energy;
    npg_energy_frame *window;
    float *ways;
} bench;

/* ---- the figure ---- */

static npg_status open_figure(bench *b)
{
    enum { SURFACE = 9 }; /* triangles' vertices in a square metre cell of the figure, measured */
    const size_t count = (size_t)b->s.frames;
    npg_scan scan = {.point_count = b->s.points, .noise = 0.1, .diagonal = 2};
    b->figure.kind = &npg_walker;
    NPG_TRY(npg_moving_open(&b->figure, sqrt(SURFACE / (double)b->s.vertices), false));
    npg_mesh *m = b->mesh = b->figure.mesh;
    b->poses = npg_arena_take(&b->arena, count, sizeof *b->poses);
    b->clouds = npg_arena_take(&b->arena, count, sizeof *b->clouds);
    NPG_TRY(npg_arena_status(&b->arena));
    for (size_t t = count; t--;) { /* the mesh stays as it is in the first frame */
        npg_moving_pose(&b->figure, &(npg_moment){.phase = (double)t / (double)count});
        for (size_t v = 0; v < m->vert_count; v++) m->vert_pos[3 * v + 1] -= 0.9f; /* its middle */
        b->poses[t] = npg_arena_copy(&b->arena, m->vert_pos, m->vert_count, 3 * sizeof(float));
        NPG_TRY(npg_arena_status(&b->arena));
        NPG_TRY(npg_scan_frame(&b->clouds[t], &scan, m, t));
    }
    return NPG_OK;
}

/* ---- kernels: decoder, and what follows it, of one batch of frames ---- */

static npg_status open_kernels(bench *b)
{
    enum { BATCH = 4 };
    static const npg_mlp_shape decoder = {512, 512, 8}; /* of the paper's preset */
    npg_target targets[BATCH];
    uint32_t(*edges)[2];
    size_t edge_count;
    const npg_mesh *m = b->mesh;
    if (b->device) return NPG_OK;
    b->batch = b->s.frames < BATCH ? (size_t)b->s.frames : BATCH;
    for (size_t t = 0; t < b->batch; t++) targets[t] = (npg_target){b->clouds[t].pos, b->clouds[t].count};
    NPG_TRY(npg_device_open(&b->device, b->s.device, NULL));
    size_t rows = npg_mlp_rows(b->device, m->vert_count);
    NPG_TRY(npg_mlp_open(&b->mlp, b->device, &decoder, rows, b->batch, b->batch));
    NPG_TRY(npg_mlp_begin(&b->mlp));
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, m->faces, m->face_count));
    npg_status status = npg_motion_open(&b->motion, b->device, m->vert_pos, m->vert_count, rows,
                                        (const uint32_t(*)[2])edges, edge_count, targets, b->batch);
    npg_release(&edges);
    return status;
}

static npg_status mlp_forward(bench *b)
{
    return npg_mlp_forward(&b->mlp, 0, b->batch);
}
static npg_status mlp_backward(bench *b)
{
    return npg_mlp_backward(&b->mlp, 0, b->batch);
}
static npg_status transform(bench *b)
{
    return npg_motion_apply(&b->motion, &b->mlp.out, 0, b->batch);
}
static npg_status nearest(bench *b)
{
    return npg_motion_chamfer(&b->motion, 0.3, 0, b->batch);
}
static npg_status isometry(bench *b)
{
    static const float gains[] = {1, 1, 1, 1};
    return npg_motion_back(&b->motion, &b->mlp.dout, &b->mlp.out, gains, 100, 0, b->batch);
}

/* ---- the host's parts; their settings are the options' defaults ---- */

static npg_status open_surface(bench *b)
{
    const npg_mesh *m = b->mesh;
    b->hits = npg_arena_take(&b->arena, b->clouds[1].count, sizeof *b->hits);
    NPG_TRY(npg_arena_status(&b->arena));
    return npg_surface_open(&b->surface, m->vert_pos, m->vert_count, m->faces, m->face_count);
}

static npg_status closest(bench *b)
{
    return npg_surface_closest_near(b->surface, b->hits, b->clouds[1].pos, b->clouds[1].count, NULL, 0);
}

static npg_status open_tracker(bench *b)
{
    static const npg_tracker_settings usual = {1600, 5000, 12, 0.006, 0.001};
    NPG_TRY(npg_tracker_open(&b->tracker, b->mesh, &usual));
    b->pose = npg_arena_take(&b->arena, npg_pose_bytes(npg_tracker_node_count(b->tracker)), 1);
    return npg_arena_status(&b->arena);
}

/* From the first frame's pose to the second. */
static npg_status track(bench *b)
{
    npg_tracked tracked;
    const npg_tracker_cloud cloud = {.points = b->clouds[1].pos, .count = b->clouds[1].count};
    npg_pose_rest(b->pose, npg_tracker_node_count(b->tracker));
    return npg_tracker_fit(b->tracker, &tracked, b->pose, &cloud, NULL, NULL);
}

static const npg_solver_settings usual_joint = {.epochs = 60, .energy = {.points = 5000, .shape = 0.1}};

static npg_status open_joint(bench *b)
{
    size_t count = (size_t)b->s.frames;
    b->window = npg_arena_take(&b->arena, count, sizeof *b->window);
    b->ways = npg_arena_take(&b->arena, count * b->mesh->vert_count, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&b->arena));
    for (size_t t = 0; t < count; t++)
        b->window[t] = (npg_energy_frame){.positions = b->poses[t],
                                          .points = b->clouds[t].pos,
                                          .normals = b->clouds[t].normals,
                                          .point_count = b->clouds[t].count};
    return npg_energy_open(&b->energy, b->mesh, &usual_joint.energy);
}

/* The whole window, always from the same poses. */
static npg_status joint(bench *b)
{
    npg_solved solved;
    const npg_problem problem = {
        .settings = &usual_joint, .count = (size_t)b->s.frames, .energy = b->energy, .result = b->ways};
    npg_energy_set_noise(b->energy, 0);
    NPG_TRY(npg_energy_set(b->energy, b->window, problem.count));
    return npg_solver_joint.solve(NULL, &solved, &problem, NULL, NULL);
}

static npg_status poisson(bench *b)
{
    const npg_poisson_settings usual = {.depth = 8, .point_weight = 10, .time_limit_s = 600};
    npg_mesh *mesh;
    npg_status status =
        npg_poisson(&mesh, b->clouds[0].pos, b->clouds[0].normals, b->clouds[0].count, &usual);
    npg_mesh_unref(&mesh);
    return status;
}

/* clang-format off */
static const struct row {
    const char *name;
    npg_status (*open)(bench *), (*call)(bench *);
} rows[] = {
    {"mlp_forward",  open_kernels, mlp_forward},
    {"mlp_backward", open_kernels, mlp_backward},
    {"transform",    open_kernels, transform},
    {"nearest",      open_kernels, nearest},
    {"isometry",     open_kernels, isometry},
    {"closest",      open_surface, closest},
    {"track",        open_tracker, track},
    {"joint",        open_joint,   joint},
    {"poisson",      NULL,         poisson},
    {0}};
/* clang-format on */

/* ---- timing ---- */

/* So many calls; what the device still has to do belongs to them. */
static npg_status call_row(npg_busy *took, bench *b, const struct row *row, size_t calls)
{
    npg_status status = NPG_OK;
    npg_busy start = npg_busy_now();
    for (size_t i = 0; i < calls && !status; i++) status = row->call(b);
    if (!status && b->device) status = npg_device_finish(b->device);
    npg_busy end = npg_busy_now(); /* helper processes work for a row, too */
    took->wall_s = (end.wall_s - start.wall_s) / (double)calls;
    took->cpu_s = (end.cpu_s + end.children_s - start.cpu_s - start.children_s) / (double)calls;
    return status;
}

static double median(double *values, size_t count)
{
    qsort(values, count, sizeof *values, npg_order_double);
    return values[count / 2];
}

static npg_status time_row(bench *b, const struct row *row)
{
    const double least_s = 8e-3; /* shorter calls are taken several times for one figure */
    size_t calls = 1, count = (size_t)b->s.repeat;
    npg_busy took;
    double *wall_s = npg_arena_take(&b->arena, count, sizeof *wall_s);
    double *cpu_s = npg_arena_take(&b->arena, count, sizeof *cpu_s);
    NPG_TRY(npg_arena_status(&b->arena));
    if (row->open) NPG_TRY(row->open(b));
    NPG_TRY(call_row(&took, b, row, 1)); /* the first may build */
    NPG_TRY(call_row(&took, b, row, 1));
    if (took.wall_s < least_s) calls = (size_t)(least_s / fmax(took.wall_s, 1e-6)) + 1;
    for (size_t i = 0; i < count; i++) {
        NPG_TRY(call_row(&took, b, row, calls));
        wall_s[i] = took.wall_s;
        cpu_s[i] = took.cpu_s;
    }
    json_object_set_new(
        b->rows, row->name,
        json_pack("{s:f, s:f}", "wall_s", median(wall_s, count), "process_cpu_s", median(cpu_s, count)));
    return NPG_OK;
}

static npg_status measure(bench *b)
{
    NPG_TRY(open_figure(b));
    for (const struct row *row = rows; row->name; row++)
        if (!strncmp(row->name, b->s.only, strlen(b->s.only)))
            NPG_TRY(npg_error_prefix(time_row(b, row), "%s", row->name));
    if (json_object_size(b->rows)) return NPG_OK;
    return npg_error(NPG_USAGE, "option only: no row's name begins with \"%s\"", b->s.only);
}

/* ---- the report ---- */

static void print_json(const bench *b)
{
    json_t *root = json_pack("{s:s, s:{s:I, s:I, s:I}, s:O}", "version", npg_version(), "sizes", "vertices",
                             (json_int_t)b->mesh->vert_count, "points", (json_int_t)b->s.points, "frames",
                             (json_int_t)b->s.frames, "rows", b->rows);
    if (b->device)
        json_object_set_new(root, "device",
                            json_pack("{s:s, s:s}", "name", npg_device_facts(b->device)->name, "tuning",
                                      npg_device_tuning(b->device)->name));
    npg_cli_print(root);
}

static void print_table(const bench *b)
{
    const char *name;
    json_t *row;
    if (b->device)
        printf("%s, tuning %s\n", npg_device_facts(b->device)->name, npg_device_tuning(b->device)->name);
    printf("%zu vertices, %lld points, %lld frames\n\n%-14s %12s %14s\n", b->mesh->vert_count,
           (long long)b->s.points, (long long)b->s.frames, "part", "wall ms", "processor ms");
    json_object_foreach(b->rows, name, row)
        printf("%-14s %12.3f %14.3f\n", name, 1e3 * json_number_value(json_object_get(row, "wall_s")),
               1e3 * json_number_value(json_object_get(row, "process_cpu_s")));
}

static void close_bench(bench *b)
{
    npg_energy_close(&b->energy);
    npg_tracker_close(&b->tracker);
    npg_surface_close(&b->surface);
    npg_motion_close(&b->motion);
    npg_mlp_close(&b->mlp);
    npg_device_close(&b->device);
    for (int64_t t = 0; b->clouds && t < b->s.frames; t++) npg_scanned_close(&b->clouds[t]);
    npg_moving_close(&b->figure);
    npg_arena_release(&b->arena);
    json_decref(b->rows);
}

npg_status npg_verb_bench(const npg_cli *cli)
{
    const settings *s = cli->values;
    bench b = {.s = *s, .arena = {.purpose = NPG_FOR_RUN}, .rows = json_object()};
    npg_status status = measure(&b);
    if (!status) s->json ? print_json(&b) : print_table(&b);
    close_bench(&b);
    return status;
}
