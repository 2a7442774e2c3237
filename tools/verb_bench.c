/* neupig bench: every kernel beside the peak that binds it, dense surfaces, and the whole fit; as a table, as
 * JSON, or against an earlier report. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "optimize/optimize.h"
#include "pipeline/clock.h"
#include "pipeline/json_file.h"
#include "tools/bench/bench_compare.h"
#include "tools/bench/bench_rows.h"
#include "tools/cli.h"

typedef struct settings {
    int64_t vertices, points, frames, epochs, repeat, dense, cloud;
    const char *device, *tuning, *only, *output, *compare;
    double tolerance;
    bool json;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_bench_options[] = {
    /* type      name         place          default   least  most   shown as */
    NPG_ROW_FLAG("json",      AT(json),      "no",
        "print the report as JSON instead of a table"),
    NPG_ROW_TEXT("output",    AT(output),    "",       "FILE",
        "write the report as JSON to this file"),
    NPG_ROW_TEXT("compare",   AT(compare),   "",       "FILE",
        "say what is slower than in this report, beyond noise: exit code 7 if anything is"),
    NPG_ROW_REAL("tolerance", AT(tolerance), "0.05",   0,     10,    NULL,
        "share by which the quartiles must lie apart for that"),
    NPG_ROW_TEXT("only",      AT(only),      "",       "NAME",
        "time only rows whose names begin with one of these words, separated by commas"),
    NPG_ROW_INT ("vertices",  AT(vertices),  "10000",  16,    1e6,   NULL,
        "vertices of the mesh"),
    NPG_ROW_INT ("points",    AT(points),    "5000",   1,     1e6,   NULL,
        "points of each frame"),
    NPG_ROW_INT ("frames",    AT(frames),    "17",     1,     1000,  NULL,
        "frames of the window"),
    NPG_ROW_INT ("dense",     AT(dense),     "100000", 0,     1e7,   NULL,
        "vertices of the dense surface that is carried and decoded, 0: none"),
    NPG_ROW_INT ("cloud",     AT(cloud),     "200000", 0,     1e7,   NULL,
        "points of the dense cloud that is cleaned and searched, 0: none"),
    NPG_ROW_INT ("epochs",    AT(epochs),    "10",     1,     10000, NULL,
        "epochs of the fit that is timed"),
    NPG_ROW_INT ("repeat",    AT(repeat),    "9",      1,     1000,  NULL,
        "times each row is taken; quartiles and median count"),
    NPG_ROW_TEXT("device",    AT(device),    "auto",   "NAME",
        "OpenCL device: auto, cpu, gpu, a number or a part of its name"),
    NPG_ROW_TEXT("tuning",    AT(tuning),    "auto",   "SET",
        "the kernels' parameters: auto, wide, narrow, gpu or a file of neupig tune"),
    {0}};
/* clang-format on */

typedef struct bench {
    settings s;
    npg_device *device;
    npg_bench_body body;
    npg_meter meter;
    json_t *kernels; /* loan */
} bench;

/* ---- rows ---- */

static json_t *json_of_spread(npg_spread spread)
{
    return json_pack("{s:f, s:f, s:f}", "low", spread.low, "median", spread.median, "high", spread.high);
}

/* How many such threads a device has room for: what runs in one thread of the host keeps one unit of a
 * processor busy. */
static double units_of(const bench *b)
{
    const npg_device_info *info = npg_device_facts(b->device);
    return info->is_cpu ? info->units : 1;
}

static npg_status visit_row(void *user, const npg_bench_row *row)
{
    bench *b = user;
    bool by_bytes;
    double share = npg_bench_share(row, &by_bytes), busy_s = row->timing.busy_s.median;
    json_t *json = json_pack("{s:f, s:f, s:f, s:f, s:f, s:f, s:s, s:f}", "flops", row->work.flops, "bytes",
                             row->work.bytes, "wall_s", row->timing.wall_s, "gflops",
                             row->work.flops / busy_s / 1e9, "gbytes", row->work.bytes / busy_s / 1e9,
                             "share_of_multiply_add_peak", row->work.flops / row->timing.in_flops.median,
                             "bound_by", by_bytes ? "memory" : "multiply-add", "share_of_bound", share);
    json_object_set_new(json, "busy_s", json_of_spread(row->timing.busy_s));
    json_object_set_new(json, "relative",
                        json_of_spread(by_bytes ? row->timing.in_bytes : row->timing.in_flops));
    if (row->work.vertex_frames > 0)
        json_object_set_new(
            json, "vertex_frames_per_busy_second",
            json_real(row->work.vertex_frames / busy_s / (row->work.on_host ? units_of(b) : 1)));
    if (row->work.points > 0)
        json_object_set_new(json, "processor_us_per_point",
                            json_real(1e6 * busy_s * units_of(b) / row->work.points));
    json_object_set_new(b->kernels, row->work.name, json);
    return NPG_OK;
}

