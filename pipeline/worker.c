/* Worker: one stage at work in one pass, and what a stage may ask of the run. */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/clock.h"
#include "pipeline/run_internal.h"

void *npg_worker_state(const npg_worker *worker)
{
    return worker->state;
}
const npg_facts *npg_worker_facts(const npg_worker *worker)
{
    return &worker->run->facts;
}

/* Who owns the fact at an offset: they stand in the order of their owners. */
static const char *owner_of(size_t offset)
{
    static const struct {
        size_t end;
        const char *name;
    } owners[] = {
        {offsetof(npg_facts, point_count_max), "ingest"},    {offsetof(npg_facts, brief), "keyframe"},
        {offsetof(npg_facts, unreached_count), "reference"}, {offsetof(npg_facts, reference), "align"},
        {offsetof(npg_facts, has_changed), "mesh"},          {offsetof(npg_facts, is_resumed), "evaluate"}};
    for (size_t i = 0; i < sizeof owners / sizeof *owners; i++)
        if (offset < owners[i].end) return owners[i].name;
    return "job";
}

npg_facts *npg_worker_own_facts(npg_worker *worker, size_t offset, const char *fact)
{
    npg_run *run = worker->run;
    if (worker->stage->begin || !strcmp(worker->name, owner_of(offset))) return &run->facts;
    npg_run_fail(run, worker->name,
                 npg_error(NPG_USAGE, "the fact %s is not stage %s's to write", fact, worker->name));
    return &run->nobodys;
}

npg_status npg_worker_restore_facts(npg_worker *worker, const npg_facts *facts)
{
    NPG_REQUIRE(worker->stage->begin);
    worker->run->facts = *facts;
    return NPG_OK;
}
const npg_settings *npg_worker_settings(const npg_worker *worker)
{
    return &worker->run->settings;
}
const npg_options *npg_worker_options(const npg_worker *worker)
{
    return worker->run->options;
}
npg_pass npg_worker_pass(const npg_worker *worker)
{
    return worker->run->pass;
}
bool npg_worker_stopping(const npg_worker *worker)
{
    return atomic_load(&worker->run->stop);
}
bool npg_worker_should_stop(void *worker)
{
    return npg_worker_stopping(worker);
}
json_t *npg_worker_report(npg_worker *worker)
{
    return worker->report;
}
json_t *npg_worker_run_report(npg_worker *worker)
{
    return worker->run->report;
}

size_t npg_worker_verts_at_most(const npg_worker *worker)
{
    const npg_run *run = worker->run;
    if (run->facts.reference) return run->facts.reference->vert_count;
    for (size_t i = 0; i < run->worker_count; i++)
        if (run->workers[i].stage->verts_at_most)
            return run->workers[i].stage->verts_at_most(&run->workers[i]);
    return 0;
}

bool npg_worker_has_field(const npg_worker *worker, uint32_t field)
{
    for (const npg_worker *before = worker->run->workers; before < worker; before++) {
        const npg_stage *stage = before->stage;
        bool solves = (stage->passes & NPG_PASS_SOLVE) && npg_worker_takes_part(before);
        if (solves && (stage->gives & field)) return true;
    }
    return false;
}

/* ---- facts of stages' own kinds ---- */

static npg_published *find_fact(npg_run *run, const npg_fact_kind *kind)
{
    for (size_t i = 0; i < run->published_count; i++)
        if (run->published[i].kind == kind) return &run->published[i];
    return NULL;
}

npg_status npg_worker_publish(npg_worker *worker, const npg_fact_kind *kind, void *value)
{
    npg_run *run = worker->run;
    npg_status status = NPG_OK;
    pthread_mutex_lock(&run->lock);
    npg_published *taken = find_fact(run, kind);
    bool is_written = taken && taken->value;
    if (strcmp(kind->owner, worker->name) != 0 || is_written ||
        (!taken && run->published_count == NPG_FACTS_MAX))
        status = npg_error(NPG_USAGE, "the fact %s is not stage %s's to write, or is written", kind->name,
                           worker->name);
    else if (taken)
        taken->value = value;
    else
        run->published[run->published_count++] = (npg_published){kind, value};
    pthread_mutex_unlock(&run->lock);
    if (status) kind->release(value);
    return status;
}

