/* Replay: records of windows read back, their decoders or poses asked for any time. */
#include "optimize/replay.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "kernels/latent.h"
#include "kernels/mlp.h"
#include "optimize/record.h"
#include "pipeline/archive.h"
#include "pipeline/file.h"
#include "pipeline/folder.h"

#define MOTION_NAME "motion_%06lld.npg" /* as job/job.h says */
#define OPEN_MOST   6 /* records that are kept open: those around a moment, and of their frames' neighbours */

typedef struct record {
    int64_t serial;
    npg_record_facts facts;
    int64_t layers; /* hidden ones of its decoder */
} record;

typedef struct open_record {
    npg_archive *archive; /* NULL: free */
    size_t which;
    uint64_t used_at;
} open_record;

struct npg_replay {
    char *folder;
    record *records; /* in the order they were solved; owned */
    size_t count;
    open_record open[OPEN_MOST];
    uint64_t clock;
    bool is_aligned;
    size_t verts;
    float *rest; /* V x 3 */
    /* without alignment */
    npg_mlp mlp; /* of one frame */
    npg_time_code *time_code;
    float *dense, *out, *codes; /* V x 3: what a window makes of the moment; rows x 8; 2 M */
};

/* ---- records ---- */

static npg_status path_of(const npg_replay *r, char **path, int64_t serial)
{
    char name[64];
    snprintf(name, sizeof name, MOTION_NAME, (long long)serial);
    return npg_join_path(path, r->folder, name);
}

static npg_status bad(int64_t serial, const char *what)
{
    char name[64];
    snprintf(name, sizeof name, MOTION_NAME, (long long)serial);
    return npg_error(NPG_BAD_INPUT, "job/%s: %s", name, what);
}

/* A block of exactly this size, else NULL with the reason in *status. */
static const void *block(npg_status *status, const npg_archive *in, const record *of, const char *name,
                         size_t size)
{
    size_t found;
    const void *bytes = *status ? NULL : npg_archive_find(in, name, &found);
    if (!*status && (!bytes || found != size)) {
        char text[96];
        snprintf(text, sizeof text, "the block %s is missing or has not its size", name);
        *status = bad(of->serial, text);
    }
    return *status ? NULL : bytes;
}

static bool are_sane(const npg_record_facts *f)
{
    bool has_order = f->first >= 0 && f->first <= f->new_first && f->new_first <= f->new_last &&
                     f->new_last <= f->last && f->last < INT32_MAX && llabs(f->direction) <= 1;
    bool has_sizes = f->vert_count > 0 && f->vert_count < INT32_MAX;
    bool has_shape = f->width_1 >= 32 && f->width_1 <= 4096 && f->width_2 >= 32 && f->width_2 <= 4096 &&
                     f->width_1 % 32 == 0 && f->width_2 % 32 == 0 && f->frequencies > 0 &&
                     f->frequencies <= 16;
    const npg_plan *plan = &f->time_plan;
    bool has_time = plan->frame_count > 0 && plan->frame_count < INT32_MAX && plan->window > 0 &&
                    plan->window < INT32_MAX && plan->key >= 0 && plan->key < INT32_MAX &&
                    plan->first_count >= 0 && plan->first_count < INT32_MAX && f->time_span > 0 &&
                    f->time_span <= 1;
    return has_order && has_sizes && has_shape && has_time && f->time_kind >= NPG_TIME_FOURIER &&
           f->time_kind <= NPG_TIME_LEARNED && f->rotation >= NPG_ROTATION_QUATERNION &&
           f->rotation <= NPG_ROTATION_EXPONENTIAL;
}

static bool belong_together(const record *one, const record *other)
{
    const npg_record_facts *a = &one->facts, *b = &other->facts;
    return a->vert_count == b->vert_count && a->is_aligned == b->is_aligned && a->width_1 == b->width_1 &&
           a->width_2 == b->width_2 && one->layers == other->layers && a->frequencies == b->frequencies &&
           a->time_kind == b->time_kind && a->rotation == b->rotation;
}

static npg_mlp_shape shape_of(const record *of)
{
    const npg_record_facts *f = &of->facts;
    return (npg_mlp_shape){(size_t)f->width_1, (size_t)f->width_2, (size_t)of->layers,
                           2 * (size_t)f->frequencies, (float)f->slope};
}

