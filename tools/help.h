/* Help: the options of a verb, the keys of the method, and both as JSON, from the tables. */
#ifndef NPG_HELP_H
#define NPG_HELP_H

#include <stdio.h>

#include "tools/cli.h"

/* Help of one verb; of run all options, or those that most need. */
void npg_help_verb(const npg_verb *verb, bool all);
void npg_help_verb_json(const npg_verb *verb);

/* The list of all verbs. */
void npg_help_verbs(FILE *out);

/* The methods, and the keys of their JSON; as JSON a schema (draft 2020-12) of what --method takes. */
void npg_help_method(void);
void npg_help_method_json(void);

/* "--name VALUE" as the help shows it; size includes the closing zero. */
void npg_help_spell(char *out, size_t size, const npg_option_info *option);

/* What an option takes: default, range and words, in one line; "" when there are none. */
void npg_help_limits(char *out, size_t size, const npg_option_info *option);

/* What report.json ("report") or done.json ("done") of a run has in it, or its JSON schema (tools/schemas/); false for
 * another name. */
bool npg_help_file(const char *name, bool as_json);
extern const char npg_schema_of_report[], npg_schema_of_done[];

#endif
