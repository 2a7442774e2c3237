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
npg_status npg_verb_verify(const npg_cli *cli)
{
    npg_status worst = NPG_OK;
    int bad = 0;
    for (int i = 0; i < cli->operand_count; i++) {
        npg_verified found = {.struct_size = sizeof found};
        npg_status status = npg_verify(&found, cli->operands[i], NULL, tell);
        if (!status) printf("%s: %zu files as they were written\n", cli->operands[i], found.files);
        if (status && !found.files) tell(NULL, npg_error_text());
        if (!worst) worst = status;
        bad += status != NPG_OK;
    }
    return worst ? npg_error(worst, "%d of %d are not as they were written", bad, cli->operand_count)
                 : NPG_OK;
}
