/* fuse: gathers what all frames saw of the body, for a reference that no single frame could give.
 *
 * In a fusing pass the reference so far is aligned with every frame.  Each frame's points are then warped to
 * the keyframe's pose by that motion (geometry/skinning.c) and averaged with those of the other frames
 * (averages.c); stage mesh makes the next reference from what comes out.  Parts that touch in a frame are
 * told apart by the surface that each point belongs to, so one frame's contact joins nothing.
 *
 * Where sensors see a side of the body, the reference so far is that side, and open.  It then grows: points
 * that lie past its border are carried by the border's motion and added, frame by frame outward from the
 * keyframe for as long as the surface has a place for most of a frame's points (stage align).  The next pass
 * follows what came out and gets farther, until all frames are reached; where it gets no farther, less is
 * asked for.
 *
 * Not in the paper, whose reference is the surface of one frame. */
#include <math.h>
#include <stdlib.h>

#include "fuse/fuse_internal.h"
#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/surface.h"
#include "pipeline/order.h"
#include "track/track.h"

#define SIDE_LEAST   0.25 /* of a cell, in spacings of the keyframe's points */
#define FRAMES_SHARE 0.05 /* of all frames must have seen a place: wrong motion shows others in a few */

#define COLOURS_MOST 60000 /* cubes; at 20 000 faces each vertex has six                          */
#define COLOUR_KEY   16    /* what the keyframe's colours count, those of frames far away being 1 */

/* Space that sensors saw empty, in spacings of the keyframe's points, each over eight of them. */
#define EMPTY_SIDE   0.4    /* of a cell                                */
#define EMPTY_MOST   300000 /* cells at most: larger ones then          */
#define EMPTY_BIN    0.5    /* of a depth map, at the points' distance  */
#define EMPTY_MARGIN 0.3    /* that a place must be before what was seen */

/* While a reference that is one side of the body grows. */
#define GROW_WEIGHT    0.25 /* of such a point, one on the surface being 1                       */
#define DENSE_SPACINGS 1.5  /* of the keyframe's points, within which a place must have NPG_PATCH */

typedef struct state {
    npg_skin *skin;
    npg_cells *cells;
    npg_carving *empty;        /* NULL: nothing was looked at from a known place */
    int64_t key;               /* index of the keyframe */
    npg_free_space *key_space; /* what the keyframe's images say; NULL: it has none */
    npg_colour_cells *colours; /* NULL: the points have no colours, or none are wanted */
    double spacing, noise;     /* of the keyframe's points */
    double usual;              /* mean of the frames' median distances */
    int64_t frames, misaligned, points, strays;
    double grow_dist; /* of an open reference that sensors saw: so near its border points add to it; else 0 */
} state;

/* ---- a frame ---- */

typedef struct cloud {
    npg_arena arena;
    float *points; /* unit */
    npg_skinned *warped;
    const float *normals;    /* of the frame, a loan, or NULL */
    const uint8_t *colours;  /* the same */
    const uint8_t *isolated; /* the same */
    size_t count;
} cloud;

static npg_status open_cloud(cloud *c, const npg_worker *worker, const npg_frame *frame)
{
    c->count = frame->point_count;
    c->normals = frame->normals;
    c->isolated = frame->isolated;
    c->colours = npg_worker_settings(worker)->colour == NPG_COLOUR_NO ? NULL : frame->colours;
    c->points = npg_arena_take(&c->arena, c->count, 3 * sizeof *c->points);
    c->warped = npg_arena_take(&c->arena, c->count, sizeof *c->warped);
    NPG_TRY(npg_arena_status(&c->arena));
    npg_box_local_to_unit(&npg_worker_facts(worker)->box, c->points, frame->pos_local, c->count);
    return NPG_OK;
}

/* Of the points that the surface has a place for, where it grows; without any infinite. */
static npg_status median_dist(double *median, const cloud *c, bool is_side)
{
    size_t count = 0;
    float *dists;
    NPG_TRY(npg_alloc_array(&dists, NPG_FOR_MESH, c->count, sizeof *dists));
    for (size_t i = 0; i < c->count; i++)
        if (!is_side || !c->warped[i].is_beyond) dists[count++] = c->warped[i].dist;
    qsort(dists, count, sizeof *dists, npg_order_float);
    *median = count ? (double)dists[count / 2] : HUGE_VAL;
    npg_release(&dists);
    return NPG_OK;
}

