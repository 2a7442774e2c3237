/* Synthetic rigs: what a ring of cameras sees, as a capture program would write it. */
#include "tools/synth/synth.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <string.h>

#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/random.h"

#define DEPTH_STEP 0.0005 /* metres: 16 bits reach 32 m */

void npg_synth_colour(uint8_t rgba[4], const double p[3])
{
    /* waves of about 0.4 m: detail that a mesh of 2 cm can carry */
    const double waves[3] = {sin(14 * p[1] + 6 * p[0]), sin(15 * p[0] + 8 * p[2] + 1),
                             sin(13 * p[2] - 10 * p[1] + 2)};
    for (int c = 0; c < 3; c++) rgba[c] = (uint8_t)lrint(128 + 90 * waves[c]);
    rgba[3] = 255;
}

/* The ring's cameras hang upside down; a rig's stand upright, so that its images do. */
static npg_synth_camera upright(const npg_scan *capture, int64_t i)
{
    npg_synth_camera c = npg_synth_camera_of_ring(capture, i);
    for (int k = 0; k < 3; k++) {
        c.right[k] = -c.right[k];
        c.up[k] = -c.up[k];
    }
    return c;
}

/* ---- rig.json ---- */

static json_t *json_of_camera(const npg_synth_camera *c, int64_t i)
{
    json_t *pose = json_array();
    for (int r = 0; r < 3; r++) {
        /* camera axes x right, y down, z ahead */
        const double row[4] = {c->right[r], -c->up[r], c->ahead[r], c->eye[r]};
        for (int k = 0; k < 4; k++) json_array_append_new(pose, json_real(row[k]));
    }
    for (int k = 0; k < 4; k++) json_array_append_new(pose, json_real(k == 3));
    char name[32], depth[64], colour[64];
    snprintf(name, sizeof name, "camera%lld", (long long)i);
    snprintf(depth, sizeof depth, "%s/depth_%%04d.png", name);
    snprintf(colour, sizeof colour, "%s/colour_%%04d.png", name);
    json_t *camera = json_pack("{sI sI sf sf sf sf}", "width", (json_int_t)c->width, "height",
                               (json_int_t)c->height, "fx", c->focal, "fy", c->focal, "cx",
                               0.5 * (double)c->width - 0.5, "cy", 0.5 * (double)c->height - 0.5);
    return json_pack("{ss ss ss so so}", "name", name, "depth", depth, "colour", colour, "camera", camera,
                     "pose", pose);
}

static npg_status begin_rig(const char *folder, const npg_scan *capture)
{
    json_t *sensors = json_array();
    char path[4096];
    npg_status status = NPG_OK;
    for (int64_t i = 0; i < capture->cameras && !status; i++) {
        npg_synth_camera c = upright(capture, i);
        json_array_append_new(sensors, json_of_camera(&c, i));
        snprintf(path, sizeof path, "%s/camera%lld", folder, (long long)i);
        status = npg_make_folder(path);
    }
    json_t *rig = json_pack("{si ss sf so}", "neupig_rig", 1, "unit", "m", "depth_scale", DEPTH_STEP,
                            "sensors", sensors);
    if (!status) status = npg_json_write(folder, "rig.json", rig);
    json_decref(rig);
    return status;
}

/* ---- images ---- */

static npg_status write_png(const char *folder, int64_t camera, const char *kind, int64_t frame,
                            const npg_synth_camera *c, int format, const void *pixels)
{
    char path[4096];
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)c->width,
                       .height = (png_uint_32)c->height,
                       .format = (png_uint_32)format};
    snprintf(path, sizeof path, "%s/camera%lld/%s_%04lld.png", folder, (long long)camera, kind,
             (long long)frame);
    if (png_image_write_to_file(&image, path, 0, pixels, 0, NULL)) return NPG_OK;
    return npg_error(NPG_DISK, "%s: %s", path, image.message);
}

typedef struct images {
    npg_ray_hit *seen;
    uint16_t *depth; /* H x W, first row on top */
    uint8_t *colour; /* H x W x 3               */
} images;

static void fill_images(images *im, const npg_synth_camera *c, const npg_mesh *rest, double noise_m,
                        npg_random *random)
{
    size_t pixels = (size_t)(c->width * c->height);
    memset(im->depth, 0, pixels * sizeof *im->depth);
    memset(im->colour, 0, 3 * pixels);
    for (int64_t at = 0; at < c->width * c->height; at++) {
        const npg_ray_hit *hit = &im->seen[at];
        double at_rest[3] = {0}, depth = (double)hit->t;
        size_t to = (size_t)((c->height - 1 - at / c->width) * c->width + at % c->width);
        uint8_t rgba[4];
        if (hit->face == UINT32_MAX || hit->is_back) continue;
        for (size_t k = 0; k < 3; k++)
            for (size_t i = 0; i < 3; i++)
                at_rest[i] += (double)hit->weights[k] *
                              (double)rest->vert_pos[3 * (size_t)rest->faces[3 * (size_t)hit->face + k] + i];
        npg_synth_colour(rgba, at_rest);
        memcpy(im->colour + 3 * to, rgba, 3);
        if (noise_m > 0) depth += noise_m * npg_random_gauss(random);
        im->depth[to] = (uint16_t)fmin(fmax(lrint(depth / DEPTH_STEP), 0), UINT16_MAX);
    }
}

npg_status npg_synth_rig_frame(const char *folder, const npg_scan *capture, const npg_mesh *mesh,
                               const npg_mesh *rest, int64_t frame, double noise_m)
{
    images im;
    npg_surface *surface = NULL;
    npg_random random = npg_random_stream(capture->seed, (uint64_t)frame, NPG_FOR_CAMERAS);
    npg_synth_camera first = upright(capture, 0);
    size_t pixels = (size_t)(first.width * first.height);
    npg_arena scratch = {.purpose = NPG_FOR_FRAMES};
    if (!frame) NPG_TRY(begin_rig(folder, capture));
    im.seen = npg_arena_take(&scratch, pixels, sizeof *im.seen);
    im.depth = npg_arena_take(&scratch, pixels, sizeof *im.depth);
    im.colour = npg_arena_take(&scratch, pixels, 3);
    npg_status status = npg_arena_status(&scratch);
    if (!status)
        status = npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    for (int64_t i = 0; i < capture->cameras && !status; i++) {
        npg_synth_camera c = upright(capture, i);
        status = npg_synth_look(im.seen, surface, &c);
        if (!status) fill_images(&im, &c, rest, noise_m, &random);
        if (!status) status = write_png(folder, i, "depth", frame, &c, PNG_FORMAT_LINEAR_Y, im.depth);
        if (!status) status = write_png(folder, i, "colour", frame, &c, PNG_FORMAT_RGB, im.colour);
    }
    npg_surface_close(&surface);
    npg_arena_release(&scratch);
    return status;
}
