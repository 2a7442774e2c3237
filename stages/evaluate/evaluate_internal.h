/* The evaluate room within: what is measured of a frame, and when its topology has changed. */
#ifndef NPG_EVALUATE_INTERNAL_H
#define NPG_EVALUATE_INTERNAL_H

#include <jansson.h>

#include "job/job.h"
#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/mesh.h"
#include "pipeline/stage.h"

/* Shape: how a deformed mesh differs from its reference. */

typedef struct npg_shape npg_shape;

/* What is needed of the reference; the mesh is a loan that must outlive the shape. */
npg_status npg_shape_open(npg_shape **shape, const npg_mesh *reference);
void npg_shape_close(npg_shape **shape);

/* Fill flipped_share, stretched_share and edge_change for V x 3 deformed vertices.
 *
 * A face is flipped when its normal points against the mean normal of the faces that share a vertex with it
 * (weighted by their areas in the reference; cosine below -0.2) although it did not in the reference (cosine
 * above 0.2): it was turned over against the rotation of its neighbourhood.  Faces that stand across a crease
 * of the reference are not judged.  A face is stretched when its area is more than 10 or less than 0.1 times
 * that in the reference.  Both shares are of the reference's area, as a sliver turns over by a breath.
 * edge_change is the mean of |length / reference length - 1|. */
void npg_shape_measure(const npg_shape *shape, npg_figures *figures, const float *vert_unit);

/* The latter, of edges that have a length at rest. */
double npg_edge_change(const float *rest, const float *now, uint32_t (*edges)[2], size_t edge_count);

/* Misfit: finds where in a frame the surface fails in one place, which is how a change of topology shows:
 * noise, outliers and a poor fit are spread all over.
 *
 *   far       points further from the surface than `reach`, near each other: something is there that the
 *             reference does not have (what lies just beyond its border, where it has one, its frame did not
 *             see)
 *   unsupported  connected surface further than `reach` from all points: something is gone
 *   stretched    connected surface whose edges are more than 1.5 times as long as in the reference, and
 *                further than 0.6 x reach from all points: a web between parts that went apart
 *   vacated      a part of the reference (one that hangs together) with fewer than 60 % of the points that
 *                are its share by area: it is gone, though its surface has found a place on another part's
 *                points, where it is neither unsupported nor stretched.  A point is its nearest part's; the
 *                share counts what is missing, of the area within NPG_SAMPLED spacings of points: a hole
 *                in them is bare surface, not points that another part has
 *
 * reach = max(NPG_BEYOND spacings of the points on the surface, NPG_DETAIL_SHARE of the reference's diagonal), with noise
 * 2 NPG_WITHIN times the median distance of the points, but no more than twice as far; the places are the largest ones.
 *
 * What sampling can explain is nothing: a place of fewer than 12 points, and one on the surface
 * where fewer than 20 points would be expected or that has fewer than 6 vertices' share of the area.
 * A reference with a border, or one that saw only a part of its frame, is never unsupported, stretched or
 * vacated: what cameras see differs.  Where it is known what of the surface they could see in a frame, the
 * rest of it is neither unsupported nor stretched, and has no share of the points; nor is what no point of the
 * reference supports (vert_unseen). */

typedef struct npg_misfit_finder npg_misfit_finder;

/* The mesh is a loan that must outlive the finder.  unseen_share: of its area that no point of its frame saw;
 * above 2 % the capture is of cameras that see other parts in each frame. */
npg_status npg_misfit_open(npg_misfit_finder **finder, const npg_mesh *reference, double unseen_share);
void npg_misfit_close(npg_misfit_finder **finder);

/* What is measured of a frame, in units. */
typedef struct npg_misfit_frame {
    const float *points;         /* N x 3                  */
    const npg_surface_hit *hits; /* N, the closest surface */
    size_t point_count;
    double point_dist_median;
    const float *vert_unit;    /* V x 3                           */
    const float *vert_dist_sq; /* V, to the nearest point         */
    const double *vert_areas;  /* V, in this frame, and their sum */
    double area;
    const uint8_t *is_in_sight; /* V: of a sensor, or NULL: no sensor is known */
} npg_misfit_frame;

/* Fill misfits[NPG_MISFITS]; `at` in units.  far's share is of the points, the others'
 * of the area.  NPG_MEMORY. */
npg_status npg_misfit_find(npg_misfit_finder *finder, npg_misfit *misfits, const npg_misfit_frame *frame);

/* Measure: how well a deformed reference explains the points of its frame. */

typedef struct npg_measure npg_measure;

