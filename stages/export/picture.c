/* Pictures: meshes, or clouds as small balls, with colours; cameras that fit a box, tiles traced by rays, PNG files. */
#include "export/exporters/exporters_internal.h"

#include <math.h>
#include <png.h>
#include <string.h>

#include "geometry/geometry.h"
#include "ingest/ingest.h"
#include "pipeline/file.h"
#include "pipeline/struct_size.h"

#define RADIANS (3.14159265358979323846 / 180)

#define PIXELS_MAX ((int64_t)1 << 28) /* 768 MiB of colours */

static const float background[3] = {0.97f, 0.97f, 0.98f};

typedef struct camera {
    double position[3];
    double axes[9];          /* rows of unit length: to the right, up, ahead      */
    double slope_x, slope_y; /* half the picture's width and height at distance 1 */
} camera;

typedef struct drawing {
    const npg_picture_settings *s;
    npg_picture *picture;
    const char *const *files;
    npg_origin origin;
    npg_bounds reach; /* along the eye's axes */
    camera eye;
    npg_arena arena;
    uint8_t *pixels; /* height x width x 3, RGB */
    npg_ray *rays;   /* of one row of a tile    */
    npg_ray_hit *hits;
    npg_mesh *first; /* the first mesh, for identity colours */
    int64_t columns, tile_width;
} drawing;

/* ---- scenes ---- */

typedef struct picture_scene {
    npg_mesh *mesh;      /* what rays meet, with vertex normals; owned              */
    float *colours;      /* V x 3, 0..1, owned                                      */
    bool is_cloud;       /* each 8 faces are a ball                                 */
    size_t shown, total; /* clouds: points drawn and points there                   */
} picture_scene;

enum { BALLS_MAX = 200000 }; /* points drawn at most: each is a mesh of 8 faces */

/* A mesh, or a cloud as one without faces, unusable points left out. */
static npg_status read_any(npg_mesh **out, const char *path, npg_origin *origin)
{
    NPG_TRY(npg_read_shape(out, path, origin));
    npg_mesh *mesh = *out;
    size_t kept = 0;
    npg_status status = mesh->face_count ? npg_mesh_require_finite(mesh, path) : NPG_OK;
    for (size_t i = 0; i < mesh->vert_count && !mesh->face_count; i++) {
        if (!npg_vec3_is_finitef(mesh->vert_pos + 3 * i)) continue;
        memmove(mesh->vert_pos + 3 * kept, mesh->vert_pos + 3 * i, 3 * sizeof(float));
        if (mesh->vert_normals)
            memmove(mesh->vert_normals + 3 * kept, mesh->vert_normals + 3 * i, 3 * sizeof(float));
        if (mesh->vert_colours) memmove(mesh->vert_colours + 4 * kept, mesh->vert_colours + 4 * i, 4);
        kept++;
    }
    if (!mesh->face_count) mesh->vert_count = kept;
    if (status) npg_mesh_unref(out);
    return status;
}

/* Read only what a file fills of the space, along three axes (rows of unit length), added to *reach. */
static npg_status measure_file(npg_bounds *reach, const char *path, npg_origin *origin, const double axes[9])
{
    npg_mesh *mesh = NULL;
    NPG_TRY(read_any(&mesh, path, origin));
    for (size_t v = 0; v < mesh->vert_count; v++)
        for (int axis = 0; axis < 3; axis++) {
            double along = 0;
            for (int k = 0; k < 3; k++)
                along += axes[3 * axis + k] * (double)mesh->vert_pos[3 * v + (size_t)k];
            reach->lo[axis] = fmin(reach->lo[axis], along);
            reach->hi[axis] = fmax(reach->hi[axis], along);
        }
    npg_mesh_unref(&mesh);
    return NPG_OK;
}

/* ---- colours ---- */

