/* Mesh: the reference surface.  The stage takes the keyframe's oriented points to a clean mesh in unit
 * coordinates (or reads the user's own), puts it into the run's facts and lets all chunks pass. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "align/sights.h"
#include "geometry/colours.h"
#include "geometry/mesh_tools.h"
#include "geometry/metrics.h"
#include "ingest/formats/reader.h"
#include "mesh/denoise.h"
#include "mesh/flatten.h"
#include "mesh/follow_normals.h"
#include "mesh/fringe.h"
#include "mesh/fused.h"
#include "mesh/mesh_clean.h"
#include "mesh/resurface.h"
#include "mesh/unseen.h"
#include "mesh/vdb.h"
#include "mesh/weld.h"
#include "pipeline/clock.h"
#include "pipeline/cost.h"
#include "pipeline/stage.h"

#define POINTS_MAX        80000
#define NOISE_MIN         0.03 /* in spacings; clean clouds have 0 */
#define FOLLOW_NOISE      0.08 /* of a frame's points, in spacings; curvature of few points is below */
#define SMOOTH_NEIGHBOURS 24
#define FUSED_NEIGHBOURS  60   /* of the points of all frames, which lie closer */
#define SEEN_SPACINGS     2.0  /* a place is seen when a point is nearer than this many spacings */
#define KEY_SPACINGS      0.5  /* of the keyframe's points: all frames lie closer, but not everywhere */
#define FLAT_SPACINGS     1.2  /* surface farther than this from every point is drawn tight */
#define UNSEEN_TOLERATED  0.02 /* of the area, before the user is told */
#define PIECE_SHARE       0.01 /* of the area */
#define PIECE_DIST        0.1  /* in diagonals */
#define LOST_TOLERATED    0.02 /* of the area, in pieces left out */
#define REBUILD_AREA_MIN  0.8  /* of the area; less is not the same surface */
#define FACES_PER_POINT   4    /* of the reference at most: more would be the mesher's, not the points' */
#define REBUILD_VOXELS    384  /* along the longest side of the unit box */

enum { UNSEEN_AUTO, UNSEEN_KEEP, UNSEEN_TRIM };
enum { PIECES_NEAR, PIECES_MAIN };
enum { MESHER_POISSON, MESHER_VDB };

typedef struct mesh_state {
    int mesher, unseen, pieces;
    int64_t depth, face_max, time_limit_s, memory_limit_mib;
    double point_weight, trim, invented_max;
    int apart; /* npg_apart_way */
    bool smooth;
    bool is_made; /* the reference of this pass */
} mesh_state;

#define AT(member) offsetof(mesh_state, member)

/* clang-format off */
static const npg_option mesh_options[] = {
    /* type        name              place                 default    least  most  shown as or words */
    NPG_ROW_CHOICE("mesher",         AT(mesher),           "poisson", "poisson|vdb",
        "How the keyframe's surface is made: "
        "Poisson, or Poisson taken through an OpenVDB level set (even triangles, no self-contact)"),
    NPG_ROW_INT   ("poisson-depth",  AT(depth),            "10",      4,     13,   NULL,
        "Depth of the Poisson octree"),
    NPG_ROW_REAL  ("poisson-weight", AT(point_weight),     "10",      0,     1000, NULL,
        "How closely the Poisson surface follows the points"),
    NPG_ROW_INT   ("poisson-time",   AT(time_limit_s),     "600",     1,     1e6,  "SECONDS",
        "Stop the reconstruction after this many seconds"),
    NPG_ROW_INT   ("poisson-memory", AT(memory_limit_mib), "8192",    64,    1e7,  "MIB",
        "Address space the reconstruction may use"),
    NPG_ROW_CHOICE("pieces",         AT(pieces),           "near",    "near|main",
        "Of a surface in pieces keep the main one and what lies near it (1 % of the area or more, "
        "within a tenth of the diagonal), or the main one alone"),
    NPG_ROW_FLAG  ("smooth",         AT(smooth),           "yes",
        "Smooth the keyframe's points for the reconstruction when they are noisy"),
    NPG_ROW_CHOICE("hold-apart",     AT(apart),            "tight",   "tight|loose|no",
        "Hold parts that nearly touch apart while the surface is made, so that they are not joined; "
        "after that bring it back to its points (tight), "
        "or nearly so, which leaves a little of the gap (loose)"),
    NPG_ROW_INT   ("faces",          AT(face_max),         "20000",   16,    1e8,  NULL,
        "Faces of the reference mesh at most (and no more than 4 per point)"),
    NPG_ROW_REAL  ("trim",           AT(trim),             "0.15",    0.001, 100,  "SHARE",
        "Drop surface farther than this from every point of the keyframe, "
        "in diagonals of the keyframe's box"),
    NPG_ROW_CHOICE("unseen",         AT(unseen),           "auto",    "auto|keep|trim",
        "Surface without points near it (holes, the far side of a single view): "
        "keep it as the mesher closed it, trim it, or draw it tight between what was seen, "
        "and trim it when it is more than a quarter of the area (auto); it is reported in any case"),
    NPG_ROW_REAL  ("max-invented",   AT(invented_max),     "10",      0,     100,  "PERCENT",
        "The reference is good when at most this share of its area is surface "
        "that no point saw and that was kept, in per cent; "
        "above it the run ends with exit code 7"),
    {0}};
