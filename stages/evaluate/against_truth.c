/* Against a truth: a mesh sequence on disk compared with a ground truth, frame by frame (npg_eval()), in bounded
 * memory but for `areas`. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate_internal.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/order.h"
#include "pipeline/struct_size.h"

typedef struct evaluation {
    npg_eval_settings s;
    npg_listing predicted, truth;
    npg_origin origin;
    npg_metrics_settings metrics;
    npg_eval_figures all;          /* sums of the frames' so far, then means */
    size_t frames;                 /* so far */
    npg_arena arena;               /* of the listings, and of the arrays below */
    npg_mesh *first, *first_truth; /* counted references */
    uint32_t *truth_of;            /* owned */
    npg_mesh_neighbours ring;
    uint32_t (*edges)[2]; /* owned */
    size_t edge_count;
    float *star_rest, *star_now;                 /* of the largest star, x 3                     */
    float *before[2];                            /* the last frame's positions, and those before */
    float *areas;                                /* frames x F, owned                            */
    size_t area_room;                            /* rows                                         */
    bool has_corr, vertices_last, topology_last; /* on both sides; the same count, faces; so far */
} evaluation;

/* ---- input ---- */

static npg_status list_side(npg_listing *listing, const char *folder, const char *subfolders,
                            const char *endings)
{
    const char *path;
    NPG_TRY(npg_subfolder(listing->arena, &path, folder, subfolders));
    return npg_listing_add(listing, path, endings);
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

/* ---- motion ---- */

/* Mean length of the second difference over time. */
static double jitter_of(const evaluation *e, const float *after)
{
    const float *middle = e->before[0], *before = e->before[1];
    double sum = 0;
    for (size_t v = 0; v < e->first->vert_count; v++) {
        double bend_sq = 0;
        for (size_t k = 3 * v; k < 3 * v + 3; k++) {
            double bend = (double)before[k] - 2 * (double)middle[k] + (double)after[k];
            bend_sq += bend * bend;
        }
        sum += sqrt(bend_sq);
    }
    return sum / (double)e->first->vert_count / e->metrics.diagonal;
}

/* A vertex and its neighbours, as differences from it. */
static size_t take_star(const evaluation *e, float *out, const float *pos, size_t v)
{
    size_t count = 0;
    for (size_t a = 0; a < 3; a++) out[a] = 0;
    for (uint32_t i = e->ring.start[v]; i < e->ring.start[v + 1]; i++) {
        count++;
        for (size_t a = 0; a < 3; a++)
            out[3 * count + a] = pos[3 * (size_t)e->ring.of[i] + a] - pos[3 * v + a];
    }
    return count + 1;
}

static double star_misfit(const evaluation *e, size_t count)
{
    double rotation[3][3], move[3], left_sq = 0, size_sq = 0;
    npg_rigid_fit(rotation, move, e->star_rest, e->star_now, count);
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double at = move[a], rest = (double)e->star_rest[3 * i + a];
            for (size_t b = 0; b < 3; b++) at += rotation[a][b] * (double)e->star_rest[3 * i + b];
            left_sq += (at - (double)e->star_now[3 * i + a]) * (at - (double)e->star_now[3 * i + a]);
            size_sq += rest * rest;
        }
    return size_sq > 0 ? sqrt(left_sq / size_sq) : 0;
}

/* The local rigidity of the paper's figures (Kabsch alignment), as one number. */
static double rigid_of(const evaluation *e, const float *pos)
{
    double sum = 0;
    for (size_t v = 0; v < e->first->vert_count; v++) {
        size_t count = take_star(e, e->star_rest, e->first->vert_pos, v);
        take_star(e, e->star_now, pos, v);
        if (count > 2) sum += star_misfit(e, count);
    }
    return sum / (double)e->first->vert_count;
}

static bool same_faces(const npg_mesh *a, const npg_mesh *b)
{
    return a->vert_count == b->vert_count && a->face_count == b->face_count &&
           !memcmp(a->faces, b->faces, a->face_count * 3 * sizeof *a->faces);
}

