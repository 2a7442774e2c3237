/* Frame store: entries in memory, or records of a store that has no name. */
#include <pthread.h>
#include <string.h>
#include <sys/statvfs.h>

#include "ingest/ingest_internal.h"

#define FREE_SHARE 4 /* of the disk's free space, one such part may be taken: results need room, too */

/* What is kept of a frame: itself, and normals that were made or mended. */
enum { WHOLE, MADE, PARTS };

static const char *const records[PARTS] = {NPG_RECORD_FRAME, "made"};

typedef struct entry {
    npg_frame *frame; /* its arrays are NULL where they are on disk; NULL: nothing is kept; owned */
    bool is_on_disk;
} entry;

struct npg_frame_store {
    pthread_mutex_t lock;
    entry (*entries)[PARTS]; /* owned */
    size_t count, capacity, bytes, byte_max;
    char *folder;    /* owned; NULL: nothing goes to disk (any more) */
    npg_store *disk; /* owned; NULL: not made yet */
    size_t disk_bytes, disk_max;
};

static void release_store(void *value)
{
    npg_frame_store *store = value;
    npg_frame_store_close(&store);
}

const npg_fact_kind npg_fact_frame_store = {"frame_store", "ingest", release_store};

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

static void drop(npg_frame_store *s, entry *e)
{
    if (e->frame) s->bytes -= sizeof *e->frame + array_bytes(e->frame);
    if (e->frame) npg_frame_clear(e->frame);
    npg_release(&e->frame);
    *e = (entry){0};
}

void npg_frame_store_close(npg_frame_store **slot)
{
    npg_frame_store *s = *slot;
    if (!s) return;
    for (size_t i = 0; i < PARTS * s->count; i++) drop(s, &s->entries[i / PARTS][i % PARTS]);
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
static bool write_frame(npg_frame_store *s, int part, const npg_frame *frame, size_t bytes)
{
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    if (!may_write(s, bytes)) return false;
    npg_frame_arrays(arrays, frame);
    npg_store_begin(s->disk, records[part], frame->index, 0);
    npg_status status = npg_store_put_arrays(s->disk, frame, arrays, NPG_FRAME_ARRAYS);
    if (npg_store_end(s->disk, status, false)) {
        npg_release(&s->folder);
        return false;
    }
    s->disk_bytes += bytes;
    return true;
}

static npg_status read_frame(const npg_frame_store *s, int part, npg_frame *frame, const npg_frame *kept)
{
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    npg_record *record;
    npg_frame_arrays(arrays, kept);
    NPG_TRY(npg_frame_copy(frame, kept));
    npg_status status = npg_store_read(s->disk, &record, records[part], kept->index, 0);
    if (!status) status = npg_record_get_arrays(record, frame, arrays, NPG_FRAME_ARRAYS, NPG_FOR_FRAMES);
    npg_record_close(&record);
    if (status) npg_frame_clear(frame);
    return status;
}

/* ---- frames ---- */

static void put_frame(npg_frame_store *s, entry *e, int part, const npg_frame *frame, bool is_final)
{
    npg_frame kept = *frame;
    size_t bytes = array_bytes(frame), most = s->byte_max > s->bytes ? s->byte_max - s->bytes : 0;
    e->is_on_disk = sizeof *frame + bytes > most;
    if (e->is_on_disk) {
        if (!is_final || !write_frame(s, part, frame, bytes)) return;
        kept = npg_frame_bare(frame);
        kept.path = frame->path; /* stays in memory */
    }
    if (npg_alloc(&e->frame, NPG_FOR_FRAMES, sizeof *e->frame)) return;
    if (npg_frame_copy(e->frame, &kept)) npg_release(&e->frame);
    if (e->frame) s->bytes += sizeof *e->frame + array_bytes(e->frame);
}

static npg_status put(npg_frame_store *s, int part, const npg_frame *frame, bool is_final)
{
    pthread_mutex_lock(&s->lock);
    size_t need = (size_t)frame->index + 1;
    npg_status status = npg_grow(&s->entries, &s->capacity, need, sizeof *s->entries, NPG_FOR_FILES);
    if (!status) {
        entry *e = &s->entries[frame->index][part];
        if (s->count < need) s->count = need;
        drop(s, e);
        put_frame(s, e, part, frame, is_final);
    }
    pthread_mutex_unlock(&s->lock);
    return status;
}

static npg_status get(npg_frame_store *s, int part, npg_frame *frame, int64_t index, bool give_away)
{
    npg_status status = NPG_END;
    pthread_mutex_lock(&s->lock);
    entry *e = index >= 0 && (size_t)index < s->count ? &s->entries[index][part] : NULL;
    if (e && e->frame && e->is_on_disk) {
        status = read_frame(s, part, frame, e->frame);
    } else if (e && e->frame && give_away) {
        s->bytes -= sizeof *frame + array_bytes(e->frame);
        *frame = *e->frame;
        npg_release(&e->frame);
        status = NPG_OK;
    } else if (e && e->frame) {
        status = npg_frame_copy(frame, e->frame);
    }
    pthread_mutex_unlock(&s->lock);
    return status;
}

npg_status npg_frame_store_put(npg_frame_store *s, const npg_frame *frame, bool is_final)
{
    return frame->point_count && !frame->is_held ? put(s, WHOLE, frame, is_final) : NPG_OK;
}

npg_status npg_frame_store_get(npg_frame_store *s, npg_frame *frame, int64_t index, bool give_away)
{
    return get(s, WHOLE, frame, index, give_away);
}

/* ---- normals ---- */

void npg_frame_store_put_normals(npg_frame_store *s, const npg_frame *frame)
{
    npg_frame made = {.index = frame->index, .point_count = frame->point_count};
    made.normals = frame->normals;
    made.cleaning = frame->cleaning;
    if (frame->point_count && !frame->is_held)
        (void)put(s, MADE, &made, true); /* without room they are made again */
}

bool npg_frame_store_get_normals(npg_frame_store *s, npg_frame *frame)
{
    npg_frame made = {0};
    bool is_there = !get(s, MADE, &made, frame->index, false) && made.point_count == frame->point_count;
    if (is_there) {
        npg_release(&frame->normals);
        frame->normals = made.normals;
        frame->cleaning = made.cleaning;
        made.normals = NULL;
    }
    npg_frame_clear(&made);
    return is_there;
}
