/* Command line: options from tables, operands, and how a verb ends. */
#ifndef NPG_CLI_H
#define NPG_CLI_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

#include "tools/verbs.h"

typedef struct npg_cli {
    const npg_verb *verb;
    void *values;         /* state of the verb's own table                       */
    npg_options *options; /* of a run; set for verbs with run options            */
    char **operands;      /* loans from argv, moved to its front                 */
    int operand_count;
} npg_cli;

/* Read argv: --name VALUE, --name=VALUE, --flag, --no-flag, -o DIR; "--" ends the options
 * and a lone "-" is an operand.  What stands on the command line wins over what --method says.  A wrong name is
 * answered with the nearest option.  Then the verb, unless help was asked for.  Prints to stderr how it failed, and
 * returns its exit code. */
int npg_cli_run(const npg_verb *verb, int argc, char **argv);

/* A value (consumed) as text on standard output. */
void npg_cli_print(json_t *value);

/* A warning on stderr where a folder has a done.json and a file that it lists is not as it was written (npg_verify). */
void npg_cli_warn_of_damage(const char *verb, const char *folder);

/* The i-th option of a verb, as its help lists them: of run in groups (the group is info->stage), of others their
 * own.  is_short (may be NULL): whether the short help shows it.  NPG_END after the last. */
npg_status npg_cli_option(npg_option_info *info, bool *is_short, const npg_verb *verb, size_t i);

#endif
