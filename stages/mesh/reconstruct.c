/* Reconstruct: the steps from a point set to a clean mesh, in the order in which they are taken. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "pipeline/clock.h"

#define NOISY             0.08 /* in spacings; curvature of few points is below */
#define NOISE_MIN         0.03 /* the same; clean clouds have 0 */
#define SMOOTH_NEIGHBOURS 24
#define FUSED_NEIGHBOURS  60   /* of the points of all frames, which lie closer */
#define UNSEEN_IS_A_SIDE  0.25 /* of the area: more than holes, a side that no camera saw */
#define UNSEEN_IS_LEFT    0.05 /* the same of one that was open before: where the body goes on, out of sight */

typedef struct reconstruction { /* what is known while the mesh is made */
    npg_worker *worker;
    const npg_reconstruct_settings *settings;
    npg_point_set *set;
    bool trims_unseen;     /* nobody saw a side: what has no points near it goes             */
    double invented_share; /* of the mesh, once it is trimmed: what no point saw             */
    npg_mesh *mesh;        /* so far; owned                                                  */
} reconstruction;

/* ---- points to a surface ---- */

/* Noise would become bumps of the surface that every frame then carries. */
static npg_status smooth(reconstruction *r)
{
    npg_point_set *p = r->set;
    double sigma;
    if (p->is_smooth) return NPG_OK;
    p->is_smooth = true;
    NPG_TRY(npg_cloud_noise(&sigma, p->points, p->normals, p->count));
    npg_mesh_note(r->worker, "noise_unit", sigma);
    if (!r->settings->smooth || sigma < NOISE_MIN * p->spacing) return NPG_OK;
    npg_worker_log(r->worker, NPG_LOG_INFO, p->key_number,
                   "the points of %s are noisy (%.2g of the unit box): smoothed for the reconstruction",
                   p->is_fused ? "all frames" : "the keyframe", sigma);
    double key_noise = p->is_fused ? p->key_noise : sigma;
    p->is_rough = key_noise > NOISY * (p->is_fused ? p->key_spacing : p->spacing);
    return npg_cloud_smooth(p->points, p->normals, p->count,
                            p->is_fused ? FUSED_NEIGHBOURS : SMOOTH_NEIGHBOURS);
}

/* Poisson through the points and what lies between those of thin parts. */
static npg_status draw_through(reconstruction *r, size_t *moved)
{
    const npg_poisson_settings *settings = &r->settings->poisson;
    npg_point_set *p = r->set;
    float *points, *normals;
    size_t count;
    /* noisy normals do not say what lies between, nor those that were estimated across both sides */
    if (p->is_rough || !p->has_given_normals)
        return npg_poisson_apart(&r->mesh, moved, p->points, p->normals, p->count, p->spacing, settings);
    NPG_TRY(npg_cloud_densify(&points, &normals, &count, p->points, p->normals, p->count, p->spacing));
    npg_mesh_note_count(r->worker, "points_between", count - p->count);
    npg_status status = npg_poisson_apart(&r->mesh, moved, points, normals, count, p->spacing, settings);
    npg_release(&points);
    npg_release(&normals);
    return status;
}

static npg_status draw_surface(reconstruction *r)
{
    npg_point_set *p = r->set;
    if (!p->normals) return npg_error(NPG_BAD_INPUT, "the keyframe has no normals");
    double since = npg_clock_s();
    size_t moved;
    NPG_TRY(smooth(r));
    NPG_TRY(draw_through(r, &moved));
    npg_mesh_note_count(r->worker, "points_held_apart", moved);
    npg_mesh_note(r->worker, "poisson_s", npg_clock_s() - since);
    npg_mesh_note_count(r->worker, "faces_reconstructed", r->mesh->face_count);
    return NPG_OK;
}

/* ---- its main pieces ---- */

/* Of a side all pieces stay that are no crumbs: what joins them, out of sight or at a slant, may be as long as
 * half an arm. */
static npg_status keep_main(reconstruction *r, const char *when)
{
    npg_pieces pieces;
    NPG_TRY(npg_mesh_keep_main(&r->mesh, &pieces, r->trims_unseen ? HUGE_VAL : r->set->diagonal));
    npg_mesh_note_count(r->worker, "components", pieces.kept);
    if (pieces.kept > 1)
        npg_mesh_warn(r->worker, false, r->set->key_number,
                      "%s, the surface is in %zu pieces: holes in the points?", when, pieces.kept);
    if (pieces.lost_share > NPG_FEW)
        npg_mesh_warn(r->worker, false, r->set->key_number,
                      "%s, the surface is in %zu pieces: %zu with %.1f %% of the area are left out", when,
                      pieces.found, pieces.found - pieces.kept, 100 * pieces.lost_share);
    return NPG_OK;
}

