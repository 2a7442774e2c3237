/* Depth points: from a depth image to points with normals and colours, in the sensor's own axes.
 *
 * A pixel is used when its depth is in range, the mask shows it, and no neighbour within the margin is
 * missing or a depth step away: there a sensor mixes the body with what is behind it (flying pixels,
 * silhouette fringe).  Of the margin, pixels beside used ones are used, too, where they continue the surface:
 * their depth is what the plane through the used ones around them says.  A mixed pixel lies somewhere between
 * the body and what is behind it, and does not.
 *
 * Normals.  On a plane n X = h the inverse depth is linear in the ray (x, y) of a pixel:
 * 1 / Z = (n_x x + n_y y + n_z) / h.  So n is had from a least-squares fit of 1 / Z over a window of the
 * image, of those pixels that lie on the same surface; it faces the sensor by construction.
 *
 * Steps.  Depths come in steps, of one disparity far off: within half of one the plane of the same window says
 * where a pixel lies.
 *
 * View.  How far ahead nothing is: the least depth of the pixels in each cell of a coarser grid, those at edges
 * among them, as they are measured; where the background was removed, a cell of pixels without depth is
 * empty as far as the sensor sees.
 *
 * Based on: Badino, Huber, Park, Kanade, Fast and accurate computation of surface normals from range images,
 * 2011 (the fit in inverse depth). */
#include <math.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"

#define WINDOW    3 /* pixels to each side: 7 x 7; less is noisier, more rounds off fingers (set by trial) */
#define FIT_MIN   8 /* pixels of a window that a plane needs                                               */
#define MASK_ON   128
#define LEVELS    65536
#define INNER     1    /* of keep: a pixel outside of the margin; planes are fitted to these         */
#define EDGE      2    /* of keep: in the margin, but it continues the surface                       */
#define BESIDE    2    /* inner pixels beside one of the margin, of eight, that make it a candidate  */
#define MOST_OF   0.5  /* of the pixels without depth: nobody's scene but one whose background was removed */
#define GRAZING   0.25 /* cosine below which a surface is no surface that a sensor measures              */
#define CONTINUES 0.25 /* of a depth step: how far from the plane it may lie                         */

typedef struct grid {
    const npg_rig *rig;
    const npg_rig_sensor *sensor;
    npg_image depth, mask, colour;
    size_t width, height;
    npg_arena arena;         /* of what follows */
    float *z;                /* H x W: depth, 0 where the pixel can't be used */
    uint8_t *keep;           /* H x W: INNER or EDGE where the pixel is used  */
    uint16_t *below, *above; /* LEVELS: the next depth, in steps, that the image has; itself at its ends */
} grid;

/* ---- images ---- */

static npg_status read_images(grid *g, const npg_rig_shot *shot)
{
    const npg_camera *camera = &g->sensor->camera;
    const npg_camera *of_colour = g->sensor->has_colour_camera ? &g->sensor->colour_camera : camera;
    g->width = camera->width;
    g->height = camera->height;
    NPG_TRY(npg_image_read(&g->depth, shot->depth, NPG_IMAGE_DEPTH, g->width, g->height));
    if (shot->mask) NPG_TRY(npg_image_read(&g->mask, shot->mask, NPG_IMAGE_MASK, g->width, g->height));
    if (shot->colour)
        NPG_TRY(
            npg_image_read(&g->colour, shot->colour, NPG_IMAGE_COLOUR, of_colour->width, of_colour->height));
    return NPG_OK;
}

/* All pixels 0 or all 65535: it says nothing about depth. */
static bool is_blank(const npg_image *depth)
{
    uint16_t first = depth->depth[0];
    if (first && first != UINT16_MAX) return false;
    for (size_t i = 1; i < depth->width * depth->height; i++)
        if (depth->depth[i] != first) return false;
    return true;
}

static void fill_depths(grid *g)
{
    const npg_rig_settings *set = &g->rig->settings;
    double near_m = fmax(g->sensor->near_m, set->near_m), far_m = g->sensor->far_m;
    if (set->far_m > 0 && (far_m <= 0 || set->far_m < far_m)) far_m = set->far_m;
    for (size_t i = 0; i < g->width * g->height; i++) {
        double z = g->depth.depth[i] * g->sensor->scale;
        bool is_in = z > 0 && z >= near_m && (far_m <= 0 || z <= far_m) && !isnan(g->sensor->rays[2 * i]);
        if (g->mask.bytes) is_in = is_in && g->mask.bytes[i] >= MASK_ON;
        g->z[i] = is_in ? (float)z : 0;
    }
}

