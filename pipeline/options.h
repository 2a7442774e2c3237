/* Options: tables, one per stage; parser, help, configuration file and manual all come from them. */
#ifndef NPG_OPTIONS_H
#define NPG_OPTIONS_H

#include <stdbool.h>

#include "pipeline/status.h"

/* One option.  A table ends with a name of NULL.  offset is where the value goes in the stage's state:
 * FLAG bool, INT int64_t, REAL double, CHOICE int (which word), TEXT const char * (a loan, lives
 * as long as the run). */
typedef struct npg_option {
    const char *name, *help;
    npg_option_type type;
    size_t offset;
    const char *default_text;
    double min, max;        /* INT and REAL, both inclusive                  */
    const char *choices;    /* CHOICE: "a|b|c"                               */
    const char *value_name; /* for the help: N, DIR, FILE; NULL: by the type */
    npg_option_use use;
} npg_option;

/* The rows of a table, a macro for each type: name, place of the value, default, what the value may be, and
 * on lines of its own the help.  "shown" stands for the value in the help (value_name above).  Tables are
 * aligned by hand, between "clang-format off" and "on":
 *
 *     type         name      place        default  least  most  shown as or words
 *     NPG_ROW_INT ("epochs", AT(epochs),  "10",    0,     1e6,  "N",
 *         "help"),
 */
#define NPG_ROW(...)        NPG_ROW_FOR(NPG_USE_COMMON, __VA_ARGS__)
#define NPG_ROW_FLAG(...)   NPG_ROW(FLAG, __VA_ARGS__)
#define NPG_ROW_INT(...)    NPG_ROW(INT, __VA_ARGS__)
#define NPG_ROW_REAL(...)   NPG_ROW(REAL, __VA_ARGS__)
#define NPG_ROW_CHOICE(...) NPG_ROW(CHOICE, __VA_ARGS__)
#define NPG_ROW_TEXT(...)   NPG_ROW(TEXT, __VA_ARGS__)

/* The same for keys of the method, for parts of a list, and for what programs alone set:
 * NPG_KEY(INT, "epochs", ...), NPG_PART(REAL, "bars.residual", ...). */
#define NPG_ROW_FOR(purpose, type, ...)                                                                      \
    {                                                                                                        \
        NPG_##type##_FIELDS(__VA_ARGS__), .use = (purpose)                                                   \
    }
#define NPG_KEY(...)         NPG_ROW_FOR(NPG_USE_METHOD, __VA_ARGS__)
#define NPG_PART(...)        NPG_ROW_FOR(NPG_USE_PART, __VA_ARGS__)
#define NPG_PROGRAM_ROW(...) NPG_ROW_FOR(NPG_USE_PROGRAM, __VA_ARGS__)

#define NPG_FLAG_FIELDS(word, place, initial, text)                                                          \
    .name = (word), .help = (text), .type = NPG_OPTION_FLAG, .offset = (place), .default_text = (initial)
#define NPG_INT_FIELDS(...)  NPG_NUMBER_FIELDS(NPG_OPTION_INT, __VA_ARGS__)
#define NPG_REAL_FIELDS(...) NPG_NUMBER_FIELDS(NPG_OPTION_REAL, __VA_ARGS__)
#define NPG_NUMBER_FIELDS(kind, word, place, initial, least, most, shown, text)                              \
    .name = (word), .help = (text), .type = (kind), .offset = (place), .default_text = (initial),            \
    .min = (least), .max = (most), .value_name = (shown)
#define NPG_CHOICE_FIELDS(word, place, initial, words, text)                                                 \
    .name = (word), .help = (text), .type = NPG_OPTION_CHOICE, .offset = (place), .default_text = (initial), \
    .choices = (words)
#define NPG_TEXT_FIELDS(word, place, initial, shown, text)                                                   \
    .name = (word), .help = (text), .type = NPG_OPTION_TEXT, .offset = (place), .default_text = (initial),   \
    .value_name = (shown)

