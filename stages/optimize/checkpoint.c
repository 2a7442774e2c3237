/* Checkpoint: the state of a run after a closed window, to the job's folder and back. */
#include "optimize/checkpoint.h"

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "job/state_mesh.h"
#include "optimize/fit_state.h"
#include "pipeline/file.h"

/* A held frame but for its arrays. */
typedef struct saved_frame {
    int64_t index, number;
    uint64_t fields, point_count, vert_count;
    uint8_t is_key, is_skipped, is_held, has_normals, has_aligned, unused[3];
    npg_cleaning cleaning;
} saved_frame;

typedef struct saved_progress {
    int64_t window_at, emitted, read, is_aligned;
    double last_chamfer, last_isometry;
} saved_progress;

static void block_name(char name[NPG_BLOCK_NAME], const char *what, int64_t index)
{
    snprintf(name, NPG_BLOCK_NAME, "%s.%lld", what, (long long)index);
}

/* ---- saving: facts ---- */

static npg_status put_story(npg_archive_writer *out, npg_worker *worker)
{
    json_t *story = npg_worker_whole_story(worker, "mesh");
    char *text = story ? json_dumps(story, JSON_COMPACT) : NULL;
    json_decref(story);
    if (!text) return npg_error(NPG_MEMORY, "no memory for the report");
    npg_status status = npg_archive_put(out, "story", text, strlen(text) + 1);
    free(text);
    return status;
}

static npg_status put_facts(npg_archive_writer *out, npg_worker *worker)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_facts plain;
    int64_t tied_number;
    size_t tied_count;
    const float *tied = npg_job_tied(facts->job, &tied_number, &tied_count);
    memcpy(&plain, facts, sizeof plain); /* with its padding: the same bytes every time */
    plain.reference = NULL;
    plain.job = NULL;
    plain.is_resumed = false;
    plain.resumed_read = 0;
    NPG_TRY(npg_archive_put(out, "planned", &facts->plan.frame_count, sizeof(int64_t)));
    NPG_TRY(npg_archive_put(out, "facts", &plain, sizeof plain));
    if (tied) NPG_TRY(npg_archive_put(out, "tied", tied, tied_count * 3 * sizeof(float)));
    if (tied) NPG_TRY(npg_archive_put(out, "tied.number", &tied_number, sizeof tied_number));
    NPG_TRY(put_story(out, worker));
    return npg_state_put_mesh(out, facts->reference);
}

/* ---- saving: frames ---- */

static npg_status put_array(npg_archive_writer *out, const char *what, int64_t index, const float *values,
                            size_t count)
{
    char name[NPG_BLOCK_NAME];
    block_name(name, what, index);
    return values ? npg_archive_put(out, name, values, count * 3 * sizeof(float)) : NPG_OK;
}

static npg_status put_frame(npg_archive_writer *out, const npg_held *held, size_t vert_count)
{
    const npg_frame *f = &held->frame;
    char name[NPG_BLOCK_NAME];
    saved_frame saved = {.index = f->index,
                         .number = f->number,
                         .fields = f->fields,
                         .point_count = f->point_count,
                         .vert_count = vert_count,
                         .is_key = f->is_key,
                         .is_skipped = f->is_skipped,
                         .is_held = f->is_held,
                         .has_normals = f->normals != NULL,
                         .has_aligned = f->vert_unit != NULL,
                         .cleaning = f->cleaning};
    block_name(name, "frame", f->index);
    NPG_TRY(npg_archive_put(out, name, &saved, sizeof saved));
    NPG_TRY(put_array(out, "points", f->index, f->pos_local, f->point_count));
    NPG_TRY(put_array(out, "normals", f->index, f->normals, f->point_count));
    NPG_TRY(put_array(out, "aligned", f->index, f->vert_unit, vert_count));
    NPG_TRY(put_array(out, "solved", f->index, held->solved, vert_count));
    block_name(name, "path", f->index);
    return f->path ? npg_archive_put(out, name, f->path, strlen(f->path) + 1) : NPG_OK;
}

static npg_status put_frames(npg_archive_writer *out, const npg_hand *hand, size_t vert_count)
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
    if (!status) status = npg_archive_put(out, "held", indices, count * sizeof *indices);
    npg_release(&indices);
    return status;
}

/* ---- saving: all of it ---- */