/* Whether two depths, both there, may be of one surface. */
static bool is_same_surface(float a, float b, float step_share)
{
    return fabsf(a - b) <= step_share * (a < b ? a : b);
}

/* Pixels with all neighbours of the 3 x 3 there and on the same surface. */
static void find_inner(const grid *g, uint8_t *inner)
{
    float step = (float)g->rig->settings.step_share;
    size_t w = g->width;
    memset(inner, 0, w * g->height);
    for (size_t y = 1; y + 1 < g->height; y++)
        for (size_t x = 1; x + 1 < w; x++) {
            const float *at = g->z + y * w + x;
            bool is_inner = *at > 0;
            for (int dy = -1; dy <= 1 && is_inner; dy++)
                for (int dx = -1; dx <= 1 && is_inner; dx++) {
                    float other = at[dy * (ptrdiff_t)w + dx];
                    is_inner = other > 0 && is_same_surface(*at, other, step);
                }
            inner[y * w + x] = is_inner;
        }
}

/* Take off one more ring of pixels beside those that are not kept. */
static void erode(uint8_t *keep, const uint8_t *before, size_t w, size_t h)
{
    memset(keep, 0, w * h);
    for (size_t y = 1; y + 1 < h; y++)
        for (size_t x = 1; x + 1 < w; x++) {
            const uint8_t *at = before + y * w + x;
            keep[y * w + x] = at[0] & at[-1] & at[1] & *(at - w) & at[w];
        }
}

static npg_status mark_inner(grid *g)
{
    size_t pixels = g->width * g->height;
    uint8_t *other;
    if (!g->rig->settings.margin) {
        for (size_t i = 0; i < pixels; i++) g->keep[i] = g->z[i] > 0;
        return NPG_OK;
    }
    find_inner(g, g->keep);
    if (g->rig->settings.margin == 1) return NPG_OK;
    other = npg_arena_take(&g->arena, pixels, 1);
    NPG_TRY(npg_arena_status(&g->arena));
    for (int64_t ring = 1; ring < g->rig->settings.margin; ring++) {
        memcpy(other, g->keep, pixels);
        erode(g->keep, other, g->width, g->height);
    }
    return NPG_OK;
}

/* ---- normals ---- */

/* Sums of a window: of 1, x, y, xx, xy, yy and of d, x d, y d, with d = 1 / Z, all relative to the middle. */
static int sum_window(const grid *g, size_t px, size_t py, double s[9])
{
    size_t w = g->width, at = py * w + px;
    size_t x0 = px > WINDOW ? px - WINDOW : 0, x1 = px + WINDOW < w ? px + WINDOW : w - 1;
    size_t y0 = py > WINDOW ? py - WINDOW : 0, y1 = py + WINDOW < g->height ? py + WINDOW : g->height - 1;
    const float *rays = g->sensor->rays;
    float z = g->z[at], cx = rays[2 * at], cy = rays[2 * at + 1], middle = 1 / z, sums[9] = {0};
    float step = WINDOW * (float)g->rig->settings.step_share; /* a slanted surface over the window */
    int count = 0;
    for (size_t y = y0; y <= y1; y++)
        for (size_t x = x0; x <= x1; x++) {
            size_t i = y * w + x;
            if (g->keep[i] != INNER || !is_same_surface(z, g->z[i], step)) continue;
            float u = rays[2 * i] - cx, v = rays[2 * i + 1] - cy, d = 1 / g->z[i] - middle;
            const float terms[9] = {1, u, v, u * u, u * v, v * v, d, u * d, v * d};
            for (int k = 0; k < 9; k++) sums[k] += terms[k];
            count++;
        }
    for (int k = 0; k < 9; k++) s[k] = (double)sums[k];
    return count;
}

