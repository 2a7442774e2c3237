/* Verbs: what the command can do, one file per verb. */
#ifndef NPG_VERBS_H
#define NPG_VERBS_H

#include "pipeline/options.h"

typedef struct npg_verb {
    const char *name;
    const char *operands; /* as the usage line shows them; "" for none */
    int operands_min, operands_max;
    const char *help;                   /* one line                                              */
    const char *text;                   /* a few sentences for the manual                        */
    const npg_option *options;          /* the verb's own; ends with a name of NULL; may be NULL */
    bool with_run_options;              /* takes the options of all stages as well               */
    int (*main)(int argc, char **argv); /* argv[0] is the verb's name; returns the exit code     */
} npg_verb;

/* In the order of the help; ends with a name of NULL (neupig.c). */
extern const npg_verb npg_verbs[];

/* NULL when there is none of that name. */
const npg_verb *npg_verb_find(const char *name);

int npg_verb_run(int argc, char **argv);
int npg_verb_append(int argc, char **argv);
int npg_verb_batch(int argc, char **argv);
int npg_verb_apply(int argc, char **argv);
int npg_verb_probe(int argc, char **argv);
int npg_verb_eval(int argc, char **argv);
int npg_verb_verify(int argc, char **argv);
int npg_verb_synth(int argc, char **argv);
int npg_verb_render(int argc, char **argv);
int npg_verb_view(int argc, char **argv);
int npg_verb_bench(int argc, char **argv);
int npg_verb_doctor(int argc, char **argv);
int npg_verb_help(int argc, char **argv);
int npg_verb_man(int argc, char **argv);
int npg_verb_version(int argc, char **argv);

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
