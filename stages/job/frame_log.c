/* Frame log: one line for every frame whose results are on disk. */
#include "job/job_internal.h"

#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/file.h"

typedef struct line_place { /* a frame's line in the partial list */
    int64_t index;
    off_t offset;
    size_t size; /* with its newline */
} line_place;

struct npg_frame_log {
    npg_arena arena; /* of what follows */
    char *output, *partial_path;
    int fd;
    off_t size;
    line_place *lines;
    size_t line_count, line_capacity;
};

/* ---- one line ---- */

static json_t *json_of_cleaning(const npg_cleaning *c)
{
    return json_pack("{sI sI sI sI sI sI sI sI}", "read", (json_int_t)c->read, "not_finite",
                     (json_int_t)c->not_finite, "duplicate", (json_int_t)c->duplicate, "isolated",
                     (json_int_t)c->isolated, "thinned", (json_int_t)c->thinned, "normals_given",
                     (json_int_t)c->normals_given, "normals_flipped", (json_int_t)c->normals_flipped,
                     "normals_estimated", (json_int_t)c->normals_estimated);
}

/* clang-format off */
const npg_figure_row npg_figure_rows[NPG_FIGURE_ROWS] = {
    {"point_dist_median", offsetof(npg_figures, point_dist_median), false},
    {"point_dist_mean",   offsetof(npg_figures, point_dist_mean),   false},
    {"point_dist_p95",    offsetof(npg_figures, point_dist_p95),    false},
    {"vertex_dist_mean",  offsetof(npg_figures, vertex_dist_mean),  false},
    {"coverage",          offsetof(npg_figures, coverage),          true},
    {"unsupported_share", offsetof(npg_figures, unsupported_share), false},
    {"nowhere_share",     offsetof(npg_figures, nowhere_share),     false},
    {"lost_share",        offsetof(npg_figures, lost_share),        false},
    {"flipped_share",     offsetof(npg_figures, flipped_share),     false},
    {"stretched_share",   offsetof(npg_figures, stretched_share),   false},
    {"edge_change",       offsetof(npg_figures, edge_change),       false},
    {"chamfer",           offsetof(npg_figures, chamfer),           false}};
/* clang-format on */

static json_t *json_of_figures(const npg_figures *f)
{
    json_t *figures = json_object();
    for (int i = 0; i < NPG_FIGURE_ROWS; i++)
        json_object_set_new(figures, npg_figure_rows[i].name,
                            npg_json_real(*npg_figure_at((npg_figures *)f, i)));
    json_object_set_new(figures, "unsupported_at", npg_json_place(f->unsupported_at));
    return figures;
}

static const char *const misfit_names[NPG_MISFITS] = {"far", "unsupported", "stretched", "vacated"};

static json_t *json_of_misfits(const npg_figures *f)
{
    json_t *misfits = json_object();
    for (int i = 0; i < NPG_MISFITS; i++) {
        const npg_misfit *misfit = &f->misfits[i];
        json_object_set_new(
            misfits, misfit_names[i],
            json_pack("{so so}", "share", npg_json_real(misfit->share), "at", npg_json_place(misfit->at)));
    }
    return misfits;
}

static double real_of(const json_t *value)
{
    return json_is_number(value) ? (double)(float)json_number_value(value) : (double)NAN;
}

void npg_frame_line_read(npg_figures *figures, const json_t *line)
{
    const json_t *misfits = json_object_get(line, "misfits"), *marks = json_object_get(line, "marks");
    for (int i = 0; i < NPG_FIGURE_ROWS; i++) {
        const json_t *value = json_object_get(json_object_get(line, "figures"), npg_figure_rows[i].name);
        if (json_is_number(value)) *npg_figure_at(figures, i) = json_number_value(value);
    }
    for (size_t i = 0; i < 3 * NPG_MARKS; i++) figures->marks[i] = (float)real_of(json_array_get(marks, i));
    for (int i = 0; i < NPG_MISFITS; i++) {
        const json_t *misfit = json_object_get(misfits, misfit_names[i]);
        figures->misfits[i].share = real_of(json_object_get(misfit, "share"));
        for (size_t a = 0; a < 3; a++)
            figures->misfits[i].at[a] = real_of(json_array_get(json_object_get(misfit, "at"), a));
    }
}

/* Words of the faults; those of a bar are its name. */
static const char *const fault_names[NPG_FAULTS] = {
    NULL,      "residual", "residual",  "coverage", "flipped", "stretched", "unsupported",
    "nowhere", "lost",     "uncovered", "distance", "torn",    "jump"};

