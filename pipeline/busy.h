/* Busy: how much of the machine a run keeps at work. */
#ifndef NPG_BUSY_H
#define NPG_BUSY_H

#include <jansson.h>

typedef struct npg_busy {
    double wall_s, cpu_s, children_s; /* children: helper processes that have ended */
} npg_busy;

npg_busy npg_busy_now(void);

/* What went by since then: {wall_s, process_cpu_s, children_cpu_s, busy_share}.  busy_share is processor
 * time, children's included, over wall time times cores: 1 where no core ever waited. */
json_t *npg_busy_since(const npg_busy *then);

#endif
