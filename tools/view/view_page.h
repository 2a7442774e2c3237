/* Page: one HTML file that needs no other, of one result or of two side by side. */
#ifndef NPG_VIEW_PAGE_H
#define NPG_VIEW_PAGE_H

#include "tools/view/view_frame.h"

/* The page without data, as the build has bundled it: build/view/page.html, or share/neupig/view/page.html of
 * what is installed. */
typedef struct npg_view_template {
    char *text;  /* owned */
    size_t size; /* in bytes */
    size_t data; /* where data go in */
} npg_view_template;

/* NPG_FAILED where it was not built, with what to install. */
npg_status npg_view_template_open(npg_view_template *page);
void npg_view_template_close(npg_view_template *page);
bool npg_view_template_is_there(void);

typedef struct npg_view_order {
    const char *const *paths; /* of results */
    size_t path_count;        /* 1 or 2 */
    const char *output;       /* the page   */
    size_t point_limit;       /* points shown per frame at most */
    int64_t every;            /* frames by index, 1: all */
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

/* JSON text for inside of a script element: ASCII, without "<", "&" and ">"; to be given to free(), NULL: no
 * memory. */
char *npg_view_json_text(const json_t *value);

/* {"format", "neupig", "live", "results"}; steals results.  NULL: no memory. */
json_t *npg_view_page_json(bool is_live, json_t *results);

#endif
