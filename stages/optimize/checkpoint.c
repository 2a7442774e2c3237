/* Checkpoint: the state of a run after a closed window, to the job's folder and back. */
#include "optimize/vdb_grids.h"
#include "optimize/window.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "job/vdb_file.h"
#include "pipeline/plan.h"

typedef struct saved_progress {
    int64_t window_at, is_aligned, total;
    double last_chamfer, last_isometry, noise;
} saved_progress;

static void block_name(char name[NPG_BLOCK_NAME], const char *what, int64_t index)
{
    snprintf(name, NPG_BLOCK_NAME, "%s.%lld", what, (long long)index);
}

enum { ARRAYS = 5 };

static void list_arrays(npg_store_array list[ARRAYS], const npg_frame *frame, size_t vert_count)
{
    static const struct {
        const char *name;
        size_t offset, row;
        bool is_of_points;
    } arrays[ARRAYS] = {{"points", offsetof(npg_held, frame.pos_local), 12, true},
                        {"normals", offsetof(npg_held, frame.normals), 12, true},
                        {"colours", offsetof(npg_held, frame.colours), 4, true},
                        {"aligned", offsetof(npg_held, frame.vert_unit), 12, false},
                        {"solved", offsetof(npg_held, solved), 12, false}};
    for (int i = 0; i < ARRAYS; i++) {
        block_name(list[i].name, arrays[i].name, frame->index);
        list[i].offset = arrays[i].offset;
        list[i].row = arrays[i].row;
        list[i].count = arrays[i].is_of_points ? frame->point_count : vert_count;
    }
}

/* ---- saving: frames ---- */

static npg_status put_frame(npg_store *out, const npg_held *held, size_t vert_count)
{
    const npg_frame *f = &held->frame;
    npg_store_array arrays[ARRAYS];
    char name[NPG_BLOCK_NAME];
    npg_frame bare = npg_frame_bare(f);
    bare.sensor_count = 0;
    block_name(name, "frame", f->index);
    NPG_TRY(npg_store_put(out, name, &bare, sizeof bare));
    list_arrays(arrays, f, vert_count);
    NPG_TRY(npg_store_put_arrays(out, held, arrays, ARRAYS));
    block_name(name, "path", f->index);
    return f->path ? npg_store_put(out, name, f->path, strlen(f->path) + 1) : NPG_OK;
}

static npg_status put_frames(npg_store *out, const npg_hand *hand, size_t vert_count)
{
    int64_t *indices;
    size_t count = 0;
    NPG_TRY(npg_alloc_array(&indices, NPG_FOR_FILES, hand->held_count + 1, sizeof *indices));
    npg_status status = NPG_OK;
    for (size_t i = 0; i < hand->held_count && !status; i++) {
        if (!hand->held[i].solved) continue;
        indices[count++] = hand->held[i].frame.index;
        status = put_frame(out, &hand->held[i], vert_count);
    }
    if (!status) status = npg_store_put(out, "held", indices, count * sizeof *indices);
    npg_release(&indices);
    return status;
}

/* ---- saving: all of it ---- */

static npg_status put_hand(npg_store *out, const npg_facts *facts, const npg_hand *hand)
{
    const saved_progress progress = {hand->window_at,    hand->is_aligned,    hand->total,
                                     hand->last_chamfer, hand->last_isometry, hand->noise};
    NPG_TRY(npg_store_put(out, "progress", &progress, sizeof progress));
    if (hand->usual > 0) NPG_TRY(npg_store_put(out, "usual", &hand->usual, sizeof hand->usual));
    if (hand->lost_count) NPG_TRY(npg_store_put(out, "lost", &hand->lost_count, sizeof hand->lost_count));
    return put_frames(out, hand, facts->reference->vert_count);
}

static npg_vdb_place place_of(const npg_facts *facts, const npg_hand *hand)
{
    npg_window window = npg_plan_window(&facts->plan, hand->window_at, hand->total);
    npg_vdb_place place = {.unit_per_world = facts->box.scale,
                           .frame_first = window.first,
                           .frame_last = window.last,
                           .window = hand->window_at};
    for (int a = 0; a < 3; a++) place.world_centre[a] = facts->box.origin[a] + facts->box.centre[a];
    return place;
}

static npg_status put_first(npg_store *out, const npg_facts *facts, const npg_hand *hand)
{
    bool is_needed = npg_plan_is_first_needed_after(&facts->plan, hand->window_at, hand->total);
    if (!hand->warm || !is_needed) return NPG_OK;
    return npg_fit_copy_save(npg_warm_first(hand->warm), out, "first");
}

typedef struct grids {
    const npg_levels *levels;
    const float *rows;
    const npg_vdb_place *place;
} grids;

static npg_status save_levels(void *user, const char *path)
{
    const grids *g = user;
    return npg_vdb_save_levels(path, g->levels, g->rows, g->place);
}

/* The latent grids for other programs, in a file beside the store; the state itself has them, too. */
static npg_status put_grids(npg_store *out, npg_fit *fit, const char *path, const npg_vdb_place *place)
{
    npg_fit_parts parts = npg_fit_open_parts(fit);
    float *rows;
    uint64_t hash;
    NPG_TRY(npg_alloc(&rows, NPG_FOR_FILES, parts.u->size));
    npg_status status = npg_buffer_read(parts.u, 0, rows, parts.u->size);
    if (!status) status = npg_vdb_file_write(path, &hash, save_levels, &(grids){parts.levels, rows, place});
    if (!status) status = npg_store_put(out, "grids.hash", &hash, sizeof hash);
    npg_release(&rows);
    return status;
}