static void colour_vertex(float *colour, const npg_mesh *mesh, size_t v, int kind, const npg_mesh *identity,
                          const npg_bounds *bounds)
{
    static const float plain[3] = {0.80f, 0.78f, 0.74f};
    bool is_own = kind == NPG_PICTURE_VERTEX || (kind == NPG_PICTURE_AUTO && !mesh->face_count);
    for (size_t k = 0; k < 3; k++) {
        double extent = bounds->hi[k] - bounds->lo[k];
        colour[k] = plain[k];
        if (is_own && mesh->vert_colours) colour[k] = (float)mesh->vert_colours[4 * v + k] / 255;
        if (kind == NPG_PICTURE_NORMAL && mesh->vert_normals)
            colour[k] = 0.5f + 0.5f * mesh->vert_normals[3 * v + k];
        if (kind == NPG_PICTURE_IDENTITY && extent > 0)
            colour[k] =
                (float)(0.15 + 0.8 * ((double)identity->vert_pos[3 * v + k] - bounds->lo[k]) / extent);
    }
}

static npg_status open_colours(picture_scene *scene, const npg_mesh *mesh, int kind, const npg_mesh *first)
{
    const npg_mesh *identity = first && first->vert_count == mesh->vert_count ? first : mesh;
    npg_bounds bounds = npg_bounds_of(identity->vert_pos, identity->vert_count);
    NPG_TRY(npg_alloc_array(&scene->colours, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float)));
    for (size_t v = 0; v < mesh->vert_count; v++)
        colour_vertex(scene->colours + 3 * v, mesh, v, kind, identity, &bounds);
    return NPG_OK;
}

/* ---- clouds as balls ---- */

static void put_ball(npg_mesh *balls, size_t b, const float *middle, const float *normal, float radius)
{
    static const uint32_t octahedron[8][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                              {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
    for (size_t c = 0; c < 6; c++) {
        float *p = balls->vert_pos + 3 * (6 * b + c), *n = balls->vert_normals + 3 * (6 * b + c);
        memcpy(p, middle, 3 * sizeof *p);
        p[c / 2] += c % 2 ? -radius : radius;
        if (normal)
            memcpy(n, normal, 3 * sizeof *n);
        else
            n[c / 2] = c % 2 ? -1.0f : 1.0f;
    }
    for (size_t f = 0; f < 8; f++)
        for (size_t k = 0; k < 3; k++)
            balls->faces[3 * (8 * b + f) + k] = (uint32_t)(6 * b) + octahedron[f][k];
}

/* Replace a cloud (its colours are known) by balls. */
static npg_status make_balls(picture_scene *scene, npg_mesh *cloud, double radius)
{
    float *point_colours = scene->colours;
    size_t total = cloud->vert_count, step = total / BALLS_MAX + 1, count = (total + step - 1) / step;
    npg_mesh *balls = NULL;
    scene->colours = NULL;
    npg_status status = npg_mesh_open(&balls, 6 * count, 8 * count);
    if (!status && !balls->vert_normals)
        status = npg_alloc_array(&balls->vert_normals, NPG_FOR_MESH, 6 * count, 3 * sizeof(float));
    if (!status) status = npg_alloc_array(&scene->colours, NPG_FOR_MESH, 6 * count, 3 * sizeof(float));
    for (size_t b = 0; b < count && !status; b++) {
        const float *middle = cloud->vert_pos + 3 * b * step;
        put_ball(balls, b, middle, cloud->vert_normals ? cloud->vert_normals + 3 * b * step : NULL,
                 (float)radius);
        for (size_t c = 0; c < 6; c++)
            memcpy(scene->colours + 3 * (6 * b + c), point_colours + 3 * b * step, 3 * sizeof(float));
    }
    npg_release(&point_colours);
    scene->shown = count;
    scene->total = total;
    scene->mesh = balls;
    scene->is_cloud = true;
    return status;
}

/* ---- scenes ---- */

static void close_scene(picture_scene *scene)
{
    npg_mesh_unref(&scene->mesh);
    npg_release(&scene->colours);
    *scene = (picture_scene){0};
}

/* Read a file to draw it.  ball_radius: of a cloud's points, in the file's unit.  first: the mesh whose
 * positions give the identity colours (NULL: this one's own); used when the vertex counts are equal. */
static npg_status open_scene(picture_scene *scene, const char *path, npg_origin *origin, double ball_radius,
                             npg_picture_colour colour, const npg_mesh *first)
{
    npg_mesh *mesh = NULL;
    *scene = (picture_scene){0};
    NPG_TRY(read_any(&mesh, path, origin));
    bool faces = mesh->face_count;
    npg_status status = NPG_OK;
    if (!mesh->vert_count) status = npg_error(NPG_BAD_INPUT, "%s: nothing to draw", path);
    if (!status && faces && !mesh->vert_normals)
        status = npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float));
    if (!status && faces)
        npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, mesh->vert_count, mesh->faces,
                                mesh->face_count);
    if (!status) status = open_colours(scene, mesh, colour, first);
    if (!status && faces)
        scene->mesh = npg_mesh_ref(mesh);
    else if (!status)
        status = make_balls(scene, mesh, ball_radius);
    npg_mesh_unref(&mesh);
    if (status) close_scene(scene);
    return status;
}

