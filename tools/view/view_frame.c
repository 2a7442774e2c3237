/* Frame: meshes and points of a result as blocks of bytes for the page. */
#include "tools/view/view.h"

#include <math.h>
#include <string.h>

#define GRID_STEPS 65535 /* of the smallest frame's longest side, at least: 16 bits */

npg_status npg_view_frames_open(npg_view_frames *frames, const npg_view_part *part, size_t point_limit)
{
    const npg_mesh *mesh = part->reference;
    *frames = (npg_view_frames){.arena = {.purpose = NPG_FOR_MESH}, .part = part, .point_limit = point_limit};
    frames->vert_pos = npg_arena_copy(&frames->arena, mesh->vert_pos, mesh->vert_count, 3 * sizeof(float));
    frames->seen = npg_arena_take(&frames->arena, mesh->vert_count, sizeof *frames->seen);
    npg_status status = npg_arena_status(&frames->arena);
    if (status) npg_arena_release(&frames->arena);
    return status;
}

/* ---- grids ---- */

static npg_view_grid grid_of(const npg_bounds *all, double shortest)
{
    double span = npg_bounds_longest(all), step = shortest / GRID_STEPS;
    npg_view_grid grid = {{all->lo[0], all->lo[1], all->lo[2]}, step};
    if (grid.step < span / NPG_VIEW_GRID_MAX) grid.step = span / NPG_VIEW_GRID_MAX;
    if (!(grid.step > 0)) grid.step = 1; /* all in one place */
    return grid;
}

static npg_view_grid grid_of_one(const float *points, size_t count)
{
    npg_bounds bounds = npg_bounds_of(points, count);
    return grid_of(&bounds, npg_bounds_longest(&bounds));
}

/* ---- what a group is made of ---- */

typedef struct group {
    npg_arena arena; /* of what follows */
    npg_view_frames *frames;
    size_t count, v;
    float *positions; /* count x V x 3 */
    int32_t *errors;  /* count x V     */
    float *points;    /* of all frames */
    size_t point_total, point_capacity;
    uint32_t *point_counts; /* 2 count: all, then those that were dropped */
    npg_view_grid grid;
} group;

static npg_status gather_frame(group *g, size_t i, const npg_view_frame *frame)
{
    npg_view_frames *frames = g->frames;
    size_t shown, dropped;
    NPG_TRY(npg_view_read_mesh(frames, frame));
    memcpy(g->positions + 3 * g->v * i, frames->vert_pos, 3 * g->v * sizeof *g->positions);
    frames->point_count = frames->dropped_count = 0;
    if (frame->file || frame->source) NPG_TRY(npg_view_read_points(frames, frame));
    if (frame->file) NPG_TRY(npg_view_measure(frames, g->errors + g->v * i));
    NPG_TRY(npg_view_choose_points(frames, &shown, &dropped));
    NPG_TRY(npg_arena_grow(&g->arena, &g->points, &g->point_capacity, g->point_total + shown,
                           3 * sizeof *g->points));
    if (shown) memcpy(g->points + 3 * g->point_total, frames->some, 3 * shown * sizeof *g->points);
    g->point_total += shown;
    g->point_counts[i] = (uint32_t)shown;
    g->point_counts[g->count + i] = (uint32_t)dropped;
    return NPG_OK;
}

static npg_status gather(group *g, size_t first)
{
    npg_bounds all = npg_bounds_empty();
    double shortest = INFINITY;
    g->positions = npg_arena_take(&g->arena, g->count * g->v, 3 * sizeof *g->positions);
    g->errors = npg_arena_take(&g->arena, g->count * g->v, sizeof *g->errors);
    g->point_counts = npg_arena_take(&g->arena, 2 * g->count, sizeof *g->point_counts);
    NPG_TRY(npg_arena_status(&g->arena));
    for (size_t i = 0; i < g->count; i++) {
        npg_bounds bounds = npg_bounds_empty();
        NPG_TRY(gather_frame(g, i, &g->frames->part->frames[first + i]));
        npg_bounds_add_points(&bounds, g->positions + 3 * g->v * i, g->v);
        shortest = fmin(shortest, npg_bounds_longest(&bounds));
        npg_bounds_add(&all, &bounds);
    }
    g->grid = grid_of(&all, shortest);
    return NPG_OK;
}

/* ---- packing ---- */

/* left = change predicted over space; now and before are 3 x V, before may be NULL; change is room for V. */
static void predict_frame(const npg_view_links *links, int32_t *left, int32_t *change, const int32_t *now,
                          const int32_t *before)
{
    size_t v = links->vert_count;
    for (size_t a = 0; a < 3; a++) {
        for (size_t i = 0; i < v; i++) change[i] = now[a * v + i] - (before ? before[a * v + i] : 0);
        npg_view_predict(links, left + a * v, change);
    }
}

/* Frames in turn, of which two are held at a time. */
static npg_status pack_positions(npg_bytes *out, size_t *size, npg_arena *arena, const npg_view_links *links,
                                 const npg_view_grid *grid, const float *positions, size_t count)
{
    size_t v = links->vert_count;
    int32_t *rooms = npg_arena_take(arena, 7 * v, sizeof *rooms);
    int32_t *left = npg_arena_take(arena, 3 * v * count, sizeof *left);
    NPG_TRY(npg_arena_status(arena));
    for (size_t t = 0; t < count; t++) {
        int32_t *now = rooms + 3 * v * (t % 2), *before = rooms + 3 * v * (1 - t % 2);
        npg_view_round(grid, now, positions + 3 * v * t, v);
        predict_frame(links, left + 3 * v * t, rooms + 6 * v, now, t ? before : NULL);
    }
    return npg_view_pack(out, size, left, 3 * v * count);
}