/* The plane d = a u + b v + c through a window, relative to its middle. */
static bool fit_plane(const grid *g, size_t px, size_t py, double abc[3])
{
    double s[9];
    int count = sum_window(g, px, py, s);
    if (count < FIT_MIN) return false;
    double uu = s[3] - s[1] * s[1] / s[0], uv = s[4] - s[1] * s[2] / s[0], vv = s[5] - s[2] * s[2] / s[0];
    double ud = s[7] - s[1] * s[6] / s[0], vd = s[8] - s[2] * s[6] / s[0], det = uu * vv - uv * uv;
    if (!(det > 1e-6 * uu * vv)) return false; /* the pixels lie on a line */
    abc[0] = (vv * ud - uv * vd) / det;
    abc[1] = (uu * vd - uv * ud) / det;
    abc[2] = (s[6] - abc[0] * s[1] - abc[1] * s[2]) / s[0];
    return true;
}

/* Its normal, turned to the sensor. */
static bool fit_normal(const grid *g, size_t at, const double abc[3], float normal[3])
{
    double n = 0;
    /* back from rays and depth relative to the middle's */
    double c = abc[2] + 1 / (double)g->z[at];
    c -= abc[0] * (double)g->sensor->rays[2 * at] + abc[1] * (double)g->sensor->rays[2 * at + 1];
    const double out[3] = {-abc[0], -abc[1], -c};
    for (int k = 0; k < 3; k++) n += out[k] * out[k];
    for (int k = 0; k < 3; k++) normal[k] = (float)(out[k] / sqrt(n));
    return n > 0 && isfinite(n);
}

/* ---- the steps of depth ---- */

/* Sensors that measure disparities know few depths far off: the true one lies between the middles to the next
 * ones that the image has.  What lies farther apart is two surfaces. */
static void find_levels(grid *g)
{
    for (size_t i = 0; i < g->width * g->height; i++) g->above[g->depth.depth[i]] = 1;
    uint16_t last = 0;
    for (size_t d = 1; d < LEVELS; d++) {
        g->below[d] = last ? last : (uint16_t)d;
        if (g->above[d]) last = (uint16_t)d;
    }
    last = 0;
    for (size_t d = LEVELS - 1; d > 0; d--) {
        bool is_there = g->above[d];
        g->above[d] = last ? last : (uint16_t)d;
        if (is_there) last = (uint16_t)d;
    }
}

/* The depth of a pixel on the plane around it, as far as its step leaves that open. */
static float depth_between(const grid *g, size_t at, const double abc[3])
{
    uint16_t step = g->depth.depth[at];
    double z = (double)g->z[at], scale = g->sensor->scale, most = g->rig->settings.step_share * z;
    double below = (step - g->below[step]) * scale, above = (g->above[step] - step) * scale;
    double fitted = 1 / (1 / z + abc[2]);
    if (below <= most && fitted < z) return (float)fmax(fitted, z - below / 2);
    return above <= most && fitted > z ? (float)fmin(fitted, z + above / 2) : g->z[at];
}

/* ---- the margin ---- */

static int inner_beside(const grid *g, size_t x, size_t y)
{
    size_t at = y * g->width + x;
    float step = (float)g->rig->settings.step_share;
    int count = 0;
    for (int dy = -1; dy <= 1; dy++)
        for (int dx = -1; dx <= 1; dx++) {
            size_t other = at + (size_t)(dy * (ptrdiff_t)g->width + dx);
            count += g->keep[other] == INNER && is_same_surface(g->z[at], g->z[other], step);
        }
    return count;
}

/* Pixels of the margin that continue the surface beside them. */
static void add_edges(grid *g)
{
    double most = CONTINUES * g->rig->settings.step_share;
    for (size_t y = 1; y + 1 < g->height; y++)
        for (size_t x = 1; x + 1 < g->width; x++) {
            size_t at = y * g->width + x;
            double abc[3];
            if (g->keep[at] || !(g->z[at] > 0) || inner_beside(g, x, y) < BESIDE) continue;
            /* 1 / Z is off by abc[2], so Z by Z Z abc[2] */
            if (fit_plane(g, x, y, abc) && fabs(abc[2]) * (double)g->z[at] <= most) g->keep[at] = EDGE;
        }
}

/* ---- colours ---- */

