/* Progress: how far a run is, as a bar on a terminal or as JSON lines, and the log on standard error. */
#ifndef NPG_PROGRESS_H
#define NPG_PROGRESS_H

#include "status.h"

#include <stdbool.h>

enum { NPG_SHOW_AUTO, NPG_SHOW_BAR, NPG_SHOW_JSON, NPG_SHOW_NONE }; /* the words of --progress */

typedef struct npg_reporter {
    int show;            /* NPG_SHOW_*, never AUTO once set up         */
    npg_log_level level; /* records above it are not shown             */
    bool colour, bar_drawn;
    double drawn_s; /* when the bar was last drawn, in run seconds */
} npg_reporter;

/* AUTO is a bar when standard error is a terminal, else nothing. */
void npg_reporter_init(npg_reporter *reporter, int show, bool quiet, bool verbose);

/* Hooks for a run; the reporter is a loan until the run is closed. */
npg_hooks npg_reporter_hooks(npg_reporter *reporter);

/* Remove the bar, and in JSON mode write the closing record. */
void npg_reporter_end(npg_reporter *reporter, npg_status status, const char *output);

#endif
