/* Look-ahead: what a live source brings first, pass by pass. */
#include "ingest/look_ahead.h"

npg_status npg_look_ahead_open(npg_look_ahead **out, npg_worker *worker, const npg_live_settings *settings,
                               size_t byte_max, const char *spill_folder)
{
    npg_look_ahead *l;
    *out = NULL;
    NPG_TRY(npg_alloc(&l, NPG_FOR_FILES, sizeof *l));
    npg_status status = npg_frame_store_open_all(&l->store, byte_max, spill_folder);
    if (!status) status = npg_live_source_open(&l->source, worker, settings);
    l->is_filled = !npg_worker_facts(worker)->is_resumed;
    if (status) npg_look_ahead_close(&l);
    *out = l;
    return status;
}

void npg_look_ahead_close(npg_look_ahead **slot)
{
    npg_look_ahead *l = *slot;
    if (!l) return;
    npg_live_source_close(&l->source);
    npg_chunk_unref(&l->behind);
    npg_frame_store_close(&l->store);
    npg_release(slot);
}

/* ---- the source ---- */

/* The next frame that comes; after the end there is none. */
static npg_status next_of_source(npg_look_ahead *l, npg_chunk *chunk)
{
    if (l->is_ended) return NPG_END;
    npg_status status = npg_live_source_next(&l->source, chunk);
    l->is_ended = status == NPG_END;
    return status;
}

static npg_status look_behind(npg_look_ahead *l)
{
    NPG_TRY(npg_chunk_open(&l->behind, 1));
    npg_status status = next_of_source(l, l->behind);
    if (status) npg_chunk_unref(&l->behind);
    return status == NPG_END ? NPG_OK : status;
}

npg_status npg_look_ahead_take(npg_look_ahead *l, npg_chunk *chunk, int64_t most)
{
    npg_status status = l->source.next < most ? next_of_source(l, chunk) : NPG_END;
    if (!status) return npg_frame_store_put(l->store, npg_chunk_frame(chunk, 0), false);
    if (status != NPG_END) return status;
    *npg_own(l->source.worker, planned_count) = l->source.next;
    NPG_TRY(look_behind(l));
    return NPG_END;
}

/* ---- a run that is resumed ---- */

/* The log of inputs has at least the look-ahead. */
static npg_status fill(npg_look_ahead *l)
{
    const npg_facts *facts = npg_worker_facts(l->source.worker);
    l->is_filled = true;
    while (l->source.next < facts->planned_count && l->source.replay_at < l->source.replay_count) {
        npg_chunk *chunk;
        NPG_TRY(npg_chunk_open(&chunk, 1));
        npg_status status = npg_live_replay(&l->source, chunk);
        if (!status && npg_chunk_count(chunk))
            status = npg_frame_store_put(l->store, npg_chunk_frame(chunk, 0), true);
        npg_chunk_unref(&chunk);
        NPG_TRY(status);
        if (npg_worker_stopping(l->source.worker)) return npg_error(NPG_STOPPED, "stopped while reading");
    }
    return NPG_OK;
}

/* ---- later passes ---- */

static npg_status from_store(npg_look_ahead *l, npg_chunk *chunk, int64_t index, bool is_last_use)
{
    npg_frame frame = {0};
    npg_status status = npg_frame_store_get(l->store, &frame, index, is_last_use);
    if (status == NPG_END)
        return npg_error(NPG_FAILED, "frame %lld of the look-ahead is not there", (long long)index);
    NPG_TRY(status);
    frame.fields &= NPG_FIELD_POINTS | NPG_FIELD_CLEAN;
    npg_chunk_add(chunk, &frame);
    return NPG_OK;
}

static npg_status from_behind(npg_look_ahead *l, npg_chunk *chunk, int64_t index)
{
    npg_status status = NPG_OK;
    if (l->behind)
        npg_chunk_add(chunk, npg_chunk_frame(l->behind, 0));
    else
        status = next_of_source(l, chunk);
    npg_chunk_unref(&l->behind);
    NPG_TRY(status);
    int64_t came = npg_chunk_frame(chunk, 0)->index;
    if (came == index) return NPG_OK;
    return npg_error(NPG_FAILED, "frame %lld came in the place of %lld", (long long)came, (long long)index);
}

npg_status npg_look_ahead_read(npg_look_ahead *l, npg_chunk *chunk, int64_t index, bool is_last_use)
{
    npg_worker *worker = l->source.worker;
    if (!l->is_filled) NPG_TRY(fill(l));
    if (index < npg_worker_facts(worker)->planned_count) return from_store(l, chunk, index, is_last_use);
    return npg_worker_pass(worker) == NPG_PASS_SOLVE ? from_behind(l, chunk, index) : NPG_END;
}

npg_status npg_look_ahead_end(npg_look_ahead *l)
{
    npg_chunk *chunk;
    NPG_TRY(npg_chunk_open(&chunk, 1));
    npg_status status = next_of_source(l, chunk);
    npg_chunk_unref(&chunk);
    return status == NPG_OK ? npg_error(NPG_FAILED, "a frame came behind the last one") : status;
}