typedef struct npg_measure_settings {
    double cover_dist;   /* a point that near covers the surface, in per cent of the diagonal */
    int64_t point_limit; /* points of a frame that are asked for at most; 0: all               */
    bool lies_as_key;    /* the reference lies as the keyframe shows the body                  */
} npg_measure_settings;

/* The mesh is a loan that must outlive the measure.  unseen_share: of its area that no point of its frame saw,
 * 0 to 1.  NPG_MEMORY; *measure is NULL after an error. */
npg_status npg_measure_open(npg_measure **measure, const npg_mesh *reference, double unseen_share,
                            const npg_measure_settings *settings);
void npg_measure_close(npg_measure **measure);

/* Fill the frame's figures from its vertices (V x 3, as the reference's) and its points: those of shape
 * (npg_shape_measure()), and unless the frame is skipped or has no finite point
 *
 *   point_dist_*       of the points to the surface, in diagonals of the box
 *   vertex_dist_mean   of the vertices, in sight where sensors are known, to the nearest point, the same
 *   chamfer            1e5 x half the sum of both mean squares
 *   marks              where eight vertices are, which lie far from each other
 *   coverage           share of the area, in sight where sensors are known, with a point within
 *                      max(cover_dist, 2 x spacing of the points)
 *   unsupported_*      share and largest place of what neither the reference's points nor these support
 *   misfits            as npg_misfit_find(), in world coordinates
 *   nowhere_share      of the area, where depth images show that nothing is; of the keyframe of a reference that
 *                      lies as it, also as it lies
 *
 * What is not known stays as it is.  One thread at a time.  NPG_MEMORY. */
npg_status npg_measure_frame(npg_measure *measure, npg_frame *frame, const npg_frame_box *box);

/* Bytes that a measure takes, at most: points, hits and distances, with the k-d tree about as much again; per
 * vertex of the reference the shape, the surface and its search tree. */
size_t npg_measure_memory(const npg_measure_settings *settings, size_t point_count, size_t vert_count);

/* Alarm: notices from which frame on the reference no longer explains the capture, for each direction from
 * the keyframe: its topology changed there.
 *
 * Each direction has a usual level of every misfit: median and median deviation of the last
 * explained frames, outward from the keyframe.  A frame is suspect when a misfit exceeds its level by half of
 *
 *     bound = max(floor, 2 NPG_BEYOND x 1.4826 x median deviation, median, NPG_CLEARLY x (quantile NPG_MOST - median))
 *
 * (twice the floor next to the keyframe, where no more than NPG_ALARM_FRAMES say what is usual)
 * and unexplained when by all of it.  NPG_ALARM_FRAMES unexplained frames in a row raise the alarm (twice as
 * many where each is merely stretched: an alignment that slips does that, too, until it is found again),
 * if no more than twice as many suspect ones lead up to them: a topology changes at once, a fit that creeps
 * away is another fault (the quality bar's).  It dates from the first of the suspect ones before them, by
 * as many frames at most.  A frame or two alone (an outlier, a fast motion that the next frame has
 * caught up with) raise none, and no level that is spread all over the surface or usual in the capture
 * (noise, holes, what cameras don't see) does.
 *
 * Nor does a surface that has lost the points: that is a failed fit, which the quality bar reports.  It is
 * known by two signs.  Points and surface miss each other: then there is much of both far and unsupported,
 * so far counts only when its excess is more than twice that of unsupported, unsupported only when its excess
 * is more than twice that of far, and stretched and vacated only where far is less than suspect.  What does not
 * count makes a frame suspect at most: over a new part a surface is stretched as a whole at first.  Or the
 * points are off everywhere: unsupported, stretched and vacated don't count when the points' median distance
 * is above 0.4 % of the diagonal and above 3 times the keyframe's.  (A new part pulls the surface off the
 * points, too, so far counts there.)
 *
 * Frames may come in any order: they are taken in order of their distance from the keyframe, so the result
 * does not depend on it.  Memory: the frames that came ahead of their turn. */

/* Set by trial; what each does stands above. */
#define NPG_ALARM_FRAMES 3

enum { NPG_FORWARD, NPG_BACKWARD, NPG_DIRECTIONS };

typedef struct npg_alarm npg_alarm;

/* key: index of the keyframe. */
npg_status npg_alarm_open(npg_alarm **alarm, int64_t key);
void npg_alarm_close(npg_alarm **alarm);

/* A frame with its figures; one that was not measured is passed over.  Each index once. */
npg_status npg_alarm_add(npg_alarm *alarm, const npg_frame *frame);

/* No more frames come: what still waits for its turn is taken. */
void npg_alarm_finish(npg_alarm *alarm);

