/* neupig probe: what a capture holds, what a run would trip over, what it would cost. */
#include <stddef.h>
#include <stdio.h>

#include "neupig.h"
#include "tools/cli.h"

typedef struct settings {
    bool json;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_probe_options[] = {
    /* type      name    place     default  shown as */
    NPG_ROW_FLAG("json", AT(json), "no",
        "Print one JSON object instead of text"),
    {0}};
/* clang-format on */

int npg_verb_probe(int argc, char **argv)
{
    settings s;
    npg_cli cli;
    npg_options *options = NULL;
    npg_capture_facts *facts = NULL;
    npg_status status = npg_options_open(&options);
    if (!status) status = npg_cli_parse(&cli, argv[0], &s, options, argc, argv);
    if (!status) status = npg_options_set(options, "input", cli.operands[0]);
    if (!status) status = npg_capture_probe(&facts, options);
    if (facts) fputs(s.json ? facts->json : facts->text, stdout);
    npg_capture_facts_close(&facts);
    npg_options_close(&options);
    return npg_cli_end(argv[0], status);
}