static npg_status read_layers(record *of, const npg_archive *in)
{
    size_t size;
    of->layers = NPG_RECORD_LAYERS;
    if (!npg_archive_find(in, "layers", &size)) return NPG_OK;
    NPG_TRY(npg_archive_get(in, "layers", &of->layers, sizeof of->layers));
    return of->layers >= 1 && of->layers <= NPG_MLP_LAYERS_MAX
               ? NPG_OK
               : bad(of->serial, "its decoder has a number of layers that makes no sense");
}

/* Sizes of all blocks, so that a record which opens can be used. */
static npg_status check_blocks(const npg_archive *in, const record *of)
{
    const npg_record_facts *f = &of->facts;
    const npg_mlp_shape shape = shape_of(of);
    size_t verts = (size_t)f->vert_count;
    npg_status status = NPG_OK;
    block(&status, in, of, "rest", verts * 3 * sizeof(float));
    if (!f->is_aligned) {
        block(&status, in, of, "decoder", npg_mlp_param_count(&shape) * sizeof(float));
        block(&status, in, of, "features", verts * NPG_LATENT_CHANNELS * sizeof(float));
    }
    for (int64_t i = f->first; f->is_aligned && i <= f->last && !status; i++) {
        char name[NPG_BLOCK_NAME];
        snprintf(name, sizeof name, "pose.%lld", (long long)i);
        block(&status, in, of, name, verts * 3 * sizeof(float));
    }
    return status;
}

static npg_status read_record(const npg_replay *r, npg_archive **out, record *of)
{
    char *path;
    NPG_TRY(path_of(r, &path, of->serial));
    npg_status status = npg_archive_open(out, path);
    npg_release(&path);
    NPG_TRY(status);
    status = npg_archive_get(*out, "window", &of->facts, sizeof of->facts);
    if (!status && !are_sane(&of->facts)) status = bad(of->serial, "its window makes no sense");
    if (!status) status = read_layers(of, *out);
    if (!status) status = check_blocks(*out, of);
    if (status) npg_archive_close(out);
    return status;
}

/* A record for each window, in the order they were solved. */
static npg_status find_records(npg_replay *r)
{
    int64_t *serials;
    NPG_TRY(npg_folder_numbers(&serials, &r->count, r->folder, "motion_", "npg"));
    if (!r->count) return NPG_END; /* live runs keep none */
    npg_status status = npg_alloc_array(&r->records, NPG_FOR_FILES, r->count, sizeof *r->records);
    for (size_t i = 0; i < r->count && !status; i++) r->records[i].serial = serials[i];
    npg_release(&serials);
    return status;
}

/* The facts of all; the rest position and the time code from the first. */
static npg_status read_records(npg_replay *r)
{
    for (size_t i = 0; i < r->count; i++) {
        npg_archive *in;
        record *at = &r->records[i];
        NPG_TRY(read_record(r, &in, at));
        npg_status status = NPG_OK;
        if (!belong_together(at, &r->records[0]))
            status = bad(at->serial, "it is of another run than the records before it");
        size_t size = (size_t)at->facts.vert_count * 3 * sizeof(float);
        if (!i && !status) status = npg_alloc(&r->rest, NPG_FOR_MESH, size);
        if (!status && !i) status = npg_archive_get(in, "rest", r->rest, size);
        npg_archive_close(&in);
        NPG_TRY(status);
    }
    return NPG_OK;
}

/* The archive of a record, a loan until the next moment is asked for. */
static npg_status open_one(npg_replay *r, size_t which, const npg_archive **out)
{
    open_record *oldest = &r->open[0];
    for (size_t i = 0; i < OPEN_MOST; i++) {
        open_record *at = &r->open[i];
        if (at->archive && at->which == which) {
            at->used_at = ++r->clock;
            *out = at->archive;
            return NPG_OK;
        }
        if (!at->archive || (oldest->archive && at->used_at < oldest->used_at)) oldest = at;
    }
    npg_archive_close(&oldest->archive);
    NPG_TRY(read_record(r, &oldest->archive, &r->records[which]));
    oldest->which = which;
    oldest->used_at = ++r->clock;
    *out = oldest->archive;
    return NPG_OK;
}

/* ---- opening ---- */

