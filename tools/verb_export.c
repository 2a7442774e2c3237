/* neupig export: other formats of a run that is done. */
#include <stddef.h>

#include "export/export.h"
#include "tools/cli.h"
#include "tools/segments/segments.h"

typedef struct settings {
    const char *list;
} settings;

/* clang-format off */
const npg_option npg_export_options[] = {
    /* type        name      place                    default  shown as */
    NPG_ROW_TEXT  ("export", offsetof(settings, list), "",     "LIST",
        NPG_EXPORT_FORMS ": what to write, as of neupig run"),
    {0}};
/* clang-format on */

npg_status npg_verb_export(const npg_cli *cli)
{
    const settings *s = cli->values;
    const char *output = cli->operands[0];
    npg_exported made = {.struct_size = sizeof made};
    if (!s->list[0]) return npg_error(NPG_USAGE, "what is to be written? say it with --export LIST");
    NPG_TRY(npg_segments_refuse(output, "export", false));
    NPG_TRY(npg_export(&made, output, s->list));
    if (made.repeated)
        fprintf(
            stderr,
            "neupig export: %zu frames without a mesh repeat the one before them in formats of a fixed rate\n",
            made.repeated);
    if (made.files)
        printf("%zu files more in %s\n", made.files, output);
    else
        printf("%s: all of it lies there already\n", output);
    return NPG_OK;
}