/* clang-format on */

#define GROWING_DEPTH 8 /* of the octree while the reference grows: it is to carry frames, no more */

#define UNSEEN_IS_A_SIDE 0.25 /* of the area: more than holes, a side that no camera saw                   */
#define UNSEEN_IS_LEFT   0.05 /* the same of one that has grown: where the body goes on, out of sight      */
#define IN_EMPTY         0.5  /* value of the cubes above which sensors saw that a point's place is empty  */

typedef struct making { /* what is known while the reference is made */
    npg_worker *worker;
    const mesh_state *state;
    const npg_frame *frame;
    npg_fused *fused;    /* of all frames, a loan whose points and normals are taken; NULL: of the frame */
    size_t count;        /* N, of the points used */
    float *points;       /* N x 3, unit, owned */
    float *normals;      /* N x 3 or NULL, owned */
    double seen;         /* what SEEN_SPACINGS and FLAT_SPACINGS are taken of */
    double spacing;      /* of the points */
    double diagonal;     /* of the points */
    double invented;     /* share of the mesh that no point saw, once it is trimmed */
    npg_cube_set *empty; /* space that sensors saw to be empty, owned; NULL: not known */
    bool is_rough;       /* the points were smoothed, and a frame's are noisy beyond doubt */
    npg_mesh *mesh;      /* owned */
} making;

/* ---- report ---- */

static void note(making *m, const char *key, double value)
{
    json_object_set_new(npg_worker_report(m->worker), key, json_real(value));
}

static void note_count(making *m, const char *key, size_t value)
{
    json_object_set_new(npg_worker_report(m->worker), key, json_integer((json_int_t)value));
}

/* Of the reference that the run delivers; what is said of those before is for the log alone. */
NPG_PRINTF(3, 4)
static void warn(const making *m, bool partial, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (npg_worker_pass(m->worker) == NPG_PASS_SOLVE)
        npg_worker_warn(m->worker, partial, m->frame->number, "%s", text);
    else
        npg_worker_log(m->worker, NPG_LOG_INFO, m->frame->number, "%s", text);
}

static bool should_stop(void *worker)
{
    return npg_worker_stopping(worker);
}

/* ---- steps ---- */

/* The points to reconstruct from, in unit coordinates, with their normals.
 * Frames with more than POINTS_MAX give an even choice: the face budget could not hold more detail,
 * and Poisson's time goes with the points. */
static npg_status take_frame_points(making *m)
{
    const npg_frame *frame = m->frame;
    size_t n = frame->point_count;
    size_t most = npg_worker_pass(m->worker) == NPG_PASS_FUSE ? NPG_START_POINTS_MOST : POINTS_MAX;
    m->count = n < most ? n : most;
    NPG_TRY(npg_alloc_array(&m->points, NPG_FOR_MESH, m->count, 3 * sizeof(float)));
    if (frame->normals) NPG_TRY(npg_alloc_array(&m->normals, NPG_FOR_MESH, m->count, 3 * sizeof(float)));
    npg_points_spread(m->points, m->normals, m->count, frame->pos_local, frame->normals, n);
    npg_box_local_to_unit(&npg_worker_facts(m->worker)->box, m->points, m->points, m->count);
    return NPG_OK;
}

