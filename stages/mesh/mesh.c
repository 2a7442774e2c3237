/* Mesh: the reference surface.  The stage says when one is made and from which points, takes the user's own
 * mesh instead, puts it into the run's facts and lets all chunks pass. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "mesh/mesh_internal.h"
#include "pipeline/clock.h"
#include "pipeline/cost.h"
#include "pipeline/stage.h"
#include "reference/reference.h"
#include "track/track.h"

/* Limits of the reconstruction's process: one that hangs, or that strange points have blown up, ends. */
#define POISSON_TIME_S     600
#define POISSON_MEMORY_MIB 8192 /* of address space, or what --max-memory says, if that is more */

typedef struct mesh_state {
    npg_reconstruct_settings surface; /* but for `poisson`, which is made of the next three */
    int64_t depth;
    double point_weight;
    bool holds_apart;
    double invented_max;
    bool is_made;          /* the reference of this pass                                              */
    bool is_larger_celled; /* a second surface is made, of an octree less deep by a step: no warning twice */
} mesh_state;

#define AT(member) offsetof(mesh_state, member)

/* clang-format off */
static const npg_option mesh_options[] = {
    /* type         name              place                 default  least most  shown as or words */
    NPG_KEY(INT,    "poisson-depth",  AT(depth),            "0",     0,  13,   NULL,
        "Depth of the Poisson octree. 0: cells about as large as the faces asked for, which is 8 up to 65536 of them"),
    NPG_KEY(REAL,   "poisson-weight", AT(point_weight),     "10",    0,  1000, NULL,
        "How closely the Poisson surface follows the points"),
    NPG_KEY(FLAG,   "smooth",         AT(surface.smooth),   "yes",
        "Smooth the keyframe's points for the reconstruction when they are noisy"),
    NPG_KEY(FLAG,   "hold-apart",     AT(holds_apart),      "yes",
        "Hold parts that nearly touch apart while the surface is made, so that they are not joined; "
        "after that bring it back to its points"),
    NPG_ROW_INT(    "faces",          AT(surface.face_max), "20000", 16, 1e8,  NULL,
        "Faces of the reference mesh at most. And no more than 4 per point"),
    NPG_ROW_CHOICE( "unseen",         AT(surface.unseen),   "auto",  "auto|keep|trim|close",
        "What becomes of surface that no frame saw. Holes, the far side of a single view: keep it as "
        "Poisson closed it, trim it, or draw it tight between what was seen, and trim it where points are "
        "all over, hidden ones too, or when it is more than a quarter of the area (auto); close: then give the shell that is left a back, drawn tight "
        "from border to border. It is reported in any case, and no fault where it was asked for (close)"),
    NPG_PART(REAL,  "bars.invented",  AT(invented_max),     "10",    0,  100,  "PERCENT",
        "most of the reference's area that no point saw and that was kept, in per cent; of a given mesh: "
        "that no point of the keyframe is near, where its sensors could see it"),
    {0}};
/* clang-format on */

/* A body fills about as much of its box's side squared as it has surface, so sqrt(faces) cells to a side are as large as
 * faces.  Of few faces the surface is fine all the same: they are decimated from it. */
static int depth_for(double faces)
{
    return (int)fmax(NPG_DRAFT_DEPTH + 1, ceil(log2(faces) / 2));
}

static npg_poisson_settings poisson_settings(const mesh_state *s)
{
    int depth = s->depth ? (int)s->depth : depth_for((double)s->surface.face_max);
    return (npg_poisson_settings){.depth = depth - s->is_larger_celled,
                                  .point_weight = s->point_weight,
                                  .holds_apart = s->holds_apart,
                                  .time_limit_s = POISSON_TIME_S,
                                  .memory_limit = (size_t)POISSON_MEMORY_MIB << 20};
}

npg_poisson_settings npg_poisson_settings_of(const npg_options *options)
{
    mesh_state s = {0};
    npg_options_fill(options, mesh_options, &s);
    return poisson_settings(&s);
}