/* ---- the fit ---- */

typedef struct epochs {
    double last_wall_s, last_cpu_s, *wall_s, *cpu_s;
} epochs;

/* An npg_epoch_visit. */
static npg_status time_epoch(void *user, int64_t epoch)
{
    epochs *e = user;
    double wall_s = npg_clock_s(), cpu_s = npg_clock_process_s();
    if (epoch >= 0) {
        e->wall_s[epoch] = wall_s - e->last_wall_s;
        e->cpu_s[epoch] = cpu_s - e->last_cpu_s;
    }
    e->last_wall_s = wall_s;
    e->last_cpu_s = cpu_s;
    return NPG_OK;
}

static npg_status bench_fit(bench *b, json_t *root)
{
    epochs e = {0};
    size_t n = (size_t)b->s.epochs;
    if (!npg_bench_wants(b->s.only, "fit")) return NPG_OK;
    npg_status status = npg_alloc_array(&e.wall_s, NPG_FOR_RUN, 2 * n, sizeof *e.wall_s);
    e.cpu_s = e.wall_s + n;
    if (!status)
        status = npg_fit_once(b->device, b->body.mesh, (const float *const *)b->body.points,
                              b->body.point_count, b->body.frame_count, b->s.epochs, time_epoch, &e);
    if (!status) {
        double wall_s = npg_spread_of(e.wall_s, n).median, frames = (double)b->body.frame_count;
        json_object_set_new(
            root, "fit",
            json_pack("{s:i, s:i, s:f, s:f, s:f, s:f}", "vertices", (int)b->body.mesh->vert_count, "frames",
                      (int)b->body.frame_count, "seconds_per_epoch", wall_s, "cpu_seconds_per_epoch",
                      npg_spread_of(e.cpu_s, n).median, "frame_epochs_per_second", frames / wall_s,
                      "frames_per_second_at_250_epochs", frames / (250 * wall_s)));
    }
    npg_release(&e.wall_s);
    return status;
}

/* ---- the report ---- */

static void describe(bench *b, json_t *root)
{
    const npg_device_info *info = npg_device_facts(b->device);
    json_object_set_new(root, "version", json_string(npg_version()));
    json_object_set_new(
        root, "device",
        json_pack("{s:s, s:s, s:i}", "name", info->name, "platform", info->platform, "units", info->units));
    json_object_set_new(root, "tuning", json_string(npg_device_tuning_source(b->device)));
    json_object_set_new(root, "sizes",
                        json_pack("{s:I, s:I, s:I, s:I, s:I}", "vertices", (json_int_t)b->s.vertices,
                                  "points", (json_int_t)b->s.points, "frames", (json_int_t)b->s.frames,
                                  "dense", (json_int_t)b->s.dense, "cloud", (json_int_t)b->s.cloud));
    json_object_set(root, "kernels", b->kernels);
}

static npg_status measure(bench *b, json_t *root)
{
    NPG_TRY(npg_device_open_tuned(&b->device, b->s.device, b->s.tuning));
    NPG_TRY(npg_bench_body_open(&b->body, (size_t)b->s.vertices, (size_t)b->s.points, (size_t)b->s.frames));
    NPG_TRY(npg_meter_open(&b->meter, b->device, (size_t)b->s.repeat));
    describe(b, root);
    NPG_TRY(npg_bench_kernels(&b->meter, &b->body, b->s.only, visit_row, b));
    if (b->s.dense) NPG_TRY(npg_bench_dense(&b->meter, b->s.only, (size_t)b->s.dense, visit_row, b));
    if (b->s.cloud) NPG_TRY(npg_bench_clouds(&b->meter, b->s.only, (size_t)b->s.cloud, visit_row, b));
    NPG_TRY(npg_bench_frame(&b->meter, b->s.only, visit_row, b));
    NPG_TRY(bench_fit(b, root));
    if (!json_object_size(b->kernels) && !json_object_get(root, "fit"))
        return npg_error(NPG_USAGE, "option only: no row's name begins with \"%s\"", b->s.only);
    json_object_set_new(root, "peak",
                        json_pack("{s:f, s:f}", "multiply_add_gflops", b->meter.flops_per_s / 1e9,
                                  "memory_gbytes", b->meter.bytes_per_s / 1e9));
    return NPG_OK;
}