/* The colour image between four pixels; false outside. */
static bool sample(const npg_image *image, const double pixel[2], uint8_t rgb[3])
{
    double fx = floor(pixel[0]), fy = floor(pixel[1]);
    if (!(fx >= 0 && fy >= 0 && fx + 1 < (double)image->width && fy + 1 < (double)image->height))
        return false;
    const uint8_t *at = image->bytes + 3 * ((size_t)fy * image->width + (size_t)fx);
    const uint8_t *below = at + 3 * image->width;
    double u = pixel[0] - fx, v = pixel[1] - fy;
    for (int c = 0; c < 3; c++) {
        double top = at[c] * (1 - u) + at[c + 3] * u, bottom = below[c] * (1 - u) + below[c + 3] * u;
        rgb[c] = (uint8_t)(top * (1 - v) + bottom * v + 0.5);
    }
    return true;
}

static void take_colour(const grid *g, size_t at, const float pos[3], uint8_t rgba[4])
{
    double in_colour[3], pixel[2];
    rgba[0] = rgba[1] = rgba[2] = rgba[3] = 0;
    if (!g->colour.bytes) return;
    if (!g->sensor->has_colour_camera) {
        memcpy(rgba, g->colour.bytes + 3 * at, 3);
        rgba[3] = 255;
        return;
    }
    npg_pose_apply(in_colour, g->sensor->depth_to_colour,
                   (const double[3]){(double)pos[0], (double)pos[1], (double)pos[2]});
    if (npg_camera_project(&g->sensor->colour_camera, pixel, in_colour) && sample(&g->colour, pixel, rgba))
        rgba[3] = 255;
}

/* ---- the points ---- */

/* Whether a sensor sees a plane so much from the side that it may as well be a smear between two surfaces. */
static bool is_grazing(const float normal[3], const float ray[2])
{
    double along =
        -((double)normal[0] * (double)ray[0] + (double)normal[1] * (double)ray[1] + (double)normal[2]);
    return along < GRAZING * sqrt(1 + (double)ray[0] * (double)ray[0] + (double)ray[1] * (double)ray[1]);
}

static npg_status reserve(npg_depth_points *points, const grid *g)
{
    size_t kept = 0;
    for (size_t i = 0; i < g->width * g->height; i++) kept += g->keep[i] != 0;
    points->has_colours = g->colour.bytes != NULL;
    points->pos = npg_arena_take(&points->arena, kept, 3 * sizeof(float));
    points->normals = npg_arena_take(&points->arena, kept, 3 * sizeof(float));
    points->pixels = npg_arena_take(&points->arena, kept, sizeof *points->pixels);
    if (points->has_colours) points->colours = npg_arena_take(&points->arena, kept, 4);
    return npg_arena_status(&points->arena);
}

static void add_points(npg_depth_points *points, const grid *g)
{
    const float *rays = g->sensor->rays;
    for (size_t y = 0; y < g->height; y++)
        for (size_t x = 0; x < g->width; x++) {
            size_t at = y * g->width + x, n = points->count;
            float *pos = points->pos + 3 * n;
            double abc[3];
            float *normal = points->normals + 3 * n;
            if (!g->keep[at] || !fit_plane(g, x, y, abc) || !fit_normal(g, at, abc, normal)) continue;
            if (is_grazing(normal, rays + 2 * at)) continue;
            pos[2] = depth_between(g, at, abc);
            pos[0] = rays[2 * at] * pos[2];
            pos[1] = rays[2 * at + 1] * pos[2];
            points->pixels[n] = (uint32_t)at;
            if (points->colours) take_colour(g, at, pos, points->colours + 4 * n);
            points->count++;
        }
}

/* ---- the view ---- */

/* Whether a pixel that shows nothing says that nothing is there. */
static bool is_background_removed(const grid *g)
{
    size_t pixels = g->width * g->height, without = 0;
    int background = g->rig->settings.background;
    if (background != NPG_BACKGROUND_AUTO || g->mask.bytes) return background != NPG_BACKGROUND_UNKNOWN;
    for (size_t i = 0; i < pixels; i++) without += !g->depth.depth[i];
    return (double)without > MOST_OF * (double)pixels;
}

/* A cell takes its least measured depth; without any it is not known as soon as one of its pixels is not. */
static void look_at(float *cell, float depth)
{
    if (isnan(*cell))
        *cell = depth;
    else if (depth > 0 && !isinf(depth))
        *cell = *cell > 0 ? fminf(*cell, depth) : depth;
    else if (isinf(*cell))
        *cell = depth;
}