typedef struct making { /* what is known while the reference is made */
    npg_worker *worker;
    mesh_state *state;
    const npg_frame *key;
    const npg_fused *fused; /* what all frames saw, a loan; NULL: it is made of the keyframe alone */
    npg_point_set set;      /* the points of either, owned */
    double invented_share;  /* of the area: what no point saw and was kept, or was given */
    int64_t handles;        /* of the mesh */
    npg_mesh *mesh;         /* owned */
} making;

/* ---- the report ---- */

void npg_mesh_note(npg_worker *worker, const char *key, double value)
{
    json_object_set_new(npg_worker_report(worker), key, json_real(value));
}

void npg_mesh_note_count(npg_worker *worker, const char *key, size_t value)
{
    json_object_set_new(npg_worker_report(worker), key, json_integer((json_int_t)value));
}

void npg_mesh_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...)
{
    const mesh_state *s = npg_worker_state(worker);
    char text[512];
    va_list arguments;
    if (s->is_larger_celled) return;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (npg_worker_pass(worker) == NPG_PASS_SOLVE)
        npg_worker_warn(worker, partial, frame, "%s", text);
    else
        npg_worker_log(worker, NPG_LOG_INFO, frame, "%s", text);
}

/* ---- from points ---- */

static npg_status make(making *m)
{
    npg_reconstruct_settings settings = m->state->surface;
    int64_t may_use = npg_worker_settings(m->worker)->max_memory_mib;
    settings.poisson = poisson_settings(m->state);
    if (may_use > POISSON_MEMORY_MIB) settings.poisson.memory_limit = (size_t)may_use << 20;
    settings.poisson.should_stop = npg_worker_should_stop;
    settings.poisson.user = m->worker;
    return npg_reconstruct(&m->mesh, &m->invented_share, m->worker, &m->set, &settings);
}

/* ---- without what frames contradict ---- */

/* The reference that was followed last, less the faces at places that were seen to be empty. */
static npg_status keep_uncontradicted(making *m)
{
    const npg_mesh *all = m->mesh = npg_mesh_ref(npg_worker_facts(m->worker)->reference);
    double before = npg_mesh_area(all);
    npg_pieces pieces;
    npg_mending mending;
    uint8_t *keep;
    NPG_TRY(npg_alloc(&keep, NPG_FOR_MESH, all->face_count));
    for (size_t f = 0; f < all->face_count; f++) {
        float middle[3];
        npg_face_middle(middle, all->vert_pos, all->faces + 3 * f);
        keep[f] = npg_cube_set_value(m->set.empty, middle) <= NPG_MAJORITY;
    }
    npg_status status = npg_mesh_keep_faces(&m->mesh, keep);
    npg_release(&keep);
    NPG_TRY(status);
    if (!m->mesh->face_count)
        return npg_error(NPG_FAILED, "depth images show nothing at any place of the reference: are the "
                                     "sensors' poses right?");
    NPG_TRY(npg_mesh_mend(&m->mesh, &mending));
    NPG_TRY(npg_mesh_keep_main(&m->mesh, &pieces, HUGE_VAL));
    npg_mesh_note(m->worker, "contradicted_share", 1 - npg_mesh_area(m->mesh) / before);
    return NPG_OK;
}

/* ---- what nobody saw ---- */

/* More than the bar of surface that no point saw is carried through all frames. */
static void warn_of_invented(const making *m, double share, const char *place)
{
    const char *given = npg_worker_settings(m->worker)->reference;
    if (given[0])
        npg_mesh_warn(m->worker, true, m->key->number,
                      "%.1f %% of %s has no point of the keyframe near it%s%s (the bar is %g %%)",
                      100 * share, given, m->key->sensor_count ? ", though a sensor faces it" : "", place,
                      m->state->invented_max);
    else
        npg_mesh_warn(m->worker, true, m->key->number,
                      "%.1f %% of the reference's surface is invented: no point of %s saw it, "
                      "and it was kept%s (the bar is %g %%; --unseen trim leaves it out)",
                      100 * share, m->fused ? "any frame" : "the keyframe", place, m->state->invented_max);
}

