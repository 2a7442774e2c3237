/* Shortlist: which frames the choosing pass reads, and which of them may become the keyframe. */
#ifndef NPG_SHORTLIST_H
#define NPG_SHORTLIST_H

#include "pipeline/stage.h"

#define NPG_SHORTLIST_REACH 24 /* frames on either side of the middle that are remembered */

typedef struct npg_nearby {
    int64_t index;
    size_t cell_count; /* as the score counts them                          */
    double contact;    /* npg_cloud_contact(), 0 where there are no normals */
} npg_nearby;

typedef struct npg_shortlist {
    size_t count;
    npg_nearby list[2 * NPG_SHORTLIST_REACH + 1]; /* in time order */
} npg_shortlist;

/* Whether a frame of so many lies near enough to the middle to be remembered. */
bool npg_shortlist_wants(int64_t index, int64_t frame_count);

/* Measure and remember a usable frame that is wanted, in time order.  NPG_MEMORY. */
npg_status npg_shortlist_add(npg_shortlist *shortlist, const npg_frame *frame, size_t cell_count);

/* Fill choice with the frames around the key: all of a short capture, every second one of a long one.
 * Candidates are the key alone, or up to NPG_CHOICE_MAX frames that show nearly as much surface as the best:
 * those with least contact, apart in time. */
void npg_shortlist_choose(npg_choice *choice, const npg_shortlist *shortlist, int64_t key,
                          int64_t frame_count, bool key_alone);

#endif
