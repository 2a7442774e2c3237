/* Choose: drafts of the candidates and what becomes of them in the other frames. */
#include "keyframe/keyframe_internal.h"

#include <math.h>

#include "geometry/geometry.h"
#include "mesh/surface.h"
#include "pipeline/parallel.h"
#include "pipeline/stage.h"

#define DRAFT_DEPTH     7
#define DRAFT_ROUNDS    1
#define DRAFT_FACES     4000
#define PIECE_SHARE     0.01 /* of the area, and units from the main piece: what belongs to the body */
#define PIECE_DIST_UNIT 0.1
#define STRETCHED       3.0  /* times its area in the candidate's frame */
#define STRETCH_COST    0.2  /* unit lengths that a stretched area counts for */
#define CONTACT_COST    0.1  /* unit lengths that a point in contact counts for */
#define HANDLE_COST     0.05 /* share of the cost that a needless handle adds */
#define MIDDLE_COST     0.3  /* share of the cost that the capture's whole length from the middle adds */
#define LESS_CONTACT    0.7  /* times the contact of the best-scored frame */
#define CLEARLY_LESS    0.97 /* of the cost of the best-scored frame */

static const npg_tracker_settings draft_tracking = {
    .nodes = 200, .samples = 1200, .steps = 10, .stiffness = 0.01, .along = 0.1};

/* ---- the draft ---- */

static npg_status draft_from(npg_mesh **mesh, int64_t *handles, const npg_candidate_cloud *cloud,
                             float *normals, const npg_poisson_settings *settings)
{
    size_t moved, turned;
    double spacing;
    npg_pieces pieces;
    int rounds;
    npg_mending mending;
    NPG_TRY(npg_cloud_spacing(&spacing, cloud->points, cloud->point_count));
    NPG_TRY(npg_resurface_widened(mesh, &moved, &turned, &rounds, normals, cloud->points, cloud->point_count,
                                  spacing, settings));
    NPG_TRY(npg_mesh_keep_main(mesh, &pieces, PIECE_SHARE, PIECE_DIST_UNIT));
    NPG_TRY(npg_mesh_handles(handles, *mesh));
    NPG_TRY(npg_mesh_decimate(mesh, DRAFT_FACES));
    NPG_TRY(npg_mesh_mend(mesh, &mending));
    npg_mesh *m = *mesh;
    NPG_TRY(npg_alloc_array(&m->vert_normals, NPG_FOR_MESH, m->vert_count, 3 * sizeof(float)));
    npg_mesh_vertex_normals(m->vert_normals, m->vert_pos, m->vert_count, m->faces, m->face_count);
    return NPG_OK;
}

static npg_status make_draft(npg_mesh **mesh, int64_t *handles, const npg_candidate_cloud *cloud,
                             const npg_poisson_settings *settings)
{
    npg_poisson_settings quick = *settings;
    float *normals;
    *mesh = NULL;
    if (quick.depth > DRAFT_DEPTH) quick.depth = DRAFT_DEPTH;
    quick.rounds_max = DRAFT_ROUNDS;
    NPG_TRY(npg_alloc_array(&normals, NPG_FOR_MESH, cloud->point_count, 3 * sizeof(float)));
    for (size_t i = 0; i < 3 * cloud->point_count; i++) normals[i] = cloud->normals[i];
    npg_status status = draft_from(mesh, handles, cloud, normals, &quick);
    npg_release(&normals);
    if (status) npg_mesh_unref(mesh);
    return status;
}

/* ---- how a draft fits the other frames ---- */

typedef struct result_sums {
    const npg_mesh *mesh;
    const npg_poisson_settings *settings; /* for the wish to stop */
    double point_dist, vert_dist, stretched;
    size_t frames;
    float *dist; /* V, owned */
} result_sums;

