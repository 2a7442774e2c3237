/* Winding: normals of a cloud, all together, from the field of its winding number.
 *
 * Each point is a dipole m_j, a normal times the area it stands for.  The dipoles' winding number
 *
 *     w(p) = 1/4pi sum_j m_j . (p_j - p) / (|p_j - p|^2 + s^2)^(3/2)
 *
 * is 1 inside a closed surface that faces out, 0 outside, and 1/2 on it; its gradient there points in.  Both
 * hold for one set of dipoles: a step towards 1/2 at all points, by the adjoint of the sum and as long as fits
 * best, and the turn of each dipole against the gradient, are repeated while the width s shrinks: what is far
 * settles first.  Nothing is asked of neighbours alone, so neither noise nor a gap leaves a patch that faces in.
 *
 * Based on: S. Lin, Z. Shi, Y. Liu, Fast and Globally Consistent Normal Orientation based on the Winding Number
 * Normal Consistency, 2024. */
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "outlier/normals.h"
#include "outlier/winding_sums.h"

/* By trial (tests/bed/decisions.md, "Normals from nothing"); widths in the cloud's spacing, or its noise. */
#define CORE_MAX    8000 /* points that are dipoles: what all points are read from */
#define STEPS       16
#define WIDTH_FIRST 1.2
#define WIDTH_LAST  0.3
#define WIDTH_NOISE 4.0 /* and no less than this many standard deviations of the noise */

typedef struct field {
    npg_arena arena;
    npg_places places;
    npg_vectors dipoles, step, turned; /* by places */
    float *number, *off;               /* the same: w, and what it lacks to 1/2 */
    double width;
} field;

/* ---- steps ---- */

/* w of these dipoles at all points. */
static npg_status find_number(field *f, const npg_vectors *dipoles)
{
    npg_vectors out = {.x = f->number};
    NPG_TRY(npg_winding_sum(&out, NPG_WINDING_NUMBER, &f->places, &f->places, dipoles, f->width));
    for (size_t i = 0; i < f->places.count; i++) f->number[i] /= 4 * (float)M_PI;
    return NPG_OK;
}

/* Go along f->step as far as brings w nearest to what it lacks. */
static npg_status advance(field *f)
{
    double fits = 0, squares = 0;
    NPG_TRY(find_number(f, &f->step));
    for (size_t i = 0; i < f->places.count; i++) {
        fits += (double)f->off[i] * (double)f->number[i];
        squares += (double)f->number[i] * (double)f->number[i];
    }
    float by = squares > 0 ? (float)(fits / squares) : 0;
    for (size_t i = 0; i < f->places.count; i++) {
        f->dipoles.x[i] += by * f->step.x[i];
        f->dipoles.y[i] += by * f->step.y[i];
        f->dipoles.z[i] += by * f->step.z[i];
    }
    return NPG_OK;
}

static npg_status step_to_half(field *f)
{
    NPG_TRY(find_number(f, &f->dipoles));
    for (size_t i = 0; i < f->places.count; i++) f->off[i] = 0.5f - f->number[i];
    const npg_vectors off = {f->off, f->off, f->off};
    NPG_TRY(npg_winding_sum(&f->step, NPG_WINDING_ADJOINT, &f->places, &f->places, &off, f->width));
    return advance(f);
}

static float length_of(const npg_vectors *v, size_t i)
{
    return sqrtf(v->x[i] * v->x[i] + v->y[i] * v->y[i] + v->z[i] * v->z[i]);
}

/* Each dipole against the gradient, as strong as it is. */
static npg_status turn(field *f)
{
    NPG_TRY(npg_winding_sum(&f->turned, NPG_WINDING_OUTWARD, &f->places, &f->places, &f->dipoles, f->width));
    for (size_t i = 0; i < f->places.count; i++) {
        float length = length_of(&f->turned, i), by = length > 0 ? length_of(&f->dipoles, i) / length : 0;
        f->dipoles.x[i] = by * f->turned.x[i];
        f->dipoles.y[i] = by * f->turned.y[i];
        f->dipoles.z[i] = by * f->turned.z[i];
    }
    return NPG_OK;
}

/* ---- a field ---- */

static npg_status open_field(field *f, const npg_winding_frame *frame, const float *points,
                             const float *given, size_t n)
{
    npg_arena *arena = &f->arena;
    NPG_TRY(npg_places_open(&f->places, arena, points, n, frame));
    npg_vectors_take(&f->dipoles, arena, n);
    npg_vectors_take(&f->step, arena, n);
    npg_vectors_take(&f->turned, arena, n);
    f->number = npg_arena_take(arena, n, sizeof *f->number);
    f->off = npg_arena_take(arena, n, sizeof *f->off);
    NPG_TRY(npg_arena_status(arena));
    if (!given) return NPG_OK;
    f->width = WIDTH_FIRST;
    npg_places_sort(&f->step, &f->places, given);
    for (size_t i = 0; i < n; i++) f->off[i] = 0.5f;
    return advance(f);
}

static npg_status settle(field *f, double noise, int steps)
{
    double last = fmax(WIDTH_LAST, WIDTH_NOISE * noise), first = fmax(WIDTH_FIRST, 2 * last);
    for (int k = 0; k < steps; k++) {
        f->width = first + (last - first) * k / (steps - 1);
        NPG_TRY(step_to_half(f));
        NPG_TRY(turn(f));
    }
    return NPG_OK;
}

