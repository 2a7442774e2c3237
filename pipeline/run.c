/* Run: builds the chain, walks the capture through it in passes, and is what the public
 * interface talks to. */
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>
#include <sys/resource.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "pipeline/file.h"
#include "pipeline/run_internal.h"
#include "pipeline/struct_size.h"

#define AT(member) offsetof(npg_settings, member)

/* clang-format off */
const npg_option npg_run_options[] = {
    /* type               name          place               default      least most  shown as or words */
    NPG_PROGRAM_ROW(TEXT, "input",      AT(input),          "",          "PATH",
        "Folder, pattern (frame_%04d.ply), list file, a rig of depth sensors (rig.json, or a folder of "
        "depth images), or - for standard input; empty: frames are pushed"),
    NPG_ROW_TEXT(         "follow",     AT(follow),         "",          "DIR",
        "A folder that grows: its files are frames as they are complete. Or a pattern of file names in it "
        "(DIR/scan_*.ply); takes the place of INPUT"),
    NPG_ROW_TEXT(         "reference",  AT(reference),      "",          "FILE",
        "Your own mesh instead of a reconstructed one. PLY or OBJ, in the capture's units and the pose of a "
        "frame"),
    NPG_ROW_TEXT(         "output",     AT(output),         "",          "DIR",
        "Folder for the results (also -o). In the library empty: results are only pulled"),
    NPG_ROW_CHOICE(       "colour",     AT(colour),         "reference", "reference|frames|no",
        "Colours of points that have any. One per vertex, the robust mean of all frames that saw it "
        "(reference), as each frame saw it (frames), or none (no)"),
    NPG_ROW_CHOICE(       "method",     AT(method),         "default",
        "default|paper|paper-1000|grids",
        "How it is done: a name, a JSON file, or '{\"KEY\": VALUE}'. Several add up; neupig help method "
        "lists names and keys"),
    NPG_ROW_CHOICE(       "effort",     AT(effort),         "usual",     "quick|usual|best",
        "How long may be looked for the reference. A first look, from one frame that is not compared with others "
        "(quick); all frames' points, and another keyframe where frames fail with the one chosen (usual); these "
        "points gathered twice, and more keyframes (best)"),
    NPG_ROW_TEXT(         "device",     AT(device),         "auto",      "DEVICE",
        "OpenCL device, for the methods paper and grids. Part of its name, its number, or auto (neupig "
        "doctor lists them)"),
    NPG_ROW_INT(          "seed",       AT(seed),           "0",         0, 4294967295.0, NULL,
        "Seed of all random numbers"),
    NPG_ROW_FLAG(         "keep-going", AT(keep_going),     "no",
        "Leave out frames that can't be used. Without it they stop the run; with it there is exit code 7 at "
        "the end"),
    NPG_ROW_FLAG(         "confine",    AT(confine),        "no",
        "For folders of unknown origin: refuse frames outside the input's folder (links, paths in a list), "
        "and links in the place of the output's own folders; "
        "in a batch it is on unless the batch says otherwise"),
    NPG_PROGRAM_ROW(INT,  "ring",       AT(ring_capacity),  "2",         1, 1024, NULL,
        "Chunks that may wait between two stages"),
    NPG_PROGRAM_ROW(INT,  "chunk",      AT(chunk_frames),   "4",         1, 1024, NULL,
        "Frames per chunk"),
    NPG_ROW_INT(          "max-memory", AT(max_memory_mib), "0",         0, 1e9,  "MIB",
        "Stop rather than take more memory than this. What neupig takes itself; the process has code, libraries "
        "and the device's compiler besides, and a warning says where it passed the limit. 0: no limit"),
    NPG_PROGRAM_ROW(FLAG, "pull",       AT(pull),           "no",
        "Finished frames are also pulled through the library"),
    {0}};
/* clang-format on */

/* ---- failure and log ---- */