static npg_status see(void *user, const npg_candidate_cloud *cloud, const float *vert_unit,
                      const npg_tracked *tracked)
{
    result_sums *f = user;
    double area = 0, stretched = 0, dist = 0;
    if (f->settings->should_stop && f->settings->should_stop(f->settings->user))
        return npg_error(NPG_STOPPED, "stopped while the keyframe was chosen");
    for (size_t i = 0; i < f->mesh->face_count; i++) {
        const uint32_t *face = f->mesh->faces + 3 * i;
        double rest = npg_face_area(f->mesh->vert_pos, face), now = npg_face_area(vert_unit, face);
        area += now;
        if (now > STRETCHED * rest) stretched += now;
    }
    NPG_TRY(npg_points_dist(f->dist, vert_unit, f->mesh->vert_count, cloud->points, cloud->point_count));
    for (size_t v = 0; v < f->mesh->vert_count; v++) dist += (double)f->dist[v];
    f->vert_dist += dist / (double)f->mesh->vert_count;
    f->point_dist += tracked->point_dist_mean;
    f->stretched += area > 0 ? stretched / area : 0;
    f->frames++;
    return NPG_OK;
}

/* Follow the candidate's draft through the other frames. */
static npg_status follow(npg_draft_result *result, const npg_candidate_clouds *clouds, size_t at,
                         npg_mesh *draft, const npg_poisson_settings *settings)
{
    result_sums f = {.mesh = draft, .settings = settings};
    npg_status status = npg_alloc_array(&f.dist, NPG_FOR_MESH, draft->vert_count, sizeof *f.dist);
    if (!status) status = npg_candidate_follow(clouds, at, draft, &draft_tracking, see, &f);
    npg_release(&f.dist);
    NPG_TRY(status);
    result->is_followed = true;
    result->point_dist_unit = f.point_dist / fmax(1, (double)f.frames);
    result->vert_dist_unit = f.vert_dist / fmax(1, (double)f.frames);
    result->stretched_share = f.stretched / fmax(1, (double)f.frames);
    return NPG_OK;
}

/* A frame of which no surface can be made is no keyframe; that is no failure of the run. */
static bool is_fatal(npg_status status)
{
    return status && status != NPG_BAD_INPUT && status != NPG_FAILED && status != NPG_DIVERGED;
}

/* ---- the choice ---- */

typedef struct candidate {
    npg_draft_result *result;
    size_t at;       /* in the clouds */
    npg_mesh *draft; /* NULL where none was needed or could be made; owned */
} candidate;

typedef struct choosing {
    const npg_candidate_clouds *clouds;
    const npg_poisson_settings *settings;
    candidate list[NPG_CHOICE_MAX];
    size_t count, scored; /* scored: place of the best-scored frame, count when it is not there */
} choosing;

/* Whether parts are further apart in a candidate than in another: what the choice is for.
 * Distances alone say little. */
static bool is_less_touching(const npg_draft_result *a, const npg_draft_result *b)
{
    return a->contact < LESS_CONTACT * b->contact;
}

static bool is_more_apart(const npg_draft_result *a, const npg_draft_result *b)
{
    return a->handles < b->handles || is_less_touching(a, b);
}

static npg_status list_candidates(choosing *c, npg_draft_result *results, int64_t best_scored)
{
    for (size_t i = 0; i < c->clouds->count && c->count < NPG_CHOICE_MAX; i++) {
        const npg_candidate_cloud *cloud = &c->clouds->list[i];
        if (!cloud->is_candidate || !cloud->normals) continue;
        npg_draft_result *result = &results[c->count];
        *result = (npg_draft_result){.index = cloud->index, .number = cloud->number};
        NPG_TRY(npg_cloud_contact(&result->contact, cloud->points, cloud->normals, cloud->point_count));
        c->list[c->count++] = (candidate){.result = result, .at = i};
    }
    c->scored = 0;
    while (c->scored < c->count && c->list[c->scored].result->index != best_scored) c->scored++;
    return NPG_OK;
}

/* What is done for several candidates at the same time. */
typedef struct together {
    choosing *c;
    npg_status (*act)(choosing *c, candidate *one);
    candidate *list[NPG_CHOICE_MAX];
    size_t count;
} together;

static npg_status draft_one(choosing *c, candidate *one)
{
    return make_draft(&one->draft, &one->result->handles, &c->clouds->list[one->at], c->settings);
}

