/* Timeline: how far a run is, and how long it will still take.
 *
 * Every stage says before a pass how long it expects to take in it and in those to come, and then how much of
 * that is done: share = sum(expected x done) / sum(expected), over all passes.  Where it is wrong by the same
 * factor everywhere, as on a slower machine, little is wrong: the time left is what is left of the work, at
 * the pace so far.  At the beginning, where one part that was estimated badly would decide the pace, that of
 * the machine which the costs were taken on counts, too, as if it had done a fifth of the run.
 *
 * How long a live source goes on behind the look-ahead nobody knows: its share is 0 until it has ended. */
#include <math.h>
#include <sys/resource.h>
#include <sys/time.h>
#include <unistd.h>

#include "pipeline/cost.h"
#include "pipeline/run_internal.h"

#define PRIOR_SHARE 0.2

static const npg_pass timed[NPG_TIMED_PASSES] = {NPG_PASS_CHOOSE, NPG_PASS_FUSE, NPG_PASS_SOLVE};

/* How often a pass is walked in all. */
static double times_walked(const npg_run *run, npg_pass pass)
{
    if (pass == NPG_PASS_CHOOSE) return run->facts.choice.count > 0;
    return pass == NPG_PASS_FUSE ? (double)run->fuse_walks : 1;
}

/* How often it has been walked, this one not counted. */
static double times_done(const npg_run *run, npg_pass pass)
{
    if (pass == NPG_PASS_FUSE) return (double)run->fuse_done;
    if (pass == NPG_PASS_CHOOSE) return run->pass == NPG_PASS_CHOOSE ? 0 : times_walked(run, pass);
    return 0;
}

void npg_timeline_begin_pass(npg_run *run)
{
    const npg_facts *facts = &run->facts;
    bool is_known = facts->frame_count >= 0 && !facts->is_resumed && facts->point_count_max;
    run->fuse_walks = run->fuse_done + facts->brief.rounds_left;
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        bool expects = is_known && worker->stage->expects && npg_worker_takes_part(worker);
        worker->done = 0;
        for (size_t p = 0; p < NPG_TIMED_PASSES; p++)
            worker->expected_s[p] = expects ? worker->stage->expects(worker, timed[p]) : 0;
    }
}

/* What there is to do and what is done of it; nothing where no stage expects anything. */
typedef struct work {
    double expected_s, done_s;
} work;

static work work_of(const npg_run *run)
{
    work w = {0, 0};
    for (size_t p = 0; p < NPG_TIMED_PASSES; p++) {
        double times = times_walked(run, timed[p]), before = times_done(run, timed[p]);
        for (size_t i = 0; i < run->worker_count; i++) {
            const npg_worker *worker = &run->workers[i];
            double done = before + (timed[p] == run->pass ? worker->done : 0);
            w.expected_s += times * worker->expected_s[p];
            w.done_s += done * worker->expected_s[p];
        }
    }
    return w;
}

static double time_left(const work *w, double elapsed_s)
{
    double prior_s = PRIOR_SHARE * w->expected_s,
           pace = (elapsed_s + prior_s / NPG_COST_BUSY) / (w->done_s + prior_s);
    return fmax(w->expected_s - w->done_s, 0) * pace;
}

/* Where nothing is known of the parts, or an earlier run has done some: by the pace since the first word. */
static double time_left_since(npg_run *run, const npg_progress *now)
{
    const npg_progress *first = &run->progress;
    if (!first->struct_size) run->progress = *now;
    double done = now->share - first->share, taken_s = now->elapsed_s - first->elapsed_s;
    return done > 0 && taken_s > 0 ? (1 - now->share) * taken_s / done : -1;
}

void npg_timeline_advance(npg_worker *worker, npg_progress *progress)
{
    npg_run *run = worker->run;
    worker->done = fmax(worker->done, fmin(progress->share, 1));
    const work w = work_of(run);
    if (w.expected_s > 0) progress->share = w.done_s / w.expected_s;
    if (run->facts.frame_count < 0) progress->share = 0;
    progress->share = run->share = fmax(run->share, progress->share);
    progress->left_s = w.expected_s > 0 ? time_left(&w, progress->elapsed_s) : time_left_since(run, progress);
}

/* ---- how busy the machine is ---- */

static double seconds_of(struct timeval time)
{
    return (double)time.tv_sec + 1e-6 * (double)time.tv_usec;
}

npg_busy npg_busy_now(void)
{
    struct rusage children;
    npg_busy now = {.wall_s = npg_clock_s(), .cpu_s = npg_clock_process_s()};
    if (!getrusage(RUSAGE_CHILDREN, &children))
        now.children_s = seconds_of(children.ru_utime) + seconds_of(children.ru_stime);
    return now;
}

json_t *npg_busy_since(const npg_busy *then)
{
    npg_busy now = npg_busy_now();
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    double wall_s = now.wall_s - then->wall_s, cpu_s = now.cpu_s - then->cpu_s,
           children_s = now.children_s - then->children_s, room_s = wall_s * (double)(cores < 1 ? 1 : cores);
    return json_pack("{s:f, s:f, s:f, s:f}", "wall_s", wall_s, "process_cpu_s", cpu_s, "children_cpu_s",
                     children_s, "busy_share", room_s > 0 ? (cpu_s + children_s) / room_s : 0.0);
}
