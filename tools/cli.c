/* Command line: options from tables, operands, help, and how a verb ends. */
#include "tools/cli.h"

#include <stdlib.h>
#include <string.h>

#include "pipeline/stage.h"

enum { NAME_LIMIT = 64, HELP_INDENT = 28, HELP_WIDTH = 100 };

/* ---- options of a verb ---- */

static const npg_option *own_option(const npg_verb *verb, const char *name)
{
    for (const npg_option *option = verb->options; option && option->name; option++)
        if (!strcmp(option->name, name)) return option;
    return NULL;
}

npg_status npg_cli_option(npg_option_info *info, const npg_verb *verb, size_t i)
{
    const npg_option *option = verb->options;
    for (; option && option->name; option++)
        if (i-- == 0) {
            *info = (npg_option_info){sizeof *info,         verb->name,      option->name,       option->help,
                                      option->default_text, option->choices, option->value_name, option->type,
                                      option->min,          option->max,     option->use};
            return NPG_OK;
        }
    info->struct_size = sizeof *info;
    for (size_t j = 0; verb->with_run_options && npg_options_describe(j, info) == NPG_OK; j++)
        if (info->use == NPG_USE_COMMON && i-- == 0) return NPG_OK;
    return NPG_END;
}

static bool find_option(npg_option_info *info, const npg_verb *verb, const char *name)
{
    for (size_t i = 0; npg_cli_option(info, verb, i) == NPG_OK; i++)
        if (!strcmp(info->name, name)) return true;
    return false;
}

/* Edits (insert, delete, replace) that lead from a to b; both shorter than NAME_LIMIT. */
static size_t edit_distance(const char *a, const char *b)
{
    size_t row[NAME_LIMIT + 1], b_length = strlen(b);
    for (size_t j = 0; j <= b_length; j++) row[j] = j;
    for (size_t i = 1; a[i - 1]; i++) {
        size_t diagonal = row[0];
        row[0] = i;
        for (size_t j = 1; j <= b_length; j++) {
            size_t above = row[j], best = diagonal + (a[i - 1] != b[j - 1]);
            if (above + 1 < best) best = above + 1;
            if (row[j - 1] + 1 < best) best = row[j - 1] + 1;
            row[j] = best;
            diagonal = above;
        }
    }
    return row[b_length];
}

/* An option of the library that is none of the command; value NULL: none was given. */
static npg_status refuse_option(const npg_option_info *info, const char *value)
{
    bool is_bare = info->type != NPG_OPTION_TEXT && info->type != NPG_OPTION_CHOICE;
    const char *quote = is_bare ? "" : "\"";
    if (info->use == NPG_USE_PROGRAM)
        return npg_error(NPG_USAGE, "option %s is for programs that use the library", info->name);
    if (info->type == NPG_OPTION_FLAG) value = value && !strcmp(value, "no") ? "false" : "true";
    return npg_error(NPG_USAGE, "option --%s is a key of the method now: --method '{\"%s\": %s%s%s}'",
                     info->name, info->name, quote, value ? value : info->default_text, quote);
}

static bool find_in_run(npg_option_info *info, const npg_verb *verb, const char *name)
{
    info->struct_size = sizeof *info;
    for (size_t i = 0; verb->with_run_options && npg_options_describe(i, info) == NPG_OK; i++)
        if (!strcmp(info->name, name)) return true;
    return false;
}

static npg_status unknown_option(const npg_verb *verb, const char *name, const char *value)
{
    npg_option_info info;
    const char *gone = verb->with_run_options ? npg_option_gone(name) : NULL;
    bool is_no = !strncmp(name, "no-", 3);
    if (gone) return npg_error(NPG_USAGE, "option --%s went: %s", name, gone);
    if (find_in_run(&info, verb, name)) return refuse_option(&info, value);
    if (is_no && find_in_run(&info, verb, name + 3)) return refuse_option(&info, "no");
    const char *nearest = NULL;
    size_t least = strlen(name) / 3 + 2; /* more edits than a third of the name: not a slip of the hand */
    for (size_t i = 0; npg_cli_option(&info, verb, i) == NPG_OK; i++) {
        size_t edits = edit_distance(name, info.name);
        if (edits < least) {
            least = edits;
            nearest = info.name;
        }
    }
    if (nearest) return npg_error(NPG_USAGE, "there is no option --%s; did you mean --%s?", name, nearest);
    return npg_error(NPG_USAGE, "there is no option --%s (neupig help %s lists them)", name, verb->name);
}

