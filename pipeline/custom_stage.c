/* Own stage: a stage that a program adds to the chain; shows each frame to a callback. */
#include <math.h>
#include <string.h>

#include "pipeline/run_internal.h"

typedef struct custom_state {
    uint8_t *keep; /* owned */
    size_t keep_capacity;
    int64_t frames, points_dropped;
} custom_state;

static const npg_custom *custom_of(const npg_worker *worker)
{
    return (const npg_custom *)(const void *)worker->stage;
}

/* ---- one frame ---- */

static npg_status show_points(npg_frame_view *view, npg_worker *worker, npg_frame *frame)
{
    custom_state *s = npg_worker_state(worker);
    view->point_count = frame->point_count;
    view->points = frame->pos_local;
    view->normals = frame->normals;
    view->colours = frame->colours;
    memcpy(view->points_origin, npg_worker_facts(worker)->origin.world, sizeof view->points_origin);
    NPG_TRY(npg_grow(&s->keep, &s->keep_capacity, frame->point_count, 1, NPG_FOR_FRAMES));
    if (frame->point_count) memset(s->keep, 1, frame->point_count);
    view->keep = s->keep;
    return NPG_OK;
}

static void show_vertices(npg_frame_view *view, const npg_facts *facts, npg_frame *frame)
{
    view->vertex_count = frame->vert_count;
    view->vertex_colours = frame->vert_colours ? frame->vert_colours : facts->reference->vert_colours;
    view->vertices = frame->vert_unit;
    view->face_count = facts->reference->face_count;
    view->faces = facts->reference->faces;
    view->vertices_unit = 1 / facts->box.scale;
    for (int a = 0; a < 3; a++) view->vertices_origin[a] = facts->box.origin[a] + facts->box.centre[a];
}

static npg_status check_finite(const float *values, size_t count, const char *what)
{
    for (size_t i = 0; i < 3 * count; i++)
        if (!isfinite(values[i]))
            return npg_error(NPG_USAGE, "left %s %zu with a coordinate that is not finite", what, i / 3);
    return NPG_OK;
}

static npg_status apply_changes(npg_worker *worker, npg_frame *frame)
{
    custom_state *s = npg_worker_state(worker);
    bool is_clean = custom_of(worker)->fields & NPG_FIELD_CLEAN;
    size_t before = frame->point_count;
    npg_frame_keep(frame, s->keep);
    s->frames++;
    s->points_dropped += (int64_t)(before - frame->point_count);
    if (is_clean && before && !frame->point_count) return npg_error(NPG_BAD_INPUT, "dropped every point");
    if (is_clean) NPG_TRY(check_finite(frame->pos_local, frame->point_count, "point"));
    return frame->vert_unit ? check_finite(frame->vert_unit, frame->vert_count, "vertex") : NPG_OK;
}

/* The callback's failure with a text in any case; what steers the flow can only be a stop. */
static npg_status result_of(npg_status status)
{
    if (status == NPG_OK || status == NPG_STOPPED) return status;
    if (status > 0) return npg_error(NPG_USAGE, "returned %d, which says nothing here", (int)status);
    return npg_error_text()[0] ? status : npg_error(status, "%s", npg_status_name(status));
}

static npg_status do_frame(npg_worker *worker, npg_frame *frame)
{
    const npg_custom *custom = custom_of(worker);
    bool has_figures = frame->fields & NPG_FIELD_FIGURES;
    npg_frame_view view = {.struct_size = sizeof view,
                           .index = frame->index,
                           .number = frame->number,
                           .path = frame->path,
                           .residual = has_figures ? frame->figures.point_dist_median : (double)NAN,
                           .coverage = has_figures ? frame->figures.coverage : (double)NAN};
    NPG_TRY(show_points(&view, worker, frame));
    if (frame->vert_unit) show_vertices(&view, npg_worker_facts(worker), frame);
    npg_error_set(NPG_OK, "");
    NPG_TRY(result_of(custom->given.frame(custom->given.user, &view)));
    return apply_changes(worker, frame);
}

/* ---- the stage ---- */

static npg_status process(npg_worker *worker, npg_chunk **chunk)
{
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (npg_worker_stopping(worker)) return NPG_STOPPED;
        if (!frame->point_count && !frame->vert_unit)
            continue; /* skipped, or missing: there is nothing to see */
        npg_status status = do_frame(worker, frame);
        if (status) return npg_error_prefix(status, "frame %lld", (long long)frame->number);
    }
    return NPG_OK;
}

static npg_status flush(npg_worker *worker)
{
    const custom_state *s = npg_worker_state(worker);
    json_t *report = npg_worker_report(worker);
    json_object_set_new(report, "frames", json_integer((json_int_t)s->frames));
    json_object_set_new(report, "points_dropped", json_integer((json_int_t)s->points_dropped));
    return NPG_OK;
}

static void uninit(npg_worker *worker)
{
    custom_state *s = npg_worker_state(worker);
    npg_release(&s->keep);
}

static size_t memory(const npg_worker *worker, size_t *chunks_held)
{
    *chunks_held = 1;
    return npg_worker_facts(worker)->point_count_max;
}

npg_custom npg_custom_make(const npg_custom_stage *given, const npg_stage *before, uint32_t fields)
{
    /* Only what is ahead of the keyframe shapes what the passes before the last find out. */
    return (npg_custom){.stage = {.name = given->name,
                                  .help = "a stage that the program added",
                                  .state_size = sizeof(custom_state),
                                  .passes = fields & NPG_FIELD_KEY ? NPG_PASS_SOLVE : before->passes,
                                  .process = process,
                                  .flush = flush,
                                  .uninit = uninit,
                                  .memory = memory},
                        .given = *given,
                        .fields = fields};
}

/* ---- what a program gives ---- */

static const npg_stage *find(const npg_stage *const *chain, const char *name)
{
    for (; *chain; chain++)
        if (!strcmp((*chain)->name, name)) return *chain;
    return NULL;
}

npg_status npg_custom_check(const npg_custom_stage *given, const npg_stage *const *chain)
{
    NPG_REQUIRE(given->name && given->after && given->frame);
    size_t length = strlen(given->name);
    if (!length || length > 31 || strspn(given->name, "abcdefghijklmnopqrstuvwxyz0123456789-") != length)
        return npg_error(NPG_USAGE, "stage \"%s\": a name has 1 to 31 small letters, digits and dashes",
                         given->name);
    if (!strcmp(given->name, "run") || find(chain, given->name))
        return npg_error(NPG_USAGE, "stage %s: the name is taken", given->name);
    const npg_stage *before = find(chain, given->after);
    if (!before || !before->passes)
        return npg_error(NPG_USAGE, "stage %s: there is no stage %s that frames pass through", given->name,
                         given->after);
    return NPG_OK;
}
