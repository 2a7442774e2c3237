/* Run of a batch: which captures are at work, signals, progress. */
#include "tools/batch/batch.h"

#include <math.h>
#include <signal.h>

#include "pipeline/clock.h"
#include "pipeline/json_file.h"
#include "pipeline/memory.h"

#define TICK_MS       200 /* between two looks at time and memory of the runs */
#define AGAIN_SECONDS 1   /* a second signal sooner than that is the first on another way */

typedef struct work {
    npg_batch *batch;
    npg_reporter *reporter;
    npg_hooks hooks;
    npg_process *processes; /* `places` of them, owned */
    size_t places, running, next, mine, ended;
    size_t worked;    /* captures ended that were not done before */
    sigset_t signals; /* that are waited for */
    double begun_s, stopped_s;
    bool stopped;
} work;

/* ---- reports ---- */

static void report_start(work *w, const npg_capture *capture)
{
    npg_reporter_log(w->reporter, NPG_LOG_INFO, npg_clock_s() - w->begun_s, capture->name,
                     "started (%zu of %zu)", w->ended + w->running + 1, w->mine);
    npg_reporter_print(w->reporter,
                       json_pack("{s:s,s:o}", "event", "start", "name", npg_json_text(capture->name)));
}

static void report_end(work *w, const npg_capture *capture)
{
    const npg_verdict *v = &capture->verdict;
    npg_log_level level = v->exit_code == 0   ? NPG_LOG_INFO
                          : v->exit_code == 7 ? NPG_LOG_WARNING
                                              : NPG_LOG_ERROR;
    if (v->was_done)
        npg_reporter_log(w->reporter, level, npg_clock_s() - w->begun_s, capture->name,
                         "was done already%s%s", *v->message ? ": " : "", v->message);
    else
        npg_reporter_log(w->reporter, level, npg_clock_s() - w->begun_s, capture->name, "%s after %.0f s%s%s",
                         v->word, v->seconds, *v->message ? ": " : "", v->message);
    npg_reporter_print(w->reporter, npg_verdict_record(capture));
}

/* ---- progress ---- */

/* What was done before took no time, so it is left out of the estimate of the rest. */
static void report_progress(work *w)
{
    double done = (double)w->worked, skipped = (double)(w->ended - w->worked),
           elapsed_s = npg_clock_s() - w->begun_s;
    const char *name = "";
    for (size_t i = 0; i < w->places; i++) {
        const npg_process *p = &w->processes[i];
        if (!p->capture) continue;
        done += json_number_value(json_object_get(p->progress, "share"));
        name = p->capture->name;
    }
    double all = (double)w->mine - skipped;
    npg_progress progress = {.struct_size = sizeof progress,
                             .stage = name,
                             .share = w->mine ? (done + skipped) / (double)w->mine : 1,
                             .elapsed_s = elapsed_s,
                             .left_s = done > 0 ? elapsed_s * (all - done) / done : -1,
                             .step = (int64_t)w->ended,
                             .steps = (int64_t)w->mine,
                             .loss = (double)NAN};
    if (w->reporter->show == NPG_SHOW_BAR) w->hooks.progress(w->hooks.user, &progress);
}

static void print_progress(const work *w, const npg_process *p)
{
    json_t *record = json_pack("{s:s,s:o}", "event", "progress", "name", npg_json_text(p->capture->name));
    json_object_update_missing(record, p->progress);
    npg_reporter_print(w->reporter, record);
}

/* ---- signals ---- */

/* Wait for a signal, the end of a run among them, or the next look, and take all that have come. */
static void take_signals(work *w, long wait_ms)
{
    int number;
    for (; (number = sigtimedwait(&w->signals, NULL, &(struct timespec){.tv_nsec = 1000000 * wait_ms})) > 0;
         wait_ms = 0) {
        double now_s = npg_clock_s();
        if (number == SIGCHLD || (w->stopped && now_s < w->stopped_s + AGAIN_SECONDS)) continue;
        if (!w->stopped)
            npg_reporter_log(w->reporter, NPG_LOG_WARNING, now_s - w->begun_s, "batch",
                             "stopping on request: the runs write their states");
        w->stopped = true;
        w->stopped_s = now_s;
        for (size_t i = 0; i < w->places; i++)
            if (w->processes[i].capture) npg_process_stop(&w->processes[i], NPG_STOP_REQUEST);
    }
}

/* ---- captures ---- */

static void count_end(work *w, const npg_capture *capture)
{
    w->ended++;
    w->worked += !capture->verdict.was_done;
    report_end(w, capture);
}

static void start_next(work *w, size_t place)
{
    while (w->next < w->batch->count && !npg_batch_is_mine(w->batch, w->next)) w->next++;
    if (w->next == w->batch->count) return;
    npg_capture *capture = &w->batch->captures[w->next++];
    report_start(w, capture);
    npg_status status =
        capture->refusal ? npg_verdict_refuse(capture) : npg_process_start(&w->processes[place], capture);
    if (!status && !capture->refusal) {
        w->running++;
        return;
    }
    if (status) npg_verdict_fail(&capture->verdict, status, npg_error_text());
    count_end(w, capture);
}

static void start_some(work *w)
{
    for (size_t i = 0; i < w->places && !w->stopped; i++)
        while (!w->processes[i].capture && w->next < w->batch->count) start_next(w, i);
}

static void serve_process(work *w, size_t i)
{
    npg_process *p = &w->processes[i];
    npg_capture *capture = p->capture;
    bool ended;
    if (npg_process_read(p)) print_progress(w, p);
    npg_process_watch(p);
    npg_status status = npg_process_reap(p, &ended);
    if (!ended) return;
    if (status) npg_verdict_fail(&capture->verdict, status, npg_error_text());
    p->capture = NULL;
    w->running--;
    count_end(w, capture);
}

static void run_all(work *w)
{
    for (;;) {
        start_some(w);
        if (!w->running) return;
        report_progress(w);
        take_signals(w, TICK_MS);
        for (size_t i = 0; i < w->places; i++)
            if (w->processes[i].capture) serve_process(w, i);
    }
}

npg_status npg_batch_run(npg_batch *batch, npg_reporter *reporter, size_t jobs, bool *stopped)
{
    work w = {.batch = batch,
              .reporter = reporter,
              .hooks = npg_reporter_hooks(reporter),
              .begun_s = npg_clock_s()};
    sigset_t before;
    for (size_t i = 0; i < batch->count; i++) w.mine += npg_batch_is_mine(batch, i);
    w.places = jobs < w.mine ? jobs : w.mine;
    npg_status status = npg_alloc_array(&w.processes, NPG_FOR_RUN, w.places, sizeof *w.processes);
    npg_signals_block(&w.signals, &before, SIGCHLD);
    if (!status) run_all(&w);
    take_signals(&w, 0); /* one that came at the very end */
    sigprocmask(SIG_SETMASK, &before, NULL);
    for (size_t i = 0; i < batch->count; i++)
        if (!batch->captures[i].verdict.is_known)
            npg_verdict_read(&batch->captures[i].verdict, &batch->captures[i]);
    *stopped = w.stopped;
    npg_release(&w.processes);
    return status;
}