void npg_run_fail(npg_run *run, const char *stage, npg_status status)
{
    pthread_mutex_lock(&run->lock);
    if (status == NPG_ABORTED) status = NPG_STOPPED;
    if (!run->first_failure) {
        run->first_failure = status;
        snprintf(run->failure_text, sizeof run->failure_text, "%s",
                 status == NPG_STOPPED ? "stopped on request" : npg_error_text());
        snprintf(run->failure_stage, sizeof run->failure_stage, "%s", stage);
    }
    atomic_store(&run->stop, true);
    for (size_t i = 0; i < run->ring_count; i++) npg_ring_abort(run->rings[i]);
    if (run->feed) npg_ring_abort(run->feed);
    if (run->results) npg_ring_abort(run->results);
    for (size_t i = 0; i < run->latch_count; i++) npg_latch_abort(run->latches[i]);
    pthread_mutex_unlock(&run->lock);
}

void npg_run_log(npg_run *run, npg_log_level level, const char *stage, int64_t frame, const char *message)
{
    if (!run->hooks.log) return;
    npg_log_record record = {sizeof record, level, npg_clock_s() - run->begun.wall_s, stage, frame, message};
    pthread_mutex_lock(&run->lock);
    run->hooks.log(run->hooks.user, &record);
    pthread_mutex_unlock(&run->lock);
}

/* ---- memory formula ---- */

/* The bound on memory to the log and the report. */
static void announce_memory(npg_run *run)
{
    const npg_facts *facts = &run->facts;
    size_t verts = npg_worker_verts_at_most(&run->workers[0]);
    size_t frame_bytes = facts->point_count_max * 6 * sizeof(float) + verts * 3 * sizeof(float) +
                         facts->view_count_max * NPG_VIEW_SIDE * NPG_VIEW_SIDE * sizeof(float);
    size_t chunk_bytes = frame_bytes * (size_t)run->settings.chunk_frames;
    size_t rings = 0, held = 0, stages = 0;
    json_t *parts = json_object();
    for (size_t i = 0; i < run->worker_count; i++) {
        const npg_worker *worker = &run->workers[i];
        if (!worker->is_in_pass) continue;
        size_t chunks = 1, bytes = worker->stage->memory ? worker->stage->memory(worker, &chunks) : 0;
        rings += (size_t)run->settings.ring_capacity;
        held += chunks;
        stages += bytes;
        json_object_set_new(parts, worker->name, json_integer((json_int_t)(bytes + chunks * chunk_bytes)));
    }
    size_t total = (rings + held) * chunk_bytes + stages;
    char text[256];
    snprintf(
        text, sizeof text,
        "memory: (%zu chunks in rings + %zu held by stages) x %.2f MiB + stages %.0f MiB = %.0f MiB at most",
        rings, held, (double)chunk_bytes / 1048576, (double)stages / 1048576, (double)total / 1048576);
    npg_run_log(run, NPG_LOG_INFO, "run", -1, text);
    json_object_set_new(parts, "rings", json_integer((json_int_t)(rings * chunk_bytes)));
    json_object_set_new(parts, "total", json_integer((json_int_t)total));
    json_t *before = json_object_get(json_object_get(run->report, "memory_bound_bytes"), "total");
    if (before && (size_t)json_integer_value(before) > total) /* a fusing pass that takes more */
        json_decref(parts);
    else
        json_object_set_new(run->report, "memory_bound_bytes", parts);
}

/* ---- one pass ---- */

static npg_status open_state(npg_worker *worker)
{
    NPG_TRY(npg_alloc(&worker->state, NPG_FOR_RUN, worker->stage->state_size + 1)); /* it may have none */
    npg_options_fill(worker->run->options, worker->stage->options, worker->state);
    return NPG_OK;
}

/* States of all stages, those that sit this pass out as well: others may ask them (memory, verts_at_most). */
static npg_status open_worker_states(npg_run *run)
{
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        const npg_stage *stage = worker->stage;
        NPG_TRY(open_state(worker));
        worker->is_in_pass = (stage->passes & run->pass) && npg_worker_takes_part(worker);
    }
    return NPG_OK;
}

static npg_status open_rings(npg_run *run)
{
    npg_worker *last = NULL;
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        worker->in = worker->out = NULL;
        if (!worker->is_in_pass) continue;
        if (last) {
            npg_ring *ring;
            NPG_TRY(npg_ring_open(&ring, (size_t)run->settings.ring_capacity));
            pthread_mutex_lock(&run->lock);
            run->rings[run->ring_count++] = ring;
            pthread_mutex_unlock(&run->lock);
            worker->in = last->out = ring;
        }
        last = worker;
    }
    if (run->pass == NPG_PASS_SOLVE && run->results) last->out = run->results;
    return NPG_OK;
}