/* What no sensor could see of a given mesh the lack of points says nothing against. */
static npg_status excuse_hidden(making *m)
{
    const npg_frame *key = m->key;
    float *sensors;
    if (!key->sensor_count) return NPG_OK;
    NPG_TRY(npg_alloc_array(&sensors, NPG_FOR_MESH, key->sensor_count, 3 * sizeof *sensors));
    npg_box_local_to_unit(&npg_worker_facts(m->worker)->box, sensors, key->sensor_local, key->sensor_count);
    npg_status status = npg_unseen_excuse(m->mesh, sensors, key->sensor_count, m->set.spacing);
    npg_release(&sensors);
    return status;
}

/* Surface that stays although nothing was seen there is the mesher's invention, or that of who gave the mesh:
 * a run that carries much of it through all frames is not a good one.  What was trimmed off is reported and
 * is not in the result.  The mesh has its normals. */
static npg_status judge_invented(making *m)
{
    npg_patch largest;
    char place[128];
    double marked, share;
    bool is_given = npg_worker_settings(m->worker)->reference[0];
    const npg_frame_box *box = &npg_worker_facts(m->worker)->box;
    NPG_TRY(npg_mesh_mark_unseen(m->mesh, m->set.points, m->set.count, m->set.seen_dist));
    if (is_given) NPG_TRY(excuse_hidden(m));
    NPG_TRY(npg_unseen_measure(&marked, &largest, m->mesh));
    *npg_own(m->worker, unseen_share) = m->invented_share;
    share = is_given ? marked : m->invented_share;
    npg_mesh_note(m->worker, "invented_share", share);
    json_object_set_new(npg_worker_report(m->worker), "invented_at",
                        npg_unseen_place(&largest, box, place, sizeof place));
    if (100 * share > m->state->invented_max && m->state->surface.unseen != NPG_UNSEEN_CLOSE)
        warn_of_invented(m, share, place);
    return NPG_OK;
}

/* ---- the user's own mesh ---- */

static npg_status read_reference(making *m)
{
    const char *path = npg_worker_settings(m->worker)->reference;
    const npg_facts *facts = npg_worker_facts(m->worker);
    npg_origin origin = facts->origin;
    NPG_TRY(npg_read_mesh(&m->mesh, path, &origin));
    NPG_TRY(npg_mesh_require_finite(m->mesh, path));
    NPG_TRY(npg_mesh_require_manifold(m->mesh, path));
    npg_box_local_to_unit(&facts->box, m->mesh->vert_pos, m->mesh->vert_pos, m->mesh->vert_count);
    if (!(npg_mesh_area(m->mesh) > 0)) return npg_error(NPG_BAD_INPUT, "%s: its faces have no area", path);
    NPG_TRY(npg_mesh_unseen(&m->invented_share, m->mesh, m->set.points, m->set.count, m->set.seen_dist));
    npg_mesh_note(m->worker, "unseen_share", m->invented_share);
    if (m->invented_share > 0.5)
        npg_mesh_warn(m->worker, false, m->key->number,
                      "%.0f %% of %s has no point of the keyframe near it: other units or another pose?",
                      100 * m->invented_share, path);
    return NPG_OK;
}

/* ---- the result ---- */

static npg_status measure_reference(making *m)
{
    npg_manifold manifold;
    npg_mesh *mesh = m->mesh;
    NPG_TRY(npg_mesh_manifold(&manifold, mesh));
    NPG_TRY(npg_mesh_handles(&m->handles, mesh));
    NPG_TRY(npg_mesh_make_normals(mesh));
    npg_mesh_note(m->worker, "handles", (double)m->handles);
    npg_mesh_note_count(m->worker, "vertices", mesh->vert_count);
    npg_mesh_note_count(m->worker, "faces", mesh->face_count);
    npg_mesh_note_count(m->worker, "border_edges", manifold.border_edges);
    npg_mesh_note(m->worker, "area_unit", npg_mesh_area(mesh));
    npg_mesh_note(m->worker, "volume_unit", npg_mesh_volume(mesh));
    npg_worker_log(m->worker, NPG_LOG_INFO, m->key->number,
                   "reference mesh: %zu vertices, %zu faces, %zu border edges", mesh->vert_count,
                   mesh->face_count, manifold.border_edges);
    return NPG_OK;
}