/* What has grown where most frames look through was carried there by a wrong motion. */
static npg_status drop_empty(making *m)
{
    uint8_t *keep;
    NPG_TRY(npg_alloc(&keep, NPG_FOR_MESH, m->count));
    for (size_t i = 0; i < m->count; i++)
        keep[i] = npg_cube_set_value(m->empty, m->points + 3 * i) <= IN_EMPTY;
    size_t kept = npg_points_keep(m->points, m->normals, m->count, keep);
    npg_release(&keep);
    note_count(m, "points_in_empty_space", m->count - kept);
    m->count = kept;
    return NPG_OK;
}

/* Those of all frames are thinned already.  `making` owns them from here on; `fused` keeps its figures. */
static npg_status take_points(making *m)
{
    if (!m->fused) return take_frame_points(m);
    m->count = m->fused->count;
    m->points = m->fused->points;
    m->normals = m->fused->normals;
    m->fused->points = m->fused->normals = NULL;
    if (!m->fused->empty) return NPG_OK;
    NPG_TRY(npg_cube_set_open(&m->empty, m->fused->empty, m->fused->empty_count, m->fused->empty_side));
    return npg_worker_facts(m->worker)->growing_passes ? drop_empty(m) : NPG_OK;
}

static npg_status measure_points(making *m)
{
    m->diagonal = npg_points_diagonal(m->points, m->count);
    note_count(m, "points", m->fused ? m->fused->count : m->frame->point_count);
    note_count(m, "points_used", m->count);
    NPG_TRY(npg_cloud_spacing(&m->spacing, m->points, m->count));
    note(m, "point_spacing_unit", m->spacing);
    m->seen = m->spacing;
    if (m->fused) m->seen = fmax(m->seen, KEY_SPACINGS * m->fused->key_spacing_unit);
    return NPG_OK;
}

static npg_poisson_settings settings_of(const mesh_state *s)
{
    return (npg_poisson_settings){.depth = (int)s->depth,
                                  .point_weight = s->point_weight,
                                  .apart = (npg_apart_way)s->apart,
                                  .time_limit_s = (double)s->time_limit_s,
                                  .memory_limit = (size_t)s->memory_limit_mib << 20};
}

npg_poisson_settings npg_poisson_settings_of(const npg_options *options)
{
    mesh_state s = {0};
    npg_options_fill(options, mesh_options, &s);
    return settings_of(&s);
}

/* Noise would become bumps of the surface that every frame then carries. */
static npg_status smooth(making *m)
{
    double sigma;
    size_t n = m->count;
    NPG_TRY(npg_cloud_noise(&sigma, m->points, n));
    note(m, "noise_unit", sigma);
    if (!m->state->smooth || sigma < NOISE_MIN * m->spacing) return NPG_OK;
    npg_worker_log(m->worker, NPG_LOG_INFO, m->frame->number,
                   "the points of %s are noisy (%.2g of the unit box): smoothed for the reconstruction",
                   m->fused ? "all frames" : "the keyframe", sigma);
    m->is_rough = m->fused ? m->fused->key_noise_unit > FOLLOW_NOISE * m->fused->key_spacing_unit
                           : sigma > FOLLOW_NOISE * m->spacing;
    return npg_cloud_smooth(m->points, m->normals, n, m->fused ? FUSED_NEIGHBOURS : SMOOTH_NEIGHBOURS);
}

static npg_status reconstruct(making *m)
{
    npg_poisson_settings settings = settings_of(m->state);
    if (npg_worker_facts(m->worker)->is_growing && settings.depth > GROWING_DEPTH)
        settings.depth = GROWING_DEPTH;
    settings.should_stop = should_stop;
    settings.user = m->worker;
    if (m->fused) settings.rounds_max = 1; /* the surface that carried them has told their sides */
    if (!m->normals) return npg_error(NPG_BAD_INPUT, "the keyframe has no normals");
    double since = npg_clock_s();
    size_t n = m->count, turned, moved;
    int rounds;
    NPG_TRY(smooth(m));
    NPG_TRY(npg_resurface_apart(&m->mesh, &moved, &turned, &rounds, m->normals, m->points, n, m->spacing,
                                &settings));
    note_count(m, "points_held_apart", moved);
    note_count(m, "poisson_rounds", (size_t)rounds);
    note_count(m, "normals_turned", turned);
    note(m, "poisson_s", npg_clock_s() - since);
    note_count(m, "faces_reconstructed", m->mesh->face_count);
    return NPG_OK;
}

