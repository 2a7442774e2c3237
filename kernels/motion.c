/* motion: buffers and launches of transform, nearest, chamfer and isometry. */
#include "kernels/motion.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- layout ---- */

/* count x 3 -> blocks, padded to `padded` points (a multiple of 16) by repeating the last. */
static void pack16(float *out, const float *points, size_t count, size_t padded)
{
    for (size_t i = 0; i < padded; i++) {
        const float *from = points + 3 * (i < count ? i : count - 1);
        for (size_t axis = 0; axis < 3; axis++) out[NPG_POINT_AT(i) + axis * NPG_LANES] = from[axis];
    }
}

/* Box blocks of the tree over `count` points. */
static size_t tree_blocks(size_t count)
{
    size_t total = 0, children = NPG_BLOCKS(count);
    do {
        children = NPG_BLOCKS(children);
        total += children;
    } while (children > 1);
    return total;
}

typedef struct keyed {
    uint64_t key;
    uint32_t index;
} keyed;

static int by_key(const void *a, const void *b)
{
    const keyed *x = a, *y = b;
    if (x->key != y->key) return x->key < y->key ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

/* Spread the low 21 bits to every third bit. */
static uint64_t spread_bits(uint64_t v)
{
    v &= 0x1fffff;
    v = (v | v << 32) & 0x1f00000000ffffULL;
    v = (v | v << 16) & 0x1f0000ff0000ffULL;
    v = (v | v << 8) & 0x100f00f00f00f00fULL;
    v = (v | v << 4) & 0x10c30c30c30c30c3ULL;
    return (v | v << 2) & 0x1249249249249249ULL;
}

npg_status npg_morton_order(uint32_t *order, const float *points, size_t count)
{
    keyed *keys;
    float lo[3] = {INFINITY, INFINITY, INFINITY}, extent = 0;
    NPG_TRY(npg_alloc_array(&keys, NPG_FOR_FIT, count, sizeof *keys));
    for (size_t i = 0; i < 3 * count; i++) lo[i % 3] = fminf(lo[i % 3], points[i]);
    for (size_t i = 0; i < 3 * count; i++) extent = fmaxf(extent, points[i] - lo[i % 3]);
    float scale = extent > 0 ? 2097151.0f /* 2^21 - 1, the last cell of an axis */ / extent : 0;
    for (size_t i = 0; i < count; i++) {
        keys[i].index = (uint32_t)i;
        for (size_t axis = 0; axis < 3; axis++)
            keys[i].key |= spread_bits((uint64_t)((points[3 * i + axis] - lo[axis]) * scale)) << axis;
    }
    qsort(keys, count, sizeof *keys, by_key);
    for (size_t i = 0; i < count; i++) order[i] = keys[i].index;
    npg_release(&keys);
    return NPG_OK;
}

/* ---- opening ---- */

static npg_status open_programs(npg_motion *m, npg_device *device)
{
    NPG_TRY(npg_program_open(&m->transform, device, "transform", ""));
    NPG_TRY(npg_program_open(&m->nearest, device, "nearest", ""));
    NPG_TRY(npg_program_open(&m->chamfer, device, "chamfer", ""));
    return npg_program_open(&m->isometry, device, "isometry", "");
}

/* Of `copies` frames, one behind the other. */
static npg_status upload_rest(npg_motion *m, npg_device *device, const float *vertices, size_t copies)
{
    float *packed;
    size_t row = 3 * m->rows;
    NPG_TRY(npg_alloc_array(&packed, NPG_FOR_FIT, copies * row, sizeof(float)));
    for (size_t t = 0; t < copies; t++)
        pack16(packed + t * row, vertices + t * 3 * m->real, m->real, m->rows);
    npg_status status = npg_buffer_from(&m->rest, device, packed, copies * row * sizeof(float));
    npg_release(&packed);
    return status;
}

static double edge_size(const float *vertices, const uint32_t edge[2])
{
    double sum = 0;
    for (size_t axis = 0; axis < 3; axis++) {
        double d = (double)vertices[3 * edge[0] + axis] - (double)vertices[3 * edge[1] + axis];
        sum += d * d;
    }
    return sqrt(sum);
}

static void fill_edges(int32_t *start, int32_t *neighbour, float *rest, const float *vertices, size_t rows,
                       const uint32_t (*edges)[2], size_t edge_count)
{
    for (size_t e = 0; e < edge_count; e++)
        for (int end = 0; end < 2; end++) start[edges[e][end] + 1]++;
    for (size_t v = 0; v < rows; v++) start[v + 1] += start[v];
    for (size_t e = 0; e < edge_count; e++)
        for (int end = 0; end < 2; end++) {
            int32_t at = start[edges[e][end]]++;
            neighbour[at] = (int32_t)edges[e][1 - end];
            rest[at] = (float)edge_size(vertices, edges[e]);
        }
    memmove(start + 1, start, rows * sizeof *start);
    start[0] = 0;
}

static npg_status upload_edges(npg_motion *m, npg_device *device, const float *vertices,
                               const uint32_t (*edges)[2], size_t edge_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_FIT};
    size_t half = m->half_edges = 2 * edge_count;
    int32_t *start = npg_arena_take(&scratch, m->rows + 2, sizeof *start),
            *neighbour = npg_arena_take(&scratch, half + 1, sizeof *neighbour);
    float *rest = npg_arena_take(&scratch, half + 1, sizeof *rest);
    npg_status status = npg_arena_status(&scratch);
    if (!status) {
        fill_edges(start, neighbour, rest, vertices, m->rows, edges, edge_count);
        status = npg_buffer_from(&m->start, device, start, (m->rows + 1) * sizeof *start);
    }
    if (!status) status = npg_buffer_from(&m->neighbour, device, neighbour, (half + 1) * sizeof *neighbour);
    if (!status) status = npg_buffer_from(&m->edge_rest, device, rest, (half + 1) * sizeof *rest);
    npg_arena_release(&scratch);
    return status;
}

