/* Codec of the page's numbers: prediction, planes of bytes, zlib. */
#include "tools/view/view.h"

#include <math.h>
#include <string.h>
#include <zlib.h>

enum { PLANES = 4, LEVEL = 9 };

npg_status npg_bytes_add(npg_bytes *bytes, const void *data, size_t size)
{
    NPG_TRY(npg_grow(&bytes->data, &bytes->capacity, bytes->size + size, 1, NPG_FOR_FILES));
    if (size) memcpy(bytes->data + bytes->size, data, size);
    bytes->size += size;
    return NPG_OK;
}

/* ---- prediction ---- */

/* Counts (of: NULL) or writes the lower ends of all edges of all faces. */
static void gather_links(uint32_t *place, uint32_t *of, const npg_mesh *mesh)
{
    for (size_t i = 0; i < 3 * mesh->face_count; i++) {
        size_t first = i - i % 3;
        uint32_t v = mesh->faces[i];
        for (size_t k = first; k < first + 3; k++) {
            if (mesh->faces[k] >= v) continue;
            if (of) of[place[v]] = mesh->faces[k];
            place[v]++;
        }
    }
}

npg_status npg_view_links_open(npg_view_links *links, npg_arena *arena, const npg_mesh *mesh)
{
    size_t v = mesh->vert_count;
    *links = (npg_view_links){.vert_count = v, .start = npg_arena_take(arena, v + 1, sizeof *links->start)};
    uint32_t *place = npg_arena_take(arena, v + 1, sizeof *place);
    NPG_TRY(npg_arena_status(arena));
    gather_links(place, NULL, mesh);
    for (size_t i = 0; i < v; i++) links->start[i + 1] = links->start[i] + place[i];
    memcpy(place, links->start, (v + 1) * sizeof *place);
    links->of = npg_arena_take(arena, links->start[v], sizeof *links->of);
    NPG_TRY(npg_arena_status(arena));
    gather_links(place, links->of, mesh);
    return NPG_OK;
}

static int64_t floor_div(int64_t a, int64_t b)
{
    int64_t quotient = a / b;
    return a % b < 0 ? quotient - 1 : quotient;
}

void npg_view_predict(const npg_view_links *links, int32_t *left, const int32_t *values)
{
    for (size_t i = 0; i < links->vert_count; i++) {
        int64_t sum = 0, count = links->start[i + 1] - links->start[i];
        for (uint32_t k = links->start[i]; k < links->start[i + 1]; k++) sum += values[links->of[k]];
        int64_t guess = count ? floor_div(2 * sum + count, 2 * count) : i ? values[i - 1] : 0;
        left[i] = (int32_t)(values[i] - guess);
    }
}

/* ---- packing ---- */

static void split_planes(uint8_t *planes, const int32_t *values, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        uint32_t zigzag = (uint32_t)values[i] << 1 ^ (values[i] < 0 ? UINT32_MAX : 0);
        for (size_t p = 0; p < PLANES; p++) planes[p * count + i] = (uint8_t)(zigzag >> 8 * p);
    }
}

static npg_status deflate_all(npg_bytes *out, uint8_t *bytes, size_t size)
{
    z_stream stream = {.next_in = bytes, .avail_in = (uInt)size};
    if (size > UINT32_MAX / 2) return npg_error(NPG_USAGE, "a block of %zu bytes is too large", size);
    if (deflateInit2(&stream, LEVEL, Z_DEFLATED, 15, 9, Z_FILTERED) != Z_OK)
        return npg_error(NPG_MEMORY, "no memory to compress");
    stream.avail_out = (uInt)deflateBound(&stream, (uLong)size);
    npg_status status = npg_grow(&out->data, &out->capacity, out->size + stream.avail_out, 1, NPG_FOR_FILES);
    stream.next_out = status ? NULL : out->data + out->size;
    if (!status && deflate(&stream, Z_FINISH) != Z_STREAM_END)
        status = npg_error(NPG_FAILED, "zlib: %s", stream.msg);
    out->size += stream.total_out;
    deflateEnd(&stream);
    return status;
}

npg_status npg_view_pack(npg_bytes *out, size_t *packed_size, const int32_t *values, size_t count)
{
    uint8_t *planes;
    size_t before = out->size;
    NPG_TRY(npg_alloc_array(&planes, NPG_FOR_FILES, count, PLANES));
    split_planes(planes, values, count);
    npg_status status = deflate_all(out, planes, count * PLANES);
    npg_release(&planes);
    if (packed_size) *packed_size = out->size - before;
    return status;
}

void npg_view_round(const npg_view_grid *grid, int32_t *out, const float *points, size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double at = ((double)points[3 * i + a] - grid->origin[a]) / grid->step;
            double bounded = at < 0 ? 0 : at > NPG_VIEW_GRID_MAX ? NPG_VIEW_GRID_MAX : at;
            out[a * count + i] = (int32_t)lrint(bounded);
        }
}
