/* neupig verify: whether results are as they were written. */
#include "pipeline/file.h"
#include "tools/cli.h"

static void tell(void *user, const char *text)
{
    (void)user;
    fprintf(stderr, "neupig verify: %s\n", text);
}

void npg_cli_warn_of_damage(const char *verb, const char *folder)
{
    npg_verified found = {.struct_size = sizeof found};
    if (npg_is_in_folder(folder, "done.json") && npg_verify(&found, folder, NULL, NULL) && found.damaged)
        fprintf(stderr, "neupig %s: warning: %s\n", verb, npg_error_text());
}

/* All folders are looked at; the first that is damaged says how it ends. */
int npg_verb_verify(int argc, char **argv)
{
    npg_cli cli;
    npg_status worst = npg_cli_parse(&cli, argv[0], NULL, NULL, argc, argv);
    if (worst) return npg_cli_end(argv[0], worst);
    for (int i = 0; i < cli.operand_count; i++) {
        npg_verified found = {.struct_size = sizeof found};
        npg_status status = npg_verify(&found, cli.operands[i], NULL, tell);
        if (!status) printf("%s: %zu files as they were written\n", cli.operands[i], found.files);
        if (status && !found.files) npg_cli_end(argv[0], status);
        if (!worst) worst = status;
    }
    return npg_status_exit_code(worst);
}