static json_t *json_of_marks(const npg_figures *f)
{
    json_t *marks = json_array();
    for (size_t i = 0; i < 3 * NPG_MARKS; i++)
        json_array_append_new(marks, npg_json_real((double)f->marks[i]));
    return marks;
}

static json_t *json_of_frame(const npg_frame *frame, const char *file)
{
    json_t *line = json_pack("{sI sI so sb sb sb}", "index", (json_int_t)frame->index, "number",
                             (json_int_t)frame->number, "source", npg_json_text(frame->path), "key",
                             frame->is_key, "skipped", frame->is_skipped, "held", frame->is_held);
    if (frame->is_shared) json_object_set_new(line, "shared", json_true());
    json_object_set_new(line, "points", json_integer((json_int_t)frame->point_count));
    json_object_set_new(line, "cleaning", json_of_cleaning(&frame->cleaning));
    if (frame->fields & NPG_FIELD_FIGURES)
        json_object_update_new(line, json_pack("{sb so so so ss*}", "good", frame->figures.good, "figures",
                                               json_of_figures(&frame->figures), "misfits",
                                               json_of_misfits(&frame->figures), "marks",
                                               json_of_marks(&frame->figures), "fault",
                                               fault_names[frame->figures.fault]));
    json_object_set_new(line, "file", npg_json_text(file));
    return line;
}

/* ---- the list ---- */

static npg_status open_list(npg_frame_log **out, const char *output, int flags)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_FILES, sizeof **out));
    npg_frame_log *list = *out;
    list->output = npg_arena_text(&list->arena, output);
    list->partial_path = npg_arena_path(&list->arena, output, NPG_FRAME_LOG_NAME);
    npg_status status = npg_arena_status(&list->arena);
    list->fd = status ? -1 : open(list->partial_path, O_RDWR | O_CLOEXEC | O_NOFOLLOW | flags, 0666);
    if (!status && list->fd < 0) status = npg_error_errno(NPG_DISK, "can't write %s", list->partial_path);
    if (status) npg_frame_log_close(out);
    return status;
}

npg_status npg_frame_log_open(npg_frame_log **out, const char *output)
{
    return open_list(out, output, O_CREAT | O_TRUNC);
}

void npg_frame_log_close(npg_frame_log **list)
{
    if (*list && (*list)->fd >= 0) close((*list)->fd);
    npg_object_close(list);
}

static npg_status add_place(npg_frame_log *list, int64_t index, size_t size)
{
    NPG_TRY(npg_arena_grow(&list->arena, &list->lines, &list->line_capacity, list->line_count + 1,
                           sizeof *list->lines));
    list->lines[list->line_count++] = (line_place){index, list->size, size};
    list->size += (off_t)size;
    return NPG_OK;
}

typedef struct resuming {
    npg_frame_log *list;
    int64_t mesh_count, skipped_count;
} resuming;

static npg_status take_line(void *user, const json_t *frame, const char *line, size_t size)
{
    resuming *r = user;
    const char *file = json_string_value(json_object_get(frame, "file"));
    (void)line;
    r->mesh_count += file != NULL;
    r->skipped_count += json_is_true(json_object_get(frame, "skipped"));
    npg_status status = file ? npg_file_check(frame, r->list->output, file) : NPG_OK;
    if (status) return npg_error(status, "%s; --restart discards what is there", npg_error_text());
    return add_place(r->list, (int64_t)json_integer_value(json_object_get(frame, "index")), size);
}

npg_status npg_frame_log_resume(npg_frame_log **out, const char *output, int64_t bytes, int64_t *mesh_count,
                                int64_t *skipped_count)
{
    resuming r = {0};
    NPG_TRY(open_list(out, output, 0));
    r.list = *out;
    npg_status status = npg_json_lines(output, NPG_FRAME_LOG_NAME, bytes, take_line, &r);
    if (!status && ftruncate(r.list->fd, (off_t)bytes))
        status = npg_error_errno(NPG_DISK, "can't shorten %s", r.list->partial_path);
    if (status) npg_frame_log_close(out);
    *mesh_count = r.mesh_count;
    *skipped_count = r.skipped_count;
    return status;
}

