/* neupig view: a result, or two, as one page to look at; or a run at work, served on this machine. */
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/file.h"
#include "tools/cli.h"
#include "tools/view/view_live.h"
#include "tools/view/view_page.h"

typedef struct settings {
    const char *output;
    int64_t points, every, port;
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
        "Serve a page that follows the run which is at work in OUT, on 127.0.0.1 alone, until the run ends"),
    NPG_ROW_INT   ("port",   AT(port),   "0",     0,     65535, "PORT",
        "With --live: the port; 0: one that is free"),
    {0}};
/* clang-format on */

static npg_status choose_output(char **output, const settings *s, const npg_cli *cli)
{
    if (s->output[0]) return npg_copy_text(output, s->output);
    if (cli->operand_count > 1) return npg_copy_text(output, "compare.html");
    return npg_join_path(output, cli->operands[0], "view.html");
}

static npg_status write_page(const settings *s, const npg_cli *cli)
{
    npg_view_facts facts;
    char *output;
    NPG_TRY(choose_output(&output, s, cli));
    const npg_view_order order = {.paths = (const char *const *)cli->operands,
                                  .path_count = (size_t)cli->operand_count,
                                  .output = output,
                                  .point_limit = (size_t)s->points,
                                  .every = s->every};
    npg_status status = npg_view_page_write(&facts, &order);
    if (!status && facts.without_points)
        fprintf(stderr, "neupig view: warning: %zu of %zu frames without points (%s)\n", facts.without_points,
                facts.frames, facts.why);
    if (!status)
        printf("%s: %zu frames, up to %zu vertices, %.1f MB\n", output, facts.frames, facts.vertices,
               (double)facts.bytes / 1e6);
    npg_release(&output);
    return status;
}

static npg_status serve(const settings *s, const npg_cli *cli)
{
    if (cli->operand_count != 1)
        return npg_error(NPG_USAGE, "--live follows one run; %d folders were given", cli->operand_count);
    if (s->output[0])
        return npg_error(NPG_USAGE, "--live writes no page; give -o without it when the run is done");
    return npg_view_live(cli->operands[0], (size_t)s->points, (int)s->port);
}

int npg_verb_view(int argc, char **argv)
{
    settings s;
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &s, NULL, argc, argv);
    if (!status) status = s.live ? serve(&s, &cli) : write_page(&s, &cli);
    return npg_cli_end(argv[0], status);
}