typedef struct totals {
    size_t leaves, boxes, points;
} totals;

/* The searches of frame t both ways; `before` sums what the earlier frames take. */
static void fill_slots(int32_t *forward, int32_t *reverse, const npg_motion *m, size_t t, size_t count,
                       const totals *before)
{
    const size_t vert_boxes = tree_blocks(m->real);
    const size_t vert_blocks = NPG_BLOCKS(m->rows);
    const int32_t f[NPG_SLOT] = {[NPG_SLOT_QUERIES] = (int32_t)m->real,
                                 [NPG_SLOT_QUERY_BLOCK] = (int32_t)(t * vert_blocks),
                                 [NPG_SLOT_POINTS] = (int32_t)count,
                                 [NPG_SLOT_POINT_BLOCK] = (int32_t)before->leaves,
                                 [NPG_SLOT_BOX_BLOCK] = (int32_t)before->boxes,
                                 [NPG_SLOT_RESULT] = (int32_t)(t * m->rows)};
    const int32_t r[NPG_SLOT] = {[NPG_SLOT_QUERIES] = (int32_t)count,
                                 [NPG_SLOT_QUERY_BLOCK] = (int32_t)before->leaves,
                                 [NPG_SLOT_POINTS] = (int32_t)m->real,
                                 [NPG_SLOT_POINT_BLOCK] = (int32_t)(t * vert_blocks),
                                 [NPG_SLOT_BOX_BLOCK] = (int32_t)(t * vert_boxes),
                                 [NPG_SLOT_RESULT] = (int32_t)before->points};
    memcpy(forward + t * NPG_SLOT, f, sizeof f);
    memcpy(reverse + t * NPG_SLOT, r, sizeof r);
}