/* The surface slides along the body, the more the farther a frame is from the keyframe: colours blur. */
static unsigned colour_weight(int64_t away)
{
    double weight = COLOUR_KEY / (1 + (double)llabs(away));
    return weight > 1 ? (unsigned)lrint(weight) : 1;
}

/* Weights fall with the distance as the tracker's do (Geman and McClure); what is near is averaged where the
 * surface is, so that noise across the surface averages out; what is not, where it is. */
static npg_status add_points(state *s, const cloud *c, int64_t frame, double near_dist, double far_dist)
{
    unsigned weight = colour_weight(frame - s->key);
    for (size_t i = 0; i < c->count; i++) {
        const npg_skinned *p = &c->warped[i];
        bool is_near = (double)p->dist <= near_dist;
        double share = (double)p->dist / near_dist, robust = 1 / (1 + share * share);
        /* What was carried to where the keyframe saw that nothing is would be a limb for the second time. */
        if ((c->isolated && c->isolated[i]) || npg_free_space_is_empty(s->key_space, p->point)) {
            s->strays++;
            continue;
        }
        if (p->is_beyond && (double)p->dist <= s->grow_dist) {
            NPG_TRY(npg_cells_add(s->cells, p->point, p->normal, p->point, p->normal, GROW_WEIGHT, frame));
            continue;
        }
        if ((double)p->dist > far_dist || p->agreement < NPG_SAME_SIDE) {
            s->strays++;
            continue;
        }
        const uint8_t *colour = c->colours ? c->colours + 4 * i : NULL;
        if (colour && colour[3] && is_near && s->colours)
            npg_colour_cells_add(s->colours, p->foot, p->facing, colour, weight);
        NPG_TRY(npg_cells_add(s->cells, is_near ? p->foot : p->point, is_near ? p->facing : p->normal,
                              p->point, p->normal, (float)(robust * robust), frame));
    }
    s->points += (int64_t)c->count;
    return NPG_OK;
}

/* What the sensors of the frame say of the space around the surface: of a rig by its images, not by its points, which lack
 * what lies at outlines and at a slant. */
static npg_status look_around(npg_worker *worker, const cloud *c, const npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    float at[3 * NPG_FRAME_SENSORS_MOST];
    size_t count = frame->sensor_count ? frame->sensor_count : facts->viewpoints.count;
    if (!count || (frame->sensors && !frame->views)) return NPG_OK;
    if (frame->sensor_count)
        npg_box_local_to_unit(&facts->box, at, frame->sensor_local, count);
    else
        npg_viewpoints_place(at, &facts->viewpoints, c->points, c->count);
    npg_seen seen = {.sensors = at,
                     .sensor_count = count,
                     .points = c->points,
                     .point_count = c->count,
                     .bin = EMPTY_BIN * s->spacing,
                     .margin = EMPTY_MARGIN * s->spacing + NPG_WITHIN * s->noise,
                     .is_key = s->grow_dist > 0 && frame->index == s->key};
    if (!s->empty)
        NPG_TRY(npg_carving_open(&s->empty, facts->reference, EMPTY_SIDE * s->spacing,
                                 NPG_BEYOND * s->spacing, EMPTY_MOST));
    NPG_TRY(npg_free_space_open(&seen.space, frame, &facts->box));
    npg_status status = npg_carving_see(s->empty, s->skin, &seen);
    npg_free_space_close(&seen.space);
    return status;
}

static size_t most_cells(const npg_facts *facts)
{
    size_t points = (size_t)facts->planned_count * facts->point_count_max;
    return points < NPG_FUSED_MOST ? points : NPG_FUSED_MOST;
}

static npg_status open_gathering(npg_worker *worker, const cloud *key, const npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    const npg_facts *facts = npg_worker_facts(worker);
    s->key = facts->plan.key;
    NPG_TRY(npg_cloud_spacing(&s->spacing, key->points, key->count));
    NPG_TRY(npg_cloud_noise(&s->noise, key->points, key->normals, key->count));
    NPG_TRY(npg_free_space_open(&s->key_space, frame, &facts->box));
    double side = fmax(SIDE_LEAST, 1 / sqrt((double)facts->planned_count)); /* for a point of all frames */
    NPG_TRY(npg_cells_open(&s->cells, side * s->spacing, most_cells(facts)));
    NPG_TRY(npg_skin_open(&s->skin, facts->reference));
    if (facts->sensor_count_max && npg_skin_is_open(s->skin))
        s->grow_dist =
            NPG_NEARBY_SHARE * npg_points_diagonal(facts->reference->vert_pos, facts->reference->vert_count);
    return NPG_OK;
}