static void note_waits(const npg_worker *worker)
{
    double push_s = 0, pop_s = 0, unused;
    if (worker->out) npg_ring_waits(worker->out, &push_s, &unused);
    if (worker->in) npg_ring_waits(worker->in, &unused, &pop_s);
    json_t *r = worker->report;
    push_s += json_real_value(json_object_get(r, "waited_for_next_s"));
    pop_s += json_real_value(json_object_get(r, "waited_for_previous_s"));
    json_object_update_new(r, json_pack("{sf sf sf sf}", "wall_s", worker->wall_s, "cpu_s", worker->cpu_s,
                                        "waited_for_previous_s", pop_s, "waited_for_next_s", push_s));
}

/* Somebody outside may be what a stage waits for, or another stage that waits for somebody outside; after a
 * request to stop it must not be. */
static void close_ends(npg_run *run)
{
    if (run->feed) npg_ring_abort(run->feed);
    if (run->results) npg_ring_abort(run->results);
    pthread_mutex_lock(&run->lock);
    for (size_t i = 0; i < run->latch_count; i++) npg_latch_abort(run->latches[i]);
    pthread_mutex_unlock(&run->lock);
}

static void wait_for_workers(npg_run *run)
{
    size_t started_count = 0;
    for (size_t i = 0; i < run->worker_count; i++) started_count += run->workers[i].started;
    while (atomic_load(&run->ended_count) < started_count) {
        if (atomic_load(&run->stop)) close_ends(run);
        while (sem_wait(&run->event) && errno == EINTR) {
        }
    }
}

static void join_workers(npg_run *run)
{
    wait_for_workers(run);
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        if (!worker->started) continue;
        pthread_join(worker->thread, NULL);
        note_waits(worker);
    }
}

/* Against the data's way: what a pass came to is known at its end, what follows from it is done at its beginning. */
static npg_status settle_pass(npg_run *run)
{
    for (size_t i = run->worker_count; i-- > 0;) {
        npg_worker *worker = &run->workers[i];
        if (worker->started && worker->stage->settle) NPG_TRY(worker->stage->settle(worker));
    }
    return NPG_OK;
}

static void close_pass(npg_run *run)
{
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        if (worker->started && worker->stage->uninit) worker->stage->uninit(worker);
        worker->started = false;
        npg_release(&worker->state);
    }
    pthread_mutex_lock(&run->lock);
    while (run->ring_count) npg_ring_close(&run->rings[--run->ring_count]);
    pthread_mutex_unlock(&run->lock);
}

/* Fail the pass when no thread could be started any more. */
static npg_status start_threads(npg_run *run)
{
    for (size_t i = 0; i < run->worker_count; i++) {
        npg_worker *worker = &run->workers[i];
        if (!worker->is_in_pass) continue;
        if (pthread_create(&worker->thread, NULL, npg_worker_main, worker))
            return npg_error(NPG_FAILED, "can't start the thread of stage %s", worker->name);
        worker->started = true;
    }
    return NPG_OK;
}

/* In the order of their bits. */
static const char *const pass_names[] = {"measure", "score", "solve", "choose", "fuse"};

/* How busy the machine was, pass by pass: the list of the report. */
static void report_pass(npg_run *run, const npg_busy *begun)
{
    json_t *passes = json_object_get(run->report, "passes"), *entry = npg_busy_since(begun);
    json_object_set_new(entry, "pass", json_string(pass_names[ffs((int)run->pass) - 1]));
    if (!passes) json_object_set_new(run->report, "passes", passes = json_array());
    json_array_append_new(passes, entry);
}

static npg_status do_pass(npg_run *run, npg_pass pass)
{
    npg_busy begun = npg_busy_now();
    run->pass = pass;
    atomic_store(&run->ended_count, 0);
    npg_status status = open_worker_states(run);
    bool is_heavy = pass == NPG_PASS_FUSE || pass == NPG_PASS_SOLVE;
    if (!status) npg_timeline_begin_pass(run);
    if (!status && is_heavy) announce_memory(run);
    if (!status) status = open_rings(run);
    if (!status) status = start_threads(run);
    if (status) npg_run_fail(run, "run", status);
    join_workers(run);
    if (!run->first_failure && (status = settle_pass(run))) npg_run_fail(run, "run", status);
    close_pass(run);
    report_pass(run, &begun);
    return run->first_failure;
}

