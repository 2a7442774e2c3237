/* Command line: options from tables, operands, and how a verb ends. */
#include "tools/cli.h"

#include <string.h>

#include "pipeline/memory.h"
#include "pipeline/options.h"

enum { NAME_LIMIT = 64 };

/* ---- options of a verb ---- */

static const npg_option *own_option(const npg_verb *verb, const char *name)
{
    for (const npg_option *option = verb->options; option && option->name; option++)
        if (!strcmp(option->name, name)) return option;
    return NULL;
}

/* An option of the library, whoever may set it; a list as one. */
static bool find_in_run(npg_option_info *info, const char *name)
{
    for (const npg_option_list *list = npg_option_lists; list->name; list++)
        if (!strcmp(list->name, name)) {
            *info = (npg_option_info){.struct_size = sizeof *info,
                                      .name = list->name,
                                      .help = list->help,
                                      .default_text = "",
                                      .value_name = list->value_name,
                                      .type = NPG_OPTION_TEXT};
            return true;
        }
    info->struct_size = sizeof *info;
    for (size_t i = 0; npg_options_describe(i, info) == NPG_OK; i++)
        if (!strcmp(info->name, name)) return true;
    return false;
}

static bool find_option(npg_option_info *info, const npg_verb *verb, const char *name)
{
    const npg_option *own = own_option(verb, name);
    if (own) *info = npg_option_info_of(own, verb->name);
    return own || (verb->with_run_options && find_in_run(info, name) && info->use == NPG_USE_COMMON);
}

/* Options of a run by what a user does; * marks those that the short help shows. */
static const struct {
    const char *title, *names;
} groups[] = {
    {"Frames", "*frames missing keep-going confine cache *follow follow-end look-ahead"},
    {"Sensors", "*sensor sensor-poses align-sensors depth-range background"},
    {"Points", "outliers normals"},
    {"Reference", "*reference keyframe effort *faces unseen colour"},
    {"Method", "*method device seed"},
    {"Result", "*output *export prefix numbering scale axes up unit centre fps overwrite *restart"},
    {"Judged", "bars *segments"},
    {"Machine", "*max-memory progress log-file quiet verbose"},
};

/* The i-th name of the groups. */
static bool grouped(char *name, size_t size, const char **title, bool *is_short, size_t i)
{
    for (size_t g = 0; g < sizeof groups / sizeof *groups; g++)
        for (const char *word = groups[g].names; *word; word += strspn(word, " ")) {
            size_t length = strcspn(word, " ");
            if (i-- == 0) {
                *is_short = *word == '*';
                *title = groups[g].title;
                snprintf(name, size, "%.*s", (int)(length - *is_short), word + *is_short);
                return true;
            }
            word += length;
        }
    return false;
}

npg_status npg_cli_option(npg_option_info *info, bool *is_short, const npg_verb *verb, size_t i)
{
    char name[NAME_LIMIT];
    const char *title;
    bool unused;
    if (verb->main == npg_verb_run) {
        if (!grouped(name, sizeof name, &title, is_short ? is_short : &unused, i)) return NPG_END;
        if (!find_option(info, verb, name)) return npg_error(NPG_FAILED, "help: no option %s", name);
        info->stage = title;
        return NPG_OK;
    }
    for (const npg_option *option = verb->options; option && option->name; option++)
        if (i-- == 0) {
            *info = npg_option_info_of(option, verb->name);
            if (is_short) *is_short = true;
            return NPG_OK;
        }
    return NPG_END;
}

/* An option of the library that is none of the command; value NULL: none was given. */
static npg_status refuse_option(const npg_option_info *info, const char *value)
{
    bool is_bare = info->type != NPG_OPTION_TEXT && info->type != NPG_OPTION_CHOICE;
    const char *quote = is_bare ? "" : "\"";
    if (info->use == NPG_USE_PROGRAM)
        return npg_error(NPG_USAGE, "option %s is for programs that use the library", info->name);
    if (info->use == NPG_USE_PART)
        return npg_error(NPG_USAGE, "option %s is a part of --%s", info->name,
                         npg_option_list_of(info->name)->name);
    if (info->type == NPG_OPTION_FLAG) value = value && !strcmp(value, "no") ? "false" : "true";
    return npg_error(NPG_USAGE, "option --%s is a key of the method now: --method '{\"%s\": %s%s%s}'",
                     info->name, info->name, quote, value ? value : info->default_text, quote);
}

/* The option that was meant, of all that the verb takes. */
static npg_status no_such_option(const npg_verb *verb, const char *name)
{
    npg_option_info info;
    npg_nearest nearest = npg_nearest_to(name);
    for (size_t i = 0; npg_cli_option(&info, NULL, verb, i) == NPG_OK; i++)
        npg_nearest_offer(&nearest, info.name);
    for (size_t i = 0; verb->with_run_options && npg_options_describe(i, &info) == NPG_OK; i++)
        if (info.use == NPG_USE_COMMON) npg_nearest_offer(&nearest, info.name);
    if (nearest.word)
        return npg_error(NPG_USAGE, "there is no option --%s; did you mean --%s?", name, nearest.word);
    return npg_error(NPG_USAGE, "there is no option --%s (neupig help %s lists them)", name, verb->name);
}

