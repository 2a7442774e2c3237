/* neupig eval: a mesh sequence against a ground truth, by the measures of the method's paper. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "tools/cli.h"
#include "tools/listing.h"

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

typedef struct evaluation {
    settings s;
    npg_listing predicted, truth;
    npg_origin origin;
    npg_sequence *sequence;
    npg_sequence_figures all;
    double sizes[4]; /* vertices and faces of prediction and truth */
    json_t *per_frame;
} evaluation;

/* ---- input ---- */

static npg_status read_truth(npg_mesh **mesh, const char *path, evaluation *e)
{
    return e->s.points_only ? npg_read_points(mesh, path, &e->origin) : npg_read_mesh(mesh, path, &e->origin);
}

static npg_status list_side(npg_listing *listing, const char *folder, const char *subfolders,
                            const char *endings)
{
    char *path;
    NPG_TRY(npg_subfolder(&path, folder, subfolders));
    npg_status status = npg_listing_add(listing, path, endings);
    npg_release(&path);
    return status;
}

static npg_status select_frames(evaluation *e)
{
    npg_selection selection;
    size_t whole = e->truth.count;
    NPG_TRY(npg_selection_parse(&selection, e->s.frames));
    if (e->predicted.count == whole) npg_listing_keep(&e->predicted, &selection);
    npg_listing_keep(&e->truth, &selection);
    npg_selection_clear(&selection);
    if (!e->truth.count)
        return npg_error(NPG_USAGE, "option frames: %s selects none of %zu frames", e->s.frames, whole);
    return NPG_OK;
}

static npg_status list_both(evaluation *e, const npg_cli *cli)
{
    static const char meshes[] = ".ply .obj", clouds[] = ".ply .obj .xyz .xyzn .txt .pts .npy .pcd";
    bool points = e->s.points_only;
    NPG_TRY(list_side(&e->predicted, cli->operands[0], "meshes", meshes));
    NPG_TRY(list_side(&e->truth, cli->operands[1], points ? "points" : "truth gt", points ? clouds : meshes));
    size_t whole = e->truth.count;
    NPG_TRY(select_frames(e));
    if (e->predicted.count != e->truth.count)
        return npg_error(NPG_BAD_INPUT,
                         "%s has %zu meshes, %s has %zu frames (%zu in all); select with --frames",
                         cli->operands[0], e->predicted.count, cli->operands[1], e->truth.count, whole);
    return NPG_OK;
}

/* ---- figures ---- */

static void set_real(json_t *object, const char *name, double value)
{
    json_object_set_new(object, name, isfinite(value) ? json_real(value) : json_null());
}

static json_t *json_of_metrics(const npg_frame_metrics *m)
{
    json_t *object = json_object();
    set_real(object, "CD", m->cd);
    set_real(object, "CD_pred_to_gt", m->cd_to_truth);
    set_real(object, "CD_gt_to_pred", m->cd_from_truth);
    set_real(object, "NC", m->nc);
    set_real(object, "F", m->f);
    set_real(object, "precision", m->precision);
    set_real(object, "recall", m->recall);
    return object;
}

static void tell_frame(evaluation *e, size_t t, const npg_frame_metrics *m, double corr)
{
    json_t *line = json_of_metrics(m);
    json_object_set_new(line, "frame", json_integer((json_int_t)t));
    set_real(line, "Corr", corr);
    json_array_append_new(e->per_frame, line);
    if (!e->s.per_frame || e->s.json) return;
    printf("%5zu  CD %9.4f  NC %7.5f  F %7.5f", t, m->cd, m->nc, m->f);
    if (isfinite(corr)) printf("  Corr %8.6f", corr);
    putchar('\n');
}

static npg_status eval_frame(evaluation *e, size_t t, npg_mesh *predicted, npg_mesh *truth)
{
    npg_frame_metrics m;
    double corr;
    if (t == 0) {
        e->sizes[0] = (double)predicted->vert_count;
        e->sizes[1] = (double)predicted->face_count;
        e->sizes[2] = (double)truth->vert_count;
        e->sizes[3] = (double)truth->face_count;
    }
    NPG_TRY(npg_error_prefix(npg_sequence_add(e->sequence, &m, &corr, predicted, truth), "%s, %s",
                             e->predicted.paths[t], e->truth.paths[t]));
    tell_frame(e, t, &m, corr);
    return NPG_OK;
}