static npg_status follow_one(choosing *c, candidate *one)
{
    return follow(one->result, c->clouds, one->at, one->draft, c->settings);
}

static npg_status act_for_one(void *user, size_t part)
{
    const together *t = user;
    npg_status status = t->act(t->c, t->list[part]);
    return is_fatal(status) ? npg_error_prefix(status, "frame %lld as a keyframe",
                                               (long long)t->list[part]->result->number)
                            : NPG_OK;
}

static npg_status act_for_all(together *t)
{
    return npg_parallel(act_for_one, t, t->count);
}

/* Drafts are made only of candidates that could be more apart than the best-scored frame: a closed draft
 * without handles has none to lose. */
static npg_status make_drafts(choosing *c)
{
    candidate *scored = c->scored < c->count ? &c->list[c->scored] : NULL;
    together first = {.c = c, .act = draft_one, .list = {scored}, .count = scored != NULL};
    together others = {.c = c, .act = draft_one};
    NPG_TRY(act_for_all(&first));
    bool has_draft = scored && scored->draft, may_lose_handles = has_draft && scored->result->handles > 0;
    for (size_t i = 0; i < c->count; i++) {
        bool is_wanted =
            !has_draft || may_lose_handles || is_less_touching(c->list[i].result, scored->result);
        if (i != c->scored && is_wanted) others.list[others.count++] = &c->list[i];
    }
    NPG_TRY(act_for_all(&others));
    for (size_t i = 0; i < others.count; i++)
        if (has_draft && others.list[i]->draft && !is_more_apart(others.list[i]->result, scored->result))
            npg_mesh_unref(&others.list[i]->draft);
    return NPG_OK;
}

/* Followed is nobody when the best-scored frame is alone in the running. */
static npg_status compare(choosing *c)
{
    together running = {.c = c, .act = follow_one};
    for (size_t i = 0; i < c->count; i++)
        if (c->list[i].draft) running.list[running.count++] = &c->list[i];
    bool is_alone = running.count == 1 && running.list[0] == &c->list[c->scored];
    return is_alone ? NPG_OK : act_for_all(&running);
}

static void add_up(npg_draft_result *results, size_t count, int64_t frame_count)
{
    int64_t fewest = INT64_MAX;
    for (size_t i = 0; i < count; i++)
        if (results[i].is_followed && results[i].handles < fewest) fewest = results[i].handles;
    for (size_t i = 0; i < count; i++) {
        double off = (double)results[i].index / (double)frame_count - 0.5;
        if (!results[i].is_followed) continue;
        results[i].cost = (results[i].point_dist_unit + results[i].vert_dist_unit +
                           STRETCH_COST * results[i].stretched_share + CONTACT_COST * results[i].contact) *
                          (1 + HANDLE_COST * (double)(results[i].handles - fewest)) *
                          (1 + MIDDLE_COST * off * off);
    }
}

/* The best-scored frame, unless another costs clearly less (and has its parts more apart, or it would not
 * have been followed). */
static size_t cheapest(const npg_draft_result *results, size_t count, size_t scored)
{
    bool has_scored = scored < count && results[scored].is_followed;
    size_t best = scored < count ? scored : 0;
    for (size_t i = 0; i < count; i++) {
        if (!results[i].is_followed || i == best) continue;
        double bar = results[best].is_followed ? results[best].cost : (double)INFINITY;
        if (has_scored) bar = fmin(bar, CLEARLY_LESS * results[scored].cost);
        if (results[i].cost < bar) best = i;
    }
    return best;
}

npg_status npg_choose(npg_draft_result *results, size_t *count, size_t *best,
                      const npg_candidate_clouds *clouds, int64_t best_scored, int64_t frame_count,
                      const npg_poisson_settings *settings)
{
    choosing c = {.clouds = clouds, .settings = settings};
    npg_status status = list_candidates(&c, results, best_scored);
    if (!status) status = make_drafts(&c);
    if (!status) status = compare(&c);
    for (size_t i = 0; i < c.count; i++) npg_mesh_unref(&c.list[i].draft);
    *count = c.count;
    add_up(results, c.count, frame_count);
    *best = cheapest(results, c.count, c.scored);
    return status;
}
