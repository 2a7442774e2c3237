/* Frame store: entries in memory, or records of a store that has no name. */
#include <pthread.h>
#include <string.h>
#include <sys/statvfs.h>

#include "ingest/ingest_internal.h"

#define ROW         (3 * sizeof(float))
#define FREE_SHARE  4      /* of the disk's free space, one such part may be taken: results need room, too */
#define RECORD_MADE "made" /* normals that were made or mended, of a frame */

typedef struct entry {
    npg_frame *frame; /* its arrays are NULL where they are on disk; NULL: nothing is kept; owned */
    float *made;      /* normals made or mended, N x 3, where they are not on disk; owned         */
    npg_cleaning made_cleaning;
    bool is_on_disk, has_made;
} entry;

struct npg_frame_store {
    pthread_mutex_t lock;
    entry *entries; /* owned */
    size_t count, capacity, bytes, byte_max;
    char *folder;    /* owned; NULL: nothing goes to disk (any more) */
    npg_store *disk; /* owned; NULL: not made yet */
    size_t disk_bytes, disk_max;
};

static void release_nothing(void *value)
{
    (void)value; /* the capture owns it */
}

const npg_fact_kind npg_fact_frame_store = {"frame_store", "ingest", release_nothing};

npg_status npg_frame_store_open(npg_frame_store **out, size_t byte_max, const char *spill_folder)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_FILES, sizeof **out));
    (*out)->byte_max = byte_max;
    pthread_mutex_init(&(*out)->lock, NULL);
    npg_status status = spill_folder ? npg_copy_text(&(*out)->folder, spill_folder) : NPG_OK;
    if (status) npg_frame_store_close(out);
    return status;
}

/* Of the arrays that the frame has. */
static size_t array_bytes(const npg_frame *frame)
{
    npg_store_array list[NPG_FRAME_ARRAYS];
    size_t bytes = 0;
    npg_frame_arrays(list, frame);
    for (size_t i = 0; i < NPG_FRAME_ARRAYS; i++) {
        const void *rows;
        memcpy(&rows, (const char *)frame + list[i].offset, sizeof rows);
        if (rows) bytes += list[i].count * list[i].row;
    }
    return bytes;
}

static size_t bytes_of(const entry *e)
{
    if (!e->frame) return 0;
    return sizeof *e->frame + array_bytes(e->frame) + (e->made ? e->frame->point_count * ROW : 0);
}

static void drop(npg_frame_store *s, entry *e)
{
    s->bytes -= bytes_of(e);
    if (e->frame) npg_frame_clear(e->frame);
    npg_release(&e->frame);
    npg_release(&e->made);
    *e = (entry){0};
}

void npg_frame_store_close(npg_frame_store **slot)
{
    npg_frame_store *s = *slot;
    if (!s) return;
    for (size_t i = 0; i < s->count; i++) drop(s, &s->entries[i]);
    npg_store_close(&s->disk);
    npg_release(&s->entries);
    npg_release(&s->folder);
    pthread_mutex_destroy(&s->lock);
    npg_release(slot);
}

npg_frame_store_use npg_frame_store_used(npg_frame_store *s)
{
    pthread_mutex_lock(&s->lock);
    npg_frame_store_use use = {s->bytes, s->disk_bytes};
    pthread_mutex_unlock(&s->lock);
    return use;
}

static entry *find(npg_frame_store *s, int64_t index)
{
    return index >= 0 && (size_t)index < s->count ? &s->entries[index] : NULL;
}

/* ---- disk ---- */

static bool may_write(npg_frame_store *s, size_t size)
{
    struct statvfs disk;
    if (!s->folder) return false;
    if (!s->disk && !npg_store_open_nameless(&s->disk, s->folder) && !statvfs(s->folder, &disk))
        s->disk_max = (size_t)(disk.f_bavail / FREE_SHARE) * (size_t)disk.f_frsize;
    if (!s->disk) npg_release(&s->folder);
    return s->disk && size <= s->disk_max - s->disk_bytes;
}

/* False: it found no place; after a failure nothing more goes to disk. */
static bool write_arrays(npg_frame_store *s, const char *kind, const npg_frame *frame, size_t bytes,
                         const npg_store_array *arrays, size_t count)
{
    if (!may_write(s, bytes)) return false;
    npg_store_begin(s->disk, kind, frame->index, 0);
    npg_status status = npg_store_put_arrays(s->disk, frame, arrays, count);
    if (npg_store_end(s->disk, status, false)) {
        npg_release(&s->folder);
        return false;
    }
    s->disk_bytes += bytes;
    return true;
}

static npg_status read_arrays(const npg_frame_store *s, const char *kind, int64_t index, npg_frame *frame,
                              const npg_store_array *arrays, size_t count)
{
    npg_record *record;
    NPG_TRY(npg_store_read(s->disk, &record, kind, index, 0));
    npg_status status = npg_record_get_arrays(record, frame, arrays, count, NPG_FOR_FRAMES);
    npg_record_close(&record);
    return status;
}

