/* neupig man: the manual page and shell completion, made from the tables of options. */
#include <stddef.h>
#include <string.h>

#include "pipeline/stage.h"
#include "tools/cli.h"

typedef enum completion { COMPLETION_NONE, COMPLETION_BASH, COMPLETION_ZSH } completion;

typedef struct settings {
    int completion;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_man_options[] = {
    /* type        name          place           default  words */
    NPG_ROW_CHOICE("completion", AT(completion), "none",  "none|bash|zsh",
        "Print completion for a shell instead"),
    {0}};
/* clang-format on */

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
    npg_cli_spell(spelled, sizeof spelled, option);
    npg_cli_limits(limits, sizeof limits, option);
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
    for (size_t i = 0; npg_cli_option(&info, verb, i) == NPG_OK; i++) {
        if (strcmp(stage, info.stage) != 0) printf(".PP\nOptions of %s:\n", info.stage);
        stage = info.stage;
        put_option(&info);
    }
}

static void put_presets(void)
{
    fputs(".SH PRESETS\n", stdout);
    for (const npg_preset *preset = npg_presets; preset->name; preset++) {
        printf(".TP\n.B %s\n", preset->name);
        put_text(preset->help);
        putchar('\n');
    }
}

static void print_manual(void)
{
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
    put_presets();
    fputs(".SH EXIT STATUS\n", stdout);
    for (size_t i = 0; i < sizeof codes / sizeof *codes; i++)
        printf(".TP\n.B %s\n%s\n", codes[i][0], codes[i][1]);
}

static void print_bash(void)
{
    npg_option_info info;
    fputs("# bash completion for neupig, made by: neupig man --completion bash\n_neupig()\n{\n"
          "    local word=${COMP_WORDS[COMP_CWORD]} words=\n"
          "    if [ \"$COMP_CWORD\" -eq 1 ]; then\n        COMPREPLY=($(compgen -W '",
          stdout);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) printf("%s ", verb->name);
    fputs("' -- \"$word\"))\n        return\n    fi\n    case ${COMP_WORDS[1]} in\n", stdout);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) {
        printf("    %s) words='--help", verb->name);
        for (size_t i = 0; npg_cli_option(&info, verb, i) == NPG_OK; i++) printf(" --%s", info.name);
        fputs("' ;;\n", stdout);
    }
    fputs("    esac\n    if [[ $word == -* ]]; then\n"
          "        COMPREPLY=($(compgen -W \"$words\" -- \"$word\"))\n"
          "    else\n        COMPREPLY=($(compgen -f -- \"$word\"))\n    fi\n}\n"
          "complete -o filenames -F _neupig neupig\n",
          stdout);
}

/* Text inside single quotes, where _arguments and _describe read it. */
static void put_zsh(const char *text)
{
    for (const char *c = text; *c; c++) {
        if (strchr("[]:\\", *c)) putchar('\\');
        fputs(*c == '\'' ? "'\\''" : (char[]){*c, 0}, stdout);
    }
}

/* What a value looks like: one of some words, a path, or anything. */
static void put_zsh_value(const npg_option_info *option)
{
    fputs(":", stdout);
    put_zsh(option->value_name ? option->value_name : "value");
    fputs(":", stdout);
    if (option->type == NPG_OPTION_CHOICE) {
        putchar('(');
        for (const char *c = option->choices; *c; c++) putchar(*c == '|' ? ' ' : *c);
        putchar(')');
    } else if (option->value_name && !strcmp(option->value_name, "DIR")) {
        fputs("_files -/", stdout);
    } else if (option->type == NPG_OPTION_TEXT) {
        fputs("_files", stdout);
    }
}

static void put_zsh_option(const npg_option_info *option, const char *spelled)
{
    printf("            '%s[", spelled);
    put_zsh(option->help);
    putchar(']');
    if (option->type != NPG_OPTION_FLAG) put_zsh_value(option);
    fputs("'\n", stdout);
}

static void put_zsh_verb(const npg_verb *verb)
{
    npg_option_info info;
    char spelled[128];
    printf("    %s)\n        options=(\n            '--help[Show the options]'\n", verb->name);
    for (size_t i = 0; npg_cli_option(&info, verb, i) == NPG_OK; i++) {
        snprintf(spelled, sizeof spelled, "--%s", info.name);
        put_zsh_option(&info, spelled);
        if (!strcmp(info.name, "output")) put_zsh_option(&info, "-o");
        if (info.type != NPG_OPTION_FLAG) continue;
        snprintf(spelled, sizeof spelled, "--no-%s", info.name);
        put_zsh_option(&info, spelled);
    }
    fputs("        )\n        ;;\n", stdout);
}

static void print_zsh(void)
{
    fputs("#compdef neupig\n# zsh completion for neupig, made by: neupig man --completion zsh\n_neupig()\n{\n"
          "    local -a verbs options\n    verbs=(\n",
          stdout);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) {
        printf("        '%s:", verb->name);
        put_zsh(verb->help);
        fputs("'\n", stdout);
    }
    fputs("    )\n    if (( CURRENT == 2 )); then\n        _describe verb verbs\n        return\n    fi\n"
          "    case $words[2] in\n",
          stdout);
    for (const npg_verb *verb = npg_verbs; verb->name; verb++) put_zsh_verb(verb);
    fputs("    esac\n    shift words\n    (( CURRENT-- ))\n    _arguments $options '*:file:_files'\n}\n"
          "_neupig \"$@\"\n",
          stdout);
}

int npg_verb_man(int argc, char **argv)
{
    settings s;
    npg_cli cli;
    npg_status status = npg_cli_parse(&cli, argv[0], &s, NULL, argc, argv);
    if (!status && s.completion == COMPLETION_BASH) print_bash();
    if (!status && s.completion == COMPLETION_ZSH) print_zsh();
    if (!status && s.completion == COMPLETION_NONE) print_manual();
    return npg_cli_end(argv[0], status);
}