static npg_status open_decoder(npg_replay *r, npg_device *device)
{
    const npg_record_facts *f = &r->records[0].facts;
    const npg_mlp_shape shape = shape_of(&r->records[0]);
    size_t rows = npg_mlp_rows(device, r->verts);
    NPG_TRY(npg_time_code_open(&r->time_code, (npg_time_kind)f->time_kind, (size_t)f->frequencies, f->seed));
    NPG_TRY(npg_alloc_array(&r->codes, NPG_FOR_FIT, shape.code_size, sizeof(float)));
    NPG_TRY(npg_alloc_array(&r->out, NPG_FOR_FIT, rows, NPG_MLP_OUT * sizeof(float)));
    NPG_TRY(npg_alloc_array(&r->dense, NPG_FOR_FIT, r->verts, 3 * sizeof(float)));
    return npg_mlp_open(&r->mlp, device, &shape, rows, 1, 0);
}

npg_status npg_replay_open(npg_replay **out, npg_device *device, const char *folder)
{
    npg_replay *r;
    *out = NULL;
    NPG_TRY(npg_alloc(&r, NPG_FOR_FIT, sizeof *r));
    npg_status status = npg_copy_text(&r->folder, folder);
    if (!status) status = find_records(r);
    if (!status) status = read_records(r);
    if (!status) {
        r->verts = (size_t)r->records[0].facts.vert_count;
        r->is_aligned = r->records[0].facts.is_aligned != 0;
        if (!r->is_aligned) status = open_decoder(r, device);
    }
    if (status) npg_replay_close(&r);
    *out = r;
    return status;
}

void npg_replay_close(npg_replay **slot)
{
    npg_replay *r = *slot;
    if (!r) return;
    for (size_t i = 0; i < OPEN_MOST; i++) npg_archive_close(&r->open[i].archive);
    npg_mlp_close(&r->mlp);
    npg_time_code_close(&r->time_code);
    void *all[] = {&r->folder, &r->records, &r->rest, &r->dense, &r->out, &r->codes};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_release(all[i]);
    npg_release(slot);
}

size_t npg_replay_vert_count(const npg_replay *r)
{
    return r->verts;
}

const float *npg_replay_rest(const npg_replay *r)
{
    return r->rest;
}

void npg_replay_range(const npg_replay *r, int64_t *first, int64_t *last)
{
    *first = INT64_MAX;
    *last = -1;
    for (size_t i = 0; i < r->count; i++) {
        const npg_record_facts *f = &r->records[i].facts;
        if (f->new_first < *first) *first = f->new_first;
        if (f->new_last > *last) *last = f->new_last;
    }
}

/* ---- aligned frames at any time ---- */

/* From the last window that had the frame: each moves those it shares a little.  NULL with NPG_OK where there
 * is no such frame. */
static npg_status frame_pose(npg_replay *r, const float **pose, int64_t index)
{
    *pose = NULL;
    for (size_t i = r->count; i-- > 0;) {
        const npg_record_facts *f = &r->records[i].facts;
        const npg_archive *in;
        char name[NPG_BLOCK_NAME];
        npg_status status = NPG_OK;
        if (index < f->first || index > f->last) continue;
        NPG_TRY(open_one(r, i, &in));
        snprintf(name, sizeof name, "pose.%lld", (long long)index);
        *pose = block(&status, in, &r->records[i], name, r->verts * 3 * sizeof(float));
        return status;
    }
    return NPG_OK;
}

/* Catmull-Rom; one-sided slopes at the ends of the run. */
static void mix_poses(float *out, const float *const at[4], double share, size_t count)
{
    double u = share, u2 = u * u, u3 = u2 * u;
    double w1 = 2 * u3 - 3 * u2 + 1, w2 = 3 * u2 - 2 * u3, s1 = u3 - 2 * u2 + u, s2 = u3 - u2;
    for (size_t i = 0; i < count; i++) {
        double p = (double)at[1][i], q = (double)at[2][i];
        double slope1 = at[0] ? (q - (double)at[0][i]) / 2 : q - p;
        double slope2 = at[3] ? ((double)at[3][i] - p) / 2 : q - p;
        out[i] = (float)(w1 * p + w2 * q + s1 * slope1 + s2 * slope2);
    }
}

static npg_status mix_frames(npg_replay *r, float *out, double index)
{
    int64_t from = (int64_t)floor(index);
    double share = index - (double)from;
    const float *at[4] = {NULL, NULL, NULL, NULL};
    for (int64_t k = share > 0 ? 0 : 1; k < (share > 0 ? 4 : 2); k++)
        NPG_TRY(frame_pose(r, &at[k], from + k - 1));
    if (!at[1] || (share > 0 && !at[2]))
        return npg_error(NPG_BAD_INPUT, "job: no record has frame %lld",
                         (long long)(at[1] ? from + 1 : from));
    if (share > 0)
        mix_poses(out, at, share, 3 * r->verts);
    else
        memcpy(out, at[1], r->verts * 3 * sizeof(float));
    return NPG_OK;
}

