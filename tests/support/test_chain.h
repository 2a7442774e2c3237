/* A chain of small stages of a test's own: a source that makes frames from a callback, and a sink that hands
 * them to one.  Real stages can stand between them. */
#ifndef NPG_TEST_CHAIN_H
#define NPG_TEST_CHAIN_H

#include <stdio.h>
#include <string.h>

#include "pipeline/options.h"
#include "pipeline/run_internal.h"

/* What the chain of the running test does; set it before the run is opened. */
typedef struct test_script {
    int64_t frame_count;
    /* Fill an empty frame of a pass; index and number are set to `index`. */
    npg_status (*make)(npg_frame *frame, npg_facts *facts, int64_t index, void *user);
    /* Sees each frame at the end of the solving pass. */
    npg_status (*see)(npg_worker *worker, npg_frame *frame, void *user);
    void *user;
} test_script;

static test_script script;

/* A stage of a test plays all those that are not there, and writes their facts. */
static inline npg_facts *test_facts(const npg_worker *worker)
{
    return (npg_facts *)npg_worker_facts(worker);
}

typedef struct source_state {
    int64_t next;
} source_state;

static npg_status source_from_feed(npg_worker *worker, npg_chunk **chunk)
{
    source_state *state = npg_worker_state(worker);
    NPG_TRY(npg_worker_feed(worker, chunk));
    npg_frame *frame = npg_chunk_frame(*chunk, 0);
    frame->index = state->next++;
    return script.make ? script.make(frame, test_facts(worker), frame->index, script.user) : NPG_OK;
}

static npg_status source_process(npg_worker *worker, npg_chunk **chunk)
{
    source_state *state = npg_worker_state(worker);
    npg_facts *facts = test_facts(worker);
    bool is_solving = npg_worker_pass(worker) == NPG_PASS_SOLVE;
    if (facts->is_live) return is_solving ? source_from_feed(worker, chunk) : NPG_END; /* no look-ahead */
    if (!state->next) /* written once, before the first chunk */
        facts->frame_count = facts->planned_count = script.frame_count;
    bool is_choosing = npg_worker_pass(worker) == NPG_PASS_CHOOSE;
    int64_t count = is_choosing ? (int64_t)facts->choice.count : script.frame_count;
    if (state->next >= count) return NPG_END;
    NPG_TRY(npg_chunk_open(chunk, (size_t)npg_worker_settings(worker)->chunk_frames));
    while (npg_chunk_count(*chunk) < npg_chunk_capacity(*chunk) && state->next < count) {
        npg_frame frame = {0};
        bool is_planned = npg_worker_pass(worker) == NPG_PASS_SOLVE && facts->plan.frame_count;
        frame.index = frame.number = is_planned ? npg_plan_frame(&facts->plan, state->next) : state->next;
        if (is_choosing) frame.index = frame.number = facts->choice.frames[state->next];
        frame.fields = NPG_FIELD_POINTS;
        state->next++;
        npg_status status = script.make ? script.make(&frame, facts, frame.index, script.user) : NPG_OK;
        if (status) {
            npg_frame_clear(&frame);
            return status;
        }
        npg_chunk_add(*chunk, &frame);
    }
    return NPG_OK;
}

static npg_status sink_process(npg_worker *worker, npg_chunk **chunk)
{
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++)
        if (script.see) NPG_TRY(script.see(worker, npg_chunk_frame(*chunk, i), script.user));
    return NPG_OK;
}

static const npg_stage test_source = {.name = "source",
                                      .help = "",
                                      .state_size = sizeof(source_state),
                                      .passes = NPG_PASS_MEASURE | NPG_PASS_SCORE | NPG_PASS_CHOOSE |
                                                NPG_PASS_SOLVE,
                                      .gives = NPG_FIELD_POINTS,
                                      .process = source_process};

static const npg_stage test_sink = {
    .name = "sink", .help = "", .passes = NPG_PASS_SOLVE, .process = sink_process};

/* Open, wait, keep the failure's text, close.  names and values: options, NULL at the end. */
static inline npg_status run_chain(const npg_stage *const *chain, const char *const (*settings)[2],
                                   char text[1024])
{
    npg_options *options = NULL;
    npg_run *run = NULL;
    npg_status status = npg_options_open_chain(&options, chain);
    for (; !status && settings && (*settings)[0]; settings++)
        status = npg_options_set(options, (*settings)[0], (*settings)[1]);
    if (!status) status = npg_run_open_chain(&run, options, NULL, chain);
    if (!status) status = npg_run_wait(run);
    if (text) snprintf(text, 1024, "%s", status < 0 ? npg_error_text() : "");
    npg_run_close(&run);
    npg_options_close(&options);
    return status;
}

#endif