/* ---- what lies near the points ---- */

/* One frame misses what another sees; all of them have seen what there is to see, where they see what is hidden. */
static npg_status trim_expected(reconstruction *r)
{
    const npg_point_set *p = r->set;
    double share;
    bool is_expected = p->is_fused && npg_worker_facts(r->worker)->viewpoints.sees_hidden;
    if (!is_expected || r->settings->unseen != NPG_UNSEEN_AUTO) return NPG_OK;
    NPG_TRY(npg_mesh_trim(&r->mesh, &share, p->points, p->count, p->seen_dist));
    npg_mesh_note(r->worker, "would_be_seen_share", share);
    if (share > NPG_FEW)
        npg_mesh_warn(
            r->worker, false, p->key_number,
            "%.1f %% of the reconstructed surface has no point near it in any frame, though points are "
            "seen that no sensor could see: no surface, trimmed off",
            100 * share);
    return NPG_OK;
}

/* What no point saw: measured on the closed surface, before anything is trimmed. */
static npg_status judge_unseen(reconstruction *r)
{
    const npg_facts *facts = npg_worker_facts(r->worker);
    const npg_point_set *p = r->set;
    int way = r->settings->unseen;
    double share, side = facts->brief.was_open ? UNSEEN_IS_LEFT : UNSEEN_IS_A_SIDE;
    NPG_TRY(npg_mesh_unseen(&share, r->mesh, p->points, p->count, p->seen_dist));
    bool is_a_side = share > UNSEEN_IS_A_SIDE && !facts->sensor_count_max;
    r->trims_unseen =
        way == NPG_UNSEEN_TRIM || facts->brief.leaves_open || (way != NPG_UNSEEN_KEEP && share > side);
    npg_mesh_note(r->worker, "unseen_share", share);
    json_object_set_new(npg_worker_report(r->worker), "unseen",
                        json_string(r->trims_unseen ? "trimmed" : "kept"));
    if (share > NPG_FEW)
        npg_mesh_warn(r->worker, false, p->key_number,
                      "%.1f %% of the reconstructed surface has no point near it: unseen in %s, %s%s",
                      100 * share, p->is_fused ? "all frames" : "the keyframe",
                      r->trims_unseen          ? "trimmed off"
                      : way == NPG_UNSEEN_KEEP ? "kept as Poisson closed it"
                                               : "closed tightly",
                      is_a_side ? ". If one sensor saw it, say where it stood (option sensor)" : "");
    return NPG_OK;
}

/* Of sides put together shreds are left along the border.  What more is added to needs all it has, and of one
 * frame half a limb is as narrow. */
static npg_status drop_shreds(reconstruction *r)
{
    const npg_facts *facts = npg_worker_facts(r->worker);
    double share;
    if (!facts->brief.was_open || facts->brief.leaves_open) return NPG_OK;
    NPG_TRY(npg_mesh_trim_shreds(&r->mesh, &share, r->set->seen_dist));
    npg_mesh_note(r->worker, "fringe_share", share);
    return NPG_OK;
}

static npg_status trim(reconstruction *r)
{
    const npg_point_set *p = r->set;
    double limit = NPG_REMOTE_SHARE * p->diagonal, share;
    if (r->trims_unseen) limit = fmin(limit, p->seen_dist);
    NPG_TRY(npg_mesh_trim(&r->mesh, &share, p->points, p->count, limit));
    npg_mesh_note(r->worker, "trimmed_share", share);
    if (!r->mesh->face_count) return npg_error(NPG_FAILED, "no surface lies near the points");
    if (r->trims_unseen) NPG_TRY(drop_shreds(r));
    NPG_TRY(npg_mesh_unseen(&r->invented_share, r->mesh, p->points, p->count, p->seen_dist));
    if (!r->trims_unseen && share > NPG_FEW)
        npg_mesh_warn(r->worker, false, p->key_number,
                      "%.1f %% of the reconstructed surface is farther than %g diagonals from every point "
                      "and was trimmed off",
                      100 * share, NPG_REMOTE_SHARE);
    return share > 0 ? keep_main(r, "after trimming") : NPG_OK;
}