static npg_status gather(npg_worker *worker, cloud *c, const npg_frame *frame)
{
    state *s = npg_worker_state(worker);
    double median;
    NPG_TRY(open_cloud(c, worker, frame));
    if (!s->skin) NPG_TRY(open_gathering(worker, c, frame));
    if (c->colours && !s->colours) NPG_TRY(npg_colour_cells_open(&s->colours, s->spacing, COLOURS_MOST));
    npg_skin_pose(s->skin, frame->vert_unit);
    NPG_TRY(npg_skin_to_rest(s->skin, c->warped, c->points, c->normals, c->count));
    NPG_TRY(median_dist(&median, c, s->grow_dist > 0));
    if (s->frames > 1 && median > NPG_WITHIN * s->usual) {
        s->misaligned++;
        return NPG_OK;
    }
    s->usual = (s->usual * (double)s->frames + median) / (double)(s->frames + 1);
    s->frames++;
    NPG_TRY(look_around(worker, c, frame));
    return add_points(s, c, frame->index, NPG_WITHIN * median, NPG_WITHIN * fmax(s->spacing, median));
}

static npg_status gather_frame(npg_worker *worker, const npg_frame *frame)
{
    cloud c = {.arena.purpose = NPG_FOR_MESH};
    const npg_brief *brief = &npg_worker_facts(worker)->brief;
    if (frame->is_skipped || !frame->point_count) return NPG_OK;
    if (frame->index < brief->gathers_from || frame->index > brief->gathers_to) return NPG_OK;
    npg_status status = gather(worker, &c, frame);
    npg_arena_release(&c.arena);
    return npg_error_prefix(status, "frame %lld", (long long)frame->number);
}

/* ---- the end of a pass ---- */

/* What grows must hang together: single places past the border are of other parts, wrongly carried. */
static npg_status drop_scattered(npg_fused *fused, double radius)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    npg_neighbours near;
    size_t n = fused->count;
    if (n < NPG_PATCH) return NPG_OK;
    uint8_t *keep = npg_arena_take(&scratch, n, 1);
    npg_status status = npg_neighbours_take(&near, &scratch, fused->points, n, fused->points, n, NPG_PATCH);
    for (size_t i = 0; i < n && !status; i++)
        keep[i] = (double)near.dist_sq[(i + 1) * NPG_PATCH - 1] <= radius * radius;
    if (!status) fused->count = npg_points_keep(fused->points, fused->normals, n, keep);
    npg_arena_release(&scratch);
    return status;
}

static npg_status collect(npg_worker *worker, npg_fused *fused)
{
    const state *s = npg_worker_state(worker);
    size_t most = npg_cells_count(s->cells);
    double least = fmax(NPG_CONFIRMED, FRAMES_SHARE * (double)s->frames);
    /* What is new may be seen by the last frame that is reached alone. */
    bool is_one_enough = s->frames < 2 * NPG_CONFIRMED || npg_worker_facts(worker)->brief.leaves_open;
    int64_t frames_least = is_one_enough ? 1 : (int64_t)least;
    NPG_TRY(npg_alloc_array(&fused->points, NPG_FOR_MESH, most + 1, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&fused->normals, NPG_FOR_MESH, most + 1, 3 * sizeof(float)));
    fused->spacing_unit = npg_cells_side(s->cells);
    fused->key_spacing_unit = s->spacing;
    fused->key_noise_unit = s->noise;
    NPG_TRY(npg_cells_means(s->cells, fused->points, fused->normals, &fused->count, frames_least));
    return s->grow_dist > 0 ? drop_scattered(fused, fmax(DENSE_SPACINGS * s->spacing,
                                                         NPG_VOTE_CELLS * fused->spacing_unit))
                            : NPG_OK;
}

static npg_status collect_colours(const state *s, npg_fused *fused)
{
    size_t count = s->colours ? npg_colour_cells_count(s->colours) : 0;
    if (!count) return NPG_OK;
    NPG_TRY(npg_alloc_array(&fused->colour_points, NPG_FOR_MESH, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&fused->colour_normals, NPG_FOR_MESH, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&fused->colours, NPG_FOR_MESH, count, 4));
    npg_colour_cells_means(s->colours, fused->colour_points, fused->colour_normals, fused->colours);
    fused->colour_count = count;
    return NPG_OK;
}

