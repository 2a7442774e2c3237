/* What the results of a job are made of: version, options, inputs; and whether they changed. */
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "ingest/ingest.h"
#include "job/job_internal.h"
#include "pipeline/file.h"

/* Of the files in the job folder; another one is not read. */
#define LAYOUT 3

/* Options that change how a run works, not what comes out of it.  The input is compared by its files. */
static const char *const free_options[] = {"input",  "output", "ring",        "chunk",   "max-memory",
                                           "pull",   "cache",  "overwrite",   "confine", "restart",
                                           "append", "alarm",  "segment-min", "follow",  NULL};
npg_job_source npg_job_source_of(const npg_settings *settings)
{
    if (settings->follow[0]) return NPG_JOB_FOLLOW;
    if (!settings->input[0]) return NPG_JOB_PUSH;
    return strcmp(settings->input, "-") != 0 ? NPG_JOB_FILES : NPG_JOB_STREAM;
}

static const char *const source_words[] = {"files", "follow", "stream", "push"};

/* ---- describing ---- */

/* The stages that a program added, "name after place" each; their code can't be compared. */
static json_t *describe_custom_stages(const npg_options *options)
{
    json_t *list = json_array();
    const npg_custom_stage *own;
    for (size_t i = 0; (own = npg_options_custom_stage(options, i)); i++)
        json_array_append_new(list, json_sprintf("%s after %s", own->name, own->after));
    return list;
}

static void describe_sum(json_t *entry, const char *path, const npg_input_sum *sum)
{
    const char *slash = strrchr(path, '/');
    json_object_set_new(entry, "name", npg_json_text(slash ? slash + 1 : path));
    json_object_set_new(entry, "bytes", json_integer((json_int_t)sum->bytes));
    json_object_set_new(entry, "xxh3", json_sprintf("%016llx", (unsigned long long)sum->hash));
}

static npg_status describe_file(json_t *entry, const char *path)
{
    npg_input_sum sum = {0};
    NPG_TRY(npg_input_sum_add(&sum, path));
    describe_sum(entry, path, &sum);
    return NPG_OK;
}

static npg_status describe_frames(json_t *frames, const npg_frame_files *list)
{
    for (size_t i = 0; i < list->count; i++) {
        json_t *entry = json_pack("{sI}", "number", (json_int_t)list->slots[i].number);
        json_array_append_new(frames, entry);
        if (!list->slots[i].path) continue;
        npg_input_sum sum;
        npg_status status = npg_frame_files_sum(list, i, &sum);
        if (!status) describe_sum(entry, list->slots[i].path, &sum);
        /* what can't be read is for ingest to refuse or skip; here it only must not pass for one that can */
        if (status && status != NPG_BAD_INPUT) return status;
    }
    return NPG_OK;
}

/* The path as it reads from any folder. */
static json_t *absolute(const char *path)
{
    char folder[PATH_MAX], joined[2 * PATH_MAX];
    if (path[0] == '/' || !getcwd(folder, sizeof folder)) return npg_json_text(path);
    snprintf(joined, sizeof joined, "%s/%s", folder, path);
    return npg_json_text(joined);
}

/* The frames of a live source are not known yet: they are in the log of inputs. */
static npg_status describe_capture(json_t *frames, const npg_options *options, npg_job_source source)
{
    npg_frame_files *list;
    if (source) return NPG_OK;
    NPG_TRY(npg_capture_list(&list, options, NULL));
    npg_status status = describe_frames(frames, list);
    npg_frame_files_close(&list);
    return status;
}

/* The file that option sensor may name is one that the result is made of, as the reference. */
static npg_status describe_sensor(json_t *files, const npg_options *options)
{
    const char *path = npg_options_get(options, "sensor");
    if (!path || !npg_is_there(path)) return NPG_OK;
    json_t *file = json_object();
    npg_status status = describe_file(file, path);
    if (!status) json_object_set(files, "sensor", file);
    json_decref(file);
    return status == NPG_BAD_INPUT ? NPG_OK : status; /* the stage says what is wrong with it */
}

npg_status npg_job_describe(json_t **out, const npg_options *options)
{
    npg_settings settings;
    *out = NULL;
    npg_options_fill(options, npg_run_options, &settings);
    npg_job_source source = npg_job_source_of(&settings);
    const char *input = source == NPG_JOB_FOLLOW ? settings.follow : settings.input;
    json_t *frames = json_array(), *mesh = json_object(), *files = json_object();
    npg_status status = describe_capture(frames, options, source);
    if (!status && settings.reference[0]) status = describe_file(mesh, settings.reference);
    if (!status) status = describe_sensor(files, options);
    json_t *description =
        json_pack("{ss si so so so so so so}", "neupig", npg_version(), "layout", LAYOUT, "input",
                  source > NPG_JOB_FOLLOW ? npg_json_text(input) : absolute(input), "options",
                  npg_options_json(options, free_options), "custom_stages", describe_custom_stages(options),
                  "reference", mesh, "files", files, "frames", frames);
    if (source) json_object_set_new(description, "source", json_string(source_words[source]));
    if (!status && !description) status = npg_error(NPG_MEMORY, "no memory for the list of inputs");
    if (status) json_decref(description);
    if (!status) *out = description;
    return status;
}

static const char *text_of(const json_t *object, const char *key)
{
    const char *text = json_string_value(json_object_get(object, key));
    return text ? text : "";
}