/* Colours of all frames; without a fusing pass those of the keyframe.  A user's own mesh keeps its own. */
static npg_status colour_reference(making *m)
{
    npg_mesh *mesh = m->mesh;
    const npg_frame *key = m->key;
    bool is_fused = m->fused && m->fused->colours;
    float *points = NULL;
    if (mesh->vert_colours || npg_worker_settings(m->worker)->colour == NPG_COLOUR_NO) return NPG_OK;
    if (!is_fused && !key->colours) return NPG_OK;
    npg_coloured cloud = {.count = is_fused ? m->fused->colour_count : key->point_count,
                          .points = is_fused ? m->fused->colour_points : NULL,
                          .normals = is_fused ? m->fused->colour_normals : key->normals,
                          .colours = is_fused ? m->fused->colours : key->colours};
    NPG_TRY(npg_alloc_array(&mesh->vert_colours, NPG_FOR_MESH, mesh->vert_count, 4));
    npg_status status =
        is_fused ? NPG_OK : npg_alloc_array(&points, NPG_FOR_MESH, cloud.count, 3 * sizeof(float));
    if (!status && !is_fused) {
        npg_box_local_to_unit(&npg_worker_facts(m->worker)->box, points, key->pos_local, cloud.count);
        cloud.points = points;
    }
    if (!status)
        status = npg_colour_vertices(mesh->vert_colours, mesh->vert_pos, mesh->vert_normals, mesh->vert_count,
                                     &cloud, m->set.seen_dist);
    npg_release(&points);
    NPG_TRY(status);
    return npg_colour_fill(mesh->vert_colours, mesh);
}

/* ---- a back for what is open ---- */

/* The reference that is delivered; what is followed on the way to it is to show what it lacks. */
static npg_status close_over(making *m)
{
    size_t added;
    npg_mending mending;
    bool is_last = npg_worker_pass(m->worker) == NPG_PASS_SOLVE;
    if (!is_last || m->state->surface.unseen != NPG_UNSEEN_CLOSE ||
        npg_worker_settings(m->worker)->reference[0])
        return NPG_OK;
    NPG_TRY(npg_mesh_close(&m->mesh, &added));
    if (!added) return NPG_OK;
    NPG_TRY(npg_mesh_decimate(&m->mesh, npg_face_budget(&m->state->surface, &m->set)));
    NPG_TRY(npg_mesh_mend(&m->mesh, &mending));
    NPG_TRY(npg_mesh_unseen(&m->invented_share, m->mesh, m->set.points, m->set.count, m->set.seen_dist));
    json_object_set_new(npg_worker_report(m->worker), "unseen", json_string("closed"));
    npg_mesh_warn(m->worker, false, m->key->number,
                  "the reference is a shell: a back that nobody saw closes it, %.0f %% of its surface",
                  100 * m->invented_share);
    return measure_reference(m);
}

/* ---- keep it, or take it back ---- */

/* Judge the new reference and the one before it by what points of the sampled frames say.  Where that left nothing to
 * explain in any frame, points are where they belong, and the keyframe shows what was gathered of them.
 * *is_worse stays as it is where nothing can be said. */
static npg_status compare(bool *is_worse, making *m, const npg_candidate_clouds *clouds, npg_mesh *before)
{
    npg_judgement now, then;
    bool is_explained = npg_worker_facts(m->worker)->choice.is_tried;
    npg_judge_settings settings = {
        .in_own_alone = is_explained, .should_stop = npg_worker_should_stop, .user = m->worker};
    size_t at = npg_candidate_clouds_find(clouds, m->key->index);
    if (at == clouds->count) return NPG_OK;
    NPG_TRY(npg_cloud_spacing(&settings.spacing_unit, clouds->list[at].points, clouds->list[at].point_count));
    NPG_TRY(npg_judge(&then, clouds, at, before, &settings));
    NPG_TRY(npg_judge(&now, clouds, at, m->mesh, &settings));
    npg_mesh_note(m->worker, "judged", now.mean);
    npg_mesh_note(m->worker, "judged_before", then.mean);
    *is_worse = is_explained ? npg_judged_clearly(&then, &now) : npg_judged_better(&then, &now);
    return NPG_OK;
}

