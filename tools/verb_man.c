/* neupig man: the manual page, made from the tables of options. */
#include <string.h>

#include "tools/cli.h"

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
    char spelled[128], limits[256];
    npg_help_spell(spelled, sizeof spelled, option);
    npg_help_limits(limits, sizeof limits, option);
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

/* Keys of the method, or the parts of a list. */
static void put_rows(npg_option_use use, const npg_option_list *list)
{
    npg_option_info info = {.struct_size = sizeof info};
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++)
        if (info.use == use && npg_option_list_of(info.name) == list) put_option(&info);
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
        put_rows(NPG_USE_PART, list);
        fputs(".RE\n", stdout);
    }
}

static void put_methods(void)
{
    fputs(".SH METHODS\nNames and keys of the option method.\n", stdout);
    for (const npg_preset *preset = npg_presets; preset->name; preset++) {
        printf(".TP\n.B %s\n", preset->name);
        put_text(preset->help);
        putchar('\n');
    }
    put_rows(NPG_USE_METHOD, NULL);
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
