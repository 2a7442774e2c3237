/* Verdicts: how a capture's run ended, in a word, and OUT/<name>/verdict.json. */
#ifndef NPG_BATCH_VERDICT_H
#define NPG_BATCH_VERDICT_H

#include <jansson.h>

#include "tools/batch/batch.h"

/* Why a run was asked to end. */
typedef enum npg_stop_cause {
    NPG_STOP_NONE,
    NPG_STOP_TIME,
    NPG_STOP_MEMORY,
    NPG_STOP_REQUEST
} npg_stop_cause;

/* From what waitpid() gave, with the cause; words: the run's own last ones. */
void npg_verdict_judge(npg_verdict *verdict, const npg_capture *capture, int how, npg_stop_cause cause,
                       const char *words);

/* Of a capture that is not started because of its refusal: bad input.  In its folder, as any other. */
npg_status npg_verdict_refuse(npg_capture *capture);

/* Whether nothing is left to do, whatever the quality. */
bool npg_verdict_is_done(const npg_verdict *verdict);

/* What verdict.json says; is_known is false when there is none. */
void npg_verdict_read(npg_verdict *verdict, const npg_capture *capture);
npg_status npg_verdict_write(const npg_capture *capture);
npg_status npg_verdict_remove(const npg_capture *capture);

/* Exit code of a batch: 75 when it was stopped before its end, 1 when a capture has failed
 * or is not done, 7 when one is done with frames skipped or below the quality bar, else 0.
 * Captures of this process, or of all. */
int npg_batch_exit_code(const npg_batch *batch, bool of_all, bool stopped);

/* An object of name, input, output and what verdict.json says. */
json_t *npg_verdict_json(const npg_capture *capture);

#endif
