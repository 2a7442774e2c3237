/* Options: tables, one per stage; parser, help, methods and manual all come from them. */
#include "pipeline/options.h"

#include <jansson.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "pipeline/source.h"
#include "pipeline/stage.h"
#include "pipeline/struct_size.h"

struct npg_options {
    npg_arena arena;               /* of all that follows but what is said to be owned */
    const npg_stage *const *chain; /* whose tables count */
    size_t count;
    char **texts; /* count of them: what the user set, or NULL; each owned */
    npg_custom_stage custom[NPG_CUSTOM_STAGES_MAX]; /* custom_count of them */
    size_t custom_count;
};

/* ---- the tables as one list ---- */

/* The i-th option of a table, or NULL with i less by as many as the table has. */
static const npg_option *in_table(const npg_option *table, size_t *i)
{
    for (; table && table->name; table++)
        if ((*i)-- == 0) return table;
    return NULL;
}

/* The run's, then the stages'. */
static const npg_option *option_at(const npg_stage *const *chain, size_t i, const char **stage)
{
    const char *name = "run";
    const npg_option *option = in_table(npg_run_options, &i);
    for (; !option && *chain; chain++) {
        option = in_table((*chain)->options, &i);
        name = (*chain)->name;
    }
    if (option && stage) *stage = name;
    return option;
}

const npg_option *npg_option_at(size_t i, const char **stage)
{
    return option_at(npg_chain, i, stage);
}

static const npg_option *find_option(const npg_options *options, const char *name, size_t *at)
{
    const npg_option *option;
    for (*at = 0; (option = option_at(options->chain, *at, NULL)); ++*at)
        if (!strcmp(option->name, name)) return option;
    return NULL;
}

npg_option_info npg_option_info_of(const npg_option *o, const char *stage)
{
    return (npg_option_info){sizeof(npg_option_info), stage,   o->name, o->help, o->default_text, o->choices,
                             o->value_name,           o->type, o->min,  o->max,  o->use};
}

npg_status npg_options_describe(size_t i, npg_option_info *info)
{
    const char *stage;
    npg_option_info known = {.struct_size = sizeof known};
    const npg_option *option = npg_option_at(i, &stage);
    if (option) known = npg_option_info_of(option, stage);
    NPG_TRY(npg_struct_give(info, &known, sizeof known, NPG_SIZE_UP_TO(npg_option_info, max), "info"));
    return option ? NPG_OK : NPG_END;
}

/* ---- values ---- */

/* The place of a word among "a|b|c", -1 when it is none of them. */
static int which_choice(const char *choices, const char *text)
{
    size_t length = strlen(text);
    for (int i = 0; choices; i++) {
        const char *bar = strchr(choices, '|');
        size_t size = bar ? (size_t)(bar - choices) : strlen(choices);
        if (size == length && length && !strncmp(choices, text, size)) return i;
        choices = bar ? bar + 1 : NULL;
    }
    return -1;
}

/* 1 for yes, 0 for no, -1 for neither. */
static int which_flag(const char *text)
{
    return which_choice("no|false|off|0", text) >= 0 ? 0 : which_choice("yes|true|on|1", text) >= 0 ? 1 : -1;
}

static npg_status check_number(const npg_option *option, const char *text)
{
    double value = (double)NAN;
    const char *end = npg_number_parse(text, text + strlen(text), &value);
    bool whole = option->type != NPG_OPTION_INT || (value == floor(value) && !strpbrk(text, ".eE"));
    if (!end || *end || !isfinite(value) || !whole)
        return npg_error(NPG_USAGE, "option %s: \"%s\" is not %s", option->name, text,
                         option->type == NPG_OPTION_INT ? "a whole number" : "a number");
    if (value < option->min || value > option->max)
        return npg_error(NPG_USAGE, "option %s: %s is outside %g .. %g", option->name, text, option->min,
                         option->max);
    return NPG_OK;
}

npg_status npg_option_check(const npg_option *option, const char *text)
{
    switch (option->type) {
    case NPG_OPTION_INT:
    case NPG_OPTION_REAL: return check_number(option, text);
    case NPG_OPTION_FLAG:
        if (which_flag(text) >= 0) return NPG_OK;
        return npg_error(NPG_USAGE, "option %s: \"%s\" is neither yes nor no", option->name, text);
    case NPG_OPTION_CHOICE:
        if (which_choice(option->choices, text) >= 0) return NPG_OK;
        return npg_error(NPG_USAGE, "option %s: \"%s\" is not one of %s", option->name, text,
                         option->choices);
    case NPG_OPTION_TEXT: break;
    }
    return NPG_OK;
}

