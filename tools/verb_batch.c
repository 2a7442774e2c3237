/* neupig batch: many captures, each in its own folder and process. */
#include <stddef.h>

#include "tools/batch/batch.h"
#include "tools/cli.h"

typedef struct settings {
    npg_reporter_settings shown;
    int segments;
    bool list, report;
    int64_t jobs, task_index, task_count;
    double max_time_s;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_batch_options[] = {
    /* type        name          place           default     least  most  shown as or words */
    NPG_ROW_INT   ("jobs",       AT(jobs),       "1",        1,     256,  "N",
        "Captures at work at the same time; each uses all cores"),
    NPG_ROW_REAL  ("max-time",   AT(max_time_s), "-1",       -1,    1e9,  "SECONDS",
        "Stop a capture after this many seconds, 0: no limit; started again it is resumed; "
        "-1: as the manifest says"),
    NPG_ROW_CHOICE("segments",   AT(segments),   "manifest", "manifest|one|auto", /* NPG_BATCH_SEGMENTS_.. */
        "Where the topology of a capture changes: one reference all the same, "
        "with an alarm (one), another from there on (auto), or as the manifest says"),
    NPG_ROW_FLAG  ("list",       AT(list),       "no",
        "Only print the names of the captures, one per line"),
    NPG_ROW_FLAG  ("report",     AT(report),     "no",
        "Only write batch.json and print the table of what is there; the exit code is that of all"),
    NPG_ROW_INT   ("task-index", AT(task_index), "0",        0,     1e6,  "I",
        "With several processes or machines: the number of this one, from 0"),
    NPG_ROW_INT   ("task-count", AT(task_count), "1",        1,     1e6,  "N",
        "... of so many; each capture is done by exactly one"),
    NPG_REPORTER_ROWS(AT(shown)),
    {0}};
/* clang-format on */

static npg_status run(npg_batch *batch, const settings *s)
{
    npg_reporter reporter;
    bool stopped;
    npg_reporter_init(&reporter, &s->shown);
    npg_status status = npg_batch_run(batch, &reporter, (size_t)s->jobs, &stopped);
    npg_reporter_pause(&reporter);
    if (!status) status = npg_batch_report(batch, reporter.show == NPG_SHOW_JSON ? NULL : stdout);
    if (!status) status = npg_batch_status(batch, false, stopped);
    npg_reporter_end(&reporter, status, batch->output);
    if (status == NPG_STOPPED) fputs("neupig batch: stopped on request; run again to resume\n", stderr);
    if (status == NPG_PARTIAL)
        fprintf(stderr,
                "neupig batch: finished, but with frames skipped, unexplained or below the quality bar; "
                "see %s/batch.json\n",
                batch->output);
    return status;
}

/* Whatever process has run the captures. */
static npg_status report(npg_batch *batch, const settings *s)
{
    for (size_t i = 0; i < batch->count; i++)
        npg_verdict_read(&batch->captures[i].verdict, &batch->captures[i]);
    NPG_TRY(npg_batch_report(batch, s->shown.quiet ? NULL : stdout));
    return npg_batch_status(batch, true, false);
}

npg_status npg_verb_batch(const npg_cli *cli)
{
    const settings *s = cli->values;
    const npg_batch_given given = {cli->options, s->max_time_s < 0 ? -1 : s->max_time_s, s->segments};
    npg_batch *batch = NULL;
    if (s->task_index >= s->task_count)
        return npg_error(NPG_USAGE,
                         "option task-index: %lld is not below the task-count of %lld; the first task is 0",
                         (long long)s->task_index, (long long)s->task_count);
    NPG_TRY(npg_batch_open(&batch, cli->operands[0], &given));
    batch->task_index = (size_t)s->task_index;
    batch->task_count = (size_t)s->task_count;
    npg_status status = s->list ? NPG_OK : s->report ? report(batch, s) : run(batch, s);
    for (size_t i = 0; s->list && i < batch->count; i++)
        if (npg_batch_is_mine(batch, i)) puts(batch->captures[i].name);
    npg_batch_close(&batch);
    return status;
}
