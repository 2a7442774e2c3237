/* Input log: what came from a live source, frame by frame. */
#include "ingest/input_log.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/file.h"
#include "pipeline/json_lines.h"

/* Where the line of a frame that was selected ends. */
typedef struct line_end {
    int64_t lines, bytes;
} line_end;

struct npg_input_log {
    char *path; /* owned */
    int fd;     /* -1: only looked at */
    npg_input_entry *entries;
    size_t entry_count, entry_capacity;
    pthread_mutex_t lock; /* guards what follows */
    line_end *ends;       /* by index; owned */
    size_t end_count, end_capacity;
    int64_t lines, bytes;
};

static void release_log(void *value)
{
    npg_input_log *log = value;
    npg_input_log_close(&log);
}

const npg_fact_kind npg_fact_input_log = {"input_log", "job", release_log};

/* ---- names that JSON can't hold ---- */

static void put_name(json_t *line, const char *name)
{
    json_t *text = json_string(name), *bytes;
    if (text) {
        json_object_set_new(line, "name", text);
        return;
    }
    bytes = json_array(); /* not UTF-8 */
    for (const char *c = name; *c; c++) json_array_append_new(bytes, json_integer((unsigned char)*c));
    json_object_set_new(line, "name", bytes);
}

/* NULL where there is none. */
static npg_status get_name(char **name, const json_t *value)
{
    *name = NULL;
    if (json_is_string(value)) return npg_copy_text(name, json_string_value(value));
    size_t count = json_array_size(value);
    if (!count) return NPG_OK;
    NPG_TRY(npg_alloc(name, NPG_FOR_FILES, count + 1));
    for (size_t i = 0; i < count; i++) (*name)[i] = (char)json_integer_value(json_array_get(value, i));
    (*name)[count] = 0;
    return NPG_OK;
}

/* ---- a line ---- */

static json_t *json_of_entry(const npg_input_entry *entry)
{
    char hash[17];
    json_t *line = json_pack("{sI}", "number", (json_int_t)entry->number);
    if (entry->index >= 0) json_object_set_new(line, "index", json_integer((json_int_t)entry->index));
    if (entry->is_missing) json_object_set_new(line, "missing", json_true());
    if (entry->is_held) json_object_set_new(line, "held", json_true());
    if (entry->is_skipped) json_object_set_new(line, "skipped", json_true());
    if (entry->name) {
        put_name(line, entry->name);
        json_object_set_new(line, "digits", json_integer((json_int_t)entry->digits));
    }
    if (entry->bytes < 0) return line;
    snprintf(hash, sizeof hash, "%016llx", (unsigned long long)entry->hash);
    json_object_set_new(line, "bytes", json_integer((json_int_t)entry->bytes));
    json_object_set_new(line, "xxh3", json_string(hash));
    return line;
}

static int64_t integer_of(const json_t *line, const char *key, int64_t otherwise)
{
    const json_t *value = json_object_get(line, key);
    return json_is_integer(value) ? (int64_t)json_integer_value(value) : otherwise;
}

/* Indices count what was selected, from 0 on. */
static npg_status parse_entry(npg_input_log *log, npg_input_entry *entry, const json_t *line)
{
    const char *hash = json_string_value(json_object_get(line, "xxh3"));
    *entry = (npg_input_entry){.number = integer_of(line, "number", 0),
                               .index = integer_of(line, "index", -1),
                               .digits = integer_of(line, "digits", 0),
                               .bytes = hash ? integer_of(line, "bytes", -1) : -1,
                               .hash = hash ? strtoull(hash, NULL, 16) : 0,
                               .is_missing = json_is_true(json_object_get(line, "missing")),
                               .is_held = json_is_true(json_object_get(line, "held")),
                               .is_skipped = json_is_true(json_object_get(line, "skipped"))};
    bool is_next = entry->index == (int64_t)log->end_count || entry->index == -1;
    if (!is_next || entry->digits < 0 || entry->bytes < -1)
        return npg_error(NPG_BAD_INPUT, "%s was changed since it was written (line %lld)", log->path,
                         (long long)log->lines + 1);
    return get_name(&entry->name, json_object_get(line, "name"));
}

/* Under the lock. */
static npg_status note_line(npg_input_log *log, int64_t index, size_t size)
{
    log->lines++;
    log->bytes += (int64_t)size;
    if (index < 0) return NPG_OK;
    NPG_TRY(npg_grow(&log->ends, &log->end_capacity, log->end_count + 1, sizeof *log->ends, NPG_FOR_FILES));
    log->ends[log->end_count++] = (line_end){log->lines, log->bytes};
    return NPG_OK;
}

