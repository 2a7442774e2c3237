/* Checkpoint: the state of a run after a closed window, to the job's folder and back. */
#include "optimize/window.h"

#include <stddef.h>
#include <stdio.h>
#include <string.h>

#include "job/vdb_file.h"
#include "pipeline/plan.h"

typedef struct saved_progress {
    int64_t window_at, total;
    npg_solved last;
} saved_progress;

/* Blocks are of a frame: its index goes behind their names. */
static void add_index(char name[NPG_BLOCK_NAME], int64_t index)
{
    size_t used = strlen(name);
    snprintf(name + used, NPG_BLOCK_NAME - used, ".%lld", (long long)index);
}

enum { ARRAYS = NPG_FRAME_ARRAYS + 1, SOLVED = NPG_FRAME_ARRAYS };

/* The frame's, and where its vertices were solved to. */
static void list_arrays(npg_store_array list[ARRAYS], const npg_frame *frame, size_t vert_count)
{
    npg_frame_arrays(list, frame);
    list[SOLVED] = (npg_store_array){"solved", offsetof(npg_held, solved), vert_count, 3 * sizeof(float)};
    for (size_t i = 0; i < ARRAYS; i++) {
        add_index(list[i].name, frame->index);
        if (i != SOLVED) list[i].offset += offsetof(npg_held, frame);
    }
}

/* ---- saving: frames ---- */

static npg_status put_frame(npg_store *out, const npg_held *held, size_t vert_count)
{
    const npg_frame *f = &held->frame;
    npg_store_array list[ARRAYS];
    char name[NPG_BLOCK_NAME] = "frame", path_name[NPG_BLOCK_NAME] = "path";
    const npg_frame bare = npg_frame_bare(f);
    add_index(name, f->index);
    NPG_TRY(npg_store_put(out, name, &bare, sizeof bare));
    list_arrays(list, f, vert_count);
    NPG_TRY(npg_store_put_arrays(out, held, list, ARRAYS));
    add_index(path_name, f->index);
    return f->path ? npg_store_put(out, path_name, f->path, strlen(f->path) + 1) : NPG_OK;
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

/* What npg_job_save_state() has written by us. */
typedef struct saving {
    npg_worker *worker;
    const npg_hand *hand;
    npg_window_solver *solver;
    bool is_inside;
} saving;

static npg_status write_state(void *user, npg_store *out, const char *grids_path)
{
    const saving *s = user;
    const npg_facts *facts = npg_worker_facts(s->worker);
    const npg_hand *hand = s->hand;
    const saved_progress progress = {hand->window_at, hand->total, hand->last};
    npg_solver_moment moment = {s->is_inside, hand->window_at, .grids_path = grids_path};
    if (hand->window_at >= 0) moment.window = npg_plan_window(&facts->plan, hand->window_at, hand->total);
    NPG_TRY(npg_store_put(out, "progress", &progress, sizeof progress));
    NPG_TRY(put_frames(out, hand, facts->reference->vert_count));
    return npg_window_save(s->solver, out, &moment);
}

npg_status npg_checkpoint_save(npg_worker *worker, const npg_hand *hand, npg_window_solver *solver,
                               bool is_inside)
{
    const npg_plan *plan = &npg_worker_facts(worker)->plan;
    npg_job_moment moment = {.emitted = hand->emitted, .is_inside = is_inside};
    if (hand->window_at >= 0) moment.read = npg_plan_read_before(plan, hand->window_at, hand->total);
    moment.is_forward_end =
        !is_inside && !npg_plan_is_open(plan) && npg_plan_is_last_forward(plan, hand->window_at);
    saving s = {worker, hand, solver, is_inside};
    return npg_job_save_state(worker, &moment, write_state, &s);
}

/* ---- restoring: frames ---- */

static npg_status get_frame(npg_held *held, const npg_record *in, int64_t index, size_t vert_count)
{
    npg_store_array list[ARRAYS];
    char name[NPG_BLOCK_NAME] = "frame", path_name[NPG_BLOCK_NAME] = "path";
    size_t size;
    npg_frame *f = &held->frame;
    add_index(name, index);
    NPG_TRY(npg_record_get(in, name, f, sizeof *f));
    list_arrays(list, f, vert_count);
    NPG_TRY(npg_record_get_arrays(in, held, list, ARRAYS, NPG_FOR_FRAMES));
    if (!held->solved) return npg_error(NPG_BAD_INPUT, "frame %lld is not solved", (long long)index);
    add_index(path_name, index);
    const char *path = npg_record_find(in, path_name, &size);
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

npg_status npg_checkpoint_restore(npg_worker *worker, npg_hand *hand)
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
    hand->total = progress.total;
    hand->last = progress.last;
    npg_job_exported(job, &hand->emitted, &log_bytes);
    return get_frames(hand, in, first_index, facts->reference->vert_count);
}
