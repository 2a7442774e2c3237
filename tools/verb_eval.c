/* neupig eval: a mesh sequence against a ground truth, by the measures of the method's paper. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>

#include "pipeline/json_file.h"
#include "tools/cli.h"

typedef struct settings {
    bool points_only, json, per_frame;
    const char *frames;
    int64_t samples, seed;
    double tau;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_eval_options[] = {
    /* type      name           place            default   least  most          shown as */
    NPG_ROW_FLAG("points-only", AT(points_only), "no",
        "The truth is point clouds: CD and F between surface samples and all its points, "
        "NC with its normals, no Corr"),
    NPG_ROW_TEXT("frames",      AT(frames),      "",       "FRAMES",
        "Frames of the truth to use: a:b:step as Python slices, or positions like 1-5,8 (counted from 0)"),
    NPG_ROW_INT ("samples",     AT(samples),     "100000", 1,     1e8,          NULL,
        "Samples on either surface"),
    NPG_ROW_REAL("tau",         AT(tau),         "0.005",  0,     1,            NULL,
        "Distance of the F-score, in diagonals"),
    NPG_ROW_INT ("seed",        AT(seed),        "0",      0,     4294967295.0, NULL,
        "Seed of the samples"),
    NPG_ROW_FLAG("per-frame",   AT(per_frame),   "no",
        "Print a line for every frame"),
    NPG_ROW_FLAG("json",        AT(json),        "no",
        "Print one JSON object instead of text"),
    {0}};
/* clang-format on */

/* ---- output ---- */

static json_t *json_of_figures(const npg_eval_figures *m)
{
    return json_pack("{so so so so so so so}", "CD", npg_json_real(m->cd), "CD_pred_to_gt",
                     npg_json_real(m->cd_to_truth), "CD_gt_to_pred", npg_json_real(m->cd_from_truth), "NC",
                     npg_json_real(m->nc), "F", npg_json_real(m->f), "precision", npg_json_real(m->precision),
                     "recall", npg_json_real(m->recall));
}

typedef struct told {
    const settings *s;
    json_t *frames;
} told;

static void tell_frame(void *user, const npg_eval_figures *m)
{
    told *t = user;
    json_t *line = json_of_figures(m);
    json_object_set_new(line, "frame", json_integer(m->frames));
    json_object_set_new(line, "Corr", npg_json_real(m->corr));
    json_array_append_new(t->frames, line);
    if (!t->s->per_frame || t->s->json) return;
    printf("%5lld  CD %9.4f  NC %7.5f  F %7.5f", (long long)m->frames, m->cd, m->nc, m->f);
    if (isfinite(m->corr)) printf("  Corr %8.6f", m->corr);
    putchar('\n');
}

static void print_json(const npg_eval_figures *e, const told *t)
{
    json_t *object = json_of_figures(e);
    json_object_update_new(
        object,
        json_pack("{sI sI sI sI sI sI sb so so so so so so so}", "frames", (json_int_t)e->frames, "samples",
                  (json_int_t)t->s->samples, "pred_vertices", (json_int_t)e->vertices, "pred_faces",
                  (json_int_t)e->faces, "gt_vertices", (json_int_t)e->truth_vertices, "gt_faces",
                  (json_int_t)e->truth_faces, "pred_constant_topology", e->constant_topology, "tau",
                  npg_json_real(t->s->tau), "diagonal", npg_json_real(e->diagonal), "Corr",
                  npg_json_real(e->corr), "jitter", npg_json_real(e->jitter), "edge", npg_json_real(e->edge),
                  "rigidity", npg_json_real(e->rigidity), "bad_area", npg_json_real(e->bad_area)));
    json_object_set(object, "per_frame", t->frames);
    npg_cli_print(object);
}

static void print_text(const npg_eval_figures *e, const settings *s)
{
    printf("frames %lld  CD %.4f (to truth %.4f, from truth %.4f)", (long long)e->frames, e->cd,
           e->cd_to_truth, e->cd_from_truth);
    if (isfinite(e->nc)) printf("  NC %.4f", e->nc);
    printf("  F-%g%% %.4f", 100 * s->tau, e->f);
    if (isfinite(e->corr)) printf("  Corr %.5f", e->corr);
    printf("\nconstant topology %s", e->constant_topology ? "yes" : "no");
    if (isfinite(e->jitter)) printf("  jitter %.3g", e->jitter);
    if (isfinite(e->edge))
        printf("  edge change %.3g  rigidity %.3g  bad areas %.3g", e->edge, e->rigidity, e->bad_area);
    putchar('\n');
}

npg_status npg_verb_eval(const npg_cli *cli)
{
    const settings *s = cli->values;
    npg_eval_figures found = {.struct_size = sizeof found};
    told t = {s, json_array()};
    npg_cli_warn_of_damage("eval", cli->operands[0]);
    npg_status status = npg_eval(&found, &(npg_eval_settings){.struct_size = sizeof(npg_eval_settings),
                                                              .predicted = cli->operands[0],
                                                              .truth = cli->operands[1],
                                                              .frames = s->frames,
                                                              .points_only = s->points_only,
                                                              .samples = (size_t)s->samples,
                                                              .seed = (uint64_t)s->seed,
                                                              .tau = s->tau,
                                                              .user = &t,
                                                              .frame = tell_frame});
    if (!status && s->json) print_json(&found, &t);
    if (!status && !s->json) print_text(&found, s);
    json_decref(t.frames);
    return status;
}
