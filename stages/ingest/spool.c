/* Spool: what came from a live source, in a store. */
#include "ingest/ingest_internal.h"

#include <string.h>
#include <xxhash.h>

#define ROW (3 * sizeof(float))

static void release_nothing(void *value)
{
    (void)value; /* the job owns it */
}

const npg_fact_kind npg_fact_spool = {"spool", "job", release_nothing};

int64_t npg_spool_count(npg_store *spool)
{
    return npg_store_last(spool, NPG_RECORD_FRAME) + 1;
}

uint64_t npg_spool_hash(const npg_frame *frame)
{
    const size_t vectors = frame->point_count * ROW;
    uint64_t hash = frame->pos_local ? XXH3_64bits(frame->pos_local, vectors) : 0;
    if (frame->normals) hash = XXH3_64bits_withSeed(frame->normals, vectors, hash + 1);
    if (frame->colours) hash = XXH3_64bits_withSeed(frame->colours, 4 * frame->point_count, hash + 2);
    return hash;
}

npg_status npg_spool_add(npg_store *spool, npg_spooled *entry, const npg_frame *frame, bool with_points,
                         const char *cause)
{
    const int64_t at = npg_spool_count(spool);
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    entry->key = XXH3_64bits(entry, sizeof *entry);
    npg_store_begin(spool, NPG_RECORD_FRAME, at, 0);
    npg_status status = npg_store_put(spool, "entry", entry, sizeof *entry);
    if (!status && frame->path) status = npg_store_put(spool, "path", frame->path, strlen(frame->path) + 1);
    if (!status && cause) status = npg_store_put(spool, "cause", cause, strlen(cause) + 1);
    npg_frame_arrays(arrays, frame);
    if (!status && with_points) status = npg_store_put_arrays(spool, frame, arrays, NPG_FRAME_ARRAYS);
    return npg_store_end(spool, status, false);
}

npg_status npg_spool_get(npg_store *spool, int64_t i, npg_spooled *entry, npg_record **out)
{
    npg_record *record;
    if (out) *out = NULL;
    NPG_TRY(npg_store_read(spool, &record, NPG_RECORD_FRAME, i, 0));
    npg_status status = npg_record_get(record, "entry", entry, sizeof *entry);
    if (!status && out)
        *out = record;
    else
        npg_record_close(&record);
    return status;
}

const char *npg_spool_text(const npg_record *record, const char *name)
{
    size_t size;
    const char *text = npg_record_find(record, name, &size);
    return text && size && !text[size - 1] ? text : NULL;
}

npg_status npg_spool_frame(const npg_spooled *entry, const npg_record *record, npg_frame *frame)
{
    const char *path = npg_spool_text(record, "path");
    npg_store_array arrays[NPG_FRAME_ARRAYS];
    size_t size = 0;
    if (npg_record_find(record, "points", &size)) frame->point_count = size / ROW;
    npg_frame_arrays(arrays, frame);
    npg_status status = path ? npg_copy_text(&frame->path, path) : NPG_OK;
    if (!status) status = npg_record_get_arrays(record, frame, arrays, NPG_FRAME_ARRAYS, NPG_FOR_FRAMES);
    if (status == NPG_BAD_INPUT)
        npg_error_prefix(status, "frame %lld was not kept whole", (long long)entry->number);
    if (status) npg_frame_clear(frame);
    NPG_TRY(status);
    frame->number = entry->number;
    frame->index = entry->index;
    frame->fields = NPG_FIELD_POINTS;
    frame->is_held = entry->is_held;
    frame->is_skipped = entry->is_skipped;
    frame->cleaning.read = frame->point_count;
    return NPG_OK;
}

npg_status npg_spool_key(npg_store *spool, int64_t count, uint64_t *key)
{
    *key = 0;
    for (int64_t i = npg_spool_count(spool) - 1; i >= 0; i--) {
        npg_spooled entry;
        NPG_TRY(npg_spool_get(spool, i, &entry, NULL));
        *key = entry.key;
        if (entry.index >= 0 && entry.index < count) break;
    }
    return NPG_OK;
}
