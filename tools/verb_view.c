/* neupig view: a result, or two, as one page to look at, also of a run that is at work. */
#include <stddef.h>
#include <stdio.h>

#include "pipeline/file.h"
#include "tools/cli.h"
#include "tools/view/view.h"

typedef struct settings {
    const char *output;
    int64_t points, every;
    bool live;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_view_options[] = {
    /* type        name      place       default  least  most   shown as */
    NPG_ROW_TEXT  ("output", AT(output), "",      "PAGE.html",
        "The page (also -o); without it OUT/view.html, of two results compare.html in the current folder"),
    NPG_ROW_INT   ("points", AT(points), "4000",  0,     1e6,   "N",
        "Points of a frame that the page holds at most; all are measured from"),
    NPG_ROW_INT   ("every",  AT(every),  "1",     1,     1e6,   "K",
        "Only every K-th frame (and the keyframe): a smaller page of a long capture"),
    NPG_ROW_FLAG  ("live",   AT(live),   "no",
        "Follow the run which is at work in OUT: the page is written anew as frames come, until the run ends"),
    {0}};
/* clang-format on */

npg_status npg_verb_view(const npg_cli *cli)
{
    const settings *s = cli->values;
    npg_view_facts facts;
    char path[NPG_PATH_SIZE];
    const char *output = s->output[0] ? s->output : cli->operand_count > 1 ? "compare.html" : path;
    if (s->live && cli->operand_count != 1)
        return npg_error(NPG_USAGE, "--live follows one run; %d folders were given", cli->operand_count);
    NPG_TRY(npg_path_of(path, cli->operands[0], "view.html"));
    const npg_view_order order = {.paths = (const char *const *)cli->operands,
                                  .path_count = (size_t)cli->operand_count,
                                  .output = output,
                                  .point_limit = (size_t)s->points,
                                  .every = s->every};
    for (int i = 0; i < cli->operand_count; i++) npg_cli_warn_of_damage("view", cli->operands[i]);
    npg_status status = s->live ? npg_view_follow(&facts, &order) : npg_view_page_write(&facts, &order);
    if (!status && facts.without_points)
        fprintf(stderr, "neupig view: warning: %zu of %zu frames without points (%s)\n", facts.without_points,
                facts.frames, facts.why);
    if (!status)
        printf("%s: %zu frames, up to %zu vertices, %.1f MB\n", output, facts.frames, facts.vertices,
               (double)facts.bytes / 1e6);
    return status;
}