static npg_status eval_all(evaluation *e)
{
    const npg_metrics_settings asked = {
        .sample_count = (size_t)e->s.samples, .tau = e->s.tau, .seed = (uint64_t)e->s.seed};
    NPG_TRY(npg_sequence_open(&e->sequence, &asked, e->s.points_only));
    for (size_t t = 0; t < e->truth.count; t++) {
        npg_mesh *predicted = NULL, *truth = NULL;
        npg_status status = read_truth(&truth, e->truth.paths[t], e);
        if (!status) status = npg_read_mesh(&predicted, e->predicted.paths[t], &e->origin);
        if (!status) status = npg_mesh_require_finite(predicted, e->predicted.paths[t]);
        if (!status) status = npg_mesh_require_finite(truth, e->truth.paths[t]);
        if (!status) status = eval_frame(e, t, predicted, truth);
        npg_mesh_unref(&predicted);
        npg_mesh_unref(&truth);
        NPG_TRY(status);
    }
    return npg_sequence_figures_of(&e->all, e->sequence);
}

/* ---- output ---- */

static void print_json(const evaluation *e)
{
    const npg_sequence_figures *all = &e->all;
    json_t *object = json_of_metrics(&all->mean);
    json_object_set_new(object, "frames", json_integer((json_int_t)e->truth.count));
    json_object_set_new(object, "samples", json_integer((json_int_t)e->s.samples));
    set_real(object, "tau", e->s.tau);
    set_real(object, "diagonal", all->diagonal);
    set_real(object, "Corr", all->corr);
    set_real(object, "jitter", all->jitter);
    set_real(object, "edge", all->edge);
    set_real(object, "rigidity", all->rigid);
    set_real(object, "bad_area", all->bad);
    json_object_set_new(object, "pred_constant_topology", json_boolean(all->topology_last));
    static const char *const names[] = {"pred_vertices", "pred_faces", "gt_vertices", "gt_faces"};
    for (int i = 0; i < 4; i++) json_object_set_new(object, names[i], json_integer((json_int_t)e->sizes[i]));
    json_object_set(object, "per_frame", e->per_frame);
    char *text = json_dumps(object, JSON_INDENT(1) | JSON_REAL_PRECISION(10));
    puts(text ? text : "{}");
    free(text);
    json_decref(object);
}

static void print_text(const evaluation *e)
{
    const npg_sequence_figures *all = &e->all;
    const npg_frame_metrics *mean = &all->mean;
    printf("frames %zu  CD %.4f (to truth %.4f, from truth %.4f)", e->truth.count, mean->cd,
           mean->cd_to_truth, mean->cd_from_truth);
    if (isfinite(mean->nc)) printf("  NC %.4f", mean->nc);
    printf("  F-%g%% %.4f", 100 * e->s.tau, mean->f);
    if (isfinite(all->corr)) printf("  Corr %.5f", all->corr);
    printf("\nconstant topology %s", all->topology_last ? "yes" : "no");
    if (isfinite(all->jitter)) printf("  jitter %.3g", all->jitter);
    if (isfinite(all->edge))
        printf("  edge change %.3g  rigidity %.3g  bad areas %.3g", all->edge, all->rigid, all->bad);
    putchar('\n');
}

int npg_verb_eval(int argc, char **argv)
{
    evaluation e = {.per_frame = json_array()};
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &e.s, NULL, argc, argv);
    if (!status) status = list_both(&e, &cli);
    if (!status) status = eval_all(&e);
    if (!status && e.s.json) print_json(&e);
    if (!status && !e.s.json) print_text(&e);
    npg_listing_close(&e.predicted);
    npg_listing_close(&e.truth);
    npg_sequence_close(&e.sequence);
    json_decref(e.per_frame);
    return npg_cli_end(argv[0], status);
}