static void *read_fact(npg_run *run, const npg_fact_kind *kind, bool takes)
{
    pthread_mutex_lock(&run->lock);
    npg_published *fact = find_fact(run, kind);
    void *value = fact ? fact->value : NULL;
    if (fact && takes) fact->value = NULL;
    pthread_mutex_unlock(&run->lock);
    return value;
}

void *npg_worker_fact(const npg_worker *worker, const npg_fact_kind *kind)
{
    return read_fact(worker->run, kind, false);
}
void *npg_worker_take_fact(npg_worker *worker, const npg_fact_kind *kind)
{
    return read_fact(worker->run, kind, true);
}

npg_status npg_worker_open_latch(npg_worker *worker, npg_latch **latch, int64_t count)
{
    npg_run *run = worker->run;
    NPG_REQUIRE(run->latch_count < NPG_LATCHES_MAX);
    NPG_TRY(npg_latch_open(latch, count));
    pthread_mutex_lock(&run->lock);
    run->latches[run->latch_count++] = *latch;
    pthread_mutex_unlock(&run->lock);
    return NPG_OK;
}

void npg_worker_keep(npg_worker *worker, void *thing, void (*release)(void *thing))
{
    worker->kept = thing;
    worker->release_kept = release;
}
void *npg_worker_kept(const npg_worker *worker)
{
    return worker->kept;
}

npg_status npg_worker_push(npg_worker *worker, npg_chunk **chunk)
{
    if (worker->out) return npg_ring_push(worker->out, chunk);
    npg_chunk_close(chunk);
    return NPG_OK;
}

npg_status npg_worker_feed(npg_worker *worker, npg_chunk **chunk)
{
    NPG_REQUIRE(worker->run->feed);
    return npg_ring_pop(worker->run->feed, chunk);
}

npg_status npg_worker_refuse_job(const npg_worker *worker)
{
    return npg_error(NPG_USAGE,
                     "%s holds another job: %s; "
                     "give --restart to discard what is there, or choose another output folder",
                     npg_worker_settings(worker)->output, npg_error_text());
}

/* ---- log and warnings ---- */

void npg_worker_log(npg_worker *worker, npg_log_level level, int64_t frame, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    npg_run_log(worker->run, level, worker->name, frame, text);
}

static bool is_listed(const json_t *warnings, const json_t *entry)
{
    for (size_t i = 0; i < json_array_size(warnings); i++)
        if (json_equal(json_array_get(warnings, i), entry)) return true;
    return false;
}

