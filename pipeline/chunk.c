/* Chunk: a few consecutive frames on their way through the stages. */
#include "pipeline/chunk.h"

#include <assert.h>
#include <stddef.h>
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

#define ROW (3 * sizeof(float))

void npg_frame_arrays(npg_store_array list[NPG_FRAME_ARRAYS], const npg_frame *f)
{
    const npg_store_array arrays[NPG_FRAME_ARRAYS] = {
        {"points", offsetof(npg_frame, pos_local), f->point_count, ROW},
        {"normals", offsetof(npg_frame, normals), f->point_count, ROW},
        {"colours", offsetof(npg_frame, colours), f->point_count, 4},
        {"sensors", offsetof(npg_frame, sensors), f->point_count, 1},
        {"isolated", offsetof(npg_frame, isolated), f->point_count, 1},
        {"sensor_local", offsetof(npg_frame, sensor_local), f->sensor_count, ROW},
        {"views", offsetof(npg_frame, views), f->sensor_count, sizeof *f->views},
        {"view_cells", offsetof(npg_frame, view_cells), f->view_cell_count, sizeof(float)},
        {"vertices", offsetof(npg_frame, vert_unit), f->vert_count, ROW},
        {"vert_colours", offsetof(npg_frame, vert_colours), f->vert_count, 4}};
    memcpy(list, arrays, sizeof arrays);
}

/* The pointer that an entry of the list is of. */
static void **array_of(npg_frame *frame, const npg_store_array *array)
{
    return (void **)(void *)((char *)frame + array->offset);
}

void npg_frame_clear(npg_frame *frame)
{
    npg_store_array list[NPG_FRAME_ARRAYS];
    npg_frame_arrays(list, frame);
    npg_release(&frame->path);
    for (size_t i = 0; i < NPG_FRAME_ARRAYS; i++) npg_release(array_of(frame, &list[i]));
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

npg_frame npg_frame_bare(const npg_frame *frame)
{
    npg_store_array list[NPG_FRAME_ARRAYS];
    npg_frame bare = *frame;
    npg_frame_arrays(list, frame);
    bare.path = NULL;
    for (size_t i = 0; i < NPG_FRAME_ARRAYS; i++) *array_of(&bare, &list[i]) = NULL;
    return bare;
}

npg_status npg_frame_copy(npg_frame *out, const npg_frame *frame)
{
    npg_store_array list[NPG_FRAME_ARRAYS];
    npg_frame from = *frame;
    npg_frame_arrays(list, frame);
    *out = npg_frame_bare(frame);
    npg_status status = frame->path ? npg_copy_text(&out->path, frame->path) : NPG_OK;
    for (const npg_store_array *a = list; a < list + NPG_FRAME_ARRAYS && !status; a++) {
        void *rows = *array_of(&from, a), **copy = array_of(out, a);
        if (!rows) continue;
        status = npg_alloc_array(copy, NPG_FOR_FRAMES, a->count, a->row);
        if (*copy) memcpy(*copy, rows, a->count * a->row);
    }
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
        if (frame->isolated) frame->isolated[kept] = frame->isolated[i];
        kept++;
    }
    frame->point_count = kept;
}
