/* Frame store: entries in memory or on disk. */
#include "ingest/ingest_internal.h"

#include <fcntl.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "pipeline/file.h"

#define ROW         (3 * sizeof(float))
#define COLOUR      4 /* bytes of a point's colour; of its sensor's index it is one */
#define FREE_SHARE  4 /* of the disk's free space, one such part may be taken: results need room, too */
#define NOT_ON_DISK (-1)

typedef struct entry {
    npg_frame *frame; /* its arrays are NULL where they are on disk; NULL: nothing is kept; owned */
    float *made;      /* normals made or mended, N x 3; owned                                     */
    npg_cleaning made_cleaning;
    off_t points_at, normals_at, colours_at, sensors_at, made_at; /* places in the file, or NOT_ON_DISK */
    bool has_made;
} entry;

struct npg_frame_store {
    pthread_mutex_t lock;
    entry *entries; /* owned */
    size_t count, capacity, bytes, byte_max;
    char *folder; /* owned; NULL: nothing goes to disk (any more) */
    int file;     /* -1: not made yet */
    off_t file_bytes, file_max;
};

static void release_nothing(void *value)
{
    (void)value; /* the capture owns it */
}

const npg_fact_kind npg_fact_frame_store = {"frame_store", "ingest", release_nothing};

npg_status npg_frame_store_open(npg_frame_store **out, size_t byte_max, const char *spill_folder)
{
    npg_frame_store *s;
    *out = NULL;
    NPG_TRY(npg_alloc(&s, NPG_FOR_FILES, sizeof *s));
    s->byte_max = byte_max;
    s->file = -1;
    pthread_mutex_init(&s->lock, NULL);
    npg_status status = spill_folder ? npg_copy_text(&s->folder, spill_folder) : NPG_OK;
    if (status) npg_frame_store_close(&s);
    *out = s;
    return status;
}

/* Of a point, in the arrays that the frame has. */
static size_t point_bytes(const npg_frame *frame)
{
    return (frame->pos_local ? ROW : 0) + (frame->normals ? ROW : 0) + (frame->colours ? COLOUR : 0) +
           (frame->sensors ? 1 : 0);
}

static size_t bytes_of(const entry *e)
{
    if (!e->frame) return 0;
    return sizeof *e->frame + e->frame->point_count * (point_bytes(e->frame) + (e->made ? ROW : 0));
}

static void drop(npg_frame_store *s, entry *e)
{
    s->bytes -= bytes_of(e);
    if (e->frame) npg_frame_clear(e->frame);
    npg_release(&e->frame);
    npg_release(&e->made);
    *e = (entry){.points_at = NOT_ON_DISK,
                 .normals_at = NOT_ON_DISK,
                 .colours_at = NOT_ON_DISK,
                 .sensors_at = NOT_ON_DISK,
                 .made_at = NOT_ON_DISK};
}

void npg_frame_store_close(npg_frame_store **slot)
{
    npg_frame_store *s = slot ? *slot : NULL;
    if (!s) return;
    for (size_t i = 0; s->entries && i < s->count; i++) drop(s, &s->entries[i]);
    if (s->file >= 0) close(s->file);
    npg_release(&s->entries);
    npg_release(&s->folder);
    pthread_mutex_destroy(&s->lock);
    npg_release(slot);
}

npg_frame_store_use npg_frame_store_used(npg_frame_store *s)
{
    pthread_mutex_lock(&s->lock);
    npg_frame_store_use use = {s->bytes, (size_t)s->file_bytes};
    pthread_mutex_unlock(&s->lock);
    return use;
}

static entry *find(npg_frame_store *s, int64_t index)
{
    return index >= 0 && (size_t)index < s->count ? &s->entries[index] : NULL;
}

/* ---- disk ---- */