/* ---- camera ---- */

static void turn_eye(camera *eye, const npg_picture_settings *s)
{
    double a = s->azimuth * RADIANS,
           e = fmin(fmax(s->elevation, -89.9), 89.9) * RADIANS; /* at 90 nothing is right of the eye */
    double back[3] = {sin(a) * cos(e), sin(e), cos(a) * cos(e)}, world_up[3] = {0, 1, 0};
    double *right = eye->axes, *above = eye->axes + 3, *ahead = eye->axes + 6;
    double down = s->up == NPG_UP_MINUS_Y || s->up == NPG_UP_MINUS_Z ? -1 : 1; /* turned over about x */
    for (int k = 1; k < 3; k++) {
        back[k] *= down;
        world_up[k] *= down;
    }
    if (s->up == NPG_UP_Z || s->up == NPG_UP_MINUS_Z) {
        const double z_up[3] = {back[0], -back[2], back[1]};
        memcpy(back, z_up, sizeof back);
        world_up[2] = world_up[1];
        world_up[1] = 0;
    }
    for (int k = 0; k < 3; k++) ahead[k] = -back[k];
    npg_vec3_cross(right, ahead, world_up);
    npg_vec3_make_unit(right);
    npg_vec3_cross(above, right, ahead);
}

/* Place a turned eye so that all of `reach` is in the picture; *aspect is width / height of what it sees (in:
 * 0 to choose it). */
static void fit_eye(camera *eye, double *aspect, const npg_bounds *reach)
{
    /* 5 % are left around; the eye is 3 diagonals away, for little perspective. */
    const double margin = 1.05, distances = 3.0;
    double diagonal = fmax(npg_bounds_diagonal(reach), 1e-12), half[3], middle[3];
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5 * (reach->hi[k] - reach->lo[k]);
        middle[k] = 0.5 * (reach->hi[k] + reach->lo[k]);
    }
    middle[2] -= distances * diagonal;
    for (int k = 0; k < 3; k++)
        eye->position[k] =
            middle[0] * eye->axes[k] + middle[1] * eye->axes[3 + k] + middle[2] * eye->axes[6 + k];
    double nearest = distances * diagonal - half[2];
    double slope_x = margin * fmax(half[0], 0.01 * diagonal) / nearest;
    double slope_y = margin * fmax(half[1], 0.01 * diagonal) / nearest;
    if (!(*aspect > 0)) *aspect = fmin(fmax(slope_x / slope_y, 0.25), 4); /* no strips */
    eye->slope_y = fmax(slope_y, slope_x / *aspect);
    eye->slope_x = eye->slope_y * *aspect;
}

/* ---- rays and shading ---- */

static void aim(npg_ray *ray, const camera *eye, double x, double y)
{
    for (int k = 0; k < 3; k++) {
        ray->origin[k] = (float)eye->position[k];
        ray->direction[k] =
            (float)(eye->axes[6 + k] + x * eye->slope_x * eye->axes[k] - y * eye->slope_y * eye->axes[3 + k]);
    }
    ray->t_min = 0;
    ray->t_max = INFINITY;
}

static void shading_normal(double normal[3], const picture_scene *scene, const npg_ray_hit *hit)
{
    const npg_mesh *mesh = scene->mesh;
    const uint32_t *face = mesh->faces + 3 * (size_t)hit->face;
    for (int k = 0; k < 3; k++) {
        normal[k] = 0;
        for (int c = 0; c < 3; c++)
            normal[k] +=
                (double)hit->weights[c] * (double)mesh->vert_normals[3 * (size_t)face[c] + (size_t)k];
    }
    double length = sqrt(npg_vec3_dot(normal, normal));
    for (int k = 0; k < 3 && length > 0; k++) normal[k] /= length;
}

