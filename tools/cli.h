/* Command line: options from tables, operands, and how a verb ends. */
#ifndef NPG_CLI_H
#define NPG_CLI_H

#include <stdbool.h>
#include <stdio.h>

#include "tools/verbs.h"

typedef struct npg_cli {
    const npg_verb *verb;
    void *values;         /* state of the verb's own table, a loan              */
    npg_options *options; /* for verbs with run options, a loan; NULL otherwise */
    char **operands;      /* loans from argv, moved to its front                */
    int operand_count;
} npg_cli;

/* Read argv: --name VALUE, --name=VALUE, --flag, --no-flag, -o DIR; "--" ends the options
 * and a lone "-" is an operand.  What stands on the command line wins over what --method says.
 * Fills cli, values and options.  NPG_END when help was asked for and has been printed; NPG_USAGE
 * names the nearest option. */
npg_status npg_cli_parse(npg_cli *cli, const char *verb, void *values, npg_options *options, int argc,
                         char **argv);

/* Print to stderr how it failed, and return the exit code of the status.  NPG_END counts as success. */
int npg_cli_end(const char *verb, npg_status status);

/* A warning on stderr where a folder has a done.json and a file that it lists is not as it was written (npg_verify). */
void npg_cli_warn_of_damage(const char *verb, const char *folder);

/* The i-th option of a verb, as its help lists them: of run in groups (the group is info->stage), of others their
 * own.  is_short (may be NULL): whether the short help shows it.  NPG_END after the last. */
npg_status npg_cli_option(npg_option_info *info, bool *is_short, const npg_verb *verb, size_t i);

#endif