/* What all frames saw mostly makes the better reference; where points that took no part say otherwise, the
 * one before stays.  Sides of a body are told by all frames that are followed with them (reference/loop.h): a sample
 * is too far apart for limbs that swing. */
static npg_status take_back_if_worse(making *m)
{
    const npg_facts *facts = npg_worker_facts(m->worker);
    const npg_candidate_clouds *clouds = npg_worker_fact(m->worker, &npg_fact_candidate_clouds);
    npg_mesh *before = facts->reference;
    bool is_worse = false;
    if (!m->fused || !before || !clouds || facts->brief.was_open || facts->brief.is_side ||
        !facts->brief.takes_poses)
        return NPG_OK;
    npg_status status = compare(&is_worse, m, clouds, before);
    if (status != NPG_DIVERGED) NPG_TRY(status);
    json_object_set_new(npg_worker_report(m->worker), "taken_back", json_boolean(is_worse));
    if (!is_worse) return NPG_OK;
    npg_worker_log(m->worker, NPG_LOG_INFO, m->key->number,
                   "the surface of all frames' points does worse than the keyframe's own, which stays");
    npg_mesh_unref(&m->mesh);
    m->mesh = npg_mesh_ref(before);
    return NPG_OK;
}

/* Of points that were carried astray no surface may be possible: the one that was followed last stays. */
static npg_status keep_before(making *m, npg_status status)
{
    const npg_facts *facts = npg_worker_facts(m->worker);
    if (!m->fused || !facts->reference || facts->reference_key != m->key->index || !npg_mesh_is_none(status))
        return status;
    npg_mesh_warn(m->worker, true, m->key->number,
                  "no surface of all frames' points, the one before stays: %s", npg_error_text());
    json_object_set_new(npg_worker_report(m->worker), "taken_back", json_true());
    npg_mesh_unref(&m->mesh);
    m->mesh = npg_mesh_ref(facts->reference);
    return NPG_OK;
}

/* Layers of sensors that lie beside each other, and noise, make handles of small cells; those that larger cells
 * leave are the body's own, or of points that lie so. */
static npg_status try_larger_cells(making *m)
{
    const npg_candidate_clouds *clouds = npg_worker_fact(m->worker, &npg_fact_candidate_clouds);
    bool stays_open = npg_worker_facts(m->worker)->brief.leaves_open, is_worse = true;
    making fine = *m;
    if (!m->fused || !clouds || !m->handles || m->state->depth || stays_open) return NPG_OK;
    json_t *report = npg_worker_report(m->worker), *of_fine = json_copy(report);
    m->mesh = NULL;
    m->state->is_larger_celled = true;
    npg_status status = make(m);
    m->state->is_larger_celled = false;
    if (!status) status = measure_reference(m);
    if (!status && (double)m->handles < NPG_MAJORITY * (double)fine.handles)
        status = compare(&is_worse, m, clouds, fine.mesh);
    npg_worker_log(m->worker, NPG_LOG_INFO, m->key->number,
                   "of larger cells the surface has %lld handles, not %lld: %s", (long long)m->handles,
                   (long long)fine.handles, is_worse ? "it is not taken" : "it is taken");
    npg_mesh_unref(is_worse ? &m->mesh : &fine.mesh);
    if (is_worse) {
        *m = fine;
        json_object_clear(report);
        json_object_update(report, of_fine);
    } else {
        npg_mesh_note_count(m->worker, "handles_of_small_cells", (size_t)fine.handles);
    }
    json_decref(of_fine);
    return status == NPG_DIVERGED || status == NPG_FAILED ? NPG_OK : status;
}

/* ---- viewpoints ---- */

/* Where nobody says where sensors stood, nor that none did, and there is surface that no point saw. */
static npg_status find_viewpoints(const making *m)
{
    npg_viewpoints *found = npg_own(m->worker, viewpoints);
    const npg_point_set *p = &m->set;
    const char *sensor = npg_options_get(npg_worker_options(m->worker), "sensor");
    *found = (npg_viewpoints){0};
    bool is_known = npg_worker_facts(m->worker)->sensor_count_max || !strcmp(sensor, "none");
    if (is_known || !p->normals || !(m->invented_share > 0)) return NPG_OK;
    return npg_viewpoints_find(found, m->mesh, p->points, p->normals, p->count, NPG_SAMPLED * p->spacing);
}