static npg_status unknown_option(const npg_verb *verb, const char *name, const char *value)
{
    npg_option_info info;
    char of_verb[2 * NAME_LIMIT];
    snprintf(of_verb, sizeof of_verb, "%s %s", verb->name, name);
    const char *gone = npg_option_gone(of_verb);
    bool is_no = !strncmp(name, "no-", 3);
    if (!gone && verb->with_run_options) gone = npg_option_gone(name);
    if (gone) return npg_error(NPG_USAGE, "option --%s went: %s", name, gone);
    if (!verb->with_run_options) return no_such_option(verb, name);
    if (find_in_run(&info, name)) return refuse_option(&info, value);
    if (is_no && find_in_run(&info, name + 3)) return refuse_option(&info, "no");
    return no_such_option(verb, name);
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

/* The name of the option that text begins with, and the value that stands in the same word, or NULL. */
static npg_status split_option(char *name, const char **value, const char *text)
{
    static const char *const shorts[] = {"output", "quiet", "verbose"};
    const char *equals = strchr(text, '=');
    *value = NULL;
    *name = 0;
    if (text[1] != '-') {
        for (size_t s = 0; s < sizeof shorts / sizeof *shorts; s++)
            if (text[1] == *shorts[s]) strcpy(name, shorts[s]);
        if (text[2]) *value = text + 2;
        return NPG_OK;
    }
    size_t length = equals ? (size_t)(equals - text - 2) : strlen(text + 2);
    if (length >= NAME_LIMIT) return npg_error(NPG_USAGE, "there is no option %.*s", (int)length + 2, text);
    memcpy(name, text + 2, length);
    name[length] = 0;
    if (equals) *value = equals + 1;
    return NPG_OK;
}

/* The option at argv[*i], which begins with a dash. */
static npg_status parse_option(npg_cli *cli, int argc, char **argv, int *i)
{
    char name[NAME_LIMIT];
    npg_option_info info;
    const char *text = argv[*i], *value;
    NPG_TRY(split_option(name, &value, text));
    if (find_option(&info, cli->verb, name)) {
        if (!value && info.type == NPG_OPTION_FLAG) value = "yes";
        if (!value && *i + 1 < argc) value = argv[++*i];
        return value ? set_option(cli, name, value) : npg_error(NPG_USAGE, "option %s needs a value", text);
    }
    if (text[1] != '-')
        return npg_error(NPG_USAGE, "there is no option %s (neupig help %s lists them)", text,
                         cli->verb->name);
    if (!strncmp(name, "no-", 3) && find_option(&info, cli->verb, name + 3) && info.type == NPG_OPTION_FLAG)
        return value ? npg_error(NPG_USAGE, "option --%s takes no value", name)
                     : set_option(cli, name + 3, "no");
    return unknown_option(cli->verb, name, value ? value : *i + 1 < argc ? argv[*i + 1] : NULL);
}

/* Read what --method says, before anything else on the command line is set. */
static npg_status read_methods(npg_cli *cli, int argc, char **argv)
{
    for (int i = 1; cli->verb->with_run_options && i < argc && strcmp(argv[i], "--") != 0; i++) {
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
        else
            NPG_TRY(parse_option(cli, argc, argv, &i));
    }
    return NPG_OK;
}

/* 0: no, 1: the short help, 2: all of it. */
static int asks_for_help(int argc, char **argv)
{
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++) {
        if (!strcmp(argv[i], "--help") || !strcmp(argv[i], "-h")) return 1;
        if (!strcmp(argv[i], "--help-all")) return 2;
    }
    return 0;
}

static npg_status parse(npg_cli *cli, int argc, char **argv)
{
    const npg_verb *verb = cli->verb;
    int help = asks_for_help(argc, argv);
    if (help == 2 && own_option(verb, "help-all")) help = 0; /* of another verb */
    if (help) {
        npg_help_verb(verb, help == 2);
        return NPG_END;
    }
    for (const npg_option *option = verb->options; option && option->name; option++)
        npg_option_store(option, option->default_text, cli->values);
    NPG_TRY(read_methods(cli, argc, argv));
    NPG_TRY(parse_all(cli, argc, argv));
    if (cli->operand_count < verb->operands_min)
        return npg_error(NPG_USAGE, "missing operand; usage: neupig %s %s", verb->name, verb->operands);
    if (cli->operand_count > verb->operands_max)
        return npg_error(NPG_USAGE, "unexpected operand \"%s\"; usage: neupig %s %s",
                         cli->operands[verb->operands_max], verb->name, verb->operands);
    return NPG_OK;
}

void npg_cli_print(json_t *value)
{
    json_dumpf(value, stdout, JSON_INDENT(1) | JSON_REAL_PRECISION(12));
    putchar('\n');
    json_decref(value);
}

int npg_cli_run(const npg_verb *verb, int argc, char **argv)
{
    npg_cli cli = {.verb = verb, .operands = argv + 1};
    size_t size = 1; /* of what the table names; no value is larger than a pointer */
    for (const npg_option *option = verb->options; option && option->name; option++)
        if (size < option->offset + sizeof(void *)) size = option->offset + sizeof(void *);
    npg_status status = npg_alloc(&cli.values, NPG_FOR_RUN, size);
    if (!status) status = npg_options_open(&cli.options);
    if (!status) status = parse(&cli, argc, argv);
    if (!status) status = verb->main(&cli);
    if (status < 0) fprintf(stderr, "neupig %s: %s\n", verb->name, npg_error_text());
    npg_options_close(&cli.options);
    npg_release(&cli.values);
    return status == NPG_END ? 0 : npg_status_exit_code(status);
}
