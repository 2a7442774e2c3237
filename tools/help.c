/* Help: the options of a verb, the keys of the method, both as JSON, and the manual page, from the tables. */
#include "tools/cli.h"

#include <jansson.h>
#include <string.h>

enum { SPELL_LIMIT = 96, LIMITS_LIMIT = 256, HELP_INDENT = 28, HELP_WIDTH = 100 };

/* ---- one option ---- */

/* A part of a list by its own name. */
static const char *short_name(const char *name)
{
    const char *dot = strchr(name, '.');
    return dot ? dot + 1 : name;
}

/* "--name VALUE". */
static void spell(char *out, size_t size, const npg_option_info *option)
{
    static const char *const by_type[] = {"", "N", "X", "WORD", "TEXT"};
    const char *value = option->value_name ? option->value_name : by_type[option->type];
    bool on = option->type == NPG_OPTION_FLAG && !strcmp(option->default_text, "yes");
    if (option->use != NPG_USE_COMMON)
        snprintf(out, size, "%s", short_name(option->name));
    else if (option->type == NPG_OPTION_FLAG)
        snprintf(out, size, "--%s%s", on ? "no-" : "", option->name);
    else
        snprintf(out, size, "--%s %s", option->name, value);
}

/* What an option takes: default, range and words, in one line; "" when there are none. */
static void limit_words(char *out, size_t size, const npg_option_info *option)
{
    const char *given = option->default_text;
    out[0] = 0;
    switch (option->type) {
    case NPG_OPTION_FLAG:
        if (option->use != NPG_USE_COMMON) snprintf(out, size, "default: %s", given);
        break;
    case NPG_OPTION_CHOICE: snprintf(out, size, "%s; default: %s", option->choices, given); break;
    case NPG_OPTION_INT:
    case NPG_OPTION_REAL:
        snprintf(out, size, "%.10g .. %.10g; default: %s", option->min, option->max, given);
        break;
    case NPG_OPTION_TEXT:
        if (given && given[0]) snprintf(out, size, "default: %s", given);
        break;
    }
}

/* Print `size` bytes of text in words, wrapped; the cursor stands at *column. */
static void print_wrapped(const char *text, size_t size, int *column, int indent)
{
    for (const char *end = text + size; text < end; text += strspn(text, " ")) {
        int length = (int)strcspn(text, " ");
        if (length > end - text) length = (int)(end - text);
        if (*column + 1 + length > HELP_WIDTH) {
            printf("\n%*s", indent, "");
            *column = indent;
        } else if (*column > indent) {
            putchar(' ');
            ++*column;
        }
        printf("%.*s", length, text);
        *column += length;
        text += length;
    }
}

static void print_option(const npg_option_info *option, bool is_short)
{
    char spelled[SPELL_LIMIT], limits[LIMITS_LIMIT], bracketed[LIMITS_LIMIT + 4];
    const char *end = is_short ? strstr(option->help, ". ") : NULL;
    spell(spelled, sizeof spelled, option);
    limit_words(limits, sizeof limits, option);
    int column = printf("  %s%s", option->use == NPG_USE_PART ? "  " : "", spelled);
    if (column + 1 > HELP_INDENT) {
        putchar('\n');
        column = 0;
    }
    printf("%*s", HELP_INDENT - column, "");
    column = HELP_INDENT;
    print_wrapped(option->help, end ? (size_t)(end - option->help) : strlen(option->help), &column,
                  HELP_INDENT);
    if (limits[0] && !is_short) {
        snprintf(bracketed, sizeof bracketed, "(%s)", limits);
        print_wrapped(bracketed, strlen(bracketed), &column, HELP_INDENT);
    }
    putchar('\n');
}

/* ---- a verb ---- */

/* Keys of the method, or the parts of a list. */
static void each_row(npg_option_use use, const npg_option_list *list, void (*print)(const npg_option_info *))
{
    npg_option_info info = {.struct_size = sizeof info};
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        if (info.use == use && npg_option_list_of(info.name) == list) print(&info);
}

static void print_row(const npg_option_info *option)
{
    print_option(option, false);
}

static void print_options(const npg_verb *verb, bool all)
{
    npg_option_info info;
    const char *group = "";
    bool is_short, is_run = verb->main == npg_verb_run;
    for (size_t i = 0; npg_cli_option(&info, &is_short, verb, i) == NPG_OK; i++) {
        if (is_run && !all && !is_short) continue;
        if ((all || !is_run) && strcmp(group, info.stage) != 0)
            printf("\n%s%s:\n", is_run ? "" : "Options of neupig ", info.stage);
        group = info.stage;
        print_option(&info, is_run && !all);
        const npg_option_list *list = npg_option_list_of(info.name);
        if (all && is_run && list) each_row(NPG_USE_PART, list, print_row);
    }
}

