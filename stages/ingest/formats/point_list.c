/* Point list: what a reader collects a cloud in. */
#include "ingest/ingest_internal.h"

#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "pipeline/order.h"

/* A number beyond this is damage, not a place: as origin it would swallow every other point. */
#define ORIGIN_MAX 1e15
#define SAMPLES    1001 /* of a cloud, for its median                                                     */
#define AWAY_MAX   16   /* spreads between origin and median: float, of 24 bits, keeps 1e-6 of the spread */

npg_status npg_points_reserve(npg_point_list *list, size_t more)
{
    npg_frame *frame = list->frame;
    if (more > SIZE_MAX / 64 - frame->point_count)
        return npg_error(NPG_MEMORY, "%zu more points can't be addressed", more);
    size_t need = frame->point_count + more, row = 3 * sizeof(float);
    if (need > list->pos_capacity)
        NPG_TRY(npg_grow(&frame->pos_local, &list->pos_capacity, need, row, NPG_FOR_FRAMES));
    if (list->has_normals && need > list->normal_capacity)
        NPG_TRY(npg_grow(&frame->normals, &list->normal_capacity, need, row, NPG_FOR_FRAMES));
    if (list->has_colours && need > list->colour_capacity)
        NPG_TRY(npg_grow(&frame->colours, &list->colour_capacity, need, 4, NPG_FOR_FRAMES));
    return NPG_OK;
}

void npg_local_of(float local[3], npg_origin *origin, const double world[3])
{
    if (!origin->known && fabs(world[0]) < ORIGIN_MAX && fabs(world[1]) < ORIGIN_MAX &&
        fabs(world[2]) < ORIGIN_MAX)
        npg_origin_offer(origin, world);
    for (int a = 0; a < 3; a++) local[a] = (float)(world[a] - (origin->known ? origin->world[a] : 0));
}

bool npg_origin_improve(npg_origin *origin, const float *pos_local, size_t point_count)
{
    double values[SAMPLES], median[3] = {0}, spread = 0, away = 0;
    size_t step = point_count / SAMPLES + 1; /* at most SAMPLES points, evenly over the file */
    for (size_t a = 0; a < 3; a++) {
        size_t count = 0;
        for (size_t i = 0; i < point_count; i += step)
            if (isfinite(pos_local[3 * i + a])) values[count++] = (double)pos_local[3 * i + a];
        if (count < 8) return false; /* too few for deciles; any origin will do */
        qsort(values, count, sizeof *values, npg_order_double);
        median[a] = values[count / 2];
        spread = fmax(spread, values[count * 9 / 10] - values[count / 10]); /* outliers aside */
        away = fmax(away, fabs(median[a]));
    }
    if (!origin->known || away <= AWAY_MAX * spread) return false;
    for (int a = 0; a < 3; a++) origin->world[a] += median[a];
    return true;
}

void npg_unit_normal(float out[3], const double normal[3])
{
    double length = npg_vec3_length(normal);
    bool usable = length > 1e-12 && isfinite(length); /* shorter ones have no direction */
    for (int a = 0; a < 3; a++) out[a] = usable ? (float)(normal[a] / length) : 0;
}

void npg_points_add(npg_point_list *list, const double world[3], const double normal[3])
{
    npg_frame *frame = list->frame;
    npg_local_of(frame->pos_local + 3 * frame->point_count, list->origin, world);
    if (list->has_normals) npg_unit_normal(frame->normals + 3 * frame->point_count, normal);
    frame->point_count++;
}
