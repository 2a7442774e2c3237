/* Frame selection: the text of --frames.
 *
 *   "a:b:step"  positions in time as Python slices them: from a up to but without b, negative ones from the
 *               end, every part may be left out; step >= 1
 *   "1-5,8"     the numbers in the files' names, both ends included
 *   ""          everything */
#ifndef NPG_FRAME_SELECT_H
#define NPG_FRAME_SELECT_H

#include <stdbool.h>

#include "pipeline/status.h"

typedef struct npg_selection {
    bool is_slice, has_first, has_end;
    int64_t first, end, step; /* slice                                          */
    size_t range_count;       /* numbers; 0 and no slice: everything            */
    int64_t (*ranges)[2];     /* both ends included, ascending and apart; owned */
} npg_selection;

/* NPG_USAGE says what is wrong with the text.  Clear it after success. */
npg_status npg_selection_parse(npg_selection *selection, const char *text);
void npg_selection_clear(npg_selection *selection);

/* Whether the frame at a position of `count` with a number is chosen; count < 0: not known, and then a slice
 * must not count from the end (npg_selection_needs_count). */
bool npg_selection_takes(const npg_selection *selection, int64_t position, int64_t number, int64_t count);
bool npg_selection_needs_count(const npg_selection *selection);

#endif
