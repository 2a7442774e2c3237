/* What run.c and worker.c share. */
#ifndef NPG_RUN_INTERNAL_H
#define NPG_RUN_INTERNAL_H

#include <pthread.h>
#include <semaphore.h>
#include <stdatomic.h>

#include "pipeline/clock.h"
#include "pipeline/options.h"
#include "pipeline/ring.h"
#include "pipeline/stage.h"

#define NPG_STAGES_MAX   17
#define NPG_FACTS_MAX    8 /* of stages' own kinds */
#define NPG_LATCHES_MAX  4
#define NPG_WARNINGS_MAX 1000 /* that the report lists; the log gets all */

#define NPG_TIMED_PASSES 3 /* CHOOSE, FUSE, SOLVE */

/* ---- stages that a program adds (custom_stage.c) ---- */

typedef struct npg_custom {
    npg_stage stage; /* first: what the worker points to */
    npg_custom_stage given;
    uint32_t fields; /* NPG_FIELD_* that frames and facts have where it stands */
} npg_custom;

/* A stage for `given` (a loan that outlives it), to stand right after `before` in a chain that has `fields`
 * there. */
npg_custom npg_custom_make(const npg_custom_stage *given, const npg_stage *before, uint32_t fields);

/* ---- a run ---- */

/* One stage at work. */
struct npg_worker {
    npg_run *run;
    const char *name;
    const npg_stage *stage;
    bool is_in_pass;
    void *state;        /* state_size bytes of the stage, owned, for one pass */
    npg_ring *in, *out; /* loans; in is NULL for the first, out for the last without pull */
    pthread_t thread;
    bool started;
    double expected_s[NPG_TIMED_PASSES],
        done;             /* of its work in each pass; share done in this one; under lock */
    double wall_s, cpu_s; /* of the passes so far: of the thread's life, and of its processor time */
    json_t *report;       /* loan from the run's report */
    void *kept;           /* owned for the run's whole life, see npg_worker_keep */
    void (*release_kept)(void *thing);
};

/* Whether the stage is in the chain under the run's options (npg_stage.takes_part). */
static inline bool npg_worker_takes_part(const npg_worker *worker)
{
    return !worker->stage->takes_part || worker->stage->takes_part(worker);
}

typedef struct npg_published {
    const npg_fact_kind *kind;
    void *value; /* owned; NULL once it was taken */
} npg_published;

struct npg_run {
    npg_options *options; /* owned */
    npg_settings settings;
    npg_hooks hooks;
    npg_facts facts, nobodys; /* what a stage writes of another stage's facts goes nowhere */
    npg_busy begun;           /* when it was opened */

    pthread_mutex_t lock; /* guards what follows up to the rings, and calls of the hooks */
    npg_status first_failure;
    char failure_text[1024], failure_stage[32];
    bool is_partial;
    int64_t warning_count;
    npg_progress progress;     /* the first one: the time left follows from the pace since */
    double share;              /* the last one told: it never goes back */
    int64_t fuse_done;         /* fusing passes walked */
    int64_t fuse_walks;        /* and to be walked, as it was when this pass began */
    json_t *report, *warnings; /* owned */
    json_t *closed_reports;    /* of stages: before the solving pass, or as they were closed; owned */
    npg_published published[NPG_FACTS_MAX];
    size_t published_count;

    atomic_bool stop;
    atomic_size_t ended_count; /* workers of the pass that have ended */
    sem_t event;               /* posted when a worker ends and when a stop is asked for */
    npg_pass pass;
    npg_worker workers[NPG_STAGES_MAX];
    size_t worker_count;
    npg_custom custom[NPG_CUSTOM_STAGES_MAX]; /* what some of the workers' stages point to */
    npg_latch *begun_latch;                   /* 1: the stages have begun; one of: */
    npg_latch *latches[NPG_LATCHES_MAX];      /* owned, for the run's whole life; only under lock */
    size_t latch_count;
    npg_ring *
        rings[NPG_STAGES_MAX]; /* rings[i] leads from worker i to i + 1 of the pass; owned; only under lock */
    size_t ring_count;
    npg_ring *feed, *results; /* push -> ingest, last stage -> pull; owned, for the run's whole life */

    pthread_t conductor;
    bool conductor_started;
    pthread_mutex_t join_lock; /* guards what follows: any thread may wait for the conductor */
    bool conductor_joined;
    npg_status end_status;
    int64_t pushed_number;
    npg_chunk *pulled; /* the chunk whose frames are being pulled */
    size_t pulled_at;
};

/* ---- the time left (timeline.c) ---- */

/* Before a pass, whose states are there and whose threads are not: what its stages expect in it and in the
 * passes to come. */
void npg_timeline_begin_pass(npg_run *run);

/* The share of the run that is done when the worker has done `share` of its work in this pass, and the
 * seconds left, -1 while there is no pace yet.  Under the lock. */
void npg_timeline_advance(npg_worker *worker, npg_progress *progress);

/* npg_run_open() with another chain in place of npg_chain. */
npg_status npg_run_open_chain(npg_run **run, const npg_options *options, const npg_hooks *hooks,
                              const npg_stage *const *chain);

/* Remember the first failure of the run and wake everybody.  NPG_ABORTED is the echo of an earlier failure;
 * where there was none, somebody closed the run's ends, and the run was stopped. */
void npg_run_fail(npg_run *run, const char *stage, npg_status status);

/* The body of a stage's thread: init, process until the end, flush, uninit.
 * The argument is the npg_worker. */
void *npg_worker_main(void *worker);

/* A log record through the run's hook. */
void npg_run_log(npg_run *run, npg_log_level level, const char *stage, int64_t frame, const char *message);

#endif