/* What explains why surface has no points is a sensor: of a frame that has none, around the middle of its own points.  So
 * tracking, carving and the verdict all know what can't be seen. */
static npg_status give_viewpoints(const npg_facts *facts, npg_frame *frame)
{
    const npg_viewpoints *found = &facts->viewpoints;
    if (!found->count || !found->explain_bare || frame->sensor_count || frame->is_skipped ||
        !frame->point_count)
        return NPG_OK;
    NPG_TRY(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, found->count, 3 * sizeof(float)));
    frame->sensor_count = found->count;
    npg_viewpoints_place(frame->sensor_local, found, frame->pos_local, frame->point_count);
    return NPG_OK;
}

/* ---- the best side so far ---- */

static npg_mesh **best_side(const npg_worker *worker)
{
    return npg_worker_kept(worker);
}

static void release_best(void *thing)
{
    npg_mesh **best = thing;
    npg_mesh_unref(best);
    npg_release(&best);
}

static npg_status mesh_settle(npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_mesh **best = best_side(worker);
    if (npg_worker_pass(worker) != NPG_PASS_FUSE || !facts->brief.is_best) return NPG_OK;
    if (!best) {
        NPG_TRY(npg_alloc(&best, NPG_FOR_MESH, sizeof *best));
        npg_worker_keep(worker, best, release_best);
    }
    npg_mesh_unref(best);
    *best = npg_mesh_ref(facts->reference);
    return NPG_OK;
}

/* ---- one reference ---- */

/* The points and normals of fused (or NULL) are taken from it. */
static npg_status make_reference(npg_worker *worker, const npg_frame *key, npg_fused *fused)
{
    making m = {.worker = worker, .state = npg_worker_state(worker), .key = key, .fused = fused};
    bool is_given = npg_worker_settings(worker)->reference[0];
    bool takes_back = npg_worker_facts(worker)->brief.takes_back;
    bool trims = fused && fused->empty && npg_worker_facts(worker)->brief.trims_only;
    double since = npg_clock_s();
    npg_status status = npg_point_set_open(&m.set, worker, key, fused);
    if (!status && takes_back)
        m.mesh = npg_mesh_ref(*best_side(worker));
    else if (!status)
        status = is_given ? read_reference(&m) : trims ? keep_uncontradicted(&m) : keep_before(&m, make(&m));
    bool is_new = !trims && !takes_back && m.mesh != npg_worker_facts(worker)->reference;
    if (!status) status = measure_reference(&m);
    if (!status && is_new) status = try_larger_cells(&m);
    if (!status && is_new) status = take_back_if_worse(&m);
    if (!status) status = close_over(&m);
    if (!status && !takes_back)
        status = judge_invented(&m); /* what is taken back has its marks and colours */
    if (!status && !takes_back) status = colour_reference(&m);
    if (!status && !fused) status = find_viewpoints(&m);
    npg_mesh_note(worker, "seconds", npg_clock_s() - since);
    npg_point_set_close(&m.set);
    if (!status) {
        npg_mesh_unref(npg_own(worker, reference));
        *npg_own(worker, reference) = m.mesh;
        *npg_own(worker, reference_key) = key->index;
        npg_worker_close_report(worker);
    } else {
        npg_mesh_unref(&m.mesh);
    }
    return npg_error_prefix(status, "keyframe %lld (%s)", (long long)key->number,
                            key->path ? key->path : "pushed");
}

/* ---- the stage ---- */