static npg_status collect_empty(const npg_worker *worker, npg_fused *fused)
{
    const state *s = npg_worker_state(worker);
    size_t most = s->empty ? npg_carving_count(s->empty) : 0;
    if (!most) return NPG_OK;
    NPG_TRY(npg_alloc_array(&fused->empty, NPG_FOR_MESH, most, 3 * sizeof(float)));
    fused->empty_side = npg_carving_side(s->empty);
    /* by viewpoints that were found, not known, more must say so */
    fused->empty_count =
        npg_carving_find(s->empty, fused->empty, s->frames < 2 * NPG_CONFIRMED ? 1 : NPG_CONFIRMED,
                         npg_worker_facts(worker)->viewpoints.count ? NPG_MAJORITY : 1 - NPG_MOST);
    return NPG_OK;
}

static void report_gathered(npg_worker *worker, const npg_fused *fused)
{
    const state *s = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    json_object_update_new(report, json_pack("{sI sI sI sI sI sf}", "frames", (json_int_t)s->frames,
                                             "frames_misaligned", (json_int_t)s->misaligned, "points",
                                             (json_int_t)s->points, "points_stray", (json_int_t)s->strays,
                                             "points_fused", (json_int_t)fused->count, "cell_unit",
                                             fused->spacing_unit));
    if (fused->empty)
        json_object_set_new(report, "cells_seen_empty", json_integer((json_int_t)fused->empty_count));
    npg_worker_log(worker, NPG_LOG_INFO, -1,
                   "%lld points of %lld frames in the keyframe's pose: %zu means over %.5f units",
                   (long long)(s->points - s->strays), (long long)s->frames, fused->count,
                   fused->spacing_unit);
}

static npg_status publish(npg_worker *worker)
{
    const state *s = npg_worker_state(worker);
    npg_fused *fused;
    NPG_TRY(npg_alloc(&fused, NPG_FOR_MESH, sizeof *fused));
    npg_status status = collect(worker, fused);
    if (!status) status = collect_colours(s, fused);
    if (!status) status = collect_empty(worker, fused);
    if (status) {
        npg_fused_close(&fused);
        return status;
    }
    report_gathered(worker, fused);
    return npg_worker_publish(worker, &npg_fact_fused, fused);
}

/* ---- the stage ---- */

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        NPG_TRY(gather_frame(worker, npg_chunk_frame(*chunk, i)));
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
    }
    return NPG_OK;
}

/* What was gathered for a keyframe that does better stays. */
static npg_status settle(npg_worker *worker)
{
    npg_fused *before = npg_worker_take_fact(worker, &npg_fact_fused);
    if (before && !npg_worker_facts(worker)->brief.keeps_gathered)
        return npg_worker_publish(worker, &npg_fact_fused, before);
    npg_fused_close(&before);
    return publish(worker);
}

static void uninit(npg_worker *worker)
{
    state *s = npg_worker_state(worker);
    npg_skin_close(&s->skin);
    npg_cells_close(&s->cells);
    npg_carving_close(&s->empty);
    npg_free_space_close(&s->key_space);
    npg_colour_cells_close(&s->colours);
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    const npg_facts *facts = npg_worker_facts(worker);
    size_t points = facts->point_count_max;
    *chunks_held = 1;
    size_t colours =
        npg_worker_settings(worker)->colour == NPG_COLOUR_NO ? 0 : npg_colour_cells_memory(COLOURS_MOST);
    return npg_carving_memory(EMPTY_MOST) + colours + npg_cells_memory(most_cells(facts)) +
           points * 8 * sizeof(float) + npg_skin_memory(npg_worker_verts_at_most(worker), points) +
           2 * npg_free_space_memory(facts->view_count_max);
}

const npg_stage npg_stage_fuse = {.name = "fuse",
                                  .help = "gathers the points of all frames for the reference",
                                  .state_size = sizeof(state),
                                  .passes = NPG_PASS_FUSE,
                                  .needs = NPG_FIELD_CLEAN | NPG_FIELD_KEY | NPG_FIELD_REFERENCE,
                                  .process = process,
                                  .settle = settle,
                                  .uninit = uninit,
                                  .memory = memory};
