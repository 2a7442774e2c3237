/* Alarm: notices from which frame on the reference no longer explains the capture, for each direction from
 * the keyframe: its topology changed there.
 *
 * Each direction has a usual level of every misfit (misfit.h): median and median deviation of the last
 * explained frames, outward from the keyframe.  A frame is suspect when a misfit exceeds its level by half of
 *
 *     bound = max(floor, 6 x 1.4826 x median deviation, median)
 *
 * and unexplained when by all of it.  NPG_ALARM_FRAMES unexplained frames in a row raise the alarm (twice as
 * many where each is merely torn: an alignment that slips tears the surface, too, until it is found again),
 * if no more than NPG_ALARM_RISE suspect ones lead up to them: a topology changes at once, a fit that creeps
 * away is another fault (the quality bar's).  It dates from the first of the suspect ones before them, by
 * NPG_ALARM_BACK frames at most.  A frame or two alone (an outlier, a fast motion that the next frame has
 * caught up with) raise none, and no level that is spread all over the surface or usual in the capture
 * (noise, holes, what cameras don't see) does.
 *
 * Nor does a surface that has lost the points: that is a failed fit, which the quality bar reports.  It is
 * known by two signs.  Points and surface miss each other: then there is much of both far and bare, so far
 * counts only when its excess is more than twice that of bare, bare only when its excess is more than twice
 * that of far, and torn and deserted only where far is less than suspect.  Or the points are off everywhere:
 * bare, torn and deserted don't count when the points' median distance is above 0.4 % of the diagonal and
 * above 3 times the keyframe's.  (A new part pulls the surface off the points, too, so far counts there.)
 *
 * Frames may come in any order: they are taken in order of their distance from the keyframe, so the result
 * does not depend on it.  Memory: the frames that came ahead of their turn. */
#ifndef NPG_ALARM_H
#define NPG_ALARM_H

#include <jansson.h>

#include "pipeline/chunk.h"

/* Set by trial; what each does stands above. */
#define NPG_ALARM_FRAMES 3
#define NPG_ALARM_BACK   3
#define NPG_ALARM_RISE   6

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

#endif