/* ---- a decoder at any time ---- */

/* r->out: what the decoder says of the vertices. */
static npg_status decode(npg_replay *r, const npg_archive *in, const record *of, double index)
{
    npg_mlp *m = &r->mlp;
    npg_status status = NPG_OK;
    size_t row_size = NPG_LATENT_CHANNELS * sizeof(float), count, found;
    int64_t *step;
    double *parts = npg_time_code_parts(r->time_code, &count, &step);
    const double *saved = npg_archive_find(in, "time", &found);
    const float *params = block(&status, in, of, "decoder", npg_mlp_param_count(&m->shape) * sizeof(float));
    const float *features = block(&status, in, of, "features", r->verts * row_size);
    NPG_TRY(status);
    if (!saved || found != count * sizeof *saved) return bad(of->serial, "its time code has another size");
    if (count) memcpy(parts, saved, found);
    double time = npg_window_time(&of->facts.time_plan, of->facts.time_span, index);
    npg_time_code_fill(r->time_code, r->codes, &time, 1);
    NPG_TRY(npg_buffer_write(&m->params, 0, params, npg_mlp_param_count(&m->shape) * sizeof(float)));
    NPG_TRY(npg_buffer_write(&m->z, 0, features, r->verts * row_size));
    NPG_TRY(npg_buffer_write(&m->code, 0, r->codes, m->shape.code_size * sizeof(float)));
    NPG_TRY(npg_mlp_begin(m));
    NPG_TRY(npg_mlp_forward(m, 0, 1));
    return npg_buffer_read(&m->out, 0, r->out, r->verts * NPG_MLP_OUT * sizeof(float));
}

/* r->dense: where this window alone puts the surface. */
static npg_status pose_of(npg_replay *r, size_t which, double index)
{
    const record *of = &r->records[which];
    const npg_archive *in;
    NPG_TRY(open_one(r, which, &in));
    NPG_TRY(decode(r, in, of, index));
    for (size_t v = 0; v < r->verts; v++) {
        double out[7], rest[3], x[3];
        for (int i = 0; i < 7; i++) out[i] = (double)r->out[v * NPG_MLP_OUT + (size_t)i];
        for (size_t i = 0; i < 3; i++) rest[i] = (double)r->rest[3 * v + i];
        npg_transform_ref(x, out, rest, (npg_rotation)of->facts.rotation);
        if (!isfinite(x[0] + x[1] + x[2])) return bad(of->serial, "its decoder gives what is not finite");
        for (size_t i = 0; i < 3; i++) r->dense[3 * v + i] = (float)x[i];
    }
    return NPG_OK;
}

static npg_window window_of(const npg_record_facts *f)
{
    return (npg_window){.first = f->first,
                        .last = f->last,
                        .new_first = f->new_first,
                        .new_last = f->new_last,
                        .direction = (int)f->direction};
}

static npg_status mix_windows(npg_replay *r, float *vert_unit, double index)
{
    bool is_first = true;
    for (size_t w = 0; w < r->count; w++) {
        npg_window window = window_of(&r->records[w].facts);
        if (index <= (double)(window.first - 1) || index >= (double)(window.last + 1)) continue;
        float share = is_first ? 1 : (float)npg_window_share(&window, index);
        if (share <= 0) continue;
        NPG_TRY(pose_of(r, w, index));
        for (size_t i = 0; i < 3 * r->verts; i++)
            vert_unit[i] = is_first ? r->dense[i] : vert_unit[i] + share * (r->dense[i] - vert_unit[i]);
        is_first = false;
    }
    return is_first ? npg_error(NPG_BAD_INPUT, "job: no record has frame %g", index) : NPG_OK;
}

npg_status npg_replay_vertices(npg_replay *r, float *vert_unit, double index)
{
    int64_t first, last;
    npg_replay_range(r, &first, &last);
    if (!(index >= (double)first && index <= (double)last))
        return npg_error(NPG_BAD_INPUT, "job: no record has frame %g, only %lld to %lld are there", index,
                         (long long)first, (long long)last);
    return r->is_aligned ? mix_frames(r, vert_unit, index) : mix_windows(r, vert_unit, index);
}