static npg_status put_hand(npg_archive_writer *out, npg_worker *worker, const npg_hand *hand)
{
    const npg_facts *facts = npg_worker_facts(worker);
    const saved_progress progress = {
        hand->window_at,  hand->emitted,      npg_plan_read_before(&facts->plan, hand->window_at),
        hand->is_aligned, hand->last_chamfer, hand->last_isometry};
    size_t size;
    NPG_TRY(npg_archive_put(out, "progress", &progress, sizeof progress));
    void *poses = npg_job_take_poses(facts->job, progress.read, &size);
    if (hand->is_aligned && !poses)
        return npg_error(NPG_FAILED, "the poses after %lld frames are not there", (long long)progress.read);
    npg_status status = poses ? npg_archive_put(out, "poses", poses, size) : NPG_OK;
    npg_release(&poses);
    if (!status) status = put_frames(out, hand, facts->reference->vert_count);
    return status;
}

/* The list of frames goes with the state: it has to be on disk before. */
static npg_status put_list(npg_archive_writer *out, const npg_worker *worker, const npg_hand *hand)
{
    npg_job_list list = {.count = hand->emitted};
    const char *output = npg_worker_settings(worker)->output;
    char *path;
    NPG_TRY(npg_job_wait_exported(npg_worker_facts(worker)->job, worker, hand->emitted, &list.bytes));
    NPG_TRY(npg_join_path(&path, output, "frames.partial.jsonl"));
    int fd = open(path, O_RDWR | O_CLOEXEC);
    npg_status status = NPG_OK;
    if (fd < 0 || fdatasync(fd)) status = npg_error_errno(NPG_DISK, "can't sync %s", path);
    if (fd >= 0) close(fd);
    if (!status) status = npg_hash_file(&list.hash, path, (uint64_t)list.bytes);
    npg_release(&path);
    return status ? status : npg_archive_put(out, "list", &list, sizeof list);
}

static npg_vdb_place place_of(const npg_facts *facts, const npg_hand *hand)
{
    npg_window window = npg_plan_window(&facts->plan, hand->window_at);
    npg_vdb_place place = {.unit_per_world = facts->box.scale * hand->figure.scale,
                           .frame_first = window.first,
                           .frame_last = window.last,
                           .window = hand->window_at};
    for (int a = 0; a < 3; a++)
        place.world_centre[a] =
            facts->box.origin[a] + facts->box.centre[a] + hand->figure.centre[a] / facts->box.scale;
    return place;
}

static npg_status put_all(npg_archive_writer *out, npg_worker *worker, const npg_hand *hand, npg_fit *fit,
                          const char *grids_path, int64_t forward)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_vdb_place place = place_of(facts, hand);
    NPG_TRY(put_list(out, worker, hand));
    NPG_TRY(npg_archive_put(out, "forward", &forward, sizeof forward));
    NPG_TRY(put_facts(out, worker));
    NPG_TRY(put_hand(out, worker, hand));
    return npg_fit_save(fit, out, grids_path, &place);
}

npg_status npg_checkpoint_save(npg_worker *worker, const npg_hand *hand, npg_fit *fit)
{
    const npg_facts *facts = npg_worker_facts(worker);
    npg_job *job = facts->job;
    npg_archive_writer *out = NULL;
    char *path, *grids_path;
    int64_t serial;
    bool is_forward_end = npg_plan_is_last_forward(&facts->plan, hand->window_at);
    NPG_TRY(npg_job_next(job, &serial, &path, &grids_path));
    npg_status status = npg_archive_create(&out, path);
    if (!status)
        status = put_all(out, worker, hand, fit, grids_path,
                         is_forward_end ? serial : npg_job_forward_serial(job));
    if (!status)
        status = npg_archive_commit(&out);
    else
        npg_archive_discard(&out);
    npg_release(&path);
    npg_release(&grids_path);
    return status ? status : npg_job_commit(job, is_forward_end);
}

/* ---- restoring: facts ---- */

static npg_status get_story(npg_worker *worker, const npg_archive *in)
{
    size_t size;
    const char *text = npg_archive_find(in, "story", &size);
    json_t *story = text && size ? json_loadb(text, size - 1, 0, NULL) : NULL;
    if (!story) return npg_error(NPG_BAD_INPUT, "the report so far is missing");
    npg_worker_retell(worker, story);
    json_decref(story);
    return NPG_OK;
}