static npg_status upload_points(npg_motion *m, npg_device *device, const npg_target *targets, size_t leaves)
{
    float *packed;
    size_t at = 0;
    NPG_TRY(npg_alloc_array(&packed, NPG_FOR_FIT, leaves * NPG_POINT_BLOCK, sizeof(float)));
    for (size_t t = 0; t < m->frames; t++) {
        size_t padded = NPG_PADDED(targets[t].count);
        pack16(packed + at, targets[t].points, targets[t].count, padded);
        at += padded * 3;
    }
    npg_status status = npg_buffer_from(&m->points, device, packed, leaves * NPG_POINT_BLOCK * sizeof(float));
    npg_release(&packed);
    return status;
}

static npg_status upload_targets(npg_motion *m, npg_device *device, const npg_target *targets)
{
    int32_t *slots;
    totals sum = {0};
    size_t bytes = m->frames * NPG_SLOT * sizeof *slots;
    NPG_TRY(npg_alloc(&slots, NPG_FOR_FIT, 2 * bytes));
    for (size_t t = 0; t < m->frames; t++) {
        fill_slots(slots, slots + m->frames * NPG_SLOT, m, t, targets[t].count, &sum);
        sum.leaves += NPG_BLOCKS(targets[t].count);
        sum.boxes += tree_blocks(targets[t].count);
        sum.points += targets[t].count;
        if (targets[t].count > m->most_points) m->most_points = targets[t].count;
    }
    npg_status status = sum.points < INT32_MAX / 64 && m->frames * m->rows < INT32_MAX / 64
                            ? upload_points(m, device, targets, sum.leaves)
                            : npg_error(NPG_USAGE, "%zu points in one window are too many", sum.points);
    if (!status) status = npg_buffer_from(&m->forward, device, slots, bytes);
    if (!status) status = npg_buffer_from(&m->reverse, device, slots + m->frames * NPG_SLOT, bytes);
    if (!status) status = npg_buffer_open(&m->point_boxes, device, sum.boxes * NPG_BOX_BLOCK * sizeof(float));
    if (!status) status = npg_buffer_open(&m->to_verts, device, sum.points * sizeof(int32_t));
    npg_release(&slots);
    return status;
}

static npg_status open_moving(npg_motion *m, npg_device *device)
{
    const size_t f = sizeof(float), all = m->frames * m->rows;
    NPG_TRY(npg_buffer_open(&m->x, device, all * 3 * f));
    NPG_TRY(npg_buffer_open(&m->g, device, all * 3 * f));
    NPG_TRY(npg_buffer_open(&m->vert_boxes, device, m->frames * tree_blocks(m->real) * NPG_BOX_BLOCK * f));
    NPG_TRY(npg_buffer_open(&m->to_points, device, all * sizeof(int32_t)));
    NPG_TRY(npg_buffer_open(&m->cd, device, m->frames * f));
    NPG_TRY(npg_buffer_open(&m->part, device, all / NPG_LANES * f));
    return npg_buffer_open(&m->gain, device, m->frames * f);
}

static npg_status refit(npg_motion *m, npg_buffer *boxes, npg_buffer *points, npg_buffer *slots, size_t first,
                        size_t count)
{
    return NPG_LAUNCH_GROUPS(m->nearest, "nearest_refit", count, m->local, NPG_BUF(boxes), NPG_BUF(points),
                             NPG_BUF(slots), NPG_INT(first), NPG_INT(count));
}

npg_status npg_motion_open(npg_motion *m, npg_device *device, const float *vertices, size_t real, size_t rows,
                           const uint32_t (*edges)[2], size_t edge_count, const npg_target *targets,
                           size_t frames)
{
    NPG_REQUIRE(real && real <= rows && rows % NPG_LANES == 0);
    *m = (npg_motion){.rows = rows,
                      .real = real,
                      .frames = frames,
                      .local = (size_t)npg_device_tuning(device)->frame_local,
                      .queries = (size_t)npg_device_tuning(device)->nearest_queries};
    npg_status status = open_programs(m, device);
    if (!status) status = upload_rest(m, device, vertices, 1);
    if (!status) status = upload_edges(m, device, vertices, edges, edge_count);
    if (!status && targets) status = upload_targets(m, device, targets);
    if (!status) status = open_moving(m, device);
    if (!status && targets) status = refit(m, &m->point_boxes, &m->points, &m->forward, 0, frames);
    if (status) npg_motion_close(m);
    return status;
}