/* ---- the conductor ---- */

/* What the process ever had resident: other libraries, compiled kernels and free pages
 * of the heap as well. */
static json_int_t resident_peak(void)
{
    struct rusage usage;
    return getrusage(RUSAGE_SELF, &usage) ? 0 : (json_int_t)usage.ru_maxrss * 1024;
}

/* Where option max-memory held and the process is larger all the same. */
static void warn_of_resident(npg_run *run)
{
    char text[256];
    long long limit = run->settings.max_memory_mib, had = (long long)(resident_peak() >> 20);
    if (!limit || had <= limit) return;
    snprintf(
        text, sizeof text,
        "the process had %lld MiB in memory, more than max-memory (%lld MiB): %zu MiB were taken by neupig, the "
        "rest are code, libraries and what these take",
        had, limit, npg_memory_peak() >> 20);
    npg_run_log(run, NPG_LOG_WARNING, "run", -1, text);
}

/* Of each stage, where a run has ended, or was done before. */
static npg_status have_last_words(npg_run *run, bool again)
{
    npg_status status = open_worker_states(run);
    for (size_t i = 0; i < run->worker_count && !status; i++) {
        npg_worker *worker = &run->workers[i];
        npg_status (*word)(npg_worker *) = again ? worker->stage->again : worker->stage->conclude;
        if (word) status = word(worker);
    }
    for (size_t i = 0; i < run->worker_count; i++) npg_release(&run->workers[i].state);
    if (status) npg_run_fail(run, "run", status);
    return status;
}

static npg_status conclude(npg_run *run)
{
    json_t *r = run->report;
    warn_of_resident(run);
    json_object_update_new(r, npg_busy_since(&run->begun));
    json_object_update_new(r, json_pack("{ss sI si si sI sI}", "status", run->is_partial ? "partial" : "ok",
                                        "warning_count", (json_int_t)run->warning_count, "exit_code",
                                        run->is_partial ? 7 : 0, "cores", (int)sysconf(_SC_NPROCESSORS_ONLN),
                                        "memory_peak_bytes", (json_int_t)npg_memory_peak(),
                                        "resident_peak_bytes", resident_peak()));
    return have_last_words(run, false);
}

static npg_status begin(npg_run *run)
{
    npg_status status = NPG_OK;
    for (size_t i = 0; i < run->worker_count && !status; i++) {
        npg_worker *worker = &run->workers[i];
        if (!worker->stage->begin) continue;
        status = open_state(worker);
        if (!status) status = worker->stage->begin(worker);
        if (status && status != NPG_END) npg_run_fail(run, worker->name, status);
        npg_release(&worker->state);
    }
    return status;
}

static npg_status choose(npg_run *run)
{
    do NPG_TRY(do_pass(run, NPG_PASS_CHOOSE));
    while (run->facts.brief.compares);
    return NPG_OK;
}

static npg_status do_passes(npg_run *run)
{
    npg_status begun = begin(run);
    if (begun == NPG_END) npg_latch_abort(run->begun_latch); /* nobody waits for passes that never come */
    if (begun) return begun == NPG_END ? have_last_words(run, true) : begun;
    npg_latch_raise(run->begun_latch, 1);
    if (!run->facts.is_resumed) {
        NPG_TRY(do_pass(run, NPG_PASS_MEASURE));
        NPG_TRY(do_pass(run, NPG_PASS_SCORE));
        if (run->facts.choice.count) NPG_TRY(choose(run));
        for (; run->facts.brief.rounds_left; run->fuse_done++) {
            NPG_TRY(do_pass(run, NPG_PASS_FUSE));
            if (run->facts.brief.compares) NPG_TRY(choose(run));
        }
    }
    run->closed_reports = json_deep_copy(json_object_get(run->report, "stages"));
    NPG_TRY(do_pass(run, NPG_PASS_SOLVE));
    return conclude(run);
}

