/* neupig eval: a mesh sequence against a ground truth, by the measures of the method's paper. */
#include <jansson.h>
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "tools/cli.h"
#include "tools/eval_motion.h"
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
    npg_metrics_settings metrics;
    npg_mesh *first_truth;
    uint32_t *truth_of;
    bool has_corr; /* constant topology on both sides, so far */
    npg_eval_motion motion;
    npg_eval_motion_figures moved;
    npg_frame_metrics sum;
    double corr_sum, sizes[4]; /* vertices and faces of prediction and truth */
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

static npg_status begin_metrics(evaluation *e, npg_mesh *predicted, npg_mesh *truth, const char *path)
{
    e->metrics = (npg_metrics_settings){.sample_count = (size_t)e->s.samples,
                                        .tau = e->s.tau,
                                        .diagonal = npg_points_diagonal(truth->vert_pos, truth->vert_count),
                                        .seed = (uint64_t)e->s.seed};
    if (!(e->metrics.diagonal > 0)) return npg_error(NPG_BAD_INPUT, "%s: all points are equal", path);
    e->motion.diagonal = e->metrics.diagonal;
    e->sizes[0] = (double)predicted->vert_count;
    e->sizes[1] = (double)predicted->face_count;
    e->sizes[2] = (double)truth->vert_count;
    e->sizes[3] = (double)truth->face_count;
    e->first_truth = npg_mesh_ref(truth);
    e->has_corr = !e->s.points_only;
    return e->has_corr ? npg_metrics_tie(&e->truth_of, predicted, truth) : NPG_OK;
}

static bool same_faces(const npg_mesh *a, const npg_mesh *b)
{
    return a->vert_count == b->vert_count && a->face_count == b->face_count &&
           !memcmp(a->faces, b->faces, a->face_count * 3 * sizeof *a->faces);
}

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

static void add_frame(evaluation *e, size_t t, const npg_frame_metrics *m, double corr)
{
    npg_frame_metrics *sum = &e->sum;
    sum->cd += m->cd;
    sum->cd_to_truth += m->cd_to_truth;
    sum->cd_from_truth += m->cd_from_truth;
    sum->nc += m->nc;
    sum->f += m->f;
    sum->precision += m->precision;
    sum->recall += m->recall;
    json_t *line = json_of_metrics(m);
    json_object_set_new(line, "frame", json_integer((json_int_t)t));
    set_real(line, "Corr", t ? corr : (double)NAN);
    json_array_append_new(e->per_frame, line);
    if (e->s.per_frame && !e->s.json)
        printf("%5zu  CD %9.4f  NC %7.5f  F %7.5f%s", t, m->cd, m->nc, m->f, t && e->has_corr ? "" : "\n");
    if (e->s.per_frame && !e->s.json && t && e->has_corr) printf("  Corr %8.6f\n", corr);
}

static npg_status eval_frame(evaluation *e, size_t t, npg_mesh *predicted, npg_mesh *truth)
{
    npg_frame_metrics m;
    double corr = 0;
    if (t == 0) NPG_TRY(begin_metrics(e, predicted, truth, e->truth.paths[0]));
    NPG_TRY(npg_error_prefix(npg_metrics_compare(&m, predicted, truth, &e->metrics, t), "%s, %s",
                             e->predicted.paths[t], e->truth.paths[t]));
    NPG_TRY(npg_eval_motion_add(&e->motion, predicted));
    e->has_corr = e->has_corr && e->motion.vertices_last && same_faces(truth, e->first_truth);
    if (t && e->has_corr)
        e->corr_sum += corr = npg_metrics_drift(predicted, truth, e->truth_of, e->metrics.diagonal);
    add_frame(e, t, &m, corr);
    return NPG_OK;
}

static npg_status eval_all(evaluation *e)
{
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
    return npg_eval_motion_end(&e->moved, &e->motion);
}

/* ---- output ---- */

static npg_frame_metrics mean_of(const evaluation *e)
{
    double count = (double)e->truth.count;
    npg_frame_metrics m = e->sum;
    double *fields[] = {&m.cd, &m.cd_to_truth, &m.cd_from_truth, &m.nc, &m.f, &m.precision, &m.recall};
    for (size_t i = 0; i < sizeof fields / sizeof *fields; i++) *fields[i] /= count;
    return m;
}

static void print_json(const evaluation *e, const npg_frame_metrics *mean, double corr)
{
    json_t *object = json_of_metrics(mean);
    json_object_set_new(object, "frames", json_integer((json_int_t)e->truth.count));
    json_object_set_new(object, "samples", json_integer((json_int_t)e->s.samples));
    set_real(object, "tau", e->s.tau);
    set_real(object, "diagonal", e->metrics.diagonal);
    set_real(object, "Corr", corr);
    set_real(object, "jitter", e->moved.jitter);
    set_real(object, "edge", e->moved.edge);
    set_real(object, "rigidity", e->moved.rigid);
    set_real(object, "bad_area", e->moved.bad);
    json_object_set_new(object, "pred_constant_topology", json_boolean(e->motion.topology_last));
    static const char *const names[] = {"pred_vertices", "pred_faces", "gt_vertices", "gt_faces"};
    for (int i = 0; i < 4; i++) json_object_set_new(object, names[i], json_integer((json_int_t)e->sizes[i]));
    json_object_set(object, "per_frame", e->per_frame);
    char *text = json_dumps(object, JSON_INDENT(1) | JSON_REAL_PRECISION(10));
    puts(text ? text : "{}");
    free(text);
    json_decref(object);
}

static void print_text(const evaluation *e, const npg_frame_metrics *mean, double corr)
{
    printf("frames %zu  CD %.4f (to truth %.4f, from truth %.4f)", e->truth.count, mean->cd,
           mean->cd_to_truth, mean->cd_from_truth);
    if (isfinite(mean->nc)) printf("  NC %.4f", mean->nc);
    printf("  F-%g%% %.4f", 100 * e->s.tau, mean->f);
    if (isfinite(corr)) printf("  Corr %.5f", corr);
    printf("\nconstant topology %s", e->motion.topology_last ? "yes" : "no");
    if (isfinite(e->moved.jitter)) printf("  jitter %.3g", e->moved.jitter);
    if (isfinite(e->moved.edge))
        printf("  edge change %.3g  rigidity %.3g  bad areas %.3g", e->moved.edge, e->moved.rigid,
               e->moved.bad);
    putchar('\n');
}

static void close_evaluation(evaluation *e)
{
    npg_listing_close(&e->predicted);
    npg_listing_close(&e->truth);
    npg_mesh_unref(&e->first_truth);
    npg_release(&e->truth_of);
    npg_eval_motion_close(&e->motion);
    json_decref(e->per_frame);
}

int npg_verb_eval(int argc, char **argv)
{
    evaluation e = {.per_frame = json_array()};
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &e.s, NULL, argc, argv);
    if (!status) status = list_both(&e, &cli);
    if (!status) status = eval_all(&e);
    if (!status) {
        npg_frame_metrics mean = mean_of(&e);
        double corr =
            e.has_corr && e.truth.count > 1 ? e.corr_sum / (double)(e.truth.count - 1) : (double)NAN;
        if (e.s.json)
            print_json(&e, &mean, corr);
        else
            print_text(&e, &mean, corr);
    }
    close_evaluation(&e);
    return npg_cli_end(argv[0], status);
}