/* A file that has no name: nobody sees it, and it goes with the process that has it open. */
static int open_nameless(const char *folder)
{
    char path[4096];
    int file = open(folder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (file >= 0) return file;
    if (snprintf(path, sizeof path, "%s/frames.XXXXXX", folder) >= (int)sizeof path) return -1;
    file = mkostemp(path, O_CLOEXEC); /* file systems that can't */
    if (file >= 0) unlink(path);
    return file;
}

static bool may_write(npg_frame_store *s, off_t size)
{
    struct statvfs disk;
    if (!s->folder) return false;
    if (s->file < 0) {
        s->file = open_nameless(s->folder);
        if (s->file >= 0 && !fstatvfs(s->file, &disk))
            s->file_max = (off_t)(disk.f_bavail / FREE_SHARE) * (off_t)disk.f_frsize;
        if (s->file < 0) npg_release(&s->folder);
    }
    return s->file >= 0 && size <= s->file_max - s->file_bytes;
}

/* Where the bytes lie in the file, or NOT_ON_DISK; after a failure nothing more goes there. */
static off_t write_bytes(npg_frame_store *s, const void *data, size_t size)
{
    off_t at = s->file_bytes;
    if (!may_write(s, (off_t)size)) return NOT_ON_DISK;
    if (!npg_write_at(s->file, data, size, at)) {
        npg_release(&s->folder);
        return NOT_ON_DISK;
    }
    s->file_bytes += (off_t)size;
    return at;
}

/* An array of `size` bytes from the file into *array, which stays NULL where it is not there. */
static npg_status read_bytes(const npg_frame_store *s, void *array, off_t at, size_t size)
{
    char *data;
    if (at == NOT_ON_DISK) return NPG_OK;
    NPG_TRY(npg_alloc(&data, NPG_FOR_FRAMES, size));
    size_t got = size;
    if (!npg_read_at(s->file, data, &got, at) || got < size) {
        npg_release(&data);
        return npg_error(NPG_DISK, "what was kept of a frame on disk can't be read back");
    }
    *(void **)array = data;
    return NPG_OK;
}

/* An array of the frame into the file, where it has one; false: it found no place there. */
static bool put_array(npg_frame_store *s, off_t *at, const void *array, size_t size)
{
    if (array) *at = write_bytes(s, array, size);
    return !array || *at != NOT_ON_DISK;
}

/* A few numbers, which stay in memory. */
static bool put_sensors(npg_frame *to, const npg_frame *frame)
{
    size_t bytes = frame->sensor_count * ROW;
    if (!frame->sensor_local) return true;
    if (npg_alloc(&to->sensor_local, NPG_FOR_FRAMES, bytes)) return false;
    memcpy(to->sensor_local, frame->sensor_local, bytes);
    return true;
}

/* The frame without its arrays, which go to disk. */
static bool put_on_disk(npg_frame_store *s, entry *e, const npg_frame *frame)
{
    size_t count = frame->point_count;
    if (npg_alloc(&e->frame, NPG_FOR_FRAMES, sizeof *e->frame)) return false;
    *e->frame = npg_frame_bare(frame);
    bool is_put = !frame->path || !npg_copy_text(&e->frame->path, frame->path);
    is_put = is_put && put_sensors(e->frame, frame) &&
             put_array(s, &e->points_at, frame->pos_local, count * ROW) &&
             put_array(s, &e->normals_at, frame->normals, count * ROW) &&
             put_array(s, &e->colours_at, frame->colours, count * COLOUR) &&
             put_array(s, &e->sensors_at, frame->sensors, count);
    if (is_put) s->bytes += bytes_of(e);
    if (!is_put) {
        npg_frame_clear(e->frame);
        npg_release(&e->frame);
        drop(s, e);
    }
    return is_put;
}

/* ---- frames ---- */

static bool fits(const npg_frame_store *s, const npg_frame *frame)
{
    size_t bytes = sizeof *frame + frame->point_count * point_bytes(frame);
    return s->bytes <= s->byte_max && bytes <= s->byte_max - s->bytes;
}

static npg_status put_in_memory(npg_frame_store *s, entry *e, const npg_frame *frame)
{
    NPG_TRY(npg_alloc(&e->frame, NPG_FOR_FRAMES, sizeof *e->frame));
    npg_status status = npg_frame_copy(e->frame, frame);
    if (status) npg_release(&e->frame);
    s->bytes += bytes_of(e);
    return status;
}

static void put_frame(npg_frame_store *s, entry *e, const npg_frame *frame, bool is_final)
{
    if (fits(s, frame) && !put_in_memory(s, e, frame)) return;
    if (is_final) put_on_disk(s, e, frame);
}

/* Under the lock: an entry for this index, too. */
static npg_status grow(npg_frame_store *s, int64_t index)
{
    if (index < (int64_t)s->count) return NPG_OK;
    NPG_TRY(npg_grow(&s->entries, &s->capacity, (size_t)index + 1, sizeof *s->entries, NPG_FOR_FILES));
    while ((int64_t)s->count <= index) s->entries[s->count++] = (entry){0};
    return NPG_OK;
}

npg_status npg_frame_store_put(npg_frame_store *s, const npg_frame *frame, bool is_final)
{
    if (!frame->point_count || frame->is_held) return NPG_OK;
    pthread_mutex_lock(&s->lock);
    npg_status status = grow(s, frame->index);
    entry *e = status ? NULL : find(s, frame->index);
    if (e) drop(s, e);
    if (e) put_frame(s, e, frame, is_final);
    pthread_mutex_unlock(&s->lock);
    return status;
}

static npg_status get_from_disk(const npg_frame_store *s, npg_frame *frame, const entry *e)
{
    size_t count = e->frame->point_count;
    npg_status status = npg_frame_copy(frame, e->frame);
    if (!status) status = read_bytes(s, &frame->pos_local, e->points_at, count * ROW);
    if (!status) status = read_bytes(s, &frame->normals, e->normals_at, count * ROW);
    if (!status) status = read_bytes(s, &frame->colours, e->colours_at, count * COLOUR);
    if (!status) status = read_bytes(s, &frame->sensors, e->sensors_at, count);
    if (status) npg_frame_clear(frame);
    return status;
}

static void give_frame_away(npg_frame_store *s, npg_frame *frame, entry *e)
{
    size_t before = bytes_of(e);
    *frame = *e->frame;
    *e->frame = (npg_frame){.point_count = frame->point_count}; /* its made normals may still be asked for */
    s->bytes -= before - bytes_of(e);
}

static bool was_given_away(const entry *e)
{
    return e->frame->point_count && !e->frame->pos_local && e->points_at == NOT_ON_DISK;
}

npg_status npg_frame_store_get(npg_frame_store *s, npg_frame *frame, int64_t index, bool give_away)
{
    npg_status status = NPG_OK;
    pthread_mutex_lock(&s->lock);
    entry *e = find(s, index);
    if (!e || !e->frame || was_given_away(e))
        status = NPG_END;
    else if (e->points_at != NOT_ON_DISK)
        status = get_from_disk(s, frame, e);
    else if (give_away)
        give_frame_away(s, frame, e);
    else
        status = npg_frame_copy(frame, e->frame);
    pthread_mutex_unlock(&s->lock);
    return status;
}

/* ---- normals ---- */

void npg_frame_store_put_normals(npg_frame_store *s, const npg_frame *frame)
{
    size_t size = frame->point_count * ROW;
    pthread_mutex_lock(&s->lock);
    entry *e = find(s, frame->index);
    if (e && e->frame && e->frame->point_count == frame->point_count && !e->has_made) {
        bool has_room = s->bytes <= s->byte_max && size <= s->byte_max - s->bytes;
        if (has_room && !npg_alloc(&e->made, NPG_FOR_FRAMES, size)) {
            memcpy(e->made, frame->normals, size);
            s->bytes += size;
        } else {
            e->made_at = write_bytes(s, frame->normals, size);
        }
        e->made_cleaning = frame->cleaning;
        e->has_made = e->made || e->made_at != NOT_ON_DISK;
    }
    pthread_mutex_unlock(&s->lock);
}

bool npg_frame_store_get_normals(npg_frame_store *s, npg_frame *frame)
{
    size_t size = frame->point_count * ROW;
    float *normals = NULL;
    pthread_mutex_lock(&s->lock);
    const entry *e = find(s, frame->index);
    bool is_there = e && e->has_made && e->frame->point_count == frame->point_count;
    if (is_there && !e->made && read_bytes(s, &normals, e->made_at, size)) normals = NULL;
    if (is_there && e->made && !npg_alloc(&normals, NPG_FOR_FRAMES, size)) memcpy(normals, e->made, size);
    if (normals) frame->cleaning = e->made_cleaning;
    pthread_mutex_unlock(&s->lock);
    if (!normals) return false;
    npg_release(&frame->normals);
    frame->normals = normals;
    return true;
}