/* A light from the upper left behind the eye and a weaker one from the eye;
 * insides of surfaces are reddish.  Directions and weights were set by eye. */
static void shade(float out[3], const picture_scene *scene, const camera *eye, const npg_ray_hit *hit)
{
    static const float inside[3] = {0.75f, 0.35f, 0.30f};
    double normal[3], light[3];
    bool is_back = hit->is_back && !scene->is_cloud;
    shading_normal(normal, scene, hit);
    if (npg_vec3_dot(normal, eye->axes + 6) > 0)
        for (int k = 0; k < 3; k++) normal[k] = -normal[k];
    for (int k = 0; k < 3; k++)
        light[k] = -0.55 * eye->axes[k] + 0.65 * eye->axes[3 + k] - 0.55 * eye->axes[6 + k];
    double key = fmax(npg_vec3_dot(normal, light) / sqrt(npg_vec3_dot(light, light)), 0),
           head = fabs(npg_vec3_dot(normal, eye->axes + 6));
    double amount = 0.16 + 0.62 * key + 0.26 * head;
    const uint32_t *face = scene->mesh->faces + 3 * (size_t)hit->face;
    for (size_t k = 0; k < 3; k++) {
        double colour = 0;
        for (size_t c = 0; c < 3; c++)
            colour += (double)hit->weights[c] * (double)scene->colours[3 * (size_t)face[c] + k];
        if (is_back) colour = (double)inside[k];
        out[k] = (float)fmin(colour * amount, 1);
    }
}

static npg_status draw_row(drawing *d, uint8_t *pixels, const picture_scene *scene,
                           const npg_surface *surface, int64_t row)
{
    const int64_t width = d->tile_width, height = d->s->height, samples = d->s->samples;
    for (int64_t i = 0; i < width * samples * samples; i++) {
        int64_t sub = i % (samples * samples), column = i / (samples * samples);
        double x = ((double)column + ((double)(sub % samples) + 0.5) / (double)samples) / (double)width;
        double y = ((double)row + ((double)(sub / samples) + 0.5) / (double)samples) / (double)height;
        aim(&d->rays[i], &d->eye, 2 * x - 1, 2 * y - 1);
    }
    NPG_TRY(npg_surface_rays(surface, d->hits, d->rays, (size_t)(width * samples * samples), 0));
    for (int64_t column = 0; column < width; column++) {
        float sum[3] = {0};
        for (int64_t sub = 0; sub < samples * samples; sub++) {
            const npg_ray_hit *hit = &d->hits[column * samples * samples + sub];
            float colour[3] = {background[0], background[1], background[2]};
            if (hit->face != UINT32_MAX) shade(colour, scene, &d->eye, hit);
            for (int k = 0; k < 3; k++) sum[k] += colour[k];
        }
        for (int k = 0; k < 3; k++)
            pixels[3 * column + k] = (uint8_t)lrintf(255 * sum[k] / (float)(samples * samples));
    }
    return NPG_OK;
}

/* The tile whose corner is at (left, top). */
static npg_status draw_scene(drawing *d, const picture_scene *scene, int64_t left, int64_t top)
{
    npg_surface *surface = NULL;
    const npg_mesh *mesh = scene->mesh;
    npg_status status =
        npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    for (int64_t row = 0; row < d->s->height && !status; row++)
        status = draw_row(d, d->pixels + 3 * ((top + row) * d->picture->width + left), scene, surface, row);
    npg_surface_close(&surface);
    return status;
}

static npg_status draw_tile(drawing *d, size_t i)
{
    picture_scene scene;
    npg_picture *p = d->picture;
    int64_t column = (int64_t)i % d->columns, row = (int64_t)i / d->columns;
    double radius = d->s->point_size * npg_bounds_diagonal(&d->reach);
    NPG_TRY(open_scene(&scene, d->files[i], &d->origin, radius, d->s->colour, d->first));
    if (!d->first && !scene.is_cloud) d->first = npg_mesh_ref(scene.mesh);
    if (scene.total > p->points_total) {
        p->points_total = scene.total;
        p->points_drawn = scene.shown;
    }
    npg_status status = draw_scene(d, &scene, column * d->tile_width, row * d->s->height);
    close_scene(&scene);
    return npg_error_prefix(status, "%s", d->files[i]);
}