/* ---- parsing ---- */

static npg_status set_option(npg_cli *cli, const char *name, const char *value)
{
    const npg_option *own = own_option(cli->verb, name);
    if (!own && !strcmp(name, "method")) return NPG_OK; /* read before the others */
    if (!own) return npg_options_set(cli->options, name, value);
    NPG_TRY(npg_option_check(own, value));
    npg_option_store(own, value, cli->values);
    return NPG_OK;
}

/* The option at argv[*i], which begins with two dashes. */
static npg_status parse_long_option(npg_cli *cli, int argc, char **argv, int *i)
{
    char name[NAME_LIMIT];
    npg_option_info info;
    const char *text = argv[*i] + 2, *equals = strchr(text, '=');
    size_t length = equals ? (size_t)(equals - text) : strlen(text);
    if (length >= sizeof name) return npg_error(NPG_USAGE, "there is no option --%.*s", (int)length, text);
    memcpy(name, text, length);
    name[length] = 0;
    if (find_option(&info, cli->verb, name)) {
        if (equals) return set_option(cli, name, equals + 1);
        if (info.type == NPG_OPTION_FLAG) return set_option(cli, name, "yes");
        if (*i + 1 >= argc) return npg_error(NPG_USAGE, "option --%s needs a value", name);
        return set_option(cli, name, argv[++*i]);
    }
    if (!strncmp(name, "no-", 3) && find_option(&info, cli->verb, name + 3) && info.type == NPG_OPTION_FLAG) {
        if (equals) return npg_error(NPG_USAGE, "option --%s takes no value", name);
        return set_option(cli, name + 3, "no");
    }
    return unknown_option(cli->verb, name, equals ? equals + 1 : *i + 1 < argc ? argv[*i + 1] : NULL);
}

static npg_status parse_short_option(npg_cli *cli, int argc, char **argv, int *i)
{
    static const struct {
        char letter;
        const char *name;
    } shorts[] = {{'o', "output"}, {'q', "quiet"}, {'v', "verbose"}};
    const char *text = argv[*i];
    npg_option_info info;
    for (size_t s = 0; s < sizeof shorts / sizeof *shorts; s++) {
        if (text[1] != shorts[s].letter || !find_option(&info, cli->verb, shorts[s].name)) continue;
        if (info.type == NPG_OPTION_FLAG && !text[2]) return set_option(cli, info.name, "yes");
        if (text[2]) return set_option(cli, info.name, text + 2);
        if (*i + 1 >= argc) return npg_error(NPG_USAGE, "option -%c needs a value", text[1]);
        return set_option(cli, info.name, argv[++*i]);
    }
    return npg_error(NPG_USAGE, "there is no option %s (neupig help %s lists them)", text, cli->verb->name);
}

/* Read what --method says, before anything else on the command line is set. */
static npg_status read_methods(npg_cli *cli, int argc, char **argv)
{
    for (int i = 1; cli->options && i < argc && strcmp(argv[i], "--") != 0; i++) {
        if (!strncmp(argv[i], "--method=", 9))
            NPG_TRY(npg_options_set(cli->options, "method", argv[i] + 9));
        else if (!strcmp(argv[i], "--method") && i + 1 < argc)
            NPG_TRY(npg_options_set(cli->options, "method", argv[++i]));
    }
    return NPG_OK;
}

static npg_status parse_all(npg_cli *cli, int argc, char **argv)
{
    bool only_operands = false;
    for (int i = 1; i < argc; i++) {
        char *text = argv[i];
        if (only_operands || text[0] != '-' || !text[1])
            cli->operands[cli->operand_count++] = text;
        else if (!strcmp(text, "--"))
            only_operands = true;
        else if (text[1] == '-')
            NPG_TRY(parse_long_option(cli, argc, argv, &i));
        else
            NPG_TRY(parse_short_option(cli, argc, argv, &i));
    }
    return NPG_OK;
}

static bool asks_for_help(int argc, char **argv)
{
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++)
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h")) return true;
    return false;
}

