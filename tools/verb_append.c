/* neupig append: continues a finished job with frames that came after it. */
#include <stddef.h>

#include "pipeline/file.h"
#include "tools/cli.h"
#include "tools/progress.h"
#include "tools/segments/segments.h"

typedef struct settings {
    const char *input;
    npg_reporter_settings shown;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_append_options[] = {
    /* type        name        place         default  words or shown as */
    NPG_ROW_TEXT  ("input",    AT(input),    "",      "PATH",
        "Where the frames are now, if they were moved; all of them, the old ones too"),
    NPG_REPORTER_ROWS(AT(shown)),
    {0}};
/* clang-format on */

/* A job that is not done yet is first brought to its end as it was begun. */
npg_status npg_verb_append(const npg_cli *cli)
{
    const settings *s = cli->values;
    npg_options *options = cli->options;
    npg_reporter reporter;
    NPG_TRY(npg_segments_refuse(cli->operands[0], cli->verb->name, true));
    NPG_TRY(npg_options_load_job(options, cli->operands[0]));
    if (s->input[0]) NPG_TRY(npg_options_set(options, "input", s->input));
    npg_reporter_init(&reporter, &s->shown);
    npg_status status =
        npg_is_in_folder(cli->operands[0], "done.json") ? NPG_OK : npg_run_job(options, &reporter);
    if (status != NPG_OK && status != NPG_PARTIAL) return status;
    NPG_TRY(npg_options_set(options, "append", "yes"));
    status = npg_run_job(options, &reporter);
    if (status == NPG_OK || status == NPG_PARTIAL) NPG_TRY(npg_segments_drop_outdated(cli->operands[0]));
    if (reporter.show != NPG_SHOW_JSON) npg_run_job_results(cli->verb->name, cli->operands[0], status);
    return status;
}