static void *conduct(void *argument)
{
    npg_run *run = argument;
    npg_status status = do_passes(run);
    run->end_status = status ? status : run->is_partial ? NPG_PARTIAL : NPG_OK;
    if (run->results) npg_ring_end(run->results);
    return NULL;
}

/* ---- public: open and close ---- */

static npg_status check_chain(const npg_run *run)
{
    uint32_t have = 0;
    for (size_t i = 0; i < run->worker_count; i++) {
        const npg_stage *stage = run->workers[i].stage;
        if (stage->passes && !stage->process)
            return npg_error(NPG_USAGE, "stage %s takes part in passes but processes nothing", stage->name);
        if (stage->needs & ~have)
            return npg_error(NPG_USAGE, "stage %s needs fields 0x%x that no stage before it gives",
                             stage->name, stage->needs & ~have);
        have |= stage->gives;
    }
    return NPG_OK;
}

static npg_status add_worker(npg_run *run, const npg_stage *stage)
{
    json_t *stages = stage->begin ? run->report : json_object_get(run->report, "stages");
    if (run->worker_count == NPG_STAGES_MAX)
        return npg_error(NPG_USAGE, "more than %d stages", NPG_STAGES_MAX);
    npg_worker *worker = &run->workers[run->worker_count++];
    *worker = (npg_worker){.run = run, .name = stage->name, .stage = stage, .report = json_object()};
    json_object_set_new(stages, stage->name, worker->report);
    return NPG_OK;
}

/* The stages that the program wants right after this one. */
static npg_status add_custom(npg_run *run, const npg_stage *before, uint32_t fields)
{
    const npg_custom_stage *given;
    for (size_t i = 0; (given = npg_options_custom_stage(run->options, i)); i++) {
        if (strcmp(given->after, before->name) != 0) continue;
        run->custom[i] = npg_custom_make(given, before, fields);
        NPG_TRY(add_worker(run, &run->custom[i].stage));
    }
    return NPG_OK;
}

static npg_status open_chain(npg_run *run, const npg_stage *const *chain)
{
    uint32_t fields = 0;
    json_object_set_new(run->report, "stages", json_object());
    for (; *chain; chain++) {
        fields |= (*chain)->gives;
        NPG_TRY(add_worker(run, *chain));
        NPG_TRY(add_custom(run, *chain, fields));
    }
    return check_chain(run);
}

/* A run that takes its own meshes for frames would never end, and would clear them away first. */
static npg_status check_followed(const npg_settings *settings)
{
    char *folder, meshes[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(meshes, settings->output, "meshes"));
    NPG_TRY(npg_copy_text(&folder, settings->follow));
    char *slash = strrchr(folder, '/');
    if (!npg_is_there(folder) && slash) *slash = 0; /* a pattern; ingest says what is not there */
    bool is_own = settings->output[0] &&
                  (npg_is_same_file(folder, settings->output) || npg_is_same_file(folder, meshes));
    npg_release(&folder);
    if (!is_own) return NPG_OK;
    return npg_error(NPG_USAGE, "the folder %s that is followed is also where this run writes",
                     settings->follow);
}

/* Files, or a live source: standard input, a folder that grows, frames that are pushed. */
static npg_status open_source(npg_run *run)
{
    const char *input = run->settings.input, *follow = run->settings.follow;
    if (input[0] && follow[0])
        return npg_error(NPG_USAGE,
                         "frames come either from the input %s or from the folder %s that is followed", input,
                         follow);
    if (follow[0]) NPG_TRY(check_followed(&run->settings));
    run->facts.is_live = follow[0] || !input[0] || !strcmp(input, "-");
    return input[0] || follow[0] ? NPG_OK : npg_ring_open(&run->feed, (size_t)run->settings.ring_capacity);
}