/* What npg_job_save_state() has written by us. */
typedef struct saving {
    npg_worker *worker;
    const npg_hand *hand;
    npg_fit *fit; /* or NULL */
} saving;

static npg_status write_state(void *user, npg_store *out, const char *grids_path)
{
    const saving *s = user;
    const npg_facts *facts = npg_worker_facts(s->worker);
    npg_vdb_place place = place_of(facts, s->hand);
    NPG_TRY(put_hand(out, facts, s->hand));
    if (!s->fit) return NPG_OK;
    NPG_TRY(put_first(out, facts, s->hand));
    NPG_TRY(put_grids(out, s->fit, grids_path, &place));
    return npg_fit_save(s->fit, out, "fit");
}

static npg_job_moment moment_of(const npg_plan *plan, const npg_hand *hand)
{
    npg_job_moment moment = {.emitted = hand->emitted};
    if (hand->window_at < 0) return moment;
    moment.read = npg_plan_read_before(plan, hand->window_at, hand->total);
    return moment;
}

npg_status npg_checkpoint_save(npg_worker *worker, const npg_hand *hand, npg_fit *fit)
{
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    npg_job_moment moment = moment_of(plan, hand);
    moment.is_forward_end = !npg_plan_is_open(plan) && npg_plan_is_last_forward(plan, hand->window_at);
    saving s = {worker, hand, fit};
    return npg_job_save_state(worker, &moment, write_state, &s);
}

static npg_status write_inside(void *user, npg_store *out, const char *grids_path)
{
    const saving *s = user;
    const npg_facts *facts = npg_worker_facts(s->worker);
    (void)grids_path;
    NPG_TRY(put_hand(out, facts, s->hand));
    NPG_TRY(put_first(out, facts, s->hand));
    return npg_warm_save(s->hand->warm, out);
}

npg_status npg_checkpoint_save_inside(npg_worker *worker, const npg_hand *hand)
{
    npg_job_moment moment = moment_of(&npg_worker_facts(worker)->plan, hand);
    moment.is_inside = true;
    saving s = {worker, hand, NULL};
    return npg_job_save_state(worker, &moment, write_inside, &s);
}

/* ---- restoring: the fit ---- */

npg_status npg_checkpoint_restore_fit(npg_worker *worker, npg_fit *fit, npg_warm *warm)
{
    const npg_record *in = npg_job_state(npg_job_of(worker));
    size_t size;
    if (warm) NPG_TRY(npg_fit_copy_load(npg_warm_first(warm), in, "first"));
    if (!npg_record_find(in, "inside", &size)) return npg_fit_restore(fit, in, "fit");
    return warm ? npg_warm_restore(warm, fit, in) : npg_error(NPG_BAD_INPUT, "a block that is not expected");
}

/* ---- restoring: frames ---- */

static npg_status get_frame(npg_held *held, const npg_record *in, int64_t index, size_t vert_count)
{
    npg_store_array arrays[ARRAYS];
    char name[NPG_BLOCK_NAME];
    size_t size;
    npg_frame *f = &held->frame;
    block_name(name, "frame", index);
    NPG_TRY(npg_record_get(in, name, f, sizeof *f));
    list_arrays(arrays, f, vert_count);
    NPG_TRY(npg_record_get_arrays(in, held, arrays, ARRAYS, NPG_FOR_FRAMES));
    if (!held->solved) return npg_error(NPG_BAD_INPUT, "frame %lld is not solved", (long long)index);
    block_name(name, "path", index);
    const char *path = npg_record_find(in, name, &size);
    return path ? npg_copy_text(&f->path, path) : NPG_OK;
}

static npg_status get_frames(npg_hand *hand, const npg_record *in, int64_t first_index, size_t vert_count)
{
    size_t size;
    const int64_t *indices = npg_record_find(in, "held", &size);
    size_t count = size / sizeof *indices;
    if (!indices) return npg_error(NPG_BAD_INPUT, "the block held is missing");
    NPG_TRY(npg_grow(&hand->held, &hand->held_capacity, count, sizeof *hand->held, NPG_FOR_FRAMES));
    for (size_t i = 0; i < count; i++) {
        if (indices[i] < first_index) continue;
        hand->held[hand->held_count] = (npg_held){0};
        NPG_TRY(get_frame(&hand->held[hand->held_count++], in, indices[i], vert_count));
    }
    return NPG_OK;
}

npg_status npg_checkpoint_restore_hand(npg_worker *worker, npg_hand *hand)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_job *job = npg_job_of(worker);
    const npg_record *in = npg_job_state(job);
    saved_progress progress;
    int64_t planned, first_index = 0, log_bytes;
    NPG_TRY(npg_record_get(in, "progress", &progress, sizeof progress));
    NPG_TRY(npg_record_get(in, "planned", &planned, sizeof planned));
    bool is_appending = planned < facts->plan.frame_count;
    if (is_appending) first_index = npg_plan_window(&facts->plan, 0, -1).first;
    hand->window_at = is_appending ? -1 : progress.window_at;
    hand->is_aligned = progress.is_aligned != 0;
    hand->total = progress.total;
    hand->noise = progress.noise;
    hand->last_chamfer = progress.last_chamfer;
    hand->last_isometry = progress.last_isometry;
    size_t size;
    if (npg_record_find(in, "usual", &size))
        NPG_TRY(npg_record_get(in, "usual", &hand->usual, sizeof hand->usual));
    if (npg_record_find(in, "lost", &size))
        NPG_TRY(npg_record_get(in, "lost", &hand->lost_count, sizeof hand->lost_count));
    npg_job_exported(job, &hand->emitted, &log_bytes);
    return get_frames(hand, in, first_index, facts->reference->vert_count);
}