npg_status npg_options_open(npg_options **out)
{
    return npg_options_open_chain(out, npg_chain);
}

npg_status npg_options_open_chain(npg_options **out, const npg_stage *const *chain)
{
    NPG_REQUIRE(out);
    *out = NULL;
    NPG_TRY(npg_object_open(out, NPG_FOR_RUN, sizeof **out));
    npg_options *options = *out;
    options->chain = chain;
    while (option_at(chain, options->count, NULL)) options->count++;
    options->texts = npg_arena_take(&options->arena, options->count, sizeof *options->texts);
    npg_status status = npg_arena_status(&options->arena);
    if (status) npg_options_close(out);
    return status;
}

/* ---- custom stages ---- */

static npg_status copy_custom(npg_options *options, const npg_custom_stage *given)
{
    npg_custom_stage *custom = &options->custom[options->custom_count];
    *custom = *given;
    custom->name = npg_arena_text(&options->arena, given->name);
    custom->after = npg_arena_text(&options->arena, given->after);
    NPG_TRY(npg_arena_status(&options->arena));
    options->custom_count++;
    return NPG_OK;
}

npg_status npg_options_add_stage(npg_options *options, const npg_custom_stage *stage)
{
    npg_custom_stage given;
    NPG_REQUIRE(options);
    NPG_TRY(
        npg_struct_take(&given, sizeof given, stage, NPG_SIZE_UP_TO(npg_custom_stage, frame), "the stage"));
    NPG_TRY(npg_custom_check(&given, options->chain));
    for (size_t i = 0; i < options->custom_count; i++)
        if (!strcmp(options->custom[i].name, given.name))
            return npg_error(NPG_USAGE, "stage %s: the name is taken", given.name);
    if (options->custom_count == NPG_CUSTOM_STAGES_MAX)
        return npg_error(NPG_USAGE, "stage %s: no more than %d stages can be added", given.name,
                         NPG_CUSTOM_STAGES_MAX);
    return copy_custom(options, &given);
}

const npg_custom_stage *npg_options_custom_stage(const npg_options *options, size_t i)
{
    return options && i < options->custom_count ? &options->custom[i] : NULL;
}

void npg_options_close(npg_options **slot)
{
    if (!slot || !*slot) return;
    for (size_t i = 0; (*slot)->texts && i < (*slot)->count; i++) npg_release(&(*slot)->texts[i]);
    npg_object_close(slot);
}

npg_status npg_options_copy(npg_options **out, const npg_options *options)
{
    npg_options *copy;
    npg_status status = NPG_OK;
    NPG_TRY(npg_options_open_chain(&copy, options ? options->chain : npg_chain));
    for (size_t i = 0; i < copy->count && !status; i++)
        if (options && options->texts[i]) status = npg_copy_text(&copy->texts[i], options->texts[i]);
    for (size_t i = 0; options && i < options->custom_count && !status; i++)
        status = copy_custom(copy, &options->custom[i]);
    if (status) npg_options_close(&copy);
    *out = copy;
    return status;
}

/* A word that names a method's base set among others is the same as the method itself. */
static const char *plain_name(const char *name)
{
    return strcmp(name, "preset") != 0 ? name : "method";
}

static npg_status unknown(const npg_options *options, const char *name)
{
    const char *gone = npg_option_gone(name);
    const npg_option *option;
    npg_nearest nearest = npg_nearest_to(name);
    if (gone) return npg_error(NPG_USAGE, "option %s went: %s", name, gone);
    for (size_t i = 0; (option = option_at(options->chain, i, NULL)); i++)
        npg_nearest_offer(&nearest, option->name);
    return npg_error(NPG_USAGE, "there is no option %s%s%s", name, nearest.word ? "; did you mean " : "",
                     nearest.word ? nearest.word : "");
}

static npg_status set_text(npg_options *options, const char *name, const char *value)
{
    size_t at;
    char *text;
    const npg_option *option = find_option(options, plain_name(name), &at);
    if (!option) return unknown(options, name);
    NPG_TRY(npg_option_check(option, value));
    NPG_TRY(npg_copy_text(&text, value));
    npg_release(&options->texts[at]);
    options->texts[at] = text;
    return NPG_OK;
}

/* ---- lists ---- */