static npg_status add_motion(evaluation *e, const npg_mesh *mesh)
{
    const size_t t = e->frames, faces = e->first->face_count;
    e->vertices_last &= mesh->vert_count == e->first->vert_count;
    e->topology_last &= e->vertices_last && same_faces(mesh, e->first);
    if (e->vertices_last) {
        if (t >= 2) e->all.jitter += jitter_of(e, mesh->vert_pos);
        float *oldest = e->before[1];
        memcpy(oldest, mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
        e->before[1] = e->before[0];
        e->before[0] = oldest;
    }
    if (!e->topology_last) return NPG_OK;
    e->all.edge += npg_edge_change(e->first->vert_pos, mesh->vert_pos, e->edges, e->edge_count);
    e->all.rigidity += rigid_of(e, mesh->vert_pos);
    NPG_TRY(npg_grow(&e->areas, &e->area_room, t + 1, faces * sizeof(float), NPG_FOR_MESH));
    for (size_t f = 0; f < faces; f++)
        e->areas[t * faces + f] = (float)npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
    return NPG_OK;
}

/* The share of all faces of all frames whose area is > 10 x or < 0.1 x its median over time. */
static npg_status find_bad_area(evaluation *e)
{
    size_t bad = 0, frames = e->frames;
    float *areas;
    NPG_TRY(npg_alloc_array(&areas, NPG_FOR_MESH, frames, sizeof *areas));
    for (size_t f = 0; f < e->first->face_count; f++) {
        for (size_t t = 0; t < frames; t++) areas[t] = e->areas[t * e->first->face_count + f];
        qsort(areas, frames, sizeof *areas, npg_order_float);
        double median = 0.5 * ((double)areas[(frames - 1) / 2] + (double)areas[frames / 2]);
        for (size_t t = 0; t < frames; t++)
            bad += (double)areas[t] > 10 * median || (double)areas[t] < 0.1 * median;
    }
    npg_release(&areas);
    e->all.bad_area = (double)bad / (double)(frames * e->first->face_count);
    return NPG_OK;
}

/* ---- frames ---- */

static npg_status begin(evaluation *e, npg_mesh *predicted, npg_mesh *truth)
{
    const size_t verts = predicted->vert_count;
    size_t most = 0;
    e->metrics.diagonal = npg_points_diagonal(truth->vert_pos, truth->vert_count);
    if (!(e->metrics.diagonal > 0)) return npg_error(NPG_BAD_INPUT, "all points are equal");
    e->first = npg_mesh_ref(predicted);
    e->first_truth = npg_mesh_ref(truth);
    e->vertices_last = e->topology_last = true;
    e->has_corr = !e->s.points_only;
    NPG_TRY(npg_mesh_neighbours_open(&e->ring, predicted));
    NPG_TRY(npg_mesh_edges(&e->edges, &e->edge_count, predicted->faces, predicted->face_count));
    for (size_t v = 0; v < verts; v++)
        if (e->ring.start[v + 1] - e->ring.start[v] > most) most = e->ring.start[v + 1] - e->ring.start[v];
    for (int i = 0; i < 2; i++) e->before[i] = npg_arena_take(&e->arena, verts, 3 * sizeof(float));
    e->star_rest = npg_arena_take(&e->arena, most + 1, 3 * sizeof(float));
    e->star_now = npg_arena_take(&e->arena, most + 1, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&e->arena));
    return e->has_corr ? npg_metrics_tie(&e->truth_of, predicted, truth) : NPG_OK;
}

static npg_status measure_frame(evaluation *e, npg_eval_figures *f, npg_mesh *predicted, npg_mesh *truth)
{
    if (!e->first) NPG_TRY(begin(e, predicted, truth));
    NPG_TRY(npg_metrics_compare(f, predicted, truth, &e->metrics, e->frames));
    NPG_TRY(add_motion(e, predicted));
    e->has_corr = e->has_corr && e->vertices_last && same_faces(truth, e->first_truth);
    if (e->frames && e->has_corr)
        f->corr = npg_metrics_drift(predicted, truth, e->truth_of, e->metrics.diagonal);
    return NPG_OK;
}

