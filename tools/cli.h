/* Command line: options from tables, operands, and how a verb ends. */
#ifndef NPG_CLI_H
#define NPG_CLI_H

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>

#include "pipeline/options.h"

struct npg_cli;

typedef struct npg_verb {
    const char *name;
    const char *operands; /* as the usage line shows them; "" for none */
    int operands_min, operands_max;
    const char *help;                              /* one line                                              */
    const char *text;                              /* a few sentences for the manual                        */
    const npg_option *options;                     /* the verb's own; ends with a name of NULL; may be NULL */
    bool with_run_options;                         /* takes the options of all stages as well               */
    npg_status (*main)(const struct npg_cli *cli); /* after its command line was read */
} npg_verb;

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

/* ---- help and manual (help.c), from the tables, on standard output ---- */

/* Help of one verb; of run all options, or those that most need. */
void npg_help_verb(const npg_verb *verb, bool all);
void npg_help_verb_json(const npg_verb *verb);

/* The list of all verbs. */
void npg_help_verbs(FILE *out);

/* The methods, and the keys of their JSON; as JSON a schema (draft 2020-12) of what --method takes. */
void npg_help_method(void);
void npg_help_method_json(void);

/* What report.json ("report") or done.json ("done") of a run has in it, or its JSON schema (tools/schemas/); false for
 * another name. */
bool npg_help_file(const char *name, bool as_json);
extern const char npg_schema_of_report[], npg_schema_of_done[];

/* ---- the verbs, one file each ---- */

/* In the order of the help; ends with a name of NULL (neupig.c). */
extern const npg_verb npg_verbs[];

npg_status npg_verb_run(const npg_cli *cli);
npg_status npg_verb_append(const npg_cli *cli);
npg_status npg_verb_batch(const npg_cli *cli);
npg_status npg_verb_export(const npg_cli *cli);
npg_status npg_verb_apply(const npg_cli *cli);
npg_status npg_verb_probe(const npg_cli *cli);
npg_status npg_verb_eval(const npg_cli *cli);
npg_status npg_verb_verify(const npg_cli *cli);
npg_status npg_verb_synth(const npg_cli *cli);
npg_status npg_verb_render(const npg_cli *cli);
npg_status npg_verb_view(const npg_cli *cli);
npg_status npg_verb_bench(const npg_cli *cli);
npg_status npg_verb_doctor(const npg_cli *cli);
npg_status npg_verb_help(const npg_cli *cli);
npg_status npg_verb_man(const npg_cli *cli);
npg_status npg_verb_version(const npg_cli *cli);

extern const npg_option npg_run_verb_options[];
extern const npg_option npg_append_options[];
extern const npg_option npg_batch_options[];
extern const npg_option npg_export_options[];
extern const npg_option npg_apply_options[];
extern const npg_option npg_probe_options[];
extern const npg_option npg_eval_options[];
extern const npg_option npg_synth_options[];
extern const npg_option npg_render_options[];
extern const npg_option npg_view_options[];
extern const npg_option npg_bench_options[];
extern const npg_option npg_doctor_options[];
extern const npg_option npg_help_options[];

#endif