const npg_option_list npg_option_lists[] = {
    {"bars", "LIST", "What a good frame, and a good reference, keeps to, as in residual=1,coverage=20", ',',
     true},
    {"depth-range", "A:B", "Depths that are used, in the rig's unit", ':', false},
    {"follow-end", "NAME|SECONDS", "What ends a folder that is followed", ',', false},
    {0}};

const npg_option_list *npg_option_list_of(const char *name)
{
    size_t length = strcspn(name, ".");
    for (const npg_option_list *list = npg_option_lists; list->name; list++)
        if (!strncmp(list->name, name, length) && !list->name[length]) return list;
    return NULL;
}

/* The part that a piece sets, from the i-th option on: the named one, or the next that accepts it. */
static npg_status find_part(const npg_options *options, const npg_option_list *list, const char *piece,
                            size_t *i, const npg_option **part)
{
    const char *equals = strchr(piece, '=');
    size_t length = equals ? (size_t)(equals - piece) : 0;
    bool can_be = equals || !list->needs_names;
    for (size_t at = equals ? 0 : *i; can_be && (*part = option_at(options->chain, at, NULL)); at++) {
        if ((*part)->use != NPG_USE_PART || npg_option_list_of((*part)->name) != list) continue;
        const char *name = (*part)->name + strlen(list->name) + 1;
        *i = at + 1;
        if (equals ? strlen(name) == length && !strncmp(name, piece, length)
                   : !*piece || !npg_option_check(*part, piece))
            return NPG_OK;
    }
    return npg_error(NPG_USAGE, "option %s: \"%s\" is none of its parts (neupig help run --help-all)",
                     list->name, piece);
}

static npg_status set_list(npg_options *options, const npg_option_list *list, char *text)
{
    size_t i = 0;
    for (char *piece = text, *end = text; end; piece = end + 1) {
        const npg_option *part;
        end = strchr(piece, list->separator);
        if (end) *end = 0;
        NPG_TRY(find_part(options, list, piece, &i, &part));
        const char *equals = strchr(piece, '=');
        if (equals || *piece) NPG_TRY(set_text(options, part->name, equals ? equals + 1 : piece));
    }
    return NPG_OK;
}

static npg_status set_list_or_text(npg_options *options, const char *name, const char *value)
{
    char *text;
    const npg_option_list *list = strchr(name, '.') ? NULL : npg_option_list_of(name);
    if (!list) return set_text(options, name, value);
    NPG_TRY(npg_copy_text(&text, value));
    npg_status status = set_list(options, list, text);
    npg_release(&text);
    return status;
}

/* ---- methods: a JSON object whose keys are options ---- */

static npg_status set_key(npg_options *options, const char *name, const json_t *value);

/* Errors name the object as `place`. */
static npg_status apply_method(npg_options *options, const json_t *root, const char *place)
{
    const char *name;
    json_t *value;
    if (!json_is_object(root)) return npg_error(NPG_USAGE, "%s: not a JSON object", place);
    json_object_foreach((json_t *)root, name, value)
        NPG_TRY(npg_error_prefix(set_key(options, name, value), "%s", place));
    return NPG_OK;
}

npg_status npg_options_load(npg_options *options, const char *path)
{
    enum { LIMIT = 1 << 20 }; /* bytes; all options together take a few thousand */
    json_t *root;
    NPG_REQUIRE(options && path);
    NPG_TRY(npg_json_read(&root, path, LIMIT));
    npg_status status = apply_method(options, root, path);
    json_decref(root);
    return status;
}

static npg_status apply_text(npg_options *options, const char *given)
{
    char *text;
    json_t *root = NULL;
    NPG_TRY(npg_copy_text(&text, given));
    npg_status status = npg_json_parse(&root, text, "method");
    if (!status) status = apply_method(options, root, "method");
    npg_release(&text);
    json_decref(root);
    return status;
}

/* A path has a slash or a dot in it; anything else was meant as a name. */
static npg_status set_method(npg_options *options, const char *value)
{
    if (value[strspn(value, " \t\r\n")] == '{') return apply_text(options, value);
    if (strpbrk(value, "./")) return npg_options_load(options, value);
    if (!strcmp(value, "best")) return npg_error(NPG_USAGE, "method best went: --effort best");
    return npg_error(NPG_USAGE,
                     "option method: \"%s\" is no method (neupig help method lists them), no file.json and "
                     "no JSON object",
                     value);
}
/* Whether a method's value is none of the names. */
static bool is_method_text(const char *name, const char *value)
{
    if (strcmp(plain_name(name), "method") != 0) return false;
    for (const npg_preset *preset = npg_presets; preset->name; preset++)
        if (!strcmp(preset->option, "method") && !strcmp(preset->name, value)) return false;
    return true;
}