static npg_status keep_main(making *m, const char *when)
{
    npg_pieces pieces;
    double dist_max = m->state->pieces == PIECES_NEAR ? PIECE_DIST * m->diagonal : 0;
    NPG_TRY(npg_mesh_keep_main(&m->mesh, &pieces, PIECE_SHARE, dist_max));
    note_count(m, "components", pieces.kept);
    if (pieces.kept > 1)
        warn(m, false, "%s, the surface is in %zu pieces: holes in the points?", when, pieces.kept);
    if (pieces.lost_share > LOST_TOLERATED)
        warn(m, false, "%s, the surface is in %zu pieces: %zu with %.1f %% of the area are left out", when,
             pieces.found, pieces.found - pieces.kept, 100 * pieces.lost_share);
    return NPG_OK;
}

/* What no point saw: measured on the closed surface, before anything is trimmed. */
static npg_status judge_unseen(making *m, bool *trim_unseen)
{
    double share, seen_dist = SEEN_SPACINGS * m->seen;
    NPG_TRY(npg_mesh_unseen(&share, m->mesh, m->points, m->count, seen_dist));
    const npg_facts *facts = npg_worker_facts(m->worker);
    double side = facts->growing_passes ? UNSEEN_IS_LEFT : UNSEEN_IS_A_SIDE;
    *trim_unseen = m->state->unseen == UNSEEN_TRIM || facts->is_growing ||
                   (m->state->unseen == UNSEEN_AUTO && share > side);
    note(m, "unseen_share", share);
    json_object_set_new(npg_worker_report(m->worker), "unseen",
                        json_string(*trim_unseen ? "trimmed" : "kept"));
    if (share > UNSEEN_TOLERATED)
        warn(m, false, "%.1f %% of the reconstructed surface has no point near it: unseen in %s, %s",
             100 * share, m->fused ? "all frames" : "the keyframe",
             *trim_unseen                      ? "trimmed off"
             : m->state->unseen == UNSEEN_KEEP ? "kept as Poisson closed it"
                                               : "closed tightly");
    return NPG_OK;
}

/* Of a side that has grown to a body shreds are left along the border.  One that still grows needs all it
 * has, and of one frame half a limb is as narrow. */
static npg_status drop_fringe(making *m)
{
    const npg_facts *facts = npg_worker_facts(m->worker);
    double share;
    if (!facts->growing_passes || facts->is_growing) return NPG_OK;
    NPG_TRY(npg_mesh_drop_fringe(&m->mesh, &share, SEEN_SPACINGS * m->seen));
    note(m, "fringe_share", share);
    return NPG_OK;
}

static npg_status trim(making *m)
{
    bool trim_unseen;
    double limit = m->state->trim * m->diagonal, share;
    NPG_TRY(judge_unseen(m, &trim_unseen));
    if (trim_unseen) limit = fmin(limit, SEEN_SPACINGS * m->seen);
    NPG_TRY(npg_mesh_trim(&m->mesh, &share, m->points, m->count, limit));
    note(m, "trimmed_share", share);
    if (!m->mesh->face_count) return npg_error(NPG_FAILED, "no surface lies near the points");
    if (trim_unseen) NPG_TRY(drop_fringe(m));
    NPG_TRY(npg_mesh_unseen(&m->invented, m->mesh, m->points, m->count, SEEN_SPACINGS * m->seen));
    if (!trim_unseen && share > LOST_TOLERATED)
        warn(m, false,
             "%.1f %% of the reconstructed surface is farther than %g diagonals from every point "
             "and was trimmed off",
             100 * share, m->state->trim);
    return share > 0 ? keep_main(m, "after trimming") : NPG_OK;
}

/* A level set knows inside from outside only where the surface is closed. */
static npg_status is_closed(bool *closed, const npg_mesh *mesh)
{
    npg_manifold manifold;
    NPG_TRY(npg_mesh_manifold(&manifold, mesh));
    *closed = !manifold.border_edges;
    return NPG_OK;
}

static npg_status rebuild(making *m)
{
    double voxel = 2 * NPG_UNIT_EXTENT / REBUILD_VOXELS, area = npg_mesh_area(m->mesh);
    NPG_TRY(npg_vdb_remesh(&m->mesh, voxel));
    note_count(m, "faces_rebuilt", m->mesh->face_count);
    double ratio = npg_mesh_area(m->mesh) / area;
    if (ratio < REBUILD_AREA_MIN || ratio > 1 / REBUILD_AREA_MIN)
        return npg_error(NPG_FAILED, "rebuilt through a level set, the surface has %.0f %% of its area",
                         100 * ratio);
    return NPG_OK;
}