void npg_worker_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...)
{
    char text[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    npg_run_log(worker->run, NPG_LOG_WARNING, worker->name, frame, text);
    json_t *entry = json_pack("{ss so}", "stage", worker->name, "message", npg_json_text(text));
    if (frame >= 0) json_object_set_new(entry, "frame", json_integer(frame));
    pthread_mutex_lock(&worker->run->lock);
    /* what a resumed run has warned of before it stopped may come again */
    if (!worker->run->facts.is_resumed || !is_listed(worker->run->warnings, entry)) {
        if (json_array_size(worker->run->warnings) < NPG_WARNINGS_MAX)
            json_array_append(worker->run->warnings, entry);
        worker->run->warning_count++;
    }
    json_decref(entry);
    worker->run->is_partial |= partial;
    pthread_mutex_unlock(&worker->run->lock);
}

/* ---- what a resumed run must have again ---- */

void npg_worker_close_report(npg_worker *worker)
{
    npg_run *run = worker->run;
    pthread_mutex_lock(&run->lock);
    if (run->closed_reports)
        json_object_set_new(run->closed_reports, worker->name, json_deep_copy(worker->report));
    pthread_mutex_unlock(&run->lock);
}

json_t *npg_worker_save_reports(npg_worker *worker)
{
    npg_run *run = worker->run;
    pthread_mutex_lock(&run->lock);
    json_t *saved = json_pack("{so so sb}", "stages", json_deep_copy(run->closed_reports), "warnings",
                              json_deep_copy(run->warnings), "partial", (int)run->is_partial);
    pthread_mutex_unlock(&run->lock);
    return saved;
}

void npg_worker_restore_reports(npg_worker *worker, const json_t *saved)
{
    npg_run *run = worker->run;
    pthread_mutex_lock(&run->lock);
    for (size_t i = 0; i < run->worker_count; i++)
        json_object_update(run->workers[i].report,
                           json_object_get(json_object_get(saved, "stages"), run->workers[i].name));
    json_array_extend(run->warnings, json_object_get(saved, "warnings"));
    run->warning_count += json_array_size(json_object_get(saved, "warnings"));
    run->is_partial |= json_is_true(json_object_get(saved, "partial"));
    pthread_mutex_unlock(&run->lock);
}

npg_status npg_worker_save_stages(const npg_worker *worker, npg_store *out, int64_t read)
{
    const npg_run *run = worker->run;
    for (size_t i = 0; i < run->worker_count; i++)
        if (run->workers[i].is_in_pass && run->workers[i].stage->save)
            NPG_TRY(run->workers[i].stage->save(&run->workers[i], out, read));
    return NPG_OK;
}

/* ---- progress ---- */

void npg_worker_progress(npg_worker *worker, const npg_progress *progress)
{
    npg_run *run = worker->run;
    if (!run->hooks.progress) return;
    npg_progress now = *progress;
    now.struct_size = sizeof now;
    now.stage = worker->name;
    now.elapsed_s = npg_clock_s() - run->begun.wall_s;
    pthread_mutex_lock(&run->lock);
    npg_timeline_advance(worker, &now);
    run->hooks.progress(run->hooks.user, &now);
    pthread_mutex_unlock(&run->lock);
}

void npg_worker_step(npg_worker *worker, double share, int64_t step, int64_t steps)
{
    const npg_progress progress = {.share = share,
                                   .step = step,
                                   .steps = steps,
                                   .windows = 1,
                                   .frames = worker->run->facts.frame_count,
                                   .loss = (double)NAN};
    npg_worker_progress(worker, &progress);
}

/* ---- the thread ---- */

static npg_status work_as_source(npg_worker *worker)
{
    for (;;) {
        npg_chunk *chunk = NULL;
        npg_status status =
            npg_worker_stopping(worker) ? NPG_STOPPED : worker->stage->process(worker, &chunk);
        if (status == NPG_OK && chunk) status = npg_worker_push(worker, &chunk);
        npg_chunk_close(&chunk);
        if (status) return status == NPG_END ? NPG_OK : status;
    }
}

static npg_status work_on_chunks(npg_worker *worker)
{
    for (;;) {
        npg_chunk *chunk = NULL;
        npg_status status = npg_ring_pop(worker->in, &chunk);
        if (status == NPG_END) return NPG_OK;
        if (status == NPG_OK && npg_worker_stopping(worker)) status = NPG_STOPPED;
        if (status == NPG_OK) status = worker->stage->process(worker, &chunk);
        if (status == NPG_OK && chunk) status = npg_worker_push(worker, &chunk);
        npg_chunk_close(&chunk);
        if (status) return status;
    }
}

static npg_status work(npg_worker *worker)
{
    const npg_stage *stage = worker->stage;
    if (stage->init) NPG_TRY(stage->init(worker));
    NPG_TRY(worker->in ? work_on_chunks(worker) : work_as_source(worker));
    return stage->flush ? stage->flush(worker) : NPG_OK;
}

void *npg_worker_main(void *argument)
{
    npg_worker *worker = argument;
    double since = npg_clock_s();
    npg_status status = work(worker);
    if (status) {
        npg_run_fail(worker->run, worker->name, status);
    } else if (worker->out && worker->out != worker->run->results) {
        npg_ring_end(worker->out); /* the results end with the run, when its last files are written */
    }
    worker->wall_s += npg_clock_s() - since;
    worker->cpu_s += npg_clock_thread_s();
    atomic_fetch_add(&worker->run->ended_count, 1);
    sem_post(&worker->run->event);
    return NULL;
}