/* Where a place has no direction of its own it is left alone. */
static void join(float *normals, const npg_vectors *v, const npg_places *places)
{
    for (size_t i = 0; i < places->count; i++) {
        float length = length_of(v, i), *normal = normals + 3 * (size_t)places->order[i];
        if (!(length > 0)) continue;
        normal[0] = v->x[i] / length;
        normal[1] = v->y[i] / length;
        normal[2] = v->z[i] / length;
    }
}

/* w of dipoles as strong as the area that a point stands for, which tells sheets from what is closed: those that were
 * found make it 1/2 as far as they can. */
static npg_status find_number_of_areas(field *f, const npg_neighbours *near, double unit)
{
    for (size_t i = 0; i < f->places.count; i++) {
        /* as many others share the disc that reaches to the farthest */
        float radius_sq =
            near->dist_sq[NPG_AROUND * ((size_t)f->places.order[i] + 1) - 1] / (float)(unit * unit);
        float area = (float)M_PI * radius_sq / (NPG_AROUND - 1), length = length_of(&f->dipoles, i);
        float by = length > 0 ? area / length : 0;
        f->step.x[i] = by * f->dipoles.x[i];
        f->step.y[i] = by * f->dipoles.y[i];
        f->step.z[i] = by * f->dipoles.z[i];
    }
    return find_number(f, &f->step);
}

/* Sheets that enclose nothing: their bulges on one side (sheets.c). */
static npg_status join_sheets(field *f, const npg_winding_frame *frame, const float *points, size_t n)
{
    npg_neighbours near;
    if (n < NPG_AROUND) return NPG_OK;
    float *normals = npg_arena_copy(&f->arena, NULL, n, 3 * sizeof *normals);
    float *number = npg_arena_take(&f->arena, n, sizeof *number);
    uint8_t *away = npg_arena_take(&f->arena, n, 1);
    NPG_TRY(npg_neighbours_take(&near, &f->arena, points, n, points, n, NPG_AROUND));
    NPG_TRY(find_number_of_areas(f, &near, frame->unit));
    join(normals, &f->dipoles, &f->places);
    for (size_t i = 0; i < n; i++) number[f->places.order[i]] = f->number[i];
    NPG_TRY(npg_sheets_find_away(away, &f->arena, points, normals, number, &near, n));
    for (size_t i = 0; i < n; i++) {
        if (!away[f->places.order[i]]) continue;
        f->dipoles.x[i] = -f->dipoles.x[i];
        f->dipoles.y[i] = -f->dipoles.y[i];
        f->dipoles.z[i] = -f->dipoles.z[i];
    }
    return NPG_OK;
}

/* At all points, of the field of some of them. */
static npg_status read_field(float *normals, field *f, const npg_winding_frame *frame, const float *points,
                             size_t n)
{
    npg_places places;
    npg_vectors out;
    npg_vectors_take(&out, &f->arena, n);
    NPG_TRY(npg_places_open(&places, &f->arena, points, n, frame));
    NPG_TRY(npg_winding_sum(&out, NPG_WINDING_OUTWARD, &places, &f->places, &f->dipoles, f->width));
    join(normals, &out, &places);
    return NPG_OK;
}

static npg_status open_frame(npg_winding_frame *frame, double *noise, const float *points, size_t n)
{
    for (size_t i = 0; i < 3 * n; i++) frame->middle[i % 3] += (double)points[i] / (double)n;
    NPG_TRY(npg_cloud_spacing(&frame->unit, points, n));
    if (!(frame->unit > 0)) frame->unit = 1; /* most points at one place */
    NPG_TRY(npg_cloud_noise(noise, points, NULL, n));
    *noise /= frame->unit;
    return NPG_OK;
}

bool npg_winding_is_whole(size_t n)
{
    return n <= CORE_MAX;
}

size_t npg_winding_memory(size_t n)
{
    return 45 * sizeof(float) * (n < CORE_MAX ? n : CORE_MAX); /* 26 of them for sheets */
}

npg_status npg_winding_normals(float *normals, const float *points, const float *given, size_t n)
{
    field f = {.arena.purpose = NPG_FOR_FRAMES};
    npg_winding_frame frame = {.middle = {0}};
    double noise;
    size_t count = n < CORE_MAX ? n : CORE_MAX;
    float *core = npg_arena_take(&f.arena, count, 3 * sizeof *core);
    float *core_given = given ? npg_arena_take(&f.arena, count, 3 * sizeof *core_given) : NULL;
    npg_status status = npg_arena_status(&f.arena);
    if (!status) npg_points_spread(core, core_given, count, points, given, n);
    if (!status) status = open_frame(&frame, &noise, core, count);
    if (!status) status = open_field(&f, &frame, core, core_given, count);
    if (!status) status = settle(&f, noise, STEPS);
    if (!status && !given) status = join_sheets(&f, &frame, core, count);
    if (!status && count == n) join(normals, &f.dipoles, &f.places);
    if (!status && count < n) status = read_field(normals, &f, &frame, points, n);
    npg_arena_release(&f.arena);
    return status;
}
