/* Page: one HTML file that needs no other, of one result or of two side by side. */
#ifndef NPG_VIEW_H
#define NPG_VIEW_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/status.h"

typedef struct npg_view_order {
    const char *const *paths; /* of results */
    size_t path_count;        /* 1 or 2 */
    const char *output;       /* the page   */
    size_t point_limit;       /* points shown per frame at most */
    int64_t every;            /* frames by index, 1: all */
    bool is_live;             /* the run is at work: the page says how far it is, and loads itself again */
} npg_view_order;

typedef struct npg_view_facts {
    size_t frames, vertices; /* of all results; vertices: the most */
    uint64_t bytes;
    size_t without_points; /* frames */
    char why[512];
} npg_view_facts;

/* The file appears when it is whole.  Failures as npg_view_result_open(), npg_view_group_block(), NPG_DISK.
 * */
npg_status npg_view_page_write(npg_view_facts *facts, const npg_view_order *order);

/* Write the page of a run that is at work, and again where frames have come, until no run holds the folder's
 * lock; then as npg_view_page_write() does. */
npg_status npg_view_follow(npg_view_facts *facts, const npg_view_order *order);

#endif