/* Several options, "NAME.part" each, as one of the command: pieces "part=value" or "value", parted by a
 * character.  Unless all need their names, a piece without one is the next part that accepts it; an empty one
 * leaves that as it is. */
typedef struct npg_option_list {
    const char *name, *value_name, *help;
    char separator;
    bool needs_names;
} npg_option_list;

/* Ends with a name of NULL. */
extern const npg_option_list npg_option_lists[];

/* The list of this name, or whose part this is; NULL: none. */
const npg_option_list *npg_option_list_of(const char *name);

/* A word of the options method or effort that stands for values of others; what the user sets himself wins, and a
 * method over an effort.  The list ends with a name of NULL, as does each set. */
typedef struct npg_preset_value {
    const char *name, *value;
} npg_preset_value;

typedef struct npg_preset {
    const char *option, *name, *help; /* option: whose word the name is */
    const npg_preset_value *values;
} npg_preset;

struct npg_stage;

/* Options of the tables of a chain (NULL-terminated) instead of npg_chain;
 * npg_options_open() is this with npg_chain. */
npg_status npg_options_open_chain(npg_options **options, const struct npg_stage *const *chain);

/* The i-th option of all tables of npg_chain, the run's own first; NULL after the last.  *stage gets the
 * table's name. */
const npg_option *npg_option_at(size_t i, const char **stage);

/* Write the values of one table into state at their offsets; an option that is in no table of the options'
 * chain gets its default. */
void npg_options_fill(const npg_options *options, const npg_option *table, void *state);

/* Write one value, which npg_option_check() has accepted, into state at the option's offset.
 * A TEXT is a loan. */
void npg_option_store(const npg_option *option, const char *text, void *state);

/* A copy that owns its texts. */
npg_status npg_options_copy(npg_options **out, const npg_options *options);

/* The i-th stage that a program added, a loan; NULL after the last. */
const npg_custom_stage *npg_options_custom_stage(const npg_options *options, size_t i);

/* Beside the chain's; what a program gives is checked: name, place in the chain, callback.  NPG_USAGE. */
#define NPG_CUSTOM_STAGES_MAX 6
npg_status npg_custom_check(const npg_custom_stage *given, const struct npg_stage *const *chain);

/* A row of a table as its description. */
npg_option_info npg_option_info_of(const npg_option *option, const char *stage);

/* {name: value} of all of npg_chain's but those named (NULL at the end; NULL: all).  A new object. */
struct json_t;
struct json_t *npg_options_json(const npg_options *options, const char *const *left_out);

/* The value of an option as a number; `otherwise` where the chain has none of this name, or it is no number. */
double npg_options_number(const npg_options *options, const char *name, double otherwise);

/* Whether the user (not a preset, not the default) set it. */
bool npg_options_is_set(const npg_options *options, const char *name);

/* npg_options_set() from a JSON text, number or true/false; of "method" also an object of keys. */
npg_status npg_options_set_json(npg_options *options, const char *name, const struct json_t *value);

/* Why there is no option of this name, and what to do instead; NULL when there never was one. */
const char *npg_option_gone(const char *name);

/* Check `text` against an option; NPG_USAGE says what it takes. */
npg_status npg_option_check(const npg_option *option, const char *text);

/* The run's own options (npg_settings), and the named sets of values (stages/chain.c). */
extern const npg_option npg_run_options[];
extern const npg_preset npg_presets[];

/* ---- the word that a mistyped one was meant to be (nearest.c) ---- */

typedef struct npg_nearest {
    const char *wanted, *word; /* word: the nearest so far, NULL: none is near; loans */
    size_t edits;              /* that are too many                                  */
} npg_nearest;

npg_nearest npg_nearest_to(const char *wanted);

/* One more word that could have been meant. */
void npg_nearest_offer(npg_nearest *nearest, const char *word);

#endif