/* ---- the picture ---- */

static npg_status lay_out(drawing *d, int64_t count)
{
    const npg_picture_settings *s = d->s;
    npg_picture *p = d->picture;
    double aspect = s->width ? (double)s->width / (double)s->height : 0;
    fit_eye(&d->eye, &aspect, &d->reach);
    d->tile_width = s->width ? s->width : (int64_t)lrint((double)s->height * aspect);
    d->columns = s->columns < count ? s->columns : count;
    p->width = d->columns * d->tile_width;
    p->height = (count + d->columns - 1) / d->columns * s->height;
    if (p->width * p->height > PIXELS_MAX)
        return npg_error(NPG_USAGE,
                         "the picture would have %lld x %lld pixels; choose a smaller --height or --count",
                         (long long)p->width, (long long)p->height);
    size_t rays = (size_t)(d->tile_width * s->samples * s->samples);
    d->pixels = npg_arena_take(&d->arena, (size_t)p->width, (size_t)p->height * 3);
    d->rays = npg_arena_take(&d->arena, rays, sizeof *d->rays);
    d->hits = npg_arena_take(&d->arena, rays, sizeof *d->hits);
    NPG_TRY(npg_arena_status(&d->arena));
    for (int64_t i = 0; i < 3 * p->width * p->height; i++)
        d->pixels[i] = (uint8_t)lrintf(255 * background[i % 3]);
    return NPG_OK;
}

static npg_status write_png(const drawing *d, const char *path)
{
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)d->picture->width,
                     .height = (png_uint_32)d->picture->height,
                     .format = PNG_FORMAT_RGB};
    png_alloc_size_t size = 0;
    npg_file *file;
    void *bytes;
    if (!png_image_write_to_memory(&png, NULL, &size, 0, d->pixels, 0, NULL))
        return npg_error(NPG_FAILED, "%s: libpng: %s", path, png.message);
    NPG_TRY(npg_alloc(&bytes, NPG_FOR_FILES, size));
    npg_status status = NPG_OK;
    if (!png_image_write_to_memory(&png, bytes, &size, 0, d->pixels, 0, NULL))
        status = npg_error(NPG_FAILED, "%s: libpng: %s", path, png.message);
    if (!status) status = npg_file_open(&file, path);
    if (!status) {
        npg_file_write(file, bytes, size);
        status = npg_file_commit(&file);
    }
    npg_release(&bytes);
    return status;
}

static npg_status draw(drawing *d, const char *path, size_t count)
{
    turn_eye(&d->eye, d->s);
    for (size_t i = 0; i < count; i++) NPG_TRY(measure_file(&d->reach, d->files[i], &d->origin, d->eye.axes));
    if (!(d->reach.lo[0] <= d->reach.hi[0]))
        return npg_error(NPG_BAD_INPUT, "%s: nothing to draw", d->files[0]);
    NPG_TRY(lay_out(d, (int64_t)count));
    for (size_t i = 0; i < count; i++) NPG_TRY(draw_tile(d, i));
    return write_png(d, path);
}

npg_status npg_picture_write(npg_picture *picture, const char *path, const char *const *files, size_t count,
                             const npg_picture_settings *settings)
{
    npg_picture_settings own;
    npg_picture made = {.struct_size = sizeof made};
    drawing d = {.s = &own,
                 .picture = &made,
                 .files = files,
                 .reach = npg_bounds_empty(),
                 .arena = {.purpose = NPG_FOR_FILES}};
    NPG_TRY(npg_struct_take(&own, sizeof own, settings, NPG_SIZE_UP_TO(npg_picture_settings, point_size),
                            "the settings"));
    NPG_REQUIRE(picture && path && files && count && own.height > 0);
    if (own.columns < 1) own.columns = 8;
    if (own.samples < 1) own.samples = 2;
    npg_status status = draw(&d, path, count);
    npg_mesh_unref(&d.first);
    npg_arena_release(&d.arena);
    NPG_TRY(status);
    return npg_struct_give(picture, &made, sizeof made, NPG_SIZE_UP_TO(npg_picture, points_drawn),
                           "the picture");
}