static npg_status take_line(void *user, const json_t *object, const char *text, size_t size)
{
    npg_input_log *log = user;
    (void)text;
    NPG_TRY(npg_grow(&log->entries, &log->entry_capacity, log->entry_count + 1, sizeof *log->entries,
                     NPG_FOR_FILES));
    npg_input_entry *entry = &log->entries[log->entry_count];
    NPG_TRY(parse_entry(log, entry, object));
    log->entry_count++;
    return note_line(log, entry->index, size);
}

/* ---- opening ---- */

static npg_status open_log(npg_input_log **out, const char *path, int flags)
{
    npg_input_log *log;
    *out = NULL;
    NPG_TRY(npg_alloc(&log, NPG_FOR_FILES, sizeof *log));
    log->fd = -1;
    pthread_mutex_init(&log->lock, NULL);
    npg_status status = npg_copy_text(&log->path, path);
    if (!status && flags) log->fd = open(path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0666);
    if (!status && flags && log->fd < 0) status = npg_error_errno(NPG_DISK, "can't write %s", path);
    if (status) npg_input_log_close(&log);
    *out = log;
    return status;
}

npg_status npg_input_log_open(npg_input_log **out, const char *path)
{
    return open_log(out, path, O_CREAT | O_TRUNC);
}

npg_status npg_input_log_read(npg_input_log **out, const char *path, int64_t bytes)
{
    NPG_TRY(open_log(out, path, 0));
    npg_status status = npg_json_lines_each(path, bytes, take_line, *out);
    if (status) npg_input_log_close(out);
    return status;
}

npg_status npg_input_log_resume(npg_input_log **out, const char *path, const npg_input_place *place)
{
    NPG_TRY(open_log(out, path, O_CREAT));
    npg_input_log *log = *out;
    npg_status status = npg_json_lines_each(path, place->bytes, take_line, log);
    if (!status && log->lines != place->lines)
        status = npg_error(NPG_BAD_INPUT, "%s was changed since it was written", path);
    if (!status && ftruncate(log->fd, (off_t)place->bytes))
        status = npg_error_errno(NPG_DISK, "can't shorten %s", path);
    if (status) npg_input_log_close(out);
    return status;
}

void npg_input_log_forget(npg_input_log *log)
{
    for (size_t i = 0; i < log->entry_count; i++) npg_release(&log->entries[i].name);
    npg_release(&log->entries);
    log->entry_count = log->entry_capacity = 0;
}

void npg_input_log_close(npg_input_log **slot)
{
    npg_input_log *log = *slot;
    if (!log) return;
    if (log->fd >= 0) close(log->fd);
    npg_input_log_forget(log);
    npg_release(&log->ends);
    npg_release(&log->path);
    pthread_mutex_destroy(&log->lock);
    npg_release(slot);
}

/* A frame that is missing behind it, and not solved, repeats its points. */
static bool is_repeated(const npg_input_log *log, size_t i)
{
    for (i++; i < log->entry_count && log->entries[i].is_missing; i++)
        if (!log->entries[i].is_solved) return true;
    return i == log->entry_count; /* what comes next may be missing */
}

bool npg_input_log_needs(const npg_input_log *log, size_t i, bool holds)
{
    const npg_input_entry *entry = &log->entries[i];
    if (entry->is_missing || entry->is_skipped) return false;
    return !entry->is_solved || (holds && is_repeated(log, i));
}

npg_input_entry *npg_input_log_entries(const npg_input_log *log, size_t *count)
{
    *count = log->entry_count;
    return log->entries;
}

/* ---- writing ---- */

npg_status npg_input_log_add(npg_input_log *log, const npg_input_entry *entry)
{
    json_t *line = json_of_entry(entry);
    char *text = line ? json_dumps(line, JSON_COMPACT) : NULL;
    json_decref(line);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the line of frame %lld", (long long)entry->number);
    size_t size = strlen(text);
    text[size] = '\n'; /* in the place of the final 0: the size goes along */
    bool is_written = npg_write_at(log->fd, text, size + 1, log->bytes);
    free(text);
    if (!is_written) return npg_error_errno(NPG_DISK, "can't write %s", log->path);
    pthread_mutex_lock(&log->lock);
    npg_status status = note_line(log, entry->index, size + 1);
    pthread_mutex_unlock(&log->lock);
    return status;
}

void npg_input_log_place(npg_input_log *log, int64_t index, npg_input_place *place)
{
    pthread_mutex_lock(&log->lock);
    bool is_there = index >= 0 && index < (int64_t)log->end_count;
    *place = is_there ? (npg_input_place){log->ends[index].lines, log->ends[index].bytes, 0}
                      : (npg_input_place){log->lines, log->bytes, 0};
    if (index < 0) *place = (npg_input_place){0};
    pthread_mutex_unlock(&log->lock);
}

npg_status npg_input_log_sync(npg_input_log *log)
{
    return fdatasync(log->fd) ? npg_error_errno(NPG_DISK, "can't sync %s", log->path) : NPG_OK;
}