static npg_status eval_frame(evaluation *e, npg_mesh *predicted, npg_mesh *truth)
{
    npg_eval_figures *all = &e->all, f = {.struct_size = sizeof f,
                                          .frames = (int64_t)e->frames,
                                          .corr = NAN,
                                          .vertices = predicted->vert_count,
                                          .faces = predicted->face_count,
                                          .truth_vertices = truth->vert_count,
                                          .truth_faces = truth->face_count,
                                          .jitter = NAN,
                                          .edge = NAN,
                                          .rigidity = NAN,
                                          .bad_area = NAN};
    NPG_TRY(npg_error_prefix(measure_frame(e, &f, predicted, truth), "%s, %s", e->predicted.paths[e->frames],
                             e->truth.paths[e->frames]));
    all->cd += f.cd;
    all->cd_to_truth += f.cd_to_truth;
    all->cd_from_truth += f.cd_from_truth;
    all->nc += f.nc;
    all->f += f.f;
    all->precision += f.precision;
    all->recall += f.recall;
    if (isfinite(f.corr)) all->corr += f.corr;
    all->vertices = f.vertices; /* of the last frame, as the faces */
    all->faces = f.faces;
    all->truth_vertices = f.truth_vertices;
    all->truth_faces = f.truth_faces;
    e->frames++;
    if (e->s.frame) e->s.frame(e->s.user, &f);
    return NPG_OK;
}

/* Sums become means; NaN where there was nothing to sum up. */
static npg_status finish(evaluation *e)
{
    npg_eval_figures *all = &e->all;
    const double frames = (double)e->frames, none = (double)NAN;
    double *means[] = {&all->cd, &all->cd_to_truth, &all->cd_from_truth, &all->nc,
                       &all->f,  &all->precision,   &all->recall};
    for (size_t i = 0; i < sizeof means / sizeof *means; i++) *means[i] /= frames;
    all->frames = (int64_t)e->frames;
    all->diagonal = e->metrics.diagonal;
    all->constant_topology = e->topology_last;
    all->corr = e->has_corr && e->frames > 1 ? all->corr / (frames - 1) : none;
    all->jitter = e->vertices_last && e->frames > 2 ? all->jitter / (frames - 2) : none;
    all->edge = e->topology_last ? all->edge / frames : none;
    all->rigidity = e->topology_last ? all->rigidity / frames : none;
    all->bad_area = none;
    return e->topology_last ? find_bad_area(e) : NPG_OK;
}

static npg_status eval_all(evaluation *e)
{
    NPG_TRY(list_both(e));
    for (size_t t = 0; t < e->truth.count; t++) {
        npg_mesh *predicted = NULL, *truth = NULL;
        npg_status status = read_both(e, t, &predicted, &truth);
        if (!status) status = eval_frame(e, predicted, truth);
        npg_mesh_unref(&predicted);
        npg_mesh_unref(&truth);
        NPG_TRY(status);
    }
    return finish(e);
}

npg_status npg_eval(npg_eval_figures *all, const npg_eval_settings *settings)
{
    evaluation e = {.all.struct_size = sizeof e.all, .arena.purpose = NPG_FOR_MESH};
    NPG_TRY(npg_struct_take(&e.s, sizeof e.s, settings, NPG_SIZE_UP_TO(npg_eval_settings, frame),
                            "the settings"));
    NPG_REQUIRE(all && e.s.predicted && e.s.truth);
    e.predicted.arena = e.truth.arena = &e.arena;
    e.metrics = (npg_metrics_settings){
        .sample_count = e.s.samples ? e.s.samples : 100000, .tau = e.s.tau, .seed = e.s.seed};
    npg_status status = eval_all(&e);
    npg_mesh_unref(&e.first);
    npg_mesh_unref(&e.first_truth);
    npg_mesh_neighbours_close(&e.ring);
    npg_release(&e.truth_of);
    npg_release(&e.edges);
    npg_release(&e.areas);
    npg_arena_release(&e.arena);
    NPG_TRY(status);
    return npg_struct_give(all, &e.all, sizeof e.all, NPG_SIZE_UP_TO(npg_eval_figures, constant_topology),
                           "figures");
}
