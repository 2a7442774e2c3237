/* neupig run: the main job. */
#include <signal.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "cli.h"
#include "progress.h"
#include "run_job.h"

typedef struct settings {
    const char *config;
    int progress;
    bool quiet, verbose;
} settings;

const npg_option npg_run_verb_options[] = {
    {"config", "Read options from a JSON object in FILE; the command line wins (also -c)", NPG_OPTION_TEXT,
     offsetof(settings, config), "", 0, 0, NULL, "FILE"},
    {"progress",
     "How to show progress; json writes one line per step to standard output; auto: a bar on a terminal",
     NPG_OPTION_CHOICE, offsetof(settings, progress), "auto", 0, 0, "auto|bar|json|none", NULL},
    {"quiet", "Log warnings and errors only (also -q)", NPG_OPTION_FLAG, offsetof(settings, quiet), "no", 0,
     0, NULL, NULL},
    {"verbose", "Log everything (also -v)", NPG_OPTION_FLAG, offsetof(settings, verbose), "no", 0, 0, NULL,
     NULL},
    {0}};

/* ---- signals ---- */

static npg_run *volatile signalled_run; /* the run that a signal stops */

#define STOP_SECONDS 4 /* a run that has not stopped by then is ended */

static void on_signal(int number)
{
    (void)number;
    npg_run_stop(signalled_run);
    alarm(STOP_SECONDS);
}

/* Something that can't be interrupted took too long.  All that is on disk is whole at every moment, so that
 * the process may end here. */
static void on_alarm(int number)
{
    static const char text[] = "neupig: stopped on request; run again to go on\n";
    (void)number;
    if (write(STDERR_FILENO, text, sizeof text - 1) < 0) _exit(75);
    _exit(75);
}

/* The first signal stops the run in good order; the second ends the process the usual way. */
static void catch_signals(npg_run *run)
{
    struct sigaction action = {.sa_handler = on_signal, .sa_flags = SA_RESETHAND | SA_RESTART};
    signalled_run = run;
    sigemptyset(&action.sa_mask);
    signal(SIGALRM, on_alarm);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    sigaction(SIGHUP, &action, NULL);
}

static void release_signals(void)
{
    signal(SIGINT, SIG_DFL);
    signal(SIGTERM, SIG_DFL);
    signal(SIGHUP, SIG_DFL);
    signalled_run = NULL;
}

/* ---- the verb ---- */

void npg_run_job_results(const char *verb, const char *output, npg_status status)
{
    static const char *const names[] = {"meshes", "reference.ply", "frames.jsonl", "report.json",
                                        "done.json"};
    char path[4096];
    if (status == NPG_STOPPED) fprintf(stderr, "neupig %s: stopped on request; run again to go on\n", verb);
    if (status == NPG_PARTIAL)
        fprintf(stderr,
                "neupig %s: finished, but with frames skipped or below the quality bar; see %s/report.json\n",
                verb, output);
    if (status < 0 || status == NPG_STOPPED) return;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", output, names[i]);
        if (access(path, F_OK) == 0) printf("%-14s %s\n", names[i], path);
    }
}

npg_status npg_run_job(const npg_options *options, npg_reporter *reporter)
{
    npg_hooks hooks = npg_reporter_hooks(reporter);
    npg_run *run = NULL;
    NPG_TRY(npg_run_open(&run, options, &hooks));
    catch_signals(run);
    npg_status status = npg_run_wait(run);
    npg_reporter_end(reporter, status, npg_options_get(options, "output"));
    release_signals();
    npg_run_close(&run);
    alarm(0); /* closing had its time, too */
    signal(SIGALRM, SIG_DFL);
    return status;
}

static npg_status check_paths(npg_options *options, const npg_cli *cli)
{
    if (cli->operand_count) NPG_TRY(npg_options_set(options, "input", cli->operands[0]));
    if (!npg_options_get(options, "input")[0] && !npg_options_get(options, "follow")[0])
        return npg_error(NPG_USAGE, "no input; usage: neupig run %s", cli->verb->operands);
    if (!strcmp(npg_options_get(options, "pull"), "yes"))
        return npg_error(NPG_USAGE,
                         "option pull is for programs that use the library; nobody would pull here");
    if (!npg_options_get(options, "output")[0])
        return npg_error(NPG_USAGE, "no output folder; say where with -o DIR");
    return NPG_OK;
}

int npg_verb_run(int argc, char **argv)
{
    settings s;
    npg_cli cli;
    npg_reporter reporter;
    npg_options *options = NULL;
    npg_status status = npg_options_open(&options);
    if (!status) status = npg_cli_parse(&cli, argv[0], &s, options, argc, argv);
    if (!status) status = check_paths(options, &cli);
    if (!status) {
        npg_reporter_init(&reporter, s.progress, s.quiet, s.verbose);
        status = npg_run_job(options, &reporter);
        if (reporter.show != NPG_SHOW_JSON)
            npg_run_job_results(argv[0], npg_options_get(options, "output"), status);
    }
    npg_options_close(&options);
    return npg_cli_end(argv[0], status);
}