/* The closed balloon over what nobody saw becomes the least surface there, out of space that is empty. */
static npg_status fair(reconstruction *r)
{
    const npg_point_set *p = r->set;
    npg_faired done;
    npg_mending mending;
    if (r->settings->unseen != NPG_UNSEEN_AUTO && r->settings->unseen != NPG_UNSEEN_CLOSE) return NPG_OK;
    NPG_TRY(
        npg_mesh_fair(r->mesh, &done, p->points, p->count, NPG_GAP / NPG_SAMPLED * p->seen_dist, p->empty));
    npg_mesh_note_count(r->worker, "vertices_flattened", done.moved);
    if (p->empty) npg_mesh_note_count(r->worker, "vertices_pushed", done.pushed);
    return done.moved ? npg_mesh_mend(&r->mesh, &mending) : NPG_OK;
}

static void note_empty(const reconstruction *r, const char *key)
{
    if (r->set->empty) npg_mesh_note(r->worker, key, npg_mesh_share_in(r->mesh, r->set->empty));
}

/* ---- few faces, and sound ones ---- */

size_t npg_face_budget(const npg_reconstruct_settings *settings, const npg_point_set *set)
{
    size_t budget = NPG_FACES_PER_POINT * set->given, most = (size_t)settings->face_max;
    return budget < most ? budget : most;
}

static npg_status decimate(reconstruction *r)
{
    npg_mending mending;
    size_t budget = npg_face_budget(r->settings, r->set);
    NPG_TRY(npg_mesh_mend(&r->mesh, &mending)); /* closes small holes before the faces are counted */
    size_t holes = mending.holes;
    for (int round = 0; round < 4 && (!round || r->mesh->face_count > budget); round++) {
        NPG_TRY(npg_mesh_decimate(&r->mesh, budget - budget / 200 * (size_t)round));
        NPG_TRY(npg_mesh_mend(&r->mesh, &mending));
        holes += mending.holes;
    }
    if (!r->mesh->face_count) return npg_error(NPG_FAILED, "only shreds of the surface lie near the points");
    npg_mesh_note_count(r->worker, "mended_degenerate", mending.degenerate);
    npg_mesh_note_count(r->worker, "mended_duplicate", mending.duplicate);
    npg_mesh_note_count(r->worker, "mended_vertices", mending.split_vertices);
    npg_mesh_note_count(r->worker, "mended_holes", holes);
    npg_mesh_note_count(r->worker, "mended_flipped", mending.flipped);
    return keep_main(r, "after decimation");
}

/* Of clean points the surface is nearer the truth than their normals' means, and of few points, too. */
static npg_status turn_faces(reconstruction *r)
{
    npg_mending mending;
    if (!r->set->is_rough) return NPG_OK;
    NPG_TRY(npg_mesh_denoise(r->mesh, r->set->points, r->set->normals, r->set->count));
    return npg_mesh_mend(&r->mesh, &mending);
}

/* True where the mesh is one that can be deformed. */
static npg_status is_sound(bool *sound, const npg_mesh *mesh)
{
    npg_manifold manifold;
    size_t flipped;
    NPG_TRY(npg_mesh_manifold(&manifold, mesh));
    NPG_TRY(npg_mesh_flipped(&flipped, NULL, mesh));
    *sound = !manifold.crowded_edges && !manifold.misoriented_edges && !manifold.degenerate_faces && !flipped;
    return NPG_OK;
}

/* Drawn tight, and out of empty space, while the faces are still small, too: the large ones that decimation leaves over
 * nothing can't follow its border. */
static npg_status shape(reconstruction *r)
{
    NPG_TRY(trim(r));
    note_empty(r, "seen_empty_share");
    NPG_TRY(fair(r));
    NPG_TRY(decimate(r));
    NPG_TRY(turn_faces(r));
    NPG_TRY(fair(r));
    note_empty(r, "seen_empty_left_share");
    return NPG_OK;
}

/* ---- the whole ---- */

static npg_status make(reconstruction *r)
{
    bool sound;
    NPG_TRY(draw_surface(r));
    NPG_TRY(trim_expected(r));
    NPG_TRY(judge_unseen(r));
    /* Of a side all parts are small beside the balloon that closes it, until that is trimmed. */
    if (!r->trims_unseen) NPG_TRY(keep_main(r, "as reconstructed"));
    NPG_TRY(shape(r));
    NPG_TRY(is_sound(&sound, r->mesh));
    if (!sound)
        npg_mesh_warn(r->worker, false, r->set->key_number,
                      "the reference mesh still has flipped or degenerate faces after all mending");
    return NPG_OK;
}

npg_status npg_reconstruct(npg_mesh **mesh, double *invented_share, npg_worker *worker, npg_point_set *set,
                           const npg_reconstruct_settings *settings)
{
    reconstruction r = {.worker = worker, .settings = settings, .set = set};
    npg_status status = make(&r);
    if (status) npg_mesh_unref(&r.mesh);
    *mesh = r.mesh;
    *invented_share = r.invented_share;
    return status;
}
