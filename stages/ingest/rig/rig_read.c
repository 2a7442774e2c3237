/* One frame of a rig: the points of all its sensors in one cloud, in world coordinates. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"
#include "pipeline/parallel.h"

typedef struct reading {
    npg_rig *rig;
    size_t frame;
    npg_depth_points of[NPG_FRAME_SENSORS_MOST];
} reading;

static npg_status read_sensor(void *user, size_t s)
{
    reading *r = user;
    const npg_rig_shot *shot = npg_rig_shot_of(r->rig, r->frame, s);
    return shot ? npg_depth_points_read(&r->of[s], r->rig, s, shot) : NPG_OK;
}

static npg_status reserve(npg_frame *frame, const reading *r)
{
    size_t count = 0;
    bool has_colours = false;
    for (size_t s = 0; s < r->rig->sensor_count; s++) {
        count += r->of[s].count;
        frame->view_cell_count += (size_t)r->of[s].view.width * r->of[s].view.height;
        has_colours = has_colours || r->of[s].has_colours;
    }
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    NPG_TRY(npg_alloc(&frame->sensors, NPG_FOR_FRAMES, count));
    NPG_TRY(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, r->rig->sensor_count, 3 * sizeof(float)));
    frame->sensor_count = r->rig->sensor_count;
    NPG_TRY(npg_alloc_array(&frame->views, NPG_FOR_FRAMES, frame->sensor_count, sizeof *frame->views));
    NPG_TRY(npg_alloc_array(&frame->view_cells, NPG_FOR_FRAMES, frame->view_cell_count, sizeof(float)));
    for (size_t i = 0; i < 3 * frame->sensor_count; i++) frame->sensor_local[i] = NAN;
    return has_colours ? npg_alloc_array(&frame->colours, NPG_FOR_FRAMES, count, 4) : NPG_OK;
}

/* The sensor's points to the world: the one origin of the capture is settled by its first point. */
static void add_sensor(npg_frame *frame, const reading *r, size_t s, npg_origin *origin)
{
    const npg_depth_points *from = &r->of[s];
    double pose[12];
    npg_rig_pose(r->rig, pose, s, npg_rig_shot_of(r->rig, r->frame, s));
    for (size_t i = 0; i < from->count; i++) {
        size_t to = frame->point_count++;
        const float *p = from->pos + 3 * i, *n = from->normals + 3 * i;
        double world[3];
        npg_pose_apply(world, pose, (const double[3]){(double)p[0], (double)p[1], (double)p[2]});
        npg_local_of(frame->pos_local + 3 * to, origin, world);
        for (size_t a = 0; a < 3; a++)
            frame->normals[3 * to + a] = (float)(pose[4 * a] * (double)n[0] + pose[4 * a + 1] * (double)n[1] +
                                                 pose[4 * a + 2] * (double)n[2]);
        if (from->colours) memcpy(frame->colours + 4 * to, from->colours + 4 * i, 4);
        frame->sensors[to] = (uint8_t)s;
    }
    for (size_t a = 0; a < 3; a++)
        frame->sensor_local[3 * s + a] = (float)(pose[4 * a + 3] - origin->world[a]);
}

/* *at: where the cells of the sensors before it end. */
static void add_view(npg_frame *frame, const reading *r, size_t s, const npg_origin *origin, size_t *at)
{
    npg_depth_view *view = &frame->views[s];
    size_t count = (size_t)r->of[s].view.width * r->of[s].view.height;
    double pose[12];
    *view = r->of[s].view;
    view->at = *at;
    if (!count) return;
    npg_rig_pose(r->rig, pose, s, npg_rig_shot_of(r->rig, r->frame, s));
    for (size_t a = 0; a < 3; a++) pose[4 * a + 3] -= origin->world[a];
    npg_pose_invert(view->to_sensor, pose);
    memcpy(frame->view_cells + *at, r->of[s].cells, count * sizeof *r->of[s].cells);
    *at += count;
}

static void note_blank(npg_rig *rig, const reading *r)
{
    for (size_t s = 0; s < rig->sensor_count; s++)
        if (r->of[s].is_blank && !rig->blank_count++)
            rig->first_blank = npg_rig_shot_of(rig, r->frame, s)->depth;
}

npg_status npg_rig_read(npg_rig *rig, npg_frame *frame, size_t at, npg_origin *origin)
{
    reading r = {.rig = rig, .frame = at};
    npg_status status = npg_parallel(read_sensor, &r, rig->sensor_count);
    if (!status) status = reserve(frame, &r);
    if (!status) note_blank(rig, &r);
    size_t cells = 0;
    for (size_t s = 0; s < rig->sensor_count && !status; s++)
        if (r.of[s].count) add_sensor(frame, &r, s, origin);
    for (size_t s = 0; s < rig->sensor_count && !status; s++) add_view(frame, &r, s, origin, &cells);
    for (size_t s = 0; s < rig->sensor_count; s++) npg_arena_release(&r.of[s].arena);
    frame->has_sure_normals = true;
    if (status) npg_frame_clear(frame);
    return status;
}

/* ---- a frame by its name ---- */

/* Split "PATH#NUMBER"; false where it is none. */
static bool split(char path[NPG_PATH_SIZE], int64_t *number, const char *text)
{
    const char *mark = strrchr(text, '#');
    char *end = NULL;
    if (!mark || (size_t)(mark - text) >= NPG_PATH_SIZE) return false;
    memcpy(path, text, (size_t)(mark - text));
    path[mark - text] = 0;
    *number = strtoll(mark + 1, &end, 10);
    return mark[1] && !*end && npg_rig_is(path);
}

bool npg_rig_is_frame(const char *text)
{
    char path[NPG_PATH_SIZE];
    int64_t number;
    return split(path, &number, text);
}

static npg_status open_rig_of(npg_rig **rig, int64_t *number, const char *text)
{
    char path[NPG_PATH_SIZE];
    if (!split(path, number, text)) return npg_error(NPG_BAD_INPUT, "%s: no frame of a rig", text);
    return npg_rig_open(rig, path, &npg_rig_usual);
}

npg_status npg_rig_up_of(npg_up *up, const char *text)
{
    int64_t number;
    npg_rig *rig;
    NPG_TRY(open_rig_of(&rig, &number, text));
    *up = npg_rig_up(rig);
    npg_rig_close(&rig);
    return NPG_OK;
}

npg_status npg_rig_read_frame(npg_frame *frame, const char *text, npg_origin *origin)
{
    int64_t number;
    npg_rig *rig;
    NPG_TRY(open_rig_of(&rig, &number, text));
    size_t at = npg_rig_find(rig, number);
    npg_status status = at == SIZE_MAX ? npg_error(NPG_BAD_INPUT, "%s: the rig has no such frame", text)
                                       : npg_rig_read(rig, frame, at, origin);
    npg_rig_close(&rig);
    return status;
}

npg_status npg_rig_read_shape(npg_mesh **mesh, const char *text, npg_origin *origin)
{
    npg_frame frame = {0};
    *mesh = NULL;
    npg_status status = npg_rig_read_frame(&frame, text, origin);
    npg_builder points = {.may_be_points = true, .vert_count = frame.point_count};
    points.pos = frame.pos_local;
    points.normals = frame.normals;
    points.colours = frame.colours;
    frame.pos_local = frame.normals = NULL;
    frame.colours = NULL;
    if (!status) status = npg_builder_mesh(mesh, &points, text);
    npg_builder_clear(&points);
    npg_frame_clear(&frame);
    return status;
}
