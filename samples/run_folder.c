/* A whole run in one call: a folder of point clouds becomes a folder of meshes.
 *
 *     run_folder CAPTURE OUT [NAME=VALUE ...]
 *
 * NAME=VALUE are the options that "neupig help run" lists, without their dashes: epochs=100 faces=20000.
 * Build:  cc run_folder.c -o run_folder $(pkg-config --cflags --libs neupig) */
#include <neupig.h>
#include <stdio.h>
#include <string.h>

/* Called from the run's threads, never twice at once. */
static void show_log(void *user, const npg_log_record *record)
{
    (void)user;
    if (record->level <= NPG_LOG_WARNING) fprintf(stderr, "%s: %s\n", record->stage, record->message);
}

static void show_progress(void *user, const npg_progress *progress)
{
    int *last = user, percent = (int)(100 * progress->share);
    if (percent / 10 != *last / 10) fprintf(stderr, "%3d %%, %s\n", percent, progress->stage);
    *last = percent;
}

static npg_status set_options(npg_options *options, int argc, char **argv)
{
    npg_status status = npg_options_set(options, "input", argv[1]);
    if (!status) status = npg_options_set(options, "output", argv[2]);
    for (int i = 3; i < argc && !status; i++) {
        char *equals = strchr(argv[i], '=');
        if (!equals) return npg_error_set(NPG_USAGE, "options are written NAME=VALUE");
        *equals = 0;
        status = npg_options_set(options, argv[i], equals + 1);
    }
    return status;
}

int main(int argc, char **argv)
{
    int percent = 0;
    npg_hooks hooks = {
        .struct_size = sizeof hooks, .user = &percent, .log = show_log, .progress = show_progress};
    npg_options *options = NULL;
    npg_run *run = NULL;
    if (argc < 3) {
        fprintf(stderr, "usage: run_folder CAPTURE OUT [NAME=VALUE ...]\n");
        return 2;
    }
    npg_status status = npg_options_open(&options);
    if (!status) status = set_options(options, argc, argv);
    if (!status) status = npg_run_open(&run, options, &hooks); /* starts the run's threads */
    if (!status) status = npg_run_wait(run);                   /* until OUT/done.json is written */
    if (status < 0) fprintf(stderr, "run_folder: %s\n", npg_error_text());
    if (status == NPG_PARTIAL) fprintf(stderr, "run_folder: done, but look into %s/report.json\n", argv[2]);
    npg_run_close(&run); /* closers take NULL, so one way out serves all */
    npg_options_close(&options);
    return npg_status_exit_code(status);
}
