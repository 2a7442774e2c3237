/* Command line: options from tables, operands, help, and how a verb ends. */
#ifndef NPG_CLI_H
#define NPG_CLI_H

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

/* Help of one verb, and the list of all verbs. */
void npg_cli_print_verb(FILE *out, const npg_verb *verb);
void npg_cli_print_verbs(FILE *out);

/* The methods, and the keys of their JSON. */
void npg_cli_print_method(FILE *out);

/* "--name VALUE" as the help shows it; size includes the closing zero. */
void npg_cli_spell(char *out, size_t size, const npg_option_info *option);

/* What an option takes: default, range and words, in one line; "" when there are none. */
void npg_cli_limits(char *out, size_t size, const npg_option_info *option);

/* The i-th option of a verb, its own first, then those of the run; NPG_END after the last. */
npg_status npg_cli_option(npg_option_info *info, const npg_verb *verb, size_t i);

#endif
