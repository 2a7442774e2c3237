/* Pictures: cameras that fit a box, tiles traced by rays, PNG files. */
#include "tools/render/render_image.h"

#include <math.h>
#include <png.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/file.h"

#define RADIANS (3.14159265358979323846 / 180)

static const float background[3] = {0.97f, 0.97f, 0.98f};

/* ---- camera ---- */

void npg_eye_turn(npg_eye *eye, double azimuth, double elevation, int up)
{
    double a = azimuth * RADIANS,
           e = fmin(fmax(elevation, -89.9), 89.9) * RADIANS; /* at 90 nothing is right of the eye */
    double back[3] = {sin(a) * cos(e), sin(e), cos(a) * cos(e)}, world_up[3] = {0, 1, 0};
    double *right = eye->axes, *above = eye->axes + 3, *ahead = eye->axes + 6;
    if (up == 2) {
        double z_up[3] = {back[0], -back[2], back[1]};
        memcpy(back, z_up, sizeof back);
        world_up[1] = 0;
        world_up[2] = 1;
    }
    for (int k = 0; k < 3; k++) ahead[k] = -back[k];
    npg_vec3_cross(right, ahead, world_up);
    npg_vec3_make_unit(right);
    npg_vec3_cross(above, right, ahead);
}

void npg_eye_fit(npg_eye *eye, double *aspect, const npg_bounds *reach)
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

static void aim(npg_ray *ray, const npg_eye *eye, double x, double y)
{
    for (int k = 0; k < 3; k++) {
        ray->origin[k] = (float)eye->position[k];
        ray->direction[k] =
            (float)(eye->axes[6 + k] + x * eye->slope_x * eye->axes[k] - y * eye->slope_y * eye->axes[3 + k]);
    }
    ray->t_min = 0;
    ray->t_max = INFINITY;
}

static void shading_normal(double normal[3], const npg_scene *scene, const npg_ray_hit *hit)
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
static void shade(float out[3], const npg_scene *scene, const npg_eye *eye, const npg_ray_hit *hit)
{
    static const float inside[3] = {0.75f, 0.35f, 0.30f};
    double normal[3], light[3];
    bool is_back = hit->is_back && !scene->ball_middle;
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

typedef struct band { /* the rays of one row of pixels */
    npg_ray *rays;
    npg_ray_hit *hits;
    size_t count;
} band;

static npg_status draw_row(uint8_t *pixels, const npg_scene *scene, const npg_surface *surface,
                           const npg_eye *eye, band *b, int64_t row, int64_t width, int64_t height,
                           int64_t samples)
{
    for (int64_t i = 0; i < width * samples * samples; i++) {
        int64_t sub = i % (samples * samples), column = i / (samples * samples);
        double x = ((double)column + ((double)(sub % samples) + 0.5) / (double)samples) / (double)width;
        double y = ((double)row + ((double)(sub / samples) + 0.5) / (double)samples) / (double)height;
        aim(&b->rays[i], eye, 2 * x - 1, 2 * y - 1);
    }
    NPG_TRY(npg_surface_rays(surface, b->hits, b->rays, b->count, 0));
    for (int64_t column = 0; column < width; column++) {
        float sum[3] = {0};
        for (int64_t sub = 0; sub < samples * samples; sub++) {
            const npg_ray_hit *hit = &b->hits[column * samples * samples + sub];
            float colour[3] = {background[0], background[1], background[2]};
            if (hit->face != UINT32_MAX) shade(colour, scene, eye, hit);
            for (int k = 0; k < 3; k++) sum[k] += colour[k];
        }
        for (int k = 0; k < 3; k++)
            pixels[3 * column + k] = (uint8_t)lrintf(255 * sum[k] / (float)(samples * samples));
    }
    return NPG_OK;
}

npg_status npg_image_draw(npg_image *image, const npg_scene *scene, const npg_eye *eye, int64_t left,
                          int64_t top, int64_t width, int64_t height, int64_t samples)
{
    npg_surface *surface = NULL;
    band b = {.count = (size_t)(width * samples * samples)};
    const npg_mesh *mesh = scene->mesh;
    NPG_REQUIRE(left >= 0 && top >= 0 && left + width <= image->width && top + height <= image->height);
    npg_status status =
        npg_surface_open(&surface, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    if (!status) status = npg_alloc_array(&b.rays, NPG_FOR_QUERY, b.count, sizeof *b.rays);
    if (!status) status = npg_alloc_array(&b.hits, NPG_FOR_QUERY, b.count, sizeof *b.hits);
    for (int64_t row = 0; row < height && !status; row++)
        status = draw_row(image->pixels + 3 * ((top + row) * image->width + left), scene, surface, eye, &b,
                          row, width, height, samples);
    npg_release(&b.rays);
    npg_release(&b.hits);
    npg_surface_close(&surface);
    return status;
}

/* ---- files ---- */

npg_status npg_image_open(npg_image *image, int64_t width, int64_t height)
{
    *image = (npg_image){width, height, NULL};
    NPG_TRY(npg_alloc_array(&image->pixels, NPG_FOR_FILES, (size_t)width, (size_t)height * 3));
    for (int64_t i = 0; i < 3 * width * height; i++)
        image->pixels[i] = (uint8_t)lrintf(255 * background[i % 3]);
    return NPG_OK;
}

void npg_image_close(npg_image *image)
{
    npg_release(&image->pixels);
}

npg_status npg_image_encode(const npg_image *image, void *out, size_t *size)
{
    void **bytes = out;
    png_image png = {.version = PNG_IMAGE_VERSION,
                     .width = (png_uint_32)image->width,
                     .height = (png_uint_32)image->height,
                     .format = PNG_FORMAT_RGB};
    png_alloc_size_t room = 0;
    *bytes = NULL;
    if (!png_image_write_to_memory(&png, NULL, &room, 0, image->pixels, 0, NULL))
        return npg_error(NPG_FAILED, "libpng: %s", png.message);
    NPG_TRY(npg_alloc(bytes, NPG_FOR_FILES, room));
    npg_status status = NPG_OK;
    if (!png_image_write_to_memory(&png, *bytes, &room, 0, image->pixels, 0, NULL))
        status = npg_error(NPG_FAILED, "libpng: %s", png.message);
    if (status) npg_release(bytes);
    *size = room;
    return status;
}

npg_status npg_image_write(const npg_image *image, const char *path)
{
    size_t size = 0;
    void *bytes;
    npg_file *file;
    npg_status status = npg_error_prefix(npg_image_encode(image, &bytes, &size), "%s", path);
    if (!status) status = npg_file_open(&file, path);
    if (!status) {
        npg_file_write(file, bytes, size);
        status = npg_file_commit(&file);
    }
    npg_release(&bytes);
    return status;
}