static float depth_seen(const grid *g, size_t i, bool is_removed)
{
    bool is_hidden = g->mask.bytes && g->mask.bytes[i] < MASK_ON;
    double z = g->depth.depth[i] * g->sensor->scale,
           near_m = fmax(g->sensor->near_m, g->rig->settings.near_m);
    if (is_hidden) return is_removed ? INFINITY : (float)z;
    if (!(z > 0)) return is_removed && !g->mask.bytes ? INFINITY : 0;
    return z < near_m ? 0 : (float)z;
}

static npg_status make_view(npg_depth_points *points, const grid *g)
{
    const npg_camera *c = &g->sensor->camera;
    npg_depth_view *view = &points->view;
    bool is_removed = is_background_removed(g);
    size_t longest = g->width > g->height ? g->width : g->height;
    size_t pixels = (longest + NPG_VIEW_SIDE - 1) / NPG_VIEW_SIDE; /* of a side of a cell, about */
    view->first[0] = -(c->cx + 0.5) / c->fx;
    view->first[1] = -(c->cy + 0.5) / c->fy;
    view->step = (double)pixels / fmin(c->fx, c->fy);
    view->width = (uint32_t)ceil((double)g->width / c->fx / view->step);
    view->height = (uint32_t)ceil((double)g->height / c->fy / view->step);
    size_t count = (size_t)view->width * view->height;
    points->cells = npg_arena_take(&points->arena, count, sizeof *points->cells);
    NPG_TRY(npg_arena_status(&points->arena));
    for (size_t i = 0; i < count; i++) points->cells[i] = NAN;
    for (size_t i = 0; i < g->width * g->height; i++) {
        double x = ((double)g->sensor->rays[2 * i] - view->first[0]) / view->step;
        double y = ((double)g->sensor->rays[2 * i + 1] - view->first[1]) / view->step;
        if (!(x >= 0 && y >= 0 && x < view->width && y < view->height)) continue;
        look_at(&points->cells[(size_t)y * view->width + (size_t)x], depth_seen(g, i, is_removed));
    }
    for (size_t i = 0; i < count; i++)
        if (isnan(points->cells[i])) points->cells[i] = 0;
    return NPG_OK;
}

static npg_status make_rays(npg_rig_sensor *sensor)
{
    const npg_camera *c = &sensor->camera;
    if (sensor->rays) return NPG_OK;
    NPG_TRY(npg_alloc_array(&sensor->rays, NPG_FOR_FILES, c->width * c->height, 2 * sizeof(float)));
    for (size_t i = 0; i < c->width * c->height; i++) {
        const double pixel[2] = {(double)(i % c->width), (double)(i / c->width)};
        double ray[2];
        bool is_good = npg_camera_ray(c, ray, pixel);
        for (size_t a = 0; a < 2; a++) sensor->rays[2 * i + a] = is_good ? (float)ray[a] : NAN;
    }
    return NPG_OK;
}

static npg_status make_points(npg_depth_points *points, grid *g, const npg_rig_shot *shot)
{
    NPG_TRY(read_images(g, shot));
    points->is_blank = is_blank(&g->depth);
    if (points->is_blank && g->depth.depth[0]) return NPG_OK; /* nor that nothing is there */
    size_t pixels = g->width * g->height;
    g->z = npg_arena_take(&g->arena, pixels, sizeof *g->z);
    g->keep = npg_arena_take(&g->arena, pixels, 1);
    g->below = npg_arena_take(&g->arena, LEVELS, sizeof *g->below);
    g->above = npg_arena_take(&g->arena, LEVELS, sizeof *g->above);
    NPG_TRY(npg_arena_status(&g->arena));
    fill_depths(g);
    find_levels(g);
    NPG_TRY(make_view(points, g));
    NPG_TRY(mark_inner(g));
    add_edges(g);
    NPG_TRY(reserve(points, g));
    add_points(points, g);
    return NPG_OK;
}

npg_status npg_depth_points_read(npg_depth_points *points, npg_rig *rig, size_t s, const npg_rig_shot *shot)
{
    grid g = {.arena.purpose = NPG_FOR_FRAMES, .rig = rig, .sensor = &rig->sensors[s]};
    *points = (npg_depth_points){.arena.purpose = NPG_FOR_FRAMES};
    npg_status status = make_rays(&rig->sensors[s]);
    if (!status) status = make_points(points, &g, shot);
    npg_image_clear(&g.depth);
    npg_image_clear(&g.mask);
    npg_image_clear(&g.colour);
    npg_arena_release(&g.arena);
    return status;
}