/* What raised it. */
typedef struct npg_alarm_cause {
    int64_t index, number;           /* of the first unexplained frame                    */
    int64_t seen_index, seen_number; /* of the unexplained frame with the clearest misfit */
    int misfit;                      /* NPG_MISFIT_*                                      */
    double value, usual, bound;      /* shares, in the frame seen                         */
    double at[3];                    /* where, in world coordinates                       */
} npg_alarm_cause;

/* NULL while it is not raised; a loan. */
const npg_alarm_cause *npg_alarm_raised(const npg_alarm *alarm, int direction);

/* "12.5 % of the points are far from the surface in one place, around (0.1, 2, 3)
 * in frame 17; usual is 0 %". */
void npg_alarm_text(char *text, size_t size, const npg_alarm_cause *cause);

/* {from_frame, from_index, figure, value, usual, bound, frame, at, cause}; JSON null for NULL. */
json_t *npg_alarm_json(const npg_alarm_cause *cause);

/* A level: what is usual among values, and how far above it one must lie to be out of the ordinary: by 6
 * normal deviations, by as much again, and by a floor.  The values are left as their distances from the
 * usual. */
typedef struct npg_level {
    double usual, bound;
} npg_level;
npg_level npg_level_of(double *values, size_t count, double floor);

/* The floor of a misfit's bound (NPG_MISFIT_*). */
double npg_misfit_floor(int kind);

/* Verdict: faults that a frame has only beside the others of its capture.
 *
 *   uncovered  more of its surface in sight is without points than elsewhere in the capture: the points of a part
 *              are not there, or the part is not where they are.  Above npg_level where sensors are known, else above
 *              twice what a quarter of the frames keeps to, and of a few more
 *   distance   its surface lies farther from the points than elsewhere, on average
 *   torn       in one place its surface is stretched over where no points are, unlike elsewhere: a part was lost, or
 *              is drawn to another part's points
 *   jump       the body is not where it was in the frame before, by far more than it moves in the frames
 *              around: a cut, a mirrored frame, another body.  Up to three odd frames after which it is where
 *              it was before are the ones at fault; else the frame behind the jump, as seen from the keyframe.
 *
 * Four frames are the least that say what is usual.  Memory: 168 bytes a frame. */

typedef struct npg_verdict_bars {
    double uncovered;   /* share of the surface, the least that counts; 1: nothing does */
    double vertex_dist; /* the same in diagonals                                        */
    double jump;        /* the same                                                     */
    bool is_seen_from;  /* it is known where sensors stood                              */
} npg_verdict_bars;

typedef struct npg_verdict {
    npg_verdict_bars bars;
    int64_t key;
    struct npg_verdict_record *records; /* NULL at first; owned */
    size_t count, room;
    double fit; /* once finished: median over the frames of their points' median distance, in diagonals */
} npg_verdict;

/* A frame with its figures, in any order; one that was not measured, or is another segment's, is passed
 * over. */
npg_status npg_verdict_add(npg_verdict *verdict, const npg_frame *frame);

/* After the last one: the frames that were good so far and are not; an array for the caller to release. */
npg_status npg_verdict_finish(npg_verdict *verdict, npg_late_faults *late);

/* Topology: what a run does when its reference no longer explains the capture (npg_alarm): it says from which
 * frame, or ends there so that another reference can take over (option alarm = split;
 * tools/segments/segments.h). */

enum { NPG_ALARM_REPORT, NPG_ALARM_SPLIT }; /* the words of --alarm */

typedef struct npg_topology {
    /* options */
    int mode;                          /* NPG_ALARM_*                                                   */
    int64_t segment_min;               /* frames that a segment must have, for a run to end for another */
    int64_t shared_first, shared_last; /* frames at the ends that other segments explain                */
    /* of the run, zeros at first */
    npg_alarm *alarm; /* owned */
    bool is_reported[NPG_DIRECTIONS];
} npg_topology;

/* Whether a frame belongs to another segment. */
bool npg_topology_is_shared(const npg_topology *topology, const npg_facts *facts, int64_t index);

/* A frame with its figures; any order; facts->plan is known.  Warns when it makes the alarm go off.
 * With NPG_ALARM_SPLIT, where both segments get their least number of frames: the place is written to
 * OUT/topology.json and NPG_CHANGED returned. */
npg_status npg_topology_add(npg_topology *topology, npg_worker *worker, const npg_frame *frame);

/* After the last frame, if there was one: the report's "topology", and facts->changed_at. */
npg_status npg_topology_finish(npg_topology *topology, npg_worker *worker);

#endif
