/* Watch: how far a run is, from the outside: what it has in its folder, and whether it holds its lock. */
#ifndef NPG_RUN_WATCH_H
#define NPG_RUN_WATCH_H

#include "tools/view/view_result.h"

typedef enum npg_run_phase {
    NPG_RUN_PREPARING, /* no frame is solved yet                    */
    NPG_RUN_SOLVING,
    NPG_RUN_WRITING, /* all are solved, the last files are written */
    NPG_RUN_DONE,
    NPG_RUN_STOPPED /* not done, and no run holds the lock        */
} npg_run_phase;

typedef struct npg_run_watch {
    npg_run_phase phase;
    uint64_t traces;   /* of what there was at the last look */
    double unlocked_s; /* since when nobody holds the lock, 0: somebody does */
} npg_run_watch;

/* Whether something has changed since the last look. */
bool npg_run_watch_look(npg_run_watch *watch, const char *path);

/* Have the next look find a change. */
void npg_run_watch_again(npg_run_watch *watch);

/* Another number for another reference of a part; 0: none. */
uint64_t npg_run_watch_reference(const npg_view_part *part);

const char *npg_run_phase_word(npg_run_phase phase);
bool npg_run_phase_is_end(npg_run_phase phase);

#endif
