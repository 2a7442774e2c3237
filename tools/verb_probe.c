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

npg_status npg_verb_probe(const npg_cli *cli)
{
    const settings *s = cli->values;
    npg_capture_facts *facts = NULL;
    NPG_TRY(npg_options_set(cli->options, "input", cli->operands[0]));
    npg_status status = npg_capture_probe(&facts, cli->options);
    if (facts) fputs(s->json ? facts->json : facts->text, stdout);
    npg_capture_facts_close(&facts);
    return status;
}