void npg_help_verb(const npg_verb *verb, bool all)
{
    int column = 0;
    bool is_run = verb->main == npg_verb_run, is_brief = is_run && !all;
    const char *end = is_brief ? strstr(verb->text, ".  ") : NULL;
    printf("Usage: neupig %s %s%s%s\n", verb->name, verb->options ? "[options]" : "",
           verb->options && verb->operands[0] ? " " : "", verb->operands);
    if (!is_brief) putchar('\n');
    print_wrapped(verb->text, end ? (size_t)(end + 1 - verb->text) : strlen(verb->text), &column, 0);
    putchar('\n');
    print_options(verb, all);
    if (is_brief)
        fputs("All options: neupig help run --help-all; names and keys of methods: neupig help method.\n",
              stdout);
    if (!is_run && verb->with_run_options)
        fputs("\nThe options of neupig run count here as well (neupig help run --help-all).\n", stdout);
}

void npg_help_verbs(FILE *out)
{
    fputs("Usage: neupig VERB [options] [operands]\n\n"
          "Turns a long sequence of point clouds into one mesh that moves.\n\n",
          out);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++)
        fprintf(out, "  %-10s%s\n", verb->name, verb->help);
    fputs("\nneupig help VERB, or neupig VERB --help, shows the options of one verb.\n"
          "Exit codes: 0 done, 1 failed, 2 usage, 3 bad input, 4 device, 5 disk, 6 memory,\n"
          "7 finished with frames skipped or below the quality bar, 75 stopped by a signal.\n",
          out);
}

void npg_help_method(void)
{
    fputs("--method NAME, --method FILE.json, or --method '{\"preset\": \"NAME\", \"KEY\": VALUE, ...}'; "
          "several add up.\n\nNames:\n",
          stdout);
    for (const npg_preset *preset = npg_presets; preset->name; preset++)
        if (!strcmp(preset->option, "method")) printf("  %-26s%s\n", preset->name, preset->help);
    fputs("\nKeys, beside all options of neupig run:\n", stdout);
    each_row(NPG_USE_METHOD, NULL, print_row);
}

/* ---- as JSON ---- */

static json_t *words_of(const char *choices)
{
    json_t *words = json_array();
    for (const char *word = choices; *word; word += *word == '|') {
        size_t length = strcspn(word, "|");
        json_array_append_new(words, json_stringn(word, length));
        word += length;
    }
    return words;
}

/* What a value may be, in the words of a JSON schema. */
static json_t *schema_of(const npg_option_info *option)
{
    static const char *const types[] = {"boolean", "integer", "number", "string", "string"};
    json_t *schema = json_pack("{ss ss ss}", "description", option->help, "type", types[option->type],
                               "default", option->default_text);
    if (option->type == NPG_OPTION_FLAG)
        json_object_set_new(schema, "default", json_boolean(!strcmp(option->default_text, "yes")));
    if (option->type == NPG_OPTION_CHOICE) json_object_set_new(schema, "enum", words_of(option->choices));
    if (option->type != NPG_OPTION_INT && option->type != NPG_OPTION_REAL) return schema;
    json_object_set_new(schema, "default", json_loads(option->default_text, JSON_DECODE_ANY, NULL));
    json_object_set_new(schema, "minimum", json_real(option->min));
    json_object_set_new(schema, "maximum", json_real(option->max));
    return schema;
}

void npg_help_verb_json(const npg_verb *verb)
{
    npg_option_info info;
    char spelled[SPELL_LIMIT];
    json_t *options = json_array();
    for (size_t i = 0; npg_cli_option(&info, NULL, verb, i) == NPG_OK; i++) {
        spell(spelled, sizeof spelled, &info);
        json_t *option = schema_of(&info);
        json_object_set_new(option, "name", json_string(info.name));
        json_object_set_new(option, "option", json_string(spelled));
        json_object_set_new(option, "group", json_string(info.stage));
        json_array_append_new(options, option);
    }
    npg_cli_print(json_pack("{ss ss ss so}", "verb", verb->name, "operands", verb->operands, "help",
                            verb->text, "options", options));
}

void npg_help_method_json(void)
{
    npg_option_info info = {.struct_size = sizeof info};
    json_t *properties = json_object();
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        json_object_set_new(properties, strcmp(info.name, "method") != 0 ? info.name : "preset",
                            schema_of(&info));
    for (const npg_option_list *list = npg_option_lists; list->name; list++)
        json_object_set_new(properties, list->name,
                            json_pack("{ss ss}", "description", list->help, "type", "string"));
    npg_cli_print(json_pack("{ss ss ss so sb}", "$schema", "https://json-schema.org/draft/2020-12/schema",
                            "title", "method of neupig run", "type", "object", "properties", properties,
                            "additionalProperties", 0));
}

