/* Timeline: how far a run is, and how long it will still take.
 *
 * Every stage says before a pass how long it expects to take in it and in those to come, and then how much of
 * that is done: share = sum(expected x done) / sum(expected), over all passes.  Where it is wrong by the same
 * factor everywhere, as on a slower machine, nothing is wrong: the time left is the time taken so far, by
 * (1 - share) / share. */
#include <math.h>

#include "pipeline/run_internal.h"

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
    run->fuse_walks = run->fuse_done + run->facts.fuse_left;
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        bool is_there = !worker->stage->takes_part || worker->stage->takes_part(worker);
        bool is_known = !run->facts.is_live && !run->facts.is_resumed && run->facts.point_count_max;
        worker->done = 0;
        for (size_t p = 0; p < NPG_TIMED_PASSES; p++)
            worker->expected_s[p] =
                is_known && is_there && worker->stage->expects ? worker->stage->expects(worker, timed[p]) : 0;
    }
}

/* False where no stage expects anything. */
static bool share_of_run(double *share, const npg_run *run)
{
    double expected = 0, done = 0;
    for (size_t p = 0; p < NPG_TIMED_PASSES; p++) {
        double times = times_walked(run, timed[p]), before = times_done(run, timed[p]);
        for (size_t i = 0; i < run->worker_count; i++) {
            const npg_worker *worker = &run->workers[i];
            expected += times * worker->expected_s[p];
            done += before * worker->expected_s[p];
            if (timed[p] == run->pass) done += worker->done * worker->expected_s[p];
        }
    }
    *share = expected > 0 ? done / expected : 0;
    return expected > 0;
}

/* By the pace since the run began, or, where an earlier one had done a part already, since the first word of
 * progress. */
static double time_left(npg_run *run, const npg_progress *now, bool from_begin)
{
    const npg_progress *first = &run->progress;
    if (!first->struct_size) {
        run->progress = *now;
        if (from_begin) run->progress.share = run->progress.elapsed_s = 0;
    }
    double done = now->share - first->share, taken_s = now->elapsed_s - first->elapsed_s;
    return done > 0 && taken_s > 0 ? (1 - now->share) * taken_s / done : -1;
}

void npg_timeline_advance(npg_worker *worker, npg_progress *progress)
{
    npg_run *run = worker->run;
    double of_run;
    worker->done = fmax(worker->done, fmin(progress->share, 1));
    bool is_timed = share_of_run(&of_run, run);
    if (is_timed) progress->share = of_run;
    progress->share = run->share = fmax(run->share, progress->share);
    progress->left_s = time_left(run, progress, is_timed);
}