npg_status npg_frame_log_add(npg_frame_log *list, const npg_frame *frame, const char *file, int64_t *lines,
                             int64_t *bytes)
{
    json_t *line = json_of_frame(frame, file);
    npg_status status = file ? npg_file_facts(line, list->output, file) : NPG_OK;
    char *text = status ? NULL : json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(line);
    NPG_TRY(status);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the line of frame %lld", (long long)frame->number);
    size_t size = strlen(text);
    text[size] = '\n'; /* in the place of the final 0: the size goes along */
    if (!npg_write_at(list->fd, text, size + 1, list->size))
        status = npg_error_errno(NPG_DISK, "can't write %s", list->partial_path);
    if (!status) status = add_place(list, frame->index, size + 1);
    free(text);
    *lines = (int64_t)list->line_count;
    *bytes = (int64_t)list->size;
    return status;
}

static int by_index(const void *left, const void *right)
{
    const line_place *a = left, *b = right;
    return a->index < b->index ? -1 : a->index > b->index;
}

static bool is_unexplained(const npg_facts *facts, int64_t index)
{
    return (facts->has_changed[0] && index >= facts->changed_at[0]) ||
           (facts->has_changed[1] && index <= facts->changed_at[1]);
}

/* A line with what the end of the run has to say: the reference does not explain its frame; it has a late fault
 * (0: none), and so is not good. */
static npg_status write_line(npg_file *file, const char *text, size_t size, bool is_unexplained, int fault)
{
    json_t *line = json_loadb(text, size, 0, NULL);
    if (!line) return npg_error(NPG_FAILED, "a line of the frame log can't be read back");
    if (is_unexplained) json_object_set_new(line, "unexplained", json_true());
    if (fault && json_is_true(json_object_get(line, "good"))) {
        json_object_set_new(line, "good", json_false());
        json_object_set_new(line, "fault", json_string(fault_names[fault]));
    }
    npg_status status = npg_json_print(file, line, JSON_COMPACT | JSON_REAL_PRECISION(9));
    json_decref(line);
    return status ? status : npg_file_write(file, "\n", 1);
}

static npg_status copy_lines(npg_frame_log *list, npg_file *file, const npg_facts *facts,
                             const npg_late_faults *late)
{
    char *line = NULL;
    size_t capacity = 0, at = 0;
    npg_status status = NPG_OK;
    for (size_t i = 0; i < list->line_count && !status; i++) {
        const line_place *place = &list->lines[i];
        status = npg_grow(&line, &capacity, place->size, 1, NPG_FOR_FILES);
        if (!status && pread(list->fd, line, place->size, place->offset) != (ssize_t)place->size)
            status = npg_error_errno(NPG_DISK, "can't read back %s", list->partial_path);
        while (late && at < late->count && late->faults[at].index < place->index) at++;
        bool is_late = late && at < late->count && late->faults[at].index == place->index;
        if (!status)
            status = write_line(file, line, place->size, is_unexplained(facts, place->index),
                                is_late ? late->faults[at].fault : 0);
    }
    npg_release(&line);
    return status;
}

static void release_late(void *value)
{
    npg_late_faults *late = value;
    if (late) npg_release(&late->faults);
    npg_release(&late);
}

const npg_fact_kind npg_fact_late_faults = {"late_faults", "evaluate", release_late};

npg_status npg_frame_log_finish(npg_frame_log *list, const npg_facts *facts, const npg_late_faults *late)
{
    npg_file *file;
    if (list->line_count) qsort(list->lines, list->line_count, sizeof *list->lines, by_index);
    NPG_TRY(npg_file_open_in(&file, list->output, "frames.jsonl"));
    npg_status status = copy_lines(list, file, facts, late);
    return npg_file_end(&file, status);
}

/* ---- appended frames ---- */

typedef struct shortened {
    npg_file *file;
    int64_t below, lines;
} shortened;

static npg_status keep_line(void *user, const json_t *frame, const char *line, size_t size)
{
    shortened *list = user;
    if (json_integer_value(json_object_get(frame, "index")) >= list->below) return NPG_OK;
    list->lines++;
    return npg_file_write(list->file, line, size);
}

npg_status npg_frame_log_shorten(const char *output, int64_t below, int64_t *lines, int64_t *bytes)
{
    const char *from = npg_is_in_folder(output, "frames.jsonl") ? "frames.jsonl" : NPG_FRAME_LOG_NAME;
    shortened list = {.below = below};
    NPG_TRY(npg_file_open_in(&list.file, output, NPG_FRAME_LOG_NAME));
    npg_status status = npg_json_lines(output, from, -1, keep_line, &list);
    *lines = list.lines;
    *bytes = (int64_t)npg_file_size(list.file);
    status = npg_file_end(&list.file, status);
    return status ? status : npg_file_remove(output, "frames.jsonl");
}