static npg_status get_tied(npg_job *job, const npg_archive *in)
{
    size_t size;
    int64_t number;
    const float *tied = npg_archive_find(in, "tied", &size);
    if (!tied) return NPG_OK;
    NPG_TRY(npg_archive_get(in, "tied.number", &number, sizeof number));
    return npg_job_leave_tied(job, number, tied, size / (3 * sizeof(float)));
}

npg_status npg_checkpoint_restore_facts(npg_worker *worker)
{
    npg_facts *facts = npg_worker_facts(worker), restored;
    npg_job *job = facts->job;
    const npg_archive *in = npg_job_archive(job);
    saved_progress progress;
    npg_job_list list;
    NPG_TRY(npg_archive_get(in, "facts", &restored, sizeof restored));
    NPG_TRY(npg_archive_get(in, "progress", &progress, sizeof progress));
    NPG_TRY(npg_archive_get(in, "list", &list, sizeof list));
    NPG_TRY(get_story(worker, in));
    NPG_TRY(npg_state_get_mesh(&restored.reference, in));
    *facts = restored; /* the run owns the reference now */
    facts->job = job;
    facts->is_resumed = true;
    facts->resumed_read = progress.read;
    npg_job_note_exported(job, list.count, list.bytes);
    return get_tied(job, in);
}

/* ---- restoring: frames ---- */

static npg_status get_array(const npg_archive *in, const char *what, int64_t index, float **values,
                            size_t count)
{
    char name[NPG_BLOCK_NAME];
    size_t size;
    block_name(name, what, index);
    if (!npg_archive_find(in, name, &size) || size / (3 * sizeof(float)) != count)
        return npg_error(NPG_BAD_INPUT, "the block %s has not the size of %zu points", name, count);
    NPG_TRY(npg_alloc_array(values, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    return npg_archive_get(in, name, *values, count * 3 * sizeof(float));
}

static npg_status get_frame(npg_held *held, const npg_archive *in, int64_t index, size_t vert_count)
{
    char name[NPG_BLOCK_NAME];
    saved_frame saved;
    size_t size;
    npg_frame *f = &held->frame;
    block_name(name, "frame", index);
    NPG_TRY(npg_archive_get(in, name, &saved, sizeof saved));
    if (saved.vert_count != vert_count || saved.index != index)
        return npg_error(NPG_BAD_INPUT, "frame %lld is not one of this reference", (long long)index);
    *f = (npg_frame){.index = saved.index,
                     .number = saved.number,
                     .fields = (uint32_t)saved.fields,
                     .is_key = saved.is_key,
                     .is_skipped = saved.is_skipped,
                     .is_held = saved.is_held,
                     .point_count = saved.point_count,
                     .cleaning = saved.cleaning};
    if (saved.point_count) NPG_TRY(get_array(in, "points", index, &f->pos_local, f->point_count));
    if (saved.has_normals && f->point_count)
        NPG_TRY(get_array(in, "normals", index, &f->normals, f->point_count));
    if (saved.has_aligned) NPG_TRY(get_array(in, "aligned", index, &f->vert_unit, vert_count));
    if (saved.has_aligned) f->vert_count = vert_count;
    NPG_TRY(get_array(in, "solved", index, &held->solved, vert_count));
    block_name(name, "path", index);
    const char *path = npg_archive_find(in, name, &size);
    return path ? npg_copy_text(&f->path, path) : NPG_OK;
}

static npg_status get_frames(npg_hand *hand, const npg_archive *in, int64_t first_index, size_t vert_count)
{
    size_t size;
    const int64_t *indices = npg_archive_find(in, "held", &size);
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
    const npg_archive *in = npg_job_archive(facts->job);
    saved_progress progress;
    int64_t planned, first_index = 0, list_bytes;
    NPG_TRY(npg_archive_get(in, "progress", &progress, sizeof progress));
    NPG_TRY(npg_archive_get(in, "planned", &planned, sizeof planned));
    bool is_appending = planned < facts->plan.frame_count;
    if (is_appending) first_index = npg_plan_window(&facts->plan, 0).first;
    hand->window_at = is_appending ? -1 : progress.window_at;
    hand->is_aligned = progress.is_aligned != 0;
    hand->last_chamfer = progress.last_chamfer;
    hand->last_isometry = progress.last_isometry;
    npg_job_exported(facts->job, &hand->emitted, &list_bytes);
    return get_frames(hand, in, first_index, facts->reference->vert_count);
}