static double number_of(const json_t *object, const char *key)
{
    return json_number_value(json_object_get(object, key));
}

static void print_row(const char *name, const json_t *row)
{
    printf("%-28s %9.2f %9.2f %9.3f %9.3f %8.1f %8.2f %6.1f %% of %s\n", name, number_of(row, "flops") / 1e6,
           number_of(row, "bytes") / 1e6, 1e3 * number_of(json_object_get(row, "busy_s"), "median"),
           1e3 * number_of(row, "wall_s"), number_of(row, "gflops"), number_of(row, "gbytes"),
           100 * number_of(row, "share_of_bound"), json_string_value(json_object_get(row, "bound_by")));
    if (json_object_get(row, "vertex_frames_per_busy_second"))
        printf("%-28s %.3g vertex-frames/s\n", "", number_of(row, "vertex_frames_per_busy_second"));
    if (json_object_get(row, "processor_us_per_point"))
        printf("%-28s %.3g us of a processor a point\n", "", number_of(row, "processor_us_per_point"));
}

static void print_table(const json_t *root)
{
    const char *name;
    json_t *row;
    const json_t *device = json_object_get(root, "device"), *peak = json_object_get(root, "peak");
    const json_t *fit = json_object_get(root, "fit");
    printf("%s, tuning %s\npeak: %.1f GFLOP/s of multiply-adds, %.1f GB/s of copying\n\n",
           json_string_value(json_object_get(device, "name")),
           json_string_value(json_object_get(root, "tuning")), number_of(peak, "multiply_add_gflops"),
           number_of(peak, "memory_gbytes"));
    printf("%-28s %9s %9s %9s %9s %8s %8s %s\n", "kernel", "MFLOP", "MB", "busy ms", "wall ms", "GFLOP/s",
           "GB/s", "share of the limit");
    json_object_foreach(json_object_get(root, "kernels"), name, row) print_row(name, row);
    if (fit)
        printf("\nfit of %g vertices in %g frames: %.4g s an epoch (%.4g processor seconds)\n",
               number_of(fit, "vertices"), number_of(fit, "frames"), number_of(fit, "seconds_per_epoch"),
               number_of(fit, "cpu_seconds_per_epoch"));
}

static npg_status write_report(const settings *s, const json_t *root)
{
    if (*s->output) NPG_TRY(npg_json_save(s->output, root));
    if (!s->json) {
        print_table(root);
        return NPG_OK;
    }
    if (json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(6)) || puts("") < 0)
        return npg_error(NPG_DISK, "standard output can't be written");
    return NPG_OK;
}

static npg_status compare_with_earlier(const settings *s, const json_t *root)
{
    json_t *before;
    if (!*s->compare) return NPG_OK;
    NPG_TRY(npg_bench_load(&before, s->compare));
    npg_status status = npg_bench_compare(before, root, s->tolerance);
    json_decref(before);
    return status;
}

int npg_verb_bench(int argc, char **argv)
{
    bench b = {0};
    npg_cli cli;
    json_t *root = NULL;
    npg_status status = npg_cli_parse(&cli, argv[0], &b.s, NULL, argc, argv);
    if (status) return npg_cli_end(argv[0], status);
    b.kernels = json_object();
    if (cli.operand_count) {
        status = npg_bench_load(&root, cli.operands[0]);
    } else {
        root = json_object();
        status = measure(&b, root);
        if (!status) status = write_report(&b.s, root);
    }
    npg_meter_close(&b.meter);
    npg_bench_body_close(&b.body);
    npg_device_close(&b.device);
    if (!status) status = compare_with_earlier(&b.s, root);
    json_decref(b.kernels);
    json_decref(root);
    return npg_cli_end(argv[0], status);
}
