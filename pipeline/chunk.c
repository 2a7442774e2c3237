/* Chunk: a few consecutive frames on their way through the stages. */
#include "pipeline/chunk.h"

#include <assert.h>
#include <string.h>

struct npg_chunk {
    npg_arena arena; /* of the frames */
    size_t count, capacity;
    npg_frame *frames; /* capacity of them */
};

npg_status npg_chunk_open(npg_chunk **chunk, size_t capacity)
{
    NPG_REQUIRE(capacity >= 1);
    NPG_TRY(npg_object_open(chunk, NPG_FOR_RUN, sizeof **chunk));
    (*chunk)->capacity = capacity;
    (*chunk)->frames = npg_arena_take(&(*chunk)->arena, capacity, sizeof *(*chunk)->frames);
    npg_status status = npg_arena_status(&(*chunk)->arena);
    if (status) npg_chunk_close(chunk);
    return status;
}

void npg_chunk_close(npg_chunk **slot)
{
    for (size_t i = 0; *slot && i < (*slot)->count; i++) npg_frame_clear(&(*slot)->frames[i]);
    npg_object_close(slot);
}

size_t npg_chunk_count(const npg_chunk *chunk)
{
    return chunk->count;
}
size_t npg_chunk_capacity(const npg_chunk *chunk)
{
    return chunk->capacity;
}

npg_frame *npg_chunk_frame(npg_chunk *chunk, size_t i)
{
    assert(i < chunk->count);
    return &chunk->frames[i];
}

void npg_chunk_add(npg_chunk *chunk, npg_frame *frame)
{
    assert(chunk->count < chunk->capacity);
    chunk->frames[chunk->count++] = *frame;
    *frame = (npg_frame){0};
}

void npg_frame_clear(npg_frame *frame)
{
    npg_release(&frame->path);
    npg_release(&frame->pos_local);
    npg_release(&frame->normals);
    npg_release(&frame->colours);
    npg_frame_forget_sensors(frame);
    npg_release(&frame->vert_unit);
    npg_release(&frame->vert_colours);
    *frame = (npg_frame){0};
}

void npg_frame_forget_sensors(npg_frame *frame)
{
    npg_release(&frame->sensors);
    npg_release(&frame->sensor_local);
    npg_release(&frame->views);
    npg_release(&frame->view_cells);
    frame->sensor_count = frame->view_cell_count = 0;
}

static npg_status copy_rows(void *out, const void *rows, size_t count, size_t row_size)
{
    void *copy;
    if (!rows) return NPG_OK;
    NPG_TRY(npg_alloc_array(&copy, NPG_FOR_FRAMES, count, row_size));
    if (copy) memcpy(copy, rows, count * row_size);
    memcpy(out, &copy, sizeof copy);
    return NPG_OK;
}

npg_frame npg_frame_bare(const npg_frame *frame)
{
    npg_frame bare = *frame;
    bare.path = NULL;
    bare.pos_local = bare.normals = bare.vert_unit = bare.sensor_local = NULL;
    bare.colours = bare.sensors = bare.vert_colours = NULL;
    bare.views = NULL;
    bare.view_cells = NULL;
    return bare;
}

npg_status npg_frame_copy(npg_frame *out, const npg_frame *frame)
{
    *out = npg_frame_bare(frame);
    npg_status status = frame->path ? npg_copy_text(&out->path, frame->path) : NPG_OK;
    size_t n = frame->point_count, row = 3 * sizeof(float);
    if (!status) status = copy_rows(&out->pos_local, frame->pos_local, n, row);
    if (!status) status = copy_rows(&out->normals, frame->normals, n, row);
    if (!status) status = copy_rows(&out->colours, frame->colours, n, 4);
    if (!status) status = copy_rows(&out->sensors, frame->sensors, n, 1);
    if (!status) status = copy_rows(&out->sensor_local, frame->sensor_local, frame->sensor_count, row);
    if (!status) status = copy_rows(&out->views, frame->views, frame->sensor_count, sizeof *frame->views);
    if (!status)
        status = copy_rows(&out->view_cells, frame->view_cells, frame->view_cell_count, sizeof(float));
    if (!status) status = copy_rows(&out->vert_colours, frame->vert_colours, frame->vert_count, 4);
    if (!status) status = copy_rows(&out->vert_unit, frame->vert_unit, frame->vert_count, row);
    if (status) npg_frame_clear(out);
    return status;
}

void npg_frame_keep(npg_frame *frame, const uint8_t *keep)
{
    size_t kept = 0;
    for (size_t i = 0; i < frame->point_count; i++) {
        if (!keep[i]) continue;
        memmove(frame->pos_local + 3 * kept, frame->pos_local + 3 * i, 3 * sizeof(float));
        if (frame->normals) memmove(frame->normals + 3 * kept, frame->normals + 3 * i, 3 * sizeof(float));
        if (frame->colours) memmove(frame->colours + 4 * kept, frame->colours + 4 * i, 4);
        if (frame->sensors) frame->sensors[kept] = frame->sensors[i];
        kept++;
    }
    frame->point_count = kept;
}