static npg_status rebuild_on_request(making *m)
{
    bool closed;
    npg_mending mending;
    NPG_TRY(npg_mesh_mend(&m->mesh, &mending));
    NPG_TRY(is_closed(&closed, m->mesh));
    if (!closed)
        return npg_error(NPG_FAILED,
                         "mesher vdb takes a closed surface, but Poisson's is open (a single view?)");
    return rebuild(m);
}

static npg_status decimate(making *m)
{
    npg_mending mending;
    size_t budget = FACES_PER_POINT * (m->fused ? m->fused->count : m->frame->point_count);
    if (budget > (size_t)m->state->face_max) budget = (size_t)m->state->face_max;
    NPG_TRY(npg_mesh_mend(&m->mesh, &mending)); /* closes small holes before the faces are counted */
    size_t holes = mending.holes;
    for (int round = 0; round < 4 && (!round || m->mesh->face_count > budget); round++) {
        NPG_TRY(npg_mesh_decimate(&m->mesh, budget - budget / 200 * (size_t)round));
        NPG_TRY(npg_mesh_mend(&m->mesh, &mending));
        holes += mending.holes;
    }
    note_count(m, "mended_degenerate", mending.degenerate);
    note_count(m, "mended_duplicate", mending.duplicate);
    note_count(m, "mended_vertices", mending.split_vertices);
    note_count(m, "mended_holes", holes);
    note_count(m, "mended_flipped", mending.flipped);
    return keep_main(m, "after decimation");
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

/* The closed balloon over what nobody saw becomes the least surface there, out of space that is empty. */
static npg_status flatten(making *m)
{
    npg_flattened done;
    npg_mending mending;
    if (m->state->unseen != UNSEEN_AUTO) return NPG_OK;
    NPG_TRY(npg_mesh_flatten(m->mesh, &done, m->points, m->count, FLAT_SPACINGS * m->seen, m->empty));
    note_count(m, "vertices_flattened", done.moved);
    if (m->empty) note_count(m, "vertices_pushed", done.pushed);
    return done.moved ? npg_mesh_mend(&m->mesh, &mending) : NPG_OK;
}

/* Out of empty space while the faces are still small: the large ones that decimation leaves over nothing
 * can't follow its border. */
static npg_status leave_empty_space(making *m)
{
    if (!m->empty) return NPG_OK;
    double share = npg_mesh_share_in(m->mesh, m->empty);
    note(m, "seen_empty_share", share);
    return share > 0 ? flatten(m) : NPG_OK;
}

/* Of clean points the surface is nearer the truth than their normals' means, and of few points, too. */
static npg_status turn_faces(making *m)
{
    npg_mending mending;
    if (!m->is_rough) return NPG_OK;
    NPG_TRY(npg_mesh_follow_normals(m->mesh, m->points, m->normals, m->count));
    return npg_mesh_mend(&m->mesh, &mending);
}

static npg_status shape(making *m, bool *sound)
{
    NPG_TRY(trim(m));
    NPG_TRY(leave_empty_space(m));
    NPG_TRY(decimate(m));
    NPG_TRY(turn_faces(m));
    NPG_TRY(flatten(m));
    if (m->empty) note(m, "seen_empty_left_share", npg_mesh_share_in(m->mesh, m->empty));
    return is_sound(sound, m->mesh);
}

/* Try again from the whole surface, taken through a level set. */
static npg_status make_again(making *m, npg_mesh **whole, bool *sound)
{
    npg_mesh_unref(&m->mesh);
    m->mesh = *whole;
    *whole = NULL;
    NPG_TRY(rebuild(m));
    return shape(m, sound);
}

/* Where the largest part of it lies on the finished reference, for the report and in words. */
static void note_place(making *m, const npg_patch *largest, char *text, size_t size)
{
    const npg_frame_box *box = &npg_worker_facts(m->worker)->box;
    json_t *place = json_null();
    if (largest->share > 0) {
        double at[3], radius = largest->radius / box->scale;
        npg_box_unit_to_world(box, at, largest->at, 1);
        place =
            json_pack("{sf s[fff] sf}", "share", largest->share, "at", at[0], at[1], at[2], "radius", radius);
        snprintf(text, size, ", the largest part within %.3g of (%.4g, %.4g, %.4g)", radius, at[0], at[1],
                 at[2]);
    }
    json_object_set_new(npg_worker_report(m->worker), "invented_at", place);
}

/* Surface that stays although nothing was seen there is the mesher's invention: a run that carries much of it
 * through all frames is not a good one.  What was trimmed off is reported and is not in the result. */
static npg_status judge_invented(making *m)
{
    npg_patch largest;
    char place[128] = "";
    NPG_TRY(npg_mesh_mark_unseen(m->mesh, &largest, m->points, m->count, SEEN_SPACINGS * m->seen));
    npg_worker_facts(m->worker)->unseen_share = m->invented;
    note(m, "invented_share", m->invented);
    note_place(m, &largest, place, sizeof place);
    if (100 * m->invented > m->state->invented_max)
        warn(m, true,
             "%.1f %% of the reference's surface is invented: no point of %s saw it, "
             "and it was kept%s (the bar is %g %%; --unseen trim leaves it out)",
             100 * m->invented, m->fused ? "any frame" : "the keyframe", place, m->state->invented_max);
    return NPG_OK;
}

/* Poisson's mesh, trimmed and decimated; when that leaves folds and the surface is closed, it is rebuilt
 * through a level set and the same is done again. */
static npg_status make(making *m)
{
    npg_mesh *whole = NULL;
    bool sound = false, closed = false;
    NPG_TRY(reconstruct(m));
    NPG_TRY(keep_main(m, "as reconstructed"));
    if (m->state->mesher == MESHER_VDB) NPG_TRY(rebuild_on_request(m));
    NPG_TRY(npg_mesh_copy(&whole, m->mesh));
    npg_status status = shape(m, &sound);
    if (!status && !sound) status = is_closed(&closed, whole);
    if (!status && !sound && closed) status = make_again(m, &whole, &sound);
    if (!status && !sound)
        warn(m, false, "the reference mesh still has flipped or degenerate faces after all mending");
    npg_mesh_unref(&whole);
    return status;
}

/* ---- welds ---- */

static void report_welds(making *m, const npg_weld_cut *cut)
{
    note(m, "handles", (double)cut->handles);
    note_count(m, "weld_frames", cut->frames);
    note_count(m, "welds_cut", cut->patches);
    note_count(m, "weld_faces_cut", cut->faces);
    note(m, "weld_area_share", cut->area_share);
    note_count(m, "welds_refused", cut->refused);
    if (cut->patches)
        npg_worker_log(m->worker, NPG_LOG_INFO, m->frame->number,
                       "%zu welds that other frames pull apart were cut: %zu faces, %.2f %% of the area",
                       cut->patches, cut->faces, 100 * cut->area_share);
    if (cut->refused)
        npg_worker_log(m->worker, NPG_LOG_INFO, m->frame->number,
                       "%zu patches that other frames stretch could not be cut cleanly and stay",
                       cut->refused);
}

/* Cut what the frames of the choosing pass contradict.  The cut itself is no reason to fail. */
static npg_status cut_welds(making *m)
{
    bool is_last = npg_worker_pass(m->worker) == NPG_PASS_SOLVE;
    npg_sights *sights = is_last ? npg_worker_take_fact(m->worker, &npg_fact_sights)
                                 : npg_worker_fact(m->worker, &npg_fact_sights);
    npg_weld_settings settings = {.spacing_unit = m->spacing, .should_stop = should_stop, .user = m->worker};
    npg_weld_cut done;
    if (!sights) return NPG_OK;
    size_t at = npg_sights_find(sights, m->frame->index);
    double since = npg_clock_s();
    npg_status status =
        at < sights->count ? npg_weld_cut_all(&m->mesh, &done, sights, at, &settings) : NPG_OK;
    if (!status && at < sights->count) report_welds(m, &done);
    note(m, "welds_s", npg_clock_s() - since);
    if (is_last) npg_sights_close(&sights); /* a few MB that no later frame needs */
    return status == NPG_DIVERGED ? NPG_OK : status;
}

/* ---- the user's own mesh ---- */

static npg_status read_reference(making *m)
{
    const char *path = npg_worker_settings(m->worker)->reference;
    npg_facts *facts = npg_worker_facts(m->worker);
    NPG_TRY(npg_read_mesh(&m->mesh, path, &facts->origin));
    NPG_TRY(npg_mesh_require_finite(m->mesh, path));
    NPG_TRY(npg_mesh_require_manifold(m->mesh, path));
    npg_box_local_to_unit(&facts->box, m->mesh->vert_pos, m->mesh->vert_pos, m->mesh->vert_count);
    NPG_TRY(npg_mesh_unseen(&facts->unseen_share, m->mesh, m->points, m->count, SEEN_SPACINGS * m->seen));
    note(m, "unseen_share", facts->unseen_share);
    if (facts->unseen_share > 0.5)
        warn(m, false, "%.0f %% of %s has no point of the keyframe near it: other units or another pose?",
             100 * facts->unseen_share, path);
    return NPG_OK;
}

/* ---- the result ---- */

static npg_status measure_reference(making *m)
{
    npg_manifold manifold;
    npg_mesh *mesh = m->mesh;
    NPG_TRY(npg_mesh_manifold(&manifold, mesh));
    npg_release(&mesh->vert_normals);
    NPG_TRY(npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float)));
    npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, mesh->vert_count, mesh->faces,
                            mesh->face_count);
    note_count(m, "vertices", mesh->vert_count);
    note_count(m, "faces", mesh->face_count);
    note_count(m, "border_edges", manifold.border_edges);
    note(m, "area_unit", npg_mesh_area(mesh));
    note(m, "volume_unit", npg_mesh_volume(mesh));
    npg_worker_log(m->worker, NPG_LOG_INFO, m->frame->number,
                   "reference mesh: %zu vertices, %zu faces, %zu border edges", mesh->vert_count,
                   mesh->face_count, manifold.border_edges);
    return NPG_OK;
}

