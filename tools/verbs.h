/* Verbs: what the command can do, one file per verb. */
#ifndef NPG_VERBS_H
#define NPG_VERBS_H

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

/* In the order of the help; ends with a name of NULL (neupig.c). */
extern const npg_verb npg_verbs[];

/* NULL when there is none of that name. */
const npg_verb *npg_verb_find(const char *name);

npg_status npg_verb_run(const struct npg_cli *cli);
npg_status npg_verb_append(const struct npg_cli *cli);
npg_status npg_verb_batch(const struct npg_cli *cli);
npg_status npg_verb_apply(const struct npg_cli *cli);
npg_status npg_verb_probe(const struct npg_cli *cli);
npg_status npg_verb_eval(const struct npg_cli *cli);
npg_status npg_verb_verify(const struct npg_cli *cli);
npg_status npg_verb_synth(const struct npg_cli *cli);
npg_status npg_verb_render(const struct npg_cli *cli);
npg_status npg_verb_view(const struct npg_cli *cli);
npg_status npg_verb_bench(const struct npg_cli *cli);
npg_status npg_verb_doctor(const struct npg_cli *cli);
npg_status npg_verb_help(const struct npg_cli *cli);
npg_status npg_verb_man(const struct npg_cli *cli);
npg_status npg_verb_version(const struct npg_cli *cli);

extern const npg_option npg_run_verb_options[];
extern const npg_option npg_append_options[];
extern const npg_option npg_batch_options[];
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
