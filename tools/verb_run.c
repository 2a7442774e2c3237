/* neupig run: the main job. */
#include <pthread.h>
#include <signal.h>
#include <stddef.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "pipeline/json_file.h"
#include "tools/cli.h"
#include "tools/progress.h"
#include "tools/segments/segments.h"

typedef struct settings {
    const char *log_file;
    npg_reporter_settings shown;
    int segments;
} settings;

#define AT(member) offsetof(settings, member)

/* clang-format off */
const npg_option npg_run_verb_options[] = {
    /* type        name        place         default  words or shown as */
    NPG_REPORTER_ROWS(AT(shown)),
    NPG_ROW_TEXT  ("log-file", AT(log_file), "",      "FILE",
        "Append the log to FILE, one JSON object per line"),
    NPG_ROW_CHOICE("segments", AT(segments), "one",   "one|auto",
        "Where the topology changes: one reference, or others from there on. With one an alarm says from "
        "where; with auto each has its frames in OUT/segment_*"),
    {0}};
/* clang-format on */

/* ---- signals ---- */

#define STOP_SECONDS  4 /* a run that has not stopped by then is ended */
#define AGAIN_SECONDS 1 /* schedulers signal every process of a job, and the parent passes its own on */

typedef struct watcher {
    npg_run *run;         /* loan */
    sigset_t all, before; /* what it waits for, and the mask to go back to */
    pthread_t thread;
    bool started;
} watcher;

/* Signals are blocked in every thread and waited for in one, so that no handler ever runs: the OpenCL
 * compiler installs one itself, which removes files that other threads are at work on. */
void npg_signals_block(sigset_t *all, sigset_t *before, int more)
{
    static const int numbers[] = {SIGINT, SIGTERM, SIGHUP};
    sigemptyset(all);
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++) {
        struct sigaction now;
        if (!sigaction(numbers[i], NULL, &now) && now.sa_handler != SIG_IGN) sigaddset(all, numbers[i]);
    }
    sigaddset(all, more);
    pthread_sigmask(SIG_BLOCK, all, before);
}

/* The second request, or -1 where none comes in time: one that comes right after the first is the same one on another
 * way. */
static int wait_for_second(const watcher *w)
{
    const struct timespec tick = {.tv_nsec = 100000000};
    for (double begin_s = npg_clock_s(); npg_clock_s() < begin_s + STOP_SECONDS;) {
        int number = sigtimedwait(&w->all, NULL, &tick);
        if (number == SIGUSR1 || (number > 0 && npg_clock_s() > begin_s + AGAIN_SECONDS)) return number;
    }
    return -1;
}

/* The first signal stops the run in good order; the second ends the process the usual way.
 * Where something that can't be interrupted takes too long the process ends, too:
 * all that is on disk is whole at every moment. */
static void *watch_signals(void *argument)
{
    static const char text[] = "neupig: stopped on request; run again to resume\n";
    const watcher *w = argument;
    int number;
    do number = sigwaitinfo(&w->all, NULL);
    while (number < 0);
    if (number == SIGUSR1) return NULL;
    npg_run_stop(w->run);
    number = wait_for_second(w);
    if (number == SIGUSR1) return NULL;
    if (number < 0) {
        ssize_t written = write(STDERR_FILENO, text, sizeof text - 1);
        _exit(written < 0 ? 75 : npg_status_exit_code(NPG_STOPPED));
    }
    signal(number, SIG_DFL);
    pthread_sigmask(SIG_UNBLOCK, &w->all, NULL);
    raise(number);
    return NULL;
}

static npg_status start_watching(watcher *w, npg_run *run)
{
    w->run = run;
    w->started = !pthread_create(&w->thread, NULL, watch_signals, w);
    return w->started ? NPG_OK : npg_error(NPG_FAILED, "can't start a thread");
}

static void end_watching(watcher *w)
{
    if (w->started) {
        pthread_kill(w->thread, SIGUSR1);
        pthread_join(w->thread, NULL);
    }
    pthread_sigmask(SIG_SETMASK, &w->before, NULL);
}

/* ---- the verb ---- */

/* How good it is, and how to look at it: of a folder, or of each of its segments. */
static void print_verdicts(const char *output, int depth)
{
    json_t *done = npg_json_in(output, "done.json"), *entry;
    const char *verdict = json_string_value(json_object_get(done, "verdict"));
    size_t i;
    if (verdict) printf("%s: neupig view %s\n", verdict, output);
    json_array_foreach(json_object_get(done, "files"), i, entry)
    {
        char folder[NPG_PATH_SIZE];
        const char *name = json_string_value(json_object_get(entry, "path"));
        char *end =
            name && !depth && !npg_path_of(folder, output, name) ? strstr(folder, "/done.json") : NULL;
        if (!end) continue;
        *end = 0;
        print_verdicts(folder, 1);
    }
    json_decref(done);
}

void npg_run_job_results(const char *verb, const char *output, npg_status status)
{
    static const char *const names[] = {"meshes",      "reference.ply", "frames.jsonl",
                                        "report.json", "segments.json", "done.json"};
    char path[4096];
    if (status == NPG_STOPPED) fprintf(stderr, "neupig %s: stopped on request; run again to resume\n", verb);
    if (status == NPG_PARTIAL)
        fprintf(stderr,
                "neupig %s: finished, but with frames skipped, unexplained or below the quality bar; "
                "see the warnings, or %s/report.json\n",
                verb, output);
    if (status == NPG_CHANGED)
        fprintf(stderr, "neupig %s: ended where the topology changed; see %s/topology.json\n", verb, output);
    if (status < 0 || status == NPG_STOPPED || status == NPG_CHANGED) return;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", output, names[i]);
        if (npg_is_there(path)) printf("%-14s %s\n", names[i], path);
    }
    print_verdicts(output, 0);
}

npg_status npg_run_once(const npg_options *options, npg_reporter *reporter)
{
    npg_hooks hooks = npg_reporter_hooks(reporter);
    npg_run *run = NULL;
    watcher signals = {.run = NULL};
    npg_signals_block(&signals.all, &signals.before, SIGUSR1); /* which says that the run has ended */
    npg_status status = npg_run_open(&run, options, &hooks);
    if (!status) status = start_watching(&signals, run);
    if (!status) status = npg_run_wait(run);
    end_watching(&signals);
    npg_run_close(&run);
    return status;
}

npg_status npg_run_job(const npg_options *options, npg_reporter *reporter)
{
    npg_status status = npg_run_once(options, reporter);
    npg_reporter_end(reporter, status, npg_options_get(options, "output"));
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

npg_status npg_verb_run(const npg_cli *cli)
{
    const settings *s = cli->values;
    const char *verb = cli->verb->name, *output;
    npg_reporter reporter;
    NPG_TRY(check_paths(cli->options, cli));
    output = npg_options_get(cli->options, "output");
    npg_reporter_init(&reporter, &s->shown);
    npg_status status = npg_reporter_open_log(&reporter, s->log_file, output);
    if (!status && s->segments == NPG_SEGMENTS_AUTO) {
        status = npg_segments_run(cli->options, &reporter);
    } else if (!status) {
        status = npg_segments_require_none(cli->options);
        if (!status) status = npg_run_job(cli->options, &reporter);
    }
    if (reporter.show != NPG_SHOW_JSON) npg_run_job_results(verb, output, status);
    return status;
}