void npg_motion_close(npg_motion *m)
{
    npg_buffer *all[] = {&m->rest,      &m->x,           &m->g,         &m->vert_boxes,
                         &m->points,    &m->point_boxes, &m->to_points, &m->to_verts,
                         &m->forward,   &m->reverse,     &m->start,     &m->neighbour,
                         &m->edge_rest, &m->cd,          &m->part,      &m->gain};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) npg_buffer_close(all[i]);
}

npg_status npg_motion_rebase(npg_motion *m, npg_device *device, const float *bases)
{
    npg_buffer_close(&m->rest);
    m->stride = 3 * m->rows;
    return upload_rest(m, device, bases, m->frames);
}

/* ---- steps ---- */

npg_status npg_motion_apply(npg_motion *m, const npg_buffer *out, size_t first, size_t count)
{
    return NPG_LAUNCH(m->transform, "transform_apply", m->rows, count, NPG_BUF(&m->x), NPG_BUF(out),
                      NPG_BUF(&m->rest), NPG_INT(m->stride), NPG_INT(m->rows), NPG_INT(first),
                      NPG_INT(count));
}

npg_status npg_motion_chamfer(npg_motion *m, double alpha, size_t first, size_t count)
{
    NPG_TRY(refit(m, &m->vert_boxes, &m->x, &m->reverse, first, count));
    NPG_TRY(NPG_LAUNCH(m->nearest, "nearest_find", (m->real + m->queries - 1) / m->queries, count,
                       NPG_BUF(&m->to_points), NPG_BUF(&m->x), NPG_BUF(&m->points), NPG_BUF(&m->point_boxes),
                       NPG_BUF(&m->forward), NPG_INT(first), NPG_INT(count)));
    NPG_TRY(NPG_LAUNCH(m->nearest, "nearest_find", (m->most_points + m->queries - 1) / m->queries, count,
                       NPG_BUF(&m->to_verts), NPG_BUF(&m->points), NPG_BUF(&m->x), NPG_BUF(&m->vert_boxes),
                       NPG_BUF(&m->reverse), NPG_INT(first), NPG_INT(count)));
    return NPG_LAUNCH_GROUPS(m->chamfer, "chamfer_frame", count, m->local, NPG_BUF(&m->cd), NPG_BUF(&m->g),
                             NPG_BUF(&m->x), NPG_BUF(&m->points), NPG_BUF(&m->to_points),
                             NPG_BUF(&m->to_verts), NPG_BUF(&m->forward), NPG_BUF(&m->reverse),
                             NPG_REAL(alpha > 0 ? 1 / (2 * alpha * alpha) : 0), NPG_INT(m->rows),
                             NPG_INT(first), NPG_INT(count));
}

npg_status npg_motion_back(npg_motion *m, const npg_buffer *dout, const npg_buffer *out, const float *gains,
                           double iso_gain, size_t first, size_t count)
{
    NPG_TRY(npg_buffer_write(&m->gain, first * sizeof *gains, gains, count * sizeof *gains));
    NPG_TRY(NPG_LAUNCH(m->isometry, "isometry_back", m->rows / NPG_LANES, count, NPG_BUF(&m->g),
                       NPG_BUF(&m->part), NPG_BUF(&m->x), NPG_BUF(&m->start), NPG_BUF(&m->neighbour),
                       NPG_BUF(&m->edge_rest), NPG_BUF(&m->gain), NPG_REAL(iso_gain), NPG_INT(m->rows),
                       NPG_INT(first), NPG_INT(count)));
    return NPG_LAUNCH(m->transform, "transform_back", m->rows, count, NPG_BUF(dout), NPG_BUF(&m->g),
                      NPG_BUF(out), NPG_BUF(&m->rest), NPG_INT(m->stride), NPG_INT(m->rows), NPG_INT(first),
                      NPG_INT(count), NPG_INT(m->real));
}