/* Colours of all frames; without a fusing pass those of the keyframe.  A user's own mesh keeps its own. */
static npg_status colour_reference(making *m)
{
    npg_mesh *mesh = m->mesh;
    const npg_frame *frame = m->frame;
    bool is_fused = m->fused && m->fused->hues;
    float *points = NULL;
    if (mesh->vert_colours || npg_worker_settings(m->worker)->colour == NPG_COLOUR_NO) return NPG_OK;
    if (!is_fused && !frame->colours) return NPG_OK;
    npg_coloured cloud = {.count = is_fused ? m->fused->hue_count : frame->point_count,
                          .points = is_fused ? m->fused->hue_points : NULL,
                          .normals = is_fused ? m->fused->hue_normals : frame->normals,
                          .colours = is_fused ? m->fused->hues : frame->colours};
    NPG_TRY(npg_alloc_array(&mesh->vert_colours, NPG_FOR_MESH, mesh->vert_count, 4));
    npg_status status =
        is_fused ? NPG_OK : npg_alloc_array(&points, NPG_FOR_MESH, cloud.count, 3 * sizeof(float));
    if (!status && !is_fused) {
        npg_box_local_to_unit(&npg_worker_facts(m->worker)->box, points, frame->pos_local, cloud.count);
        cloud.points = points;
    }
    if (!status)
        status = npg_colour_vertices(mesh->vert_colours, mesh->vert_pos, mesh->vert_normals, mesh->vert_count,
                                     &cloud, SEEN_SPACINGS * m->seen);
    npg_release(&points);
    NPG_TRY(status);
    size_t seen = 0;
    for (size_t i = 0; i < mesh->vert_count; i++) seen += mesh->vert_colours[4 * i + 3] != 0;
    note_count(m, "vertices_coloured", seen);
    return npg_colour_fill(mesh->vert_colours, mesh);
}

