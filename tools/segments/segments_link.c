/* Overlaps: the frames that two segments share, and where the vertices of one lie on the other. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "export/export.h"
#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/file_facts.h"
#include "pipeline/frame_box.h"
#include "pipeline/json_lines.h"
#include "pipeline/order.h"
#include "tools/segments/segments.h"

#define NEAR                                                                                                 \
    0.01 /* of the diagonal: vertices no farther from the other surface count as near; set by trial */

/* ---- a frame's mesh ---- */

typedef struct wanted {
    int64_t number;
    const char *folder;
    char *path; /* owned */
} wanted;

static npg_status find_frame(void *user, const json_t *frame, const char *line, size_t size)
{
    wanted *w = user;
    const char *file = json_string_value(json_object_get(frame, "file"));
    (void)line, (void)size;
    if (!file || w->path || json_integer_value(json_object_get(frame, "number")) != w->number) return NPG_OK;
    return npg_join_path(&w->path, w->folder, file);
}

/* NULL when the segment has no mesh of the frame. */
static npg_status read_frame(npg_mesh **mesh, const npg_segments *s, const npg_segment *segment,
                             int64_t number, npg_origin *origin)
{
    char *folder, *list = NULL;
    struct stat info;
    *mesh = NULL;
    NPG_TRY(npg_segment_path(&folder, s, segment));
    wanted w = {.number = number, .folder = folder};
    npg_status status = npg_join_path(&list, folder, "frames.jsonl");
    if (!status && stat(list, &info)) status = npg_error_errno(NPG_DISK, "can't read back %s", list);
    if (!status) status = npg_json_lines_each(list, (int64_t)info.st_size, find_frame, &w);
    if (!status && w.path) status = npg_read_mesh(mesh, w.path, origin);
    npg_release(&w.path);
    npg_release(&list);
    npg_release(&folder);
    return status;
}

/* ---- links ---- */

static npg_status write_rows(npg_file *file, const npg_surface_hit *hits, size_t count)
{
    NPG_TRY(npg_file_print(file, "vertex,face,weight_0,weight_1,weight_2,distance\n"));
    for (size_t i = 0; i < count; i++) {
        const npg_surface_hit *hit = &hits[i];
        NPG_TRY(npg_file_print(file, "%zu,%" PRIu32 ",%.9g,%.9g,%.9g,%.9g\n", i, hit->face,
                               (double)hit->weights[0], (double)hit->weights[1], (double)hit->weights[2],
                               sqrt((double)hit->dist_sq)));
    }
    return NPG_OK;
}

/* Sums up how far the vertices lie from the other surface; hits are not needed any more. */
static void add_figures(json_t *entry, npg_surface_hit *hits, size_t count, double diagonal)
{
    float *dists = (float *)(void *)hits; /* no longer than the hits, and written behind what is read */
    size_t near = 0;
    for (size_t i = 0; i < count; i++) dists[i] = sqrtf(hits[i].dist_sq);
    for (size_t i = 0; i < count; i++) near += (double)dists[i] <= NEAR * diagonal;
    qsort(dists, count, sizeof *dists, npg_order_float);
    json_object_set_new(entry, "vertices", json_integer((json_int_t)count));
    json_object_set_new(entry, "distance_median", json_real(count ? (double)dists[count / 2] : 0));
    json_object_set_new(entry, "near_share", json_real(count ? (double)near / (double)count : 0));
}

static npg_status write_link(json_t *entry, const npg_segments *s, const char *name, const npg_mesh *of,
                             const npg_mesh *on)
{
    npg_surface *surface = NULL;
    npg_surface_hit *hits = NULL;
    npg_file *file = NULL;
    char *path = NULL;
    npg_bounds bounds = npg_bounds_empty();
    npg_bounds_add_points(&bounds, on->vert_pos, on->vert_count);
    npg_status status = npg_surface_open(&surface, on->vert_pos, on->vert_count, on->faces, on->face_count);
    if (!status) status = npg_alloc_array(&hits, NPG_FOR_QUERY, of->vert_count, sizeof *hits);
    if (!status) status = npg_surface_closest(surface, hits, of->vert_pos, of->vert_count);
    if (!status) status = npg_join_path(&path, s->output, name);
    if (!status) status = npg_file_open(&file, path);
    if (!status) {
        write_rows(file, hits, of->vert_count);
        status = npg_file_commit(&file);
    }
    if (!status) status = npg_file_facts(entry, s->output, name);
    if (!status) add_figures(entry, hits, of->vert_count, npg_bounds_diagonal(&bounds));
    npg_release(&path);
    npg_release(&hits);
    npg_surface_close(&surface);
    return status;
}

static npg_status add_link(json_t *links, const npg_segments *s, const npg_segment *of,
                           const npg_mesh *of_mesh, const npg_segment *on, const npg_mesh *on_mesh)
{
    char name[128];
    snprintf(name, sizeof name, "links/%s_on_%s.csv", of->folder, on->folder);
    json_t *entry = json_pack("{ss ss ss}", "file", name, "of", of->folder, "on", on->folder);
    json_array_append_new(links, entry);
    return write_link(entry, s, name, of_mesh, on_mesh);
}

/* ---- one overlap ---- */

static npg_status link_pair(json_t *links, bool *is_linked, const npg_segments *s, const npg_segment *a,
                            const npg_segment *b, int64_t number)
{
    npg_mesh *mesh_a = NULL, *mesh_b = NULL;
    npg_origin origin = {0};
    npg_status status = read_frame(&mesh_a, s, a, number, &origin);
    if (!status) status = read_frame(&mesh_b, s, b, number, &origin);
    *is_linked = !status && mesh_a && mesh_b;
    if (*is_linked) status = add_link(links, s, b, mesh_b, a, mesh_a);
    if (*is_linked && !status) status = add_link(links, s, a, mesh_a, b, mesh_b);
    npg_mesh_unref(&mesh_a);
    npg_mesh_unref(&mesh_b);
    return status;
}

/* The frames of an overlap, the nearest to the cut last; the links are made in the last
 * one that both have. */
static npg_status link_overlap(json_t *overlaps, const npg_segments *s, const npg_segment *a,
                               const npg_segment *b)
{
    bool is_later = b->shared_first > 0, is_linked = false;
    int64_t count = is_later ? b->shared_first : a->shared_last, number = -1;
    json_t *frames = json_array(), *links = json_array();
    npg_status status = NPG_OK;
    for (int64_t i = 0; i < count; i++)
        json_array_append_new(
            frames, json_integer(npg_segment_number(s, is_later ? b->first - count + i : b->first + i)));
    for (int64_t i = 0; i < count && !status && !is_linked; i++) {
        number = npg_segment_number(s, is_later ? b->first - 1 - i : b->first + i);
        status = link_pair(links, &is_linked, s, a, b, number);
    }
    json_t *overlap =
        json_pack("{s[ss] so so}", "between", a->folder, b->folder, "frames", frames, "links", links);
    if (is_linked) json_object_set_new(overlap, "link_frame", json_integer(number));
    json_array_append_new(overlaps, overlap);
    return status;
}

npg_status npg_segments_link(json_t **overlaps, const npg_segments *s)
{
    *overlaps = json_array();
    if (s->count < 2) return NPG_OK;
    char *folder;
    NPG_TRY(npg_join_path(&folder, s->output, "links"));
    npg_status status = npg_make_folder(folder);
    npg_release(&folder);
    for (size_t i = 1; i < s->count && !status; i++)
        status = link_overlap(*overlaps, s, &s->list[i - 1], &s->list[i]);
    return status;
}