static npg_status fill_run(npg_run *run, const npg_options *options, const npg_hooks *hooks,
                           const npg_stage *const *chain)
{
    NPG_TRY(options ? npg_options_copy(&run->options, options)
                    : npg_options_open_chain(&run->options, chain));
    npg_options_fill(run->options, npg_run_options, &run->settings);
    if (hooks)
        NPG_TRY(npg_struct_take(&run->hooks, sizeof run->hooks, hooks, NPG_SIZE_UP_TO(npg_hooks, progress),
                                "hooks"));
    run->report = json_object();
    run->warnings = json_array();
    json_object_set(run->report, "warnings", run->warnings);
    NPG_TRY(npg_latch_open(&run->begun_latch, 0));
    run->latches[run->latch_count++] = run->begun_latch;
    run->facts.frame_count = -1;
    run->facts.wanted_number = INT64_MIN;
    run->facts.bounds_local = npg_bounds_empty();
    NPG_TRY(open_source(run));
    if (!run->settings.output[0] && !run->settings.pull)
        return npg_error(NPG_USAGE, "neither an output folder nor pull = yes: the results would be lost");
    if (run->settings.pull) NPG_TRY(npg_ring_open(&run->results, (size_t)run->settings.ring_capacity));
    npg_memory_set_limit((size_t)run->settings.max_memory_mib << 20);
    return open_chain(run, chain);
}

npg_status npg_run_open(npg_run **out, const npg_options *options, const npg_hooks *hooks)
{
    return npg_run_open_chain(out, options, hooks, npg_chain);
}

npg_status npg_run_open_chain(npg_run **out, const npg_options *options, const npg_hooks *hooks,
                              const npg_stage *const *chain)
{
    npg_run *run;
    NPG_REQUIRE(out);
    *out = NULL;
    NPG_TRY(npg_alloc(&run, NPG_FOR_RUN, sizeof *run));
    pthread_mutex_init(&run->lock, NULL);
    pthread_mutex_init(&run->join_lock, NULL);
    sem_init(&run->event, 0, 0);
    run->begun = npg_busy_now();
    run->pushed_number = INT64_MIN;
    npg_status status = fill_run(run, options, hooks, chain);
    if (!status && pthread_create(&run->conductor, NULL, conduct, run))
        status = npg_error(NPG_FAILED, "can't start a thread");
    if (status) {
        npg_run_close(&run);
        return status;
    }
    run->conductor_started = true;
    *out = run;
    return NPG_OK;
}

static void join_conductor(npg_run *run)
{
    pthread_mutex_lock(&run->join_lock);
    if (run->conductor_started && !run->conductor_joined) pthread_join(run->conductor, NULL);
    run->conductor_joined = true;
    pthread_mutex_unlock(&run->join_lock);
}

npg_status npg_run_wait(npg_run *run)
{
    NPG_REQUIRE(run && run->conductor_started);
    join_conductor(run);
    if (run->end_status < 0 || run->end_status == NPG_STOPPED || run->end_status == NPG_CHANGED)
        return npg_error(run->end_status, "%s: %s", run->failure_stage, run->failure_text);
    return run->end_status;
}

void npg_run_stop(npg_run *run)
{
    if (!run) return;
    atomic_store(&run->stop, true);
    sem_post(&run->event);
}

static void release_facts(npg_run *run)
{
    for (size_t i = 0; i < run->published_count; i++) {
        npg_published *fact = &run->published[i];
        if (fact->value) fact->kind->release(fact->value);
    }
}

static void release_kept(npg_worker *worker)
{
    if (!worker->release_kept)
        npg_release(&worker->kept);
    else if (worker->kept)
        worker->release_kept(worker->kept);
}

void npg_run_close(npg_run **slot)
{
    if (!slot || !*slot) return;
    npg_run *run = *slot;
    npg_run_stop(run);
    close_ends(run);
    join_conductor(run);
    release_facts(run);
    for (size_t i = 0; i < run->worker_count; i++) release_kept(&run->workers[i]);
    for (size_t i = 0; i < run->latch_count; i++) npg_latch_close(&run->latches[i]);
    npg_chunk_close(&run->pulled);
    npg_ring_close(&run->feed);
    npg_ring_close(&run->results);
    npg_mesh_unref(&run->facts.reference);
    json_decref(run->warnings);
    json_decref(run->closed_reports);
    json_decref(run->report);
    npg_options_close(&run->options);
    sem_destroy(&run->event);
    pthread_mutex_destroy(&run->join_lock);
    pthread_mutex_destroy(&run->lock);
    npg_release(slot);
}