/* The points and normals of fused (or NULL) are taken from it. */
static npg_status make_reference(npg_worker *worker, const npg_frame *frame, npg_fused *fused)
{
    making m = {.worker = worker, .state = npg_worker_state(worker), .frame = frame, .fused = fused};
    npg_facts *facts = npg_worker_facts(worker);
    bool is_given = npg_worker_settings(worker)->reference[0];
    double since = npg_clock_s();
    npg_status status = take_points(&m);
    if (!status) status = measure_points(&m);
    if (!status) status = is_given ? read_reference(&m) : make(&m);
    if (!status && !is_given) status = cut_welds(&m);
    if (!status && !is_given) status = judge_invented(&m);
    if (!status) status = measure_reference(&m);
    if (!status) status = colour_reference(&m);
    note(&m, "seconds", npg_clock_s() - since);
    npg_release(&m.points);
    npg_release(&m.normals);
    npg_cube_set_close(&m.empty);
    if (status) npg_mesh_unref(&m.mesh);
    npg_mesh_unref(&facts->reference);
    facts->reference = m.mesh;
    if (!status) npg_worker_close_report(worker);
    return npg_error_prefix(status, "keyframe %lld (%s)", (long long)frame->number,
                            frame->path ? frame->path : "pushed");
}

/* ---- the stage ---- */

