/* Log of what a fusing pass found. */
#include "align/follow_log.h"

#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/file.h"

typedef struct head {
    char magic[8];
    uint64_t job, reference, nodes, state_bytes, zero[3];
} head;

typedef struct group_head {
    uint64_t bytes, hash;
} group_head;

struct npg_follow_log {
    int fd;
    char *path; /* owned */
    size_t pose_bytes, state_bytes;
    int64_t groups_left;   /* to be read                                            */
    off_t at;              /* of the next group                                     */
    unsigned char *buffer; /* of the group at hand, owned                           */
    size_t size, capacity; /* filled of it, and its room                            */
    size_t next;           /* where the next frame is read; 0: no group is at hand  */
};

static uint64_t hash_reference(const npg_mesh *mesh)
{
    uint64_t places = XXH3_64bits(mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
    return places ^ XXH3_64bits(mesh->faces, mesh->face_count * 3 * sizeof(uint32_t));
}

static npg_status fail(const npg_follow_log *log, const char *does)
{
    return npg_error_errno(NPG_DISK, "can't %s %s", does, log->path);
}

/* *size gets what there is of it. */
static npg_status read_at(const npg_follow_log *log, void *data, size_t *size, off_t at)
{
    return npg_read_at(log->fd, data, size, at) ? NPG_OK : fail(log, "read");
}

static npg_status write_at(const npg_follow_log *log, const void *data, size_t size, off_t at)
{
    return npg_write_at(log->fd, data, size, at) ? NPG_OK : fail(log, "write");
}

static npg_status append(npg_follow_log *log, const void *data, size_t size)
{
    NPG_TRY(npg_grow(&log->buffer, &log->capacity, log->size + size, 1, NPG_FOR_FIT));
    memcpy(log->buffer + log->size, data, size);
    log->size += size;
    return NPG_OK;
}

/* ---- reading ---- */

static size_t frame_bytes(const npg_follow_log *log)
{
    return sizeof(int64_t) + log->pose_bytes;
}

/* The group at `at` into the buffer; false where it is not whole, or no group. */
static npg_status read_group(npg_follow_log *log, off_t at, off_t file_size, bool *is_whole)
{
    group_head g;
    uint64_t frames;
    size_t size = sizeof g, least = sizeof frames + log->state_bytes;
    *is_whole = false;
    NPG_TRY(read_at(log, &g, &size, at));
    if (size < sizeof g || g.bytes < least || g.bytes > (uint64_t)(file_size - at)) return NPG_OK;
    NPG_TRY(npg_grow(&log->buffer, &log->capacity, (size_t)g.bytes, 1, NPG_FOR_FIT));
    log->size = size = (size_t)g.bytes;
    NPG_TRY(read_at(log, log->buffer, &size, at + (off_t)sizeof g));
    if (size < g.bytes || XXH3_64bits(log->buffer, size) != g.hash) return NPG_OK;
    memcpy(&frames, log->buffer, sizeof frames);
    *is_whole = frames <= g.bytes / frame_bytes(log) && g.bytes == least + frames * frame_bytes(log);
    return NPG_OK;
}

/* Count the groups that are whole; what follows them is cut off. */
static npg_status count_groups(npg_follow_log *log)
{
    struct stat info;
    off_t at = sizeof(head);
    bool is_whole = true;
    if (fstat(log->fd, &info)) return fail(log, "look at");
    while (is_whole) {
        NPG_TRY(read_group(log, at, info.st_size, &is_whole));
        if (!is_whole) break;
        at += (off_t)(sizeof(group_head) + log->size);
        log->groups_left++;
    }
    return ftruncate(log->fd, at) ? fail(log, "write") : NPG_OK;
}

static npg_status begin(npg_follow_log *log, const npg_follow_key *key)
{
    head wanted = {"NPGFOLLW",      key->job,         hash_reference(key->reference),
                   key->node_count, key->state_bytes, {0}};
    head found;
    size_t size = sizeof found;
    log->at = sizeof(head);
    NPG_TRY(read_at(log, &found, &size, 0));
    if (size == sizeof found && !memcmp(&found, &wanted, sizeof found)) return count_groups(log);
    if (ftruncate(log->fd, 0)) return fail(log, "write");
    return write_at(log, &wanted, sizeof wanted, 0);
}

npg_status npg_follow_log_open(npg_follow_log **out, int64_t *groups, const char *path,
                               const npg_follow_key *key)
{
    npg_follow_log *log;
    *out = NULL;
    *groups = 0;
    NPG_TRY(npg_alloc(&log, NPG_FOR_FIT, sizeof *log));
    log->pose_bytes = npg_pose_bytes(key->node_count);
    log->state_bytes = key->state_bytes;
    log->fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    npg_status status = npg_copy_text(&log->path, path);
    if (!status && log->fd < 0) status = fail(log, "write");
    if (!status) status = begin(log, key);
    if (!status) *groups = log->groups_left;
    if (status) npg_follow_log_close(&log);
    *out = log;
    return status;
}

void npg_follow_log_close(npg_follow_log **slot)
{
    npg_follow_log *log = *slot;
    if (!log) return;
    if (log->fd >= 0) close(log->fd);
    npg_release(&log->buffer);
    npg_release(&log->path);
    npg_release(slot);
}

bool npg_follow_log_has_group(const npg_follow_log *log)
{
    return log->groups_left > 0;
}

static npg_status damaged(const npg_follow_log *log)
{
    return npg_error(NPG_BAD_INPUT,
                     "%s does not go with this capture; --restart discards what an earlier run left",
                     log->path);
}

static npg_status open_group(npg_follow_log *log)
{
    struct stat info;
    bool is_whole;
    if (log->next) return NPG_OK;
    if (fstat(log->fd, &info)) return fail(log, "look at");
    NPG_TRY(read_group(log, log->at, info.st_size, &is_whole));
    log->next = sizeof(uint64_t) + log->state_bytes;
    return is_whole ? NPG_OK : damaged(log);
}

npg_status npg_follow_log_read(npg_follow_log *log, int64_t index, double *pose)
{
    int64_t found;
    NPG_TRY(open_group(log));
    if (log->next + frame_bytes(log) > log->size) return damaged(log);
    memcpy(&found, log->buffer + log->next, sizeof found);
    if (found != index) return damaged(log);
    memcpy(pose, log->buffer + log->next + sizeof found, log->pose_bytes);
    log->next += frame_bytes(log);
    return NPG_OK;
}

npg_status npg_follow_log_end_group(npg_follow_log *log, const void **state)
{
    if (log->next != log->size) return damaged(log);
    *state = log->buffer + sizeof(uint64_t);
    log->at += (off_t)(sizeof(group_head) + log->size);
    log->groups_left--;
    log->next = log->size = 0;
    return NPG_OK;
}

/* ---- adding ---- */

/* Frames follow the count and the state, which come last but stand first. */
npg_status npg_follow_log_add(npg_follow_log *log, int64_t index, const double *pose)
{
    size_t before = sizeof(uint64_t) + log->state_bytes;
    if (!log->size) {
        NPG_TRY(npg_grow(&log->buffer, &log->capacity, before, 1, NPG_FOR_FIT));
        log->size = before;
    }
    NPG_TRY(append(log, &index, sizeof index));
    return append(log, pose, log->pose_bytes);
}

npg_status npg_follow_log_commit_group(npg_follow_log *log, const void *state)
{
    if (!log->size) return NPG_OK;
    size_t before = sizeof(uint64_t) + log->state_bytes;
    uint64_t frames = (log->size - before) / frame_bytes(log);
    memcpy(log->buffer, &frames, sizeof frames);
    memcpy(log->buffer + sizeof frames, state, log->state_bytes);
    const group_head g = {log->size, XXH3_64bits(log->buffer, log->size)};
    NPG_TRY(write_at(log, &g, sizeof g, log->at));
    NPG_TRY(write_at(log, log->buffer, log->size, log->at + (off_t)sizeof g));
    if (fdatasync(log->fd)) return fail(log, "write");
    log->at += (off_t)(sizeof g + log->size);
    log->size = 0;
    return NPG_OK;
}
