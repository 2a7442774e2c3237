/* neupig tune: tries parameters of the kernels on this device, checks each against the plain twins, and keeps
 * the fastest for later runs. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "tools/bench/bench_rows.h"
#include "tools/cli.h"

#define GAIN                                                                                                 \
    0.03 /* a set takes the place of the present one when it is faster by this share: more than noise */

typedef struct settings {
    int64_t vertices, points, frames, repeat;
    const char *device, *tuning, *output, *only;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_tune_options[] = {
    /* type      name        place         default  least  most  shown as */
    NPG_ROW_TEXT("output",   AT(output),   "",      "FILE",
        "write the set to this file instead of the cache, where runs look for it"),
    NPG_ROW_TEXT("only",     AT(only),     "",      "NAMES",
        "tune only this: decoder, or names of other numbers of a set, separated by commas"),
    NPG_ROW_INT ("vertices", AT(vertices), "1500",  16,    1e6,  NULL,
        "vertices of the mesh that is timed"),
    NPG_ROW_INT ("points",   AT(points),   "5000",  1,     1e6,  NULL,
        "points of each frame"),
    NPG_ROW_INT ("frames",   AT(frames),   "8",     1,     1000, NULL,
        "frames of the window"),
    NPG_ROW_INT ("repeat",   AT(repeat),   "7",     1,     1000, NULL,
        "times each is taken; the median counts"),
    NPG_ROW_TEXT("device",   AT(device),   "auto",  "NAME",
        "OpenCL device: auto, cpu, gpu, a number or a part of its name"),
    NPG_ROW_TEXT("tuning",   AT(tuning),   "auto",  "SET",
        "the set to begin with: auto, wide, narrow, gpu or a file"),
    {0}};
/* clang-format on */

typedef struct tune {
    settings s;
    npg_device *device;
    npg_bench_body body;
    npg_meter meter;
    npg_tuning best;
    double cost, flops; /* of the set at hand, summed over its rows */
} tune;

/* ---- what is tried ---- */

/* Values of the decoder that belong together: rows, vector, tile vectors, tile rows,
 * grad rows, head rows, local. */
typedef struct tile_set {
    int values[7];
} tile_set;

/* clang-format off */
static const tile_set tiles_of_processors[] = {
    {{192, 16, 2, 12,  8, 12, 1}},
    {{ 96, 16, 2, 12,  8, 12, 1}},
    {{192, 16, 2,  8,  8, 12, 1}},
    {{192, 16, 1, 24, 16, 12, 1}},
    {{192,  8, 2,  6,  4,  6, 1}},
    {{192,  8, 4,  3,  2,  6, 1}},
    {{192,  8, 2, 12,  8, 12, 1}},
    {{192,  4, 2,  6,  4,  6, 1}},
    {{0}}};

static const tile_set tiles_of_gpus[] = {
    {{ 64, 4, 1,  8,  8, 1, 128}},
    {{ 32, 4, 1,  8,  8, 1, 128}},
    {{128, 4, 1,  8,  8, 1, 128}},
    {{ 64, 4, 1, 16,  8, 1, 128}},
    {{ 64, 4, 2,  8,  8, 1,  64}},
    {{ 64, 4, 1,  4,  4, 1, 128}},
    {{ 64, 4, 1,  8, 16, 1, 256}},
    {{0}}};
/* clang-format on */

/* One number alone: its name, the rows that show it, the ops to check, the values
 * for processors and for GPUs. */
typedef struct one_number {
    const char *field, *row, *op;
    int processors[6], gpus[6];
} one_number;

/* clang-format off */
static const one_number knobs[] = {
    {"nearest_queries", "nearest_and_chamfer",               "nearest", {16, 64, 256},    {1, 2, 4, 8}},
    {"frame_local",     "nearest_and_chamfer",               "chamfer", {1},              {32, 64, 128, 256}},
    {"span",            "adam",                              "adam",    {8, 16, 64, 256}, {1, 2, 4}},
    {"local",           "latent,transform,isometry,sobolev", "",        {1, 4, 16, 32},   {32, 64, 128}},
    {0}};
/* clang-format on */

/* ---- one set ---- */

static npg_status add_row(void *user, const npg_bench_row *row)
{
    tune *t = user;
    t->cost += row->timing.in_flops.median;
    t->flops += row->work.flops;
    return NPG_OK;
}

/* Largest error of the ops whose names begin so; *agrees: all are within their tolerance. */
static npg_status check_ops(double *error, bool *agrees, npg_device *device, const char *op)
{
    *error = 0;
    *agrees = true;
    for (const npg_kernel_case *c = npg_kernel_cases; c->op; c++) {
        double one = 0;
        if (strncmp(c->op, op, strlen(op)) != 0) continue;
        for (int size = 1; size <= 3; size += 2) { /* one block, and several with a part of one */
            NPG_TRY(c->check(device, size, 7, &one));
            if (!(one <= c->tolerance)) *agrees = false;
            if (!(one <= *error)) *error = one;
        }
    }
    return NPG_OK;
}

/* Check and time a set by the rows that begin so; it becomes the best when it is right and faster. */
static npg_status try_set(tune *t, const npg_tuning *set, const char *what, const char *row, const char *op,
                          double *best_cost)
{
    double error;
    bool agrees;
    NPG_TRY(npg_device_set_tuning(t->device, set));
    npg_status status = check_ops(&error, &agrees, t->device, op);
    t->cost = t->flops = 0;
    if (!status && agrees) status = npg_bench_kernels(&t->meter, &t->body, row, add_row, t);
    if (status == NPG_DEVICE) { /* too large for this device: its compiler or its launch says no */
        printf("  %-44s can't be used: %s\n", what, npg_error_text());
        return NPG_OK;
    }
    NPG_TRY(status);
    if (!agrees) {
        printf("  %-44s computes wrong: error %.2g\n", what, error);
        return NPG_OK;
    }
    bool is_first = *best_cost <= 0, is_best = is_first || t->cost < *best_cost * (1 - GAIN);
    printf("  %-44s error %.1e  %9.1f Mops of peak", what, error, t->cost / 1e6);
    if (t->flops > 0) printf("  %5.1f %% of multiply-add", 100 * t->flops / t->cost);
    puts(is_first ? "  (present)" : is_best ? "  (best so far)" : "");
    fflush(stdout);
    if (!is_best) return NPG_OK;
    *best_cost = t->cost;
    t->best = *set;
    return NPG_OK;
}

/* ---- all of them ---- */

static npg_tuning with_tile(npg_tuning set, const tile_set *tile)
{
    const int *v = tile->values;
    set.mlp_rows = v[0];
    set.mlp_vector = v[1];
    set.mlp_tile_vectors = v[2];
    set.mlp_tile_rows = v[3];
    set.mlp_grad_rows = v[4];
    set.mlp_head_rows = v[5];
    set.mlp_local = v[6];
    return set;
}

static void name_tile(char *out, size_t size, const npg_tuning *t)
{
    snprintf(out, size, "block %d, tile %d x %d x %d, grad %d, group %d", t->mlp_rows, t->mlp_tile_rows,
             t->mlp_tile_vectors, t->mlp_vector, t->mlp_grad_rows, t->mlp_local);
}

static npg_status tune_decoder(tune *t)
{
    char what[96];
    double cost = 0;
    npg_tuning present = t->best;
    bool is_cpu = npg_device_facts(t->device)->is_cpu;
    puts("decoder");
    name_tile(what, sizeof what, &present);
    NPG_TRY(try_set(t, &present, what, "mlp_", "mlp", &cost));
    for (const tile_set *tile = is_cpu ? tiles_of_processors : tiles_of_gpus; tile->values[0]; tile++) {
        npg_tuning set = with_tile(present, tile);
        if (!memcmp(&set, &present, sizeof set)) continue;
        name_tile(what, sizeof what, &set);
        NPG_TRY(try_set(t, &set, what, "mlp_", "mlp", &cost));
    }
    return NPG_OK;
}

static npg_status tune_knob(tune *t, const one_number *knob)
{
    char what[96];
    double cost = 0;
    const npg_tuning_field *field = npg_tuning_fields;
    const int *values = npg_device_facts(t->device)->is_cpu ? knob->processors : knob->gpus;
    npg_tuning present = t->best;
    while (strcmp(field->name, knob->field) != 0) field++;
    if (!values[1]) return NPG_OK;
    puts(field->help);
    snprintf(what, sizeof what, "%d", npg_tuning_get(&present, field));
    NPG_TRY(try_set(t, &present, what, knob->row, knob->op, &cost));
    for (size_t i = 0; i < 6 && values[i]; i++) {
        npg_tuning set = present;
        if (values[i] == npg_tuning_get(&present, field)) continue;
        npg_tuning_put(&set, field, values[i]);
        snprintf(what, sizeof what, "%d", values[i]);
        NPG_TRY(try_set(t, &set, what, knob->row, knob->op, &cost));
    }
    return NPG_OK;
}

static npg_status save_best(const tune *t)
{
    char path[NPG_CACHE_PATH];
    if (*t->s.output)
        snprintf(path, sizeof path, "%s", t->s.output);
    else
        NPG_TRY(npg_device_tuning_path(path, sizeof path, t->device));
    NPG_TRY(npg_tuning_save(&t->best, path, npg_device_facts(t->device)->name));
    printf("written: %s\n", path);
    return NPG_OK;
}

static npg_status do_tune(tune *t)
{
    const settings *s = &t->s;
    NPG_TRY(npg_device_open_tuned(&t->device, s->device, s->tuning));
    t->best = *npg_device_tuning(t->device);
    printf("%s, beginning with %s\n", npg_device_facts(t->device)->name, npg_device_tuning_source(t->device));
    NPG_TRY(npg_bench_body_open(&t->body, (size_t)s->vertices, (size_t)s->points, (size_t)s->frames));
    NPG_TRY(npg_meter_open(&t->meter, t->device, (size_t)s->repeat));
    if (npg_bench_wants(s->only, "decoder")) NPG_TRY(tune_decoder(t));
    for (const one_number *knob = knobs; knob->field; knob++)
        if (npg_bench_wants(s->only, knob->field)) NPG_TRY(tune_knob(t, knob));
    NPG_TRY(npg_device_set_tuning(t->device, &t->best));
    NPG_TRY(npg_kernels_self_test(t->device));
    return save_best(t);
}

int npg_verb_tune(int argc, char **argv)
{
    tune t = {0};
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &t.s, NULL, argc, argv);
    if (status) return npg_cli_end(argv[0], status);
    status = do_tune(&t);
    npg_meter_close(&t.meter);
    npg_bench_body_close(&t.body);
    npg_device_close(&t.device);
    return npg_cli_end(argv[0], status);
}