/* ---- files of a run ---- */

static void print_keys(const json_t *schema, const char *path)
{
    const char *key;
    json_t *value, *items = json_object_get(schema, "items");
    char name[256];
    json_object_foreach(json_object_get(schema, "properties"), key, value)
    {
        const char *help = json_string_value(json_object_get(value, "description"));
        snprintf(name, sizeof name, "%s%s%s", path, *path ? "." : "", key);
        printf("  %-42s %s\n", name, help ? help : "");
        print_keys(value, name);
    }
    snprintf(name, sizeof name, "%s[]", path);
    if (items) print_keys(items, name);
}

bool npg_help_file(const char *name, bool as_json)
{
    bool is_done = !strcmp(name, "done");
    const char *text = is_done ? npg_schema_of_done : npg_schema_of_report;
    if (!is_done && strcmp(name, "report") != 0) return false;
    json_t *schema = as_json ? NULL : json_loads(text, 0, NULL);
    if (as_json)
        fputs(text, stdout);
    else
        printf("%s.json: %s\n\n", name, json_string_value(json_object_get(schema, "description")));
    print_keys(schema, "");
    json_decref(schema);
    return true;
}

/* ---- the manual page ---- */

/* Text as roff shows it letter by letter. */
static void put_text(const char *text)
{
    for (const char *c = text; *c; c++) {
        if (c == text && (*c == '.' || *c == '\'')) fputs("\\&", stdout);
        if (*c == '\\')
            fputs("\\e", stdout);
        else if (*c == '-')
            fputs("\\-", stdout);
        else
            putchar(*c);
    }
}

static void put_option(const npg_option_info *option)
{
    char spelled[SPELL_LIMIT], limits[LIMITS_LIMIT];
    spell(spelled, sizeof spelled, option);
    limit_words(limits, sizeof limits, option);
    fputs(".TP\n.B ", stdout);
    put_text(spelled);
    putchar('\n');
    put_text(option->help);
    if (limits[0]) {
        fputs(" (", stdout);
        put_text(limits);
        putchar(')');
    }
    putchar('\n');
}

static void put_verb(const npg_verb *verb)
{
    npg_option_info info;
    const char *stage = "";
    printf(".SS neupig %s", verb->name);
    putchar(' ');
    put_text(verb->operands);
    putchar('\n');
    put_text(verb->text);
    putchar('\n');
    for (size_t i = 0; npg_cli_option(&info, NULL, verb, i) == NPG_OK; i++) {
        if (strcmp(stage, info.stage) != 0)
            printf(".PP\n%s%s:\n", verb->with_run_options ? "" : "Options of ", info.stage);
        stage = info.stage;
        put_option(&info);
        const npg_option_list *list = npg_option_list_of(info.name);
        if (!list) continue;
        fputs(".RS\n", stdout);
        each_row(NPG_USE_PART, list, put_option);
        fputs(".RE\n", stdout);
    }
}

static void put_methods(void)
{
    fputs(".SH METHODS\nNames and keys of the option method.\n", stdout);
    for (const npg_preset *preset = npg_presets; preset->name; preset++) {
        if (strcmp(preset->option, "method") != 0) continue;
        printf(".TP\n.B %s\n", preset->name);
        put_text(preset->help);
        putchar('\n');
    }
    each_row(NPG_USE_METHOD, NULL, put_option);
}

npg_status npg_verb_man(const npg_cli *cli)
{
    (void)cli;
    static const char *const codes[][2] = {
        {"0", "done"},
        {"1", "failed"},
        {"2", "usage or configuration"},
        {"3", "bad input; the message names file, place and cause"},
        {"4", "device: no OpenCL device, or one that computes wrong"},
        {"5", "disk: writing failed"},
        {"6", "memory"},
        {"7", "finished with frames skipped or below the quality bar"},
        {"75", "stopped by a signal"},
    };
    printf(".TH NEUPIG 1 \"\" \"neupig %s\" \"User Commands\"\n", npg_version());
    fputs(".SH NAME\nneupig \\- one moving mesh from a long sequence of point clouds\n"
          ".SH SYNOPSIS\n.B neupig\n.I VERB\n[options] [operands]\n"
          ".SH DESCRIPTION\nTurns a sequence of point clouds into one mesh that moves through all of them, "
          "every vertex keeping its identity.\n"
          "Options are written \\-\\-name VALUE or \\-\\-name=VALUE; flags \\-\\-name or \\-\\-no\\-name.\n"
          ".SH VERBS\n",
          stdout);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) put_verb(verb);
    put_methods();
    fputs(".SH EXIT STATUS\n", stdout);
    for (size_t i = 0; i < sizeof codes / sizeof *codes; i++)
        printf(".TP\n.B %s\n%s\n", codes[i][0], codes[i][1]);
    return NPG_OK;
}