npg_status npg_job_publish_hashes(npg_worker *worker, const npg_job *job)
{
    uint64_t *hashes;
    const json_t *frames = json_object_get(job->now, "frames");
    size_t count = json_array_size(frames);
    if (!count) return NPG_OK;
    NPG_TRY(npg_alloc_array(&hashes, NPG_FOR_FILES, count, sizeof *hashes));
    for (size_t i = 0; i < count; i++)
        hashes[i] = strtoull(text_of(json_array_get(frames, i), "xxh3"), NULL, 16);
    return npg_worker_publish(worker, &npg_fact_input_hashes, hashes);
}

/* ---- comparing ---- */

static const char *source_of(const json_t *description)
{
    const char *source = text_of(description, "source");
    return source[0] ? source : source_words[NPG_JOB_FILES];
}

static npg_status compare_options(const json_t *then, const json_t *now, bool is_done)
{
    const char *name;
    const json_t *value;
    json_object_foreach((json_t *)now, name, value)
    {
        const char *was = text_of(then, name), *is = text_of(now, name);
        if (!strncmp(name, "follow-end.", 11) || (is_done && !strcmp(name, "export")))
            continue; /* what ends a live source is kept for npg_options_load_job(); more can be exported */
        if (!json_object_get(then, name))
            return npg_error(NPG_USAGE, "option %s is new and is \"%s\"", name, is);
        if (strcmp(was, is) != 0)
            return npg_error(NPG_USAGE, "option %s was \"%s\" and is \"%s\"", name, was, is);
    }
    return NPG_OK;
}

/* A file that was only touched or copied is the same. */
static bool is_same_file(const json_t *then, const json_t *now)
{
    return !strcmp(text_of(then, "name"), text_of(now, "name")) &&
           json_integer_value(json_object_get(then, "bytes")) ==
               json_integer_value(json_object_get(now, "bytes")) &&
           !strcmp(text_of(then, "xxh3"), text_of(now, "xxh3"));
}

static npg_status compare_frames(int64_t *added, const json_t *then, const json_t *now)
{
    size_t was = json_array_size(then), is = json_array_size(now);
    for (size_t i = 0; i < was && i < is; i++) {
        const json_t *a = json_array_get(then, i), *b = json_array_get(now, i);
        if (!json_equal(json_object_get(a, "number"), json_object_get(b, "number")))
            return npg_error(NPG_USAGE, "frame %zu of the input had the number %lld and has %lld", i,
                             (long long)json_integer_value(json_object_get(a, "number")),
                             (long long)json_integer_value(json_object_get(b, "number")));
        if (!is_same_file(a, b))
            return npg_error(NPG_USAGE, "the input %s is not the one it was (frame %lld)",
                             text_of(b, "name")[0] ? text_of(b, "name") : text_of(a, "name"),
                             (long long)json_integer_value(json_object_get(a, "number")));
    }
    if (is < was) return npg_error(NPG_USAGE, "the input had %zu frames and has %zu", was, is);
    *added = (int64_t)(is - was);
    return NPG_OK;
}

npg_status npg_job_compare(int64_t *added, const json_t *then, const json_t *now, bool is_done)
{
    *added = 0;
    if (strcmp(text_of(then, "neupig"), text_of(now, "neupig")) != 0)
        return npg_error(NPG_USAGE, "it was begun by neupig %s, and this is %s", text_of(then, "neupig"),
                         text_of(now, "neupig"));
    if (strcmp(text_of(then, "source"), text_of(now, "source")) != 0)
        return npg_error(NPG_USAGE,
                         "its frames come from another kind of source (%s) than they came from (%s)",
                         source_of(now), source_of(then));
    NPG_TRY(compare_options(json_object_get(then, "options"), json_object_get(now, "options"), is_done));
    const json_t *own_then = json_object_get(then, "custom_stages"),
                 *own_now = json_object_get(now, "custom_stages");
    if ((json_array_size(own_then) || json_array_size(own_now)) && !json_equal(own_then, own_now))
        return npg_error(NPG_USAGE, "the stages that the program added are not those that it had");
    if (!is_same_file(json_object_get(then, "reference"), json_object_get(now, "reference")))
        return npg_error(NPG_USAGE, "the reference mesh is not the one it was");
    if (!is_same_file(npg_json_at(then, "files.sensor"), npg_json_at(now, "files.sensor")))
        return npg_error(NPG_USAGE, "the file of option sensor is not the one it was");
    return compare_frames(added, json_object_get(then, "frames"), json_object_get(now, "frames"));
}

/* ---- taking up ---- */

static npg_status set_from(npg_options *options, const json_t *job, const char *path)
{
    const char *name, *input = json_string_value(json_object_get(job, "input")), *source = source_of(job);
    json_t *value;
    bool is_followed = !strcmp(source, source_words[NPG_JOB_FOLLOW]);
    if (!input) return npg_error(NPG_USAGE, "%s names no input", path);
    if (!is_followed && strcmp(source, source_words[NPG_JOB_FILES]) != 0)
        return npg_error(NPG_USAGE, "%s: its frames came from a live source (%s) and can't be read again",
                         path, source);
    json_object_foreach(json_object_get(job, "options"), name, value)
        NPG_TRY(npg_options_set(options, name, json_string_value(value) ? json_string_value(value) : ""));
    return npg_options_set(options, is_followed ? "follow" : "input", input);
}

npg_status npg_options_load_job(npg_options *options, const char *folder)
{
    json_t *job;
    NPG_REQUIRE(options && folder);
    npg_status status = npg_json_load(&job, folder, "job/job.json", NPG_USAGE);
    if (status)
        status = npg_error_prefix(status, "%s holds no job", folder);
    else
        status = job ? set_from(options, job, folder) : npg_error(NPG_USAGE, "%s holds no job", folder);
    if (!status) status = npg_options_set(options, "output", folder);
    json_decref(job);
    return status;
}