npg_status npg_cli_parse(npg_cli *cli, const char *name, void *values, npg_options *options, int argc,
                         char **argv)
{
    const npg_verb *verb = npg_verb_find(name);
    *cli = (npg_cli){verb, values, options, argv + 1, 0};
    if (asks_for_help(argc, argv)) {
        npg_cli_print_verb(stdout, verb);
        return NPG_END;
    }
    for (const npg_option *option = verb->options; option && option->name; option++)
        npg_option_store(option, option->default_text, values);
    NPG_TRY(read_methods(cli, argc, argv));
    NPG_TRY(parse_all(cli, argc, argv));
    if (cli->operand_count < verb->operands_min)
        return npg_error(NPG_USAGE, "missing operand; usage: neupig %s %s", name, verb->operands);
    if (cli->operand_count > verb->operands_max)
        return npg_error(NPG_USAGE, "unexpected operand \"%s\"; usage: neupig %s %s",
                         cli->operands[verb->operands_max], name, verb->operands);
    return NPG_OK;
}

int npg_cli_end(const char *verb, npg_status status)
{
    if (status == NPG_END) status = NPG_OK;
    if (status < 0) fprintf(stderr, "neupig %s: %s\n", verb, npg_error_text());
    return npg_status_exit_code(status);
}

/* ---- help ---- */

void npg_cli_spell(char *out, size_t size, const npg_option_info *option)
{
    static const char *const by_type[] = {"", "N", "X", "WORD", "TEXT"};
    const char *value = option->value_name ? option->value_name : by_type[option->type];
    bool on = option->type == NPG_OPTION_FLAG && !strcmp(option->default_text, "yes");
    if (option->type == NPG_OPTION_FLAG)
        snprintf(out, size, "--%s%s", on ? "no-" : "", option->name);
    else
        snprintf(out, size, "--%s %s", option->name, value);
}

void npg_cli_limits(char *out, size_t size, const npg_option_info *option)
{
    const char *given = option->default_text;
    out[0] = 0;
    switch (option->type) {
    case NPG_OPTION_FLAG: snprintf(out, size, "default: %s", given); break;
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

/* Print text in words, wrapped; the cursor stands at *column. */
static void print_wrapped(FILE *out, const char *text, int *column, int indent)
{
    while (*text) {
        int length = (int)strcspn(text, " ");
        if (*column + 1 + length > HELP_WIDTH) {
            fprintf(out, "\n%*s", indent, "");
            *column = indent;
        } else if (*column > indent) {
            fputc(' ', out);
            ++*column;
        }
        fprintf(out, "%.*s", length, text);
        *column += length;
        text += length;
        text += strspn(text, " ");
    }
}

static void print_option(FILE *out, const npg_option_info *option)
{
    char spelled[NAME_LIMIT + 32], limits[256], bracketed[260];
    if (option->use == NPG_USE_METHOD)
        snprintf(spelled, sizeof spelled, "%s", option->name);
    else
        npg_cli_spell(spelled, sizeof spelled, option);
    npg_cli_limits(limits, sizeof limits, option);
    int column = fprintf(out, "  %s", spelled);
    if (column + 1 > HELP_INDENT) {
        fputc('\n', out);
        column = 0;
    }
    fprintf(out, "%*s", HELP_INDENT - column, "");
    column = HELP_INDENT;
    print_wrapped(out, option->help, &column, HELP_INDENT);
    if (limits[0]) {
        snprintf(bracketed, sizeof bracketed, "(%s)", limits);
        print_wrapped(out, bracketed, &column, HELP_INDENT);
    }
    fputc('\n', out);
}

void npg_cli_print_verb(FILE *out, const npg_verb *verb)
{
    npg_option_info info;
    const char *stage = "";
    int column = 0;
    fprintf(out, "Usage: neupig %s %s%s%s\n\n", verb->name, verb->options ? "[options]" : "",
            verb->options && verb->operands[0] ? " " : "", verb->operands);
    print_wrapped(out, verb->text, &column, 0);
    fputs("\n", out);
    for (size_t i = 0; npg_cli_option(&info, verb, i) == NPG_OK; i++) {
        if (strcmp(stage, info.stage) != 0)
            fprintf(out, "\n%s%s:\n", i ? "Options of " : "Options of neupig ", info.stage);
        stage = info.stage;
        print_option(out, &info);
    }
}

void npg_cli_print_method(FILE *out)
{
    npg_option_info info = {.struct_size = sizeof info};
    fputs("--method NAME, --method FILE.json, or --method '{\"preset\": \"NAME\", \"KEY\": VALUE, ...}'; "
          "several add up.\n\nNames:\n",
          out);
    for (const npg_preset *preset = npg_presets; preset->name; preset++)
        fprintf(out, "  %-26s%s\n", preset->name, preset->help);
    fputs("\nKeys, beside all options of neupig run:\n", out);
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        if (info.use == NPG_USE_METHOD) print_option(out, &info);
}

void npg_cli_print_verbs(FILE *out)
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
