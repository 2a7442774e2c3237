/* Visible: rays from the surface to the sensors. */
#include "track/track.h"

#include <math.h>
#include <string.h>

#include "pipeline/memory.h"

#define GRAZING 0.1 /* cosine below which a sensor sees a place too much from the side to have points of it */

void npg_visible_open(npg_visible *visible, npg_arena *arena, size_t place_count)
{
    visible->rays = npg_arena_take(arena, place_count, sizeof *visible->rays);
    visible->hits = npg_arena_take(arena, place_count, sizeof *visible->hits);
}

bool npg_faces_sensor(const float *sensors, size_t sensor_count, const float place[3], const double normal[3],
                      double least)
{
    for (size_t k = 0; k < sensor_count; k++) {
        double along = 0, size_sq = 0;
        for (size_t c = 0; c < 3; c++) {
            double way = (double)sensors[3 * k + c] - (double)place[c];
            along += way * normal[c];
            size_sq += way * way;
        }
        if (along > least * sqrt(size_sq)) return true; /* false for a sensor that is not finite */
    }
    return false;
}

/* From a little above the surface to the sensor; of no length where the place does not face it. */
static void aim(npg_ray *ray, const float sensor[3], const float place[3], const float normal[3],
                double offset)
{
    const double n[3] = {(double)normal[0], (double)normal[1], (double)normal[2]};
    *ray = (npg_ray){.t_max = npg_faces_sensor(sensor, 1, place, n, GRAZING) ? 1 : -1};
    for (int c = 0; c < 3; c++) {
        ray->origin[c] = place[c] + (float)offset * normal[c];
        ray->direction[c] = sensor[c] - ray->origin[c];
    }
}

npg_status npg_visible_find(npg_visible *visible, uint8_t *is_seen, const npg_surface *surface,
                            const float *sensors, size_t sensor_count, const float *places,
                            const uint32_t *verts, const float *vert_normals, size_t count, double offset)
{
    memset(is_seen, !sensor_count, count);
    for (size_t k = 0; k < sensor_count; k++) {
        const float *sensor = sensors + 3 * k;
        if (!isfinite(sensor[0] + sensor[1] + sensor[2])) continue;
        for (size_t i = 0; i < count; i++)
            aim(&visible->rays[i], sensor, places + 3 * i, vert_normals + 3 * (verts ? verts[i] : i), offset);
        NPG_TRY(npg_surface_rays(surface, visible->hits, visible->rays, count, 0));
        for (size_t i = 0; i < count; i++)
            is_seen[i] |= visible->rays[i].t_max > 0 && visible->hits[i].face == UINT32_MAX;
    }
    return NPG_OK;
}
