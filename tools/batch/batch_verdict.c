/* Verdicts: how a capture's run ended, in a word, and OUT/<name>/verdict.json. */
#include "tools/batch/batch.h"

#include <stdio.h>
#include <string.h>
#include <sys/wait.h>

#include "pipeline/file.h"
#include "pipeline/json_file.h"

#define FILE_NAME "verdict.json"

/* ---- judging ---- */

static const char *word_of(int exit_code)
{
    for (int status = NPG_MEMORY; status < NPG_FAILED; status++)
        if (npg_status_exit_code((npg_status)status) == exit_code) return npg_status_name((npg_status)status);
    return "failed";
}

static void set(npg_verdict *v, const char *word, int exit_code, const char *message)
{
    snprintf(v->word, sizeof v->word, "%s", word);
    snprintf(v->message, sizeof v->message, "%s", message);
    v->exit_code = exit_code;
}

/* Of a capture with one reference for all frames: where that ended to explain them, and what helps. */
static void add_topology(npg_verdict *v, const npg_capture *capture)
{
    static const char *const directions[] = {"forward", "backward"};
    if (capture->segments == NPG_BATCH_SEGMENTS_AUTO) return;
    json_t *report = npg_json_in(capture->output, "report.json");
    const json_t *topology = npg_json_at(report, "stages.evaluate.topology");
    for (int d = 1; d >= 0; d--) {
        const json_t *alarm = json_object_get(topology, directions[d]);
        if (json_is_object(alarm))
            snprintf(v->message, sizeof v->message,
                     "from frame %lld %s the reference no longer explains the points; "
                     "\"segments\": \"auto\" takes another there",
                     (long long)json_integer_value(json_object_get(alarm, "from_frame")), d ? "back" : "on");
    }
    json_decref(report);
}

void npg_verdict_judge(npg_verdict *v, const npg_capture *capture, int how, npg_stop_cause cause,
                       const char *words)
{
    char text[sizeof v->message];
    int code = WIFEXITED(how) ? WEXITSTATUS(how) : 128 + WTERMSIG(how);
    v->is_known = true;
    if (code == 0) {
        set(v, "done", 0, "");
    } else if (code == 7) {
        set(v, "partial", 7, "frames were skipped, are unexplained or below the quality bar");
        add_topology(v, capture);
    } else if (cause == NPG_STOP_TIME) {
        snprintf(text, sizeof text, "not done after %g s (max-time)%s; started again it is resumed",
                 capture->max_time_s, code == 75 ? "" : " and had to be killed");
        set(v, "time", 75, text);
    } else if (cause == NPG_STOP_REQUEST || code == 75) {
        set(v, "stopped", code, "stopped on request; started again it is resumed");
    } else if (WIFSIGNALED(how)) {
        snprintf(text, sizeof text, "killed by signal %d (%s)%s%s", WTERMSIG(how), strsignal(WTERMSIG(how)),
                 *words ? ": " : "", words);
        set(v, "killed", code, text);
    } else {
        set(v, word_of(code), code, words);
    }
}

void npg_verdict_fail(npg_verdict *v, npg_status status, const char *message)
{
    *v = (npg_verdict){.is_known = true};
    set(v, npg_status_name(status), npg_status_exit_code(status), message);
}

npg_status npg_verdict_refuse(npg_capture *capture)
{
    npg_verdict_fail(&capture->verdict, NPG_BAD_INPUT, capture->refusal);
    NPG_TRY(npg_make_folder(capture->output));
    return npg_verdict_write(capture);
}

bool npg_verdict_is_done(const npg_verdict *v)
{
    return v->is_known && (v->exit_code == 0 || v->exit_code == 7);
}

npg_status npg_batch_status(const npg_batch *batch, bool of_all, bool stopped)
{
    size_t mine = 0, bad = 0, partial = 0;
    for (size_t i = 0; i < batch->count; i++) {
        const npg_verdict *v = &batch->captures[i].verdict;
        if (!of_all && !npg_batch_is_mine(batch, i)) continue;
        mine++;
        bad += !npg_verdict_is_done(v);
        partial += v->exit_code == 7;
    }
    if (bad && stopped) return NPG_STOPPED;
    if (bad)
        return npg_error(NPG_FAILED, "%zu of %zu captures are not done; see %s/batch.json", bad, mine,
                         batch->output);
    return partial ? NPG_PARTIAL : NPG_OK;
}

/* ---- segments ---- */

json_t *npg_capture_segments(const npg_capture *capture)
{
    static const char *const told[] = {"folder", "first_frame", "last_frame", "keyframe", "status"};
    if (capture->segments != NPG_BATCH_SEGMENTS_AUTO) return NULL;
    json_t *saved = npg_json_in(capture->output, "segments.json"), *list = json_object_get(saved, "segments");
    json_t *segments = json_array_size(list) && json_object_get(saved, "status") ? json_array() : NULL,
           *entry;
    size_t i;
    json_array_foreach(segments ? list : NULL, i, entry)
    {
        json_t *cause = npg_json_at(entry, "alarm.cause"), *segment = json_object();
        for (size_t k = 0; k < sizeof told / sizeof *told; k++)
            json_object_set(segment, told[k], json_object_get(entry, told[k]));
        json_object_set_new(segment, "cause", cause ? json_incref(cause) : json_null());
        json_array_append_new(segments, segment);
    }
    json_decref(saved);
    return segments;
}

/* ---- the file ---- */

json_t *npg_verdict_json(const npg_capture *capture)
{
    const npg_verdict *v = &capture->verdict;
    json_t *object = json_pack("{so so so}", "name", npg_json_text(capture->name), "input",
                               npg_json_text(capture->input), "output", npg_json_text(capture->output));
    if (!object || !v->is_known) return object;
    json_object_set_new(object, "verdict", json_string(v->word));
    json_object_set_new(object, "exit_code", json_integer(v->exit_code));
    json_object_set_new(object, "message", npg_json_text(v->message));
    json_object_set_new(object, "seconds", npg_json_real(v->seconds));
    json_object_set_new(object, "peak_memory_bytes", json_integer((json_int_t)v->peak_bytes));
    json_t *segments = npg_verdict_is_done(v) ? npg_capture_segments(capture) : NULL;
    if (segments) json_object_set_new(object, "segments", segments);
    return object;
}

json_t *npg_verdict_record(const npg_capture *capture)
{
    json_t *record = json_pack("{s:s}", "event", "verdict");
    json_object_update_new(record, npg_verdict_json(capture));
    json_object_set_new(record, "was_done", json_boolean(capture->verdict.was_done));
    return record;
}

npg_status npg_verdict_write(const npg_capture *capture)
{
    json_t *object = npg_verdict_json(capture);
    npg_status status = object ? npg_json_write(capture->output, FILE_NAME, object)
                               : npg_error(NPG_MEMORY, "no memory for a verdict");
    json_decref(object);
    return status;
}

void npg_verdict_read(npg_verdict *v, const npg_capture *capture)
{
    memset(v, 0, sizeof *v);
    json_t *object = npg_json_in(capture->output, FILE_NAME);
    const char *word = json_string_value(json_object_get(object, "verdict"));
    const char *message = json_string_value(json_object_get(object, "message"));
    if (word) {
        set(v, word, (int)json_integer_value(json_object_get(object, "exit_code")), message ? message : "");
        v->is_known = true;
        v->seconds = json_number_value(json_object_get(object, "seconds"));
        v->peak_bytes = (size_t)json_integer_value(json_object_get(object, "peak_memory_bytes"));
    }
    json_decref(object);
}