/* The first one from the keyframe's points, those of later passes from all frames'. */
static npg_status make_of_pass(npg_worker *worker, const npg_frame *key)
{
    mesh_state *s = npg_worker_state(worker);
    npg_fused *fused =
        npg_worker_facts(worker)->brief.takes_gathered ? npg_worker_take_fact(worker, &npg_fact_fused) : NULL;
    if (key->is_skipped || !key->point_count)
        return npg_error(NPG_BAD_INPUT, "keyframe %lld has no usable points", (long long)key->number);
    npg_status status = make_reference(worker, key, fused);
    npg_fused_close(&fused);
    if (npg_worker_facts(worker)->brief.is_attempt && npg_mesh_is_none(status)) {
        npg_worker_log(worker, NPG_LOG_INFO, key->number, "can't be the keyframe: %s", npg_error_text());
        status = NPG_OK; /* stage reference tells by reference_key, and takes it back */
    }
    s->is_made = !status;
    return status;
}

static npg_status mesh_process(npg_worker *worker, npg_chunk **chunk)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const mesh_state *s = npg_worker_state(worker);
    npg_pass pass = npg_worker_pass(worker);
    bool is_tried =
        pass == NPG_PASS_FUSE && facts->choice.is_tried && facts->reference_key == facts->plan.key;
    bool is_there =
        s->is_made || facts->is_resumed || (is_tried && !npg_worker_fact(worker, &npg_fact_fused));
    for (size_t i = 0; i < npg_chunk_count(*chunk) && !is_there; i++) {
        const npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (!frame->is_key) continue;
        NPG_TRY(make_of_pass(worker, frame));
        npg_worker_step(worker, 1, 1, 1);
        is_there = true;
    }
    if (!is_there && pass != NPG_PASS_CHOOSE)
        return npg_error(NPG_FAILED, "the keyframe does not come first");
    for (size_t i = 0; i < npg_chunk_count(*chunk) && pass != NPG_PASS_CHOOSE; i++)
        NPG_TRY(give_viewpoints(facts, npg_chunk_frame(*chunk, i)));
    return NPG_OK;
}

/* The raw reconstruction is the largest thing held.  Measured at depth 10: about 16 faces a point (3 where
 * those of all frames share the octree's cells), and 80 bytes a face with its share of vertices, normals and the links
 * that mending needs. */
#define RAW_FACES_PER_POINT 16
#define BYTES_PER_RAW_FACE  80

static size_t mesh_memory(const npg_worker *worker, size_t *chunks_held)
{
    const npg_fused *fused = npg_worker_fact(worker, &npg_fact_fused);
    size_t faces = npg_worker_facts(worker)->point_count_max * RAW_FACES_PER_POINT;
    *chunks_held = 1;
    if (fused && fused->count * NPG_FACES_PER_POINT > faces) faces = fused->count * NPG_FACES_PER_POINT;
    return faces * BYTES_PER_RAW_FACE;
}

/* A closed mesh has half as many vertices as faces, and two; the budget is npg_reconstruct()'s. */
static size_t verts_at_most(const npg_worker *worker)
{
    const mesh_state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    size_t faces = (size_t)s->surface.face_max, by_points = NPG_FACES_PER_POINT * facts->point_count_max;
    if (facts->own_verts) return facts->own_verts;
    if (by_points && faces > by_points) faces = by_points;
    return faces / 2 + 2;
}

static double mesh_expects(const npg_worker *worker, npg_pass pass)
{
    const npg_facts *facts = npg_worker_facts(worker);
    double points = (double)facts->point_count_max;
    bool from_all =
        pass == NPG_PASS_SOLVE && (facts->brief.rounds_left || npg_worker_fact(worker, &npg_fact_fused));
    if (pass == NPG_PASS_CHOOSE || facts->own_verts) return 0;
    return npg_cost_surface_s(from_all ? fmin(points * (double)facts->frame_count, NPG_COST_FUSED_POINTS)
                                       : fmin(points, NPG_START_POINTS_MOST));
}

const npg_stage npg_stage_mesh = {.name = "mesh",
                                  .help = "Reference surface of the keyframe",
                                  .options = mesh_options,
                                  .state_size = sizeof(mesh_state),
                                  .passes = NPG_PASS_CHOOSE | NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                  .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY,
                                  .gives = NPG_FIELD_REFERENCE,
                                  .process = mesh_process,
                                  .settle = mesh_settle,
                                  .memory = mesh_memory,
                                  .verts_at_most = verts_at_most,
                                  .expects = mesh_expects};
