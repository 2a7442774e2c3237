/* Against a truth: a mesh sequence on disk compared with a ground truth, frame by frame (npg_eval()). */
#include <math.h>

#include "evaluate/evaluate.h"
#include "ingest/ingest.h"
#include "pipeline/struct_size.h"

typedef struct evaluation {
    npg_eval_settings s;
    npg_listing predicted, truth;
    npg_origin origin;
    npg_sequence *sequence;
    npg_eval_figures all;
} evaluation;

/* ---- input ---- */

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
    const char *frames = e->s.frames ? e->s.frames : "";
    NPG_TRY(npg_selection_parse(&selection, frames));
    if (e->predicted.count == whole) npg_listing_keep(&e->predicted, &selection);
    npg_listing_keep(&e->truth, &selection);
    npg_selection_clear(&selection);
    if (!e->truth.count)
        return npg_error(NPG_USAGE, "option frames: %s selects none of %zu frames", frames, whole);
    if (e->predicted.count == e->truth.count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "%s has %zu meshes, %s has %zu frames (%zu in all); select with option frames",
                     e->s.predicted, e->predicted.count, e->s.truth, e->truth.count, whole);
}

static npg_status list_both(evaluation *e)
{
    static const char meshes[] = ".ply .obj";
    bool points = e->s.points_only;
    NPG_TRY(list_side(&e->predicted, e->s.predicted, "meshes", meshes));
    NPG_TRY(list_side(&e->truth, e->s.truth, points ? "points" : "truth gt", points ? NPG_CLOUDS : meshes));
    return select_frames(e);
}

static npg_status read_both(evaluation *e, size_t t, npg_mesh **predicted, npg_mesh **truth)
{
    const char *path = e->predicted.paths[t], *truth_path = e->truth.paths[t];
    NPG_TRY(e->s.points_only ? npg_read_points(truth, truth_path, &e->origin)
                             : npg_read_mesh(truth, truth_path, &e->origin));
    NPG_TRY(npg_read_mesh(predicted, path, &e->origin));
    NPG_TRY(npg_mesh_require_finite(*predicted, path));
    return npg_mesh_require_finite(*truth, truth_path);
}

/* ---- figures ---- */

static npg_eval_figures figures_of(const npg_frame_metrics *m, double corr, const npg_mesh *predicted,
                                   const npg_mesh *truth)
{
    return (npg_eval_figures){.struct_size = sizeof(npg_eval_figures),
                              .cd = m->cd,
                              .cd_to_truth = m->cd_to_truth,
                              .cd_from_truth = m->cd_from_truth,
                              .nc = m->nc,
                              .f = m->f,
                              .precision = m->precision,
                              .recall = m->recall,
                              .corr = corr,
                              .vertices = predicted->vert_count,
                              .faces = predicted->face_count,
                              .truth_vertices = truth->vert_count,
                              .truth_faces = truth->face_count,
                              .jitter = NAN,
                              .edge = NAN,
                              .rigidity = NAN,
                              .bad_area = NAN};
}

static npg_status eval_frame(evaluation *e, size_t t, npg_mesh *predicted, npg_mesh *truth)
{
    npg_frame_metrics m;
    npg_sequence_figures all;
    double corr;
    NPG_TRY(npg_error_prefix(npg_sequence_add(e->sequence, &m, &corr, predicted, truth), "%s, %s",
                             e->predicted.paths[t], e->truth.paths[t]));
    npg_eval_figures figures = figures_of(&m, corr, predicted, truth);
    figures.frames = (int64_t)t;
    if (e->s.frame) e->s.frame(e->s.user, &figures);
    if (t + 1 < e->truth.count) return NPG_OK;
    NPG_TRY(npg_sequence_figures_of(&all, e->sequence));
    e->all = figures_of(&all.mean, all.corr, predicted, truth);
    e->all.frames = (int64_t)e->truth.count;
    e->all.diagonal = all.diagonal;
    e->all.jitter = all.jitter;
    e->all.edge = all.edge;
    e->all.rigidity = all.rigid;
    e->all.bad_area = all.bad;
    e->all.constant_topology = all.topology_last;
    return NPG_OK;
}

static npg_status eval_all(evaluation *e)
{
    const npg_metrics_settings asked = {
        .sample_count = e->s.samples ? e->s.samples : 100000, .tau = e->s.tau, .seed = e->s.seed};
    NPG_TRY(list_both(e));
    NPG_TRY(npg_sequence_open(&e->sequence, &asked, e->s.points_only));
    for (size_t t = 0; t < e->truth.count; t++) {
        npg_mesh *predicted = NULL, *truth = NULL;
        npg_status status = read_both(e, t, &predicted, &truth);
        if (!status) status = eval_frame(e, t, predicted, truth);
        npg_mesh_unref(&predicted);
        npg_mesh_unref(&truth);
        NPG_TRY(status);
    }
    return NPG_OK;
}

npg_status npg_eval(npg_eval_figures *all, const npg_eval_settings *settings)
{
    evaluation e = {.origin = {0}};
    NPG_TRY(npg_struct_take(&e.s, sizeof e.s, settings, NPG_SIZE_UP_TO(npg_eval_settings, frame),
                            "the settings"));
    NPG_REQUIRE(all && e.s.predicted && e.s.truth);
    npg_status status = eval_all(&e);
    npg_listing_close(&e.predicted);
    npg_listing_close(&e.truth);
    npg_sequence_close(&e.sequence);
    NPG_TRY(status);
    return npg_struct_give(all, &e.all, sizeof e.all, NPG_SIZE_UP_TO(npg_eval_figures, constant_topology),
                           "figures");
}