/* Rows of V values, each predicted by itself. */
static npg_status pack_rows(npg_bytes *out, size_t *size, npg_arena *arena, const npg_view_links *links,
                            const int32_t *rows, size_t count)
{
    size_t v = links->vert_count;
    int32_t *left = npg_arena_take(arena, count * v, sizeof *left);
    NPG_TRY(npg_arena_status(arena));
    for (size_t r = 0; r < count; r++) npg_view_predict(links, left + r * v, rows + r * v);
    return npg_view_pack(out, size, left, count * v);
}

static npg_status pack_points(npg_bytes *out, size_t *size, group *g)
{
    const double step = g->grid.step * NPG_VIEW_POINT_STEP;
    int32_t *values = npg_arena_take(&g->arena, g->point_total, 3 * sizeof *values);
    NPG_TRY(npg_arena_status(&g->arena));
    for (size_t t = 0, at = 0; t < g->count; at += g->point_counts[t++])
        for (size_t a = 0; a < 3; a++) {
            int32_t before = 0, *row = values + 3 * at + a * g->point_counts[t];
            for (size_t i = 0; i < g->point_counts[t]; i++) {
                double share = ((double)g->points[3 * (at + i) + a] - g->grid.origin[a]) / step;
                int32_t now = (int32_t)lrint(fmax(-NPG_VIEW_GRID_MAX, fmin(NPG_VIEW_GRID_MAX, share)));
                row[i] = now - before;
                before = now;
            }
        }
    return npg_view_pack(out, size, values, 3 * g->point_total);
}

/* ---- blocks ---- */

/* Numbers as they stand in memory: the machines this runs on are little-endian, as are those of browsers. */
static npg_status add_grid(npg_bytes *out, const npg_view_grid *grid)
{
    NPG_TRY(npg_bytes_add(out, grid->origin, sizeof grid->origin));
    return npg_bytes_add(out, &grid->step, sizeof grid->step);
}

static void set_sizes(npg_bytes *out, size_t at, const size_t *sizes, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        uint32_t size = (uint32_t)sizes[i];
        memcpy(out->data + at + 4 * i, &size, 4);
    }
}

static npg_status pack_group(npg_bytes *out, group *g)
{
    const npg_view_part *part = g->frames->part;
    const uint32_t head[4] = {(uint32_t)g->count};
    size_t sizes[3];
    NPG_TRY(add_grid(out, &g->grid));
    size_t at = out->size + 4;
    NPG_TRY(npg_bytes_add(out, head, sizeof head));
    NPG_TRY(npg_bytes_add(out, g->point_counts, 2 * g->count * sizeof *g->point_counts));
    NPG_TRY(pack_positions(out, &sizes[0], &g->arena, &part->links, &g->grid, g->positions, g->count));
    NPG_TRY(pack_rows(out, &sizes[1], &g->arena, &part->links, g->errors, g->count));
    NPG_TRY(pack_points(out, &sizes[2], g));
    set_sizes(out, at, sizes, 3);
    return NPG_OK;
}

npg_status npg_view_group_block(npg_bytes *out, npg_view_frames *frames, size_t first, size_t count)
{
    group g = {.arena = {.purpose = NPG_FOR_MESH},
               .frames = frames,
               .count = count,
               .v = frames->part->reference->vert_count};
    npg_status status = gather(&g, first);
    if (!status) status = pack_group(out, &g);
    npg_arena_release(&g.arena);
    return status;
}

static npg_status pack_faces(npg_bytes *out, size_t *size, npg_arena *arena, const npg_mesh *mesh)
{
    int32_t *values = npg_arena_take(arena, mesh->face_count, 3 * sizeof *values);
    NPG_TRY(npg_arena_status(arena));
    for (size_t i = 0; i < 3 * mesh->face_count; i++)
        values[i] = (int32_t)(mesh->faces[i] - (i ? mesh->faces[i - 1] : 0));
    return npg_view_pack(out, size, values, 3 * mesh->face_count);
}

static npg_status pack_colours(npg_bytes *out, size_t *size, npg_arena *arena, const npg_view_part *part)
{
    const npg_mesh *mesh = part->reference;
    size_t v = mesh->vert_count;
    int32_t *rows = npg_arena_take(arena, v, 3 * sizeof *rows);
    NPG_TRY(npg_arena_status(arena));
    for (size_t i = 0; i < 3 * v; i++) rows[i % 3 * v + i / 3] = mesh->vert_colours[i / 3 * 4 + i % 3];
    return pack_rows(out, size, arena, &part->links, rows, 3);
}

npg_status npg_view_part_block(npg_bytes *out, npg_view_frames *frames)
{
    const npg_view_part *part = frames->part;
    const npg_mesh *mesh = part->reference;
    const uint32_t head[2] = {(uint32_t)mesh->vert_count, (uint32_t)mesh->face_count}, none[4] = {0};
    const npg_view_grid grid = grid_of_one(mesh->vert_pos, mesh->vert_count);
    npg_arena *arena = &frames->arena;
    size_t sizes[4] = {0};
    NPG_TRY(npg_bytes_add(out, head, sizeof head));
    NPG_TRY(add_grid(out, &grid));
    size_t at = out->size;
    NPG_TRY(npg_bytes_add(out, none, sizeof none));
    NPG_TRY(pack_faces(out, &sizes[0], arena, mesh));
    NPG_TRY(pack_positions(out, &sizes[1], arena, &part->links, &grid, mesh->vert_pos, 1));
    if (mesh->vert_colours) NPG_TRY(pack_colours(out, &sizes[2], arena, part));
    if (frames->with_points) NPG_TRY(pack_rows(out, &sizes[3], arena, &part->links, frames->seen, 1));
    set_sizes(out, at, sizes, 4);
    return NPG_OK;
}