/* What all frames saw is one body only where the reference so far explains the capture to its ends: parts
 * that come, go or open belong to no common surface, and hiding them in one would silence the alarm.  A side
 * of the body that is growing explains what it has reached, and no more is gathered. */
static void drop_if_changed(npg_worker *worker, npg_fused **fused)
{
    const npg_facts *facts = npg_worker_facts(worker);
    if (!*fused || facts->growing_passes || !npg_facts_has_changed(facts)) return;
    npg_worker_log(worker, NPG_LOG_INFO, -1,
                   "the keyframe's surface does not explain all frames: the reference is made from it alone");
    npg_fused_close(fused);
}

/* The first one from the keyframe's points, those of later passes from all frames'. */
static npg_status make_of_pass(npg_worker *worker, const npg_frame *key)
{
    mesh_state *s = npg_worker_state(worker);
    npg_fused *fused = npg_worker_take_fact(worker, &npg_fact_fused);
    drop_if_changed(worker, &fused);
    if (key->is_skipped || !key->point_count)
        return npg_error(NPG_BAD_INPUT, "keyframe %lld has no usable points", (long long)key->number);
    npg_status status = make_reference(worker, key, fused);
    npg_fused_close(&fused);
    s->is_made = !status;
    return status;
}

static npg_status mesh_process(npg_worker *worker, npg_chunk **chunk)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const mesh_state *s = npg_worker_state(worker);
    bool is_there = s->is_made || facts->is_resumed;
    for (size_t i = 0; i < npg_chunk_count(*chunk) && !is_there; i++) {
        const npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (!frame->is_key) continue;
        NPG_TRY(make_of_pass(worker, frame));
        npg_worker_step(worker, 1, 1, 1);
        is_there = true;
    }
    if (!is_there) return npg_error(NPG_FAILED, "the keyframe does not come first");
    return NPG_OK;
}

/* The raw reconstruction is the largest thing held.  Measured at depth 10: about 16 faces a point,
 * and 80 bytes a face with its share of vertices, normals and the links that mending needs. */
#define RAW_FACES_PER_POINT 16
#define RAW_FACES_PER_FUSED 6 /* points that lie closer share the octree's cells; measured: 3 */
#define BYTES_PER_RAW_FACE  80

static size_t mesh_memory(const npg_worker *worker, size_t *chunks_held)
{
    const npg_fused *fused = npg_worker_fact(worker, &npg_fact_fused);
    size_t faces = npg_worker_facts(worker)->point_count_max * RAW_FACES_PER_POINT;
    *chunks_held = 1;
    if (fused && fused->count * RAW_FACES_PER_FUSED > faces) faces = fused->count * RAW_FACES_PER_FUSED;
    return faces * BYTES_PER_RAW_FACE;
}

/* A closed mesh has half as many vertices as faces, and two; the budget is decimate()'s. */
static size_t verts_at_most(const npg_worker *worker)
{
    const mesh_state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    size_t faces = (size_t)s->face_max, by_points = FACES_PER_POINT * facts->point_count_max;
    if (facts->own_verts) return facts->own_verts;
    if (by_points && faces > by_points) faces = by_points;
    return faces / 2 + 2;
}

static double mesh_expects(const npg_worker *worker, npg_pass pass)
{
    const npg_facts *facts = npg_worker_facts(worker);
    double points = (double)facts->point_count_max;
    bool from_all = pass == NPG_PASS_SOLVE && (facts->fuse_left || npg_worker_fact(worker, &npg_fact_fused));
    if (pass == NPG_PASS_CHOOSE || facts->own_verts) return 0;
    return npg_cost_surface_s(from_all ? fmin(points * (double)facts->frame_count, NPG_COST_FUSED_POINTS)
                                       : fmin(points, NPG_START_POINTS_MOST));
}

const npg_stage npg_stage_mesh = {.name = "mesh",
                                  .help = "Reference surface of the keyframe",
                                  .options = mesh_options,
                                  .state_size = sizeof(mesh_state),
                                  .passes = NPG_PASS_FUSE | NPG_PASS_SOLVE,
                                  .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY,
                                  .gives = NPG_FIELD_REFERENCE,
                                  .process = mesh_process,
                                  .memory = mesh_memory,
                                  .verts_at_most = verts_at_most,
                                  .expects = mesh_expects};
