/* Stream: frames one after the other from a pipe. */
#include <string.h>

#include "ingest/ingest_internal.h"

struct npg_stream {
    npg_source *source; /* owned */
    int64_t frames;
};

npg_status npg_stream_open(npg_stream **out, int fd, const char *name)
{
    npg_stream *stream;
    *out = NULL;
    NPG_TRY(npg_alloc(&stream, NPG_FOR_FILES, sizeof *stream));
    npg_status status = npg_source_open_fd(&stream->source, fd, name);
    if (status) npg_release(&stream);
    *out = stream;
    return status;
}

void npg_stream_close(npg_stream **slot)
{
    if (!*slot) return;
    npg_source_close(&(*slot)->source);
    npg_release(slot);
}

void npg_stream_set_stop(npg_stream *stream, bool (*stopping)(void *user), void *user)
{
    stream->source->stopping = stopping;
    stream->source->user = user;
}

/* Blank lines may stand between two frames. */
static npg_status skip_blanks(npg_source *source)
{
    size_t available;
    for (;;) {
        NPG_TRY(npg_source_fill(source, 6, &available));
        if (!available) return NPG_END;
        if (!memchr(" \t\r\n", npg_source_data(source)[0], 4)) return NPG_OK;
        npg_source_take(source, 1);
    }
}

/* Only these two formats say in their header where they end. */
static npg_status read_one(npg_stream *stream, npg_frame *frame, npg_origin *origin)
{
    npg_source *source = stream->source;
    size_t available;
    NPG_TRY(skip_blanks(source));
    NPG_TRY(npg_source_fill(source, 6, &available));
    const unsigned char *data = npg_source_data(source);
    if (available >= 3 && !memcmp(data, "ply", 3)) return npg_ply_read_cloud(frame, source, origin);
    if (available >= 6 && !memcmp(data, "\x93NUMPY", 6)) return npg_npy_read_cloud(frame, source, origin);
    return npg_source_bad_byte(source, "frame %lld begins neither as PLY nor as NPY",
                               (long long)stream->frames);
}

npg_status npg_stream_next(npg_stream *stream, npg_frame *frame, npg_origin *origin)
{
    npg_status status = read_one(stream, frame, origin);
    if (status == NPG_BAD_INPUT) npg_error_prefix(status, "frame %lld", (long long)stream->frames);
    if (!status) status = npg_copy_text(&frame->path, stream->source->name);
    if (status) npg_frame_clear(frame);
    if (status) return status;
    frame->cleaning.read = frame->point_count;
    frame->fields = NPG_FIELD_POINTS;
    frame->number = frame->index = stream->frames++;
    return NPG_OK;
}