npg_status npg_options_set(npg_options *options, const char *name, const char *value)
{
    NPG_REQUIRE(options && name && value);
    return is_method_text(name, value) ? set_method(options, value) : set_list_or_text(options, name, value);
}

/* Inside a method, which can only be one of the names there. */
static npg_status set_key(npg_options *options, const char *name, const json_t *value)
{
    char number[64];
    if (json_is_string(value)) return set_list_or_text(options, name, json_string_value(value));
    if (json_is_boolean(value)) return set_list_or_text(options, name, json_is_true(value) ? "yes" : "no");
    if (json_is_integer(value))
        snprintf(number, sizeof number, "%" JSON_INTEGER_FORMAT, json_integer_value(value));
    else if (json_is_real(value))
        snprintf(number, sizeof number, "%.17g", json_real_value(value));
    else
        return npg_option_gone(name)
                   ? unknown(options, name)
                   : npg_error(NPG_USAGE, "option %s: neither text, number nor true/false", name);
    return set_list_or_text(options, name, number);
}

npg_status npg_options_set_json(npg_options *options, const char *name, const json_t *value)
{
    if (strcmp(plain_name(name), "method") != 0) return set_key(options, name, value);
    if (json_is_string(value)) return npg_options_set(options, name, json_string_value(value));
    return apply_method(options, value, name);
}

double npg_options_number(const npg_options *options, const char *name, double otherwise)
{
    const char *text = npg_options_get(options, name);
    char *end = NULL;
    double value = text ? strtod(text, &end) : 0;
    return text && end != text ? value : otherwise;
}

bool npg_options_is_set(const npg_options *options, const char *name)
{
    size_t at;
    return find_option(options, name, &at) && options->texts[at];
}

static bool is_chosen(const npg_options *options, const npg_preset *preset)
{
    size_t at;
    const npg_option *option = find_option(options, preset->option, &at);
    const char *text = !option ? NULL : options->texts[at] ? options->texts[at] : option->default_text;
    return text && !strcmp(text, preset->name);
}

static const char *text_of_preset(const npg_options *options, const char *name)
{
    for (const npg_preset *preset = npg_presets; preset->name; preset++)
        for (const npg_preset_value *value = preset->values; value->name && is_chosen(options, preset);
             value++)
            if (!strcmp(value->name, name)) return value->value;
    return NULL;
}

static const char *text_of(const npg_options *options, const npg_option *option, size_t at)
{
    const char *text = options->texts[at];
    if (!text) text = text_of_preset(options, option->name);
    return text ? text : option->default_text;
}

const char *npg_options_get(const npg_options *options, const char *name)
{
    size_t at;
    const npg_option *option = options && name ? find_option(options, plain_name(name), &at) : NULL;
    return option ? text_of(options, option, at) : NULL;
}

json_t *npg_options_json(const npg_options *options, const char *const *left_out)
{
    const npg_option *option;
    json_t *values = json_object();
    for (size_t i = 0; (option = npg_option_at(i, NULL)); i++) {
        const char *const *out = left_out;
        while (out && *out && strcmp(*out, option->name) != 0) out++;
        if (!out || !*out)
            json_object_set_new(values, option->name, npg_json_text(npg_options_get(options, option->name)));
    }
    return values;
}

void npg_option_store(const npg_option *option, const char *text, void *state)
{
    void *slot = (char *)state + option->offset;
    switch (option->type) {
    case NPG_OPTION_FLAG: *(bool *)slot = which_flag(text) == 1; break;
    case NPG_OPTION_INT: *(int64_t *)slot = strtoll(text, NULL, 10); break;
    case NPG_OPTION_REAL: npg_number_parse(text, text + strlen(text), slot); break;
    case NPG_OPTION_CHOICE: *(int *)slot = which_choice(option->choices, text); break;
    case NPG_OPTION_TEXT: *(const char **)slot = text; break;
    }
}

void npg_options_fill(const npg_options *options, const npg_option *table, void *state)
{
    for (const npg_option *option = table; option && option->name; option++) {
        size_t at;
        bool is_known = find_option(options, option->name, &at) == option;
        npg_option_store(option, is_known ? text_of(options, option, at) : option->default_text, state);
    }
}