/* ---- frames ---- */

static bool fits(const npg_frame_store *s, size_t bytes)
{
    return s->bytes <= s->byte_max && bytes <= s->byte_max - s->bytes;
}

static void put_frame(npg_frame_store *s, entry *e, const npg_frame *frame, bool is_final)
{
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    npg_frame kept = *frame;
    size_t bytes = array_bytes(frame);
    npg_frame_arrays(arrays, frame);
    e->is_on_disk = !fits(s, sizeof *frame + bytes);
    if (e->is_on_disk) {
        if (!is_final || !write_arrays(s, NPG_RECORD_FRAME, frame, bytes, arrays, NPG_FRAME_ARRAYS)) return;
        kept = npg_frame_bare(frame);
        kept.path = frame->path; /* stays in memory */
    }
    if (npg_alloc(&e->frame, NPG_FOR_FRAMES, sizeof *e->frame)) return;
    if (npg_frame_copy(e->frame, &kept)) npg_release(&e->frame);
    s->bytes += bytes_of(e);
}

npg_status npg_frame_store_put(npg_frame_store *s, const npg_frame *frame, bool is_final)
{
    if (!frame->point_count || frame->is_held) return NPG_OK;
    pthread_mutex_lock(&s->lock);
    size_t need = (size_t)frame->index + 1;
    npg_status status = npg_grow(&s->entries, &s->capacity, need, sizeof *s->entries, NPG_FOR_FILES);
    if (!status && s->count < need) s->count = need;
    entry *e = status ? NULL : find(s, frame->index);
    if (e) drop(s, e);
    if (e) put_frame(s, e, frame, is_final);
    pthread_mutex_unlock(&s->lock);
    return status;
}

static npg_status get_from_disk(const npg_frame_store *s, npg_frame *frame, const entry *e)
{
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    npg_frame_arrays(arrays, e->frame);
    NPG_TRY(npg_frame_copy(frame, e->frame));
    npg_status status = read_arrays(s, NPG_RECORD_FRAME, e->frame->index, frame, arrays, NPG_FRAME_ARRAYS);
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

npg_status npg_frame_store_get(npg_frame_store *s, npg_frame *frame, int64_t index, bool give_away)
{
    npg_status status = NPG_OK;
    pthread_mutex_lock(&s->lock);
    entry *e = find(s, index);
    if (!e || !e->frame || (!e->is_on_disk && !e->frame->pos_local)) /* or was given away */
        status = NPG_END;
    else if (e->is_on_disk)
        status = get_from_disk(s, frame, e);
    else if (give_away)
        give_frame_away(s, frame, e);
    else
        status = npg_frame_copy(frame, e->frame);
    pthread_mutex_unlock(&s->lock);
    return status;
}

/* ---- normals ---- */

static npg_store_array made_array(size_t point_count)
{
    return (npg_store_array){"normals", offsetof(npg_frame, normals), point_count, ROW};
}

void npg_frame_store_put_normals(npg_frame_store *s, const npg_frame *frame)
{
    size_t size = frame->point_count * ROW;
    const npg_store_array array = made_array(frame->point_count);
    pthread_mutex_lock(&s->lock);
    entry *e = find(s, frame->index);
    if (e && e->frame && e->frame->point_count == frame->point_count && !e->has_made) {
        if (fits(s, size) && !npg_alloc(&e->made, NPG_FOR_FRAMES, size)) {
            memcpy(e->made, frame->normals, size);
            s->bytes += size;
        }
        e->made_cleaning = frame->cleaning;
        e->has_made = e->made || write_arrays(s, RECORD_MADE, frame, size, &array, 1);
    }
    pthread_mutex_unlock(&s->lock);
}

bool npg_frame_store_get_normals(npg_frame_store *s, npg_frame *frame)
{
    size_t size = frame->point_count * ROW;
    const npg_store_array array = made_array(frame->point_count);
    npg_frame made = {0};
    pthread_mutex_lock(&s->lock);
    const entry *e = find(s, frame->index);
    bool is_there = e && e->has_made && e->frame->point_count == frame->point_count;
    if (is_there && !e->made) is_there = !read_arrays(s, RECORD_MADE, frame->index, &made, &array, 1);
    if (is_there && e->made && !npg_alloc(&made.normals, NPG_FOR_FRAMES, size))
        memcpy(made.normals, e->made, size);
    if (made.normals && is_there) frame->cleaning = e->made_cleaning;
    pthread_mutex_unlock(&s->lock);
    if (!made.normals || !is_there) {
        npg_release(&made.normals);
        return false;
    }
    npg_release(&frame->normals);
    frame->normals = made.normals;
    return true;
}
