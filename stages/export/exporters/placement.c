/* Placement: from the capture's coordinates to those of the written files. */
#include "export/files.h"

#include <math.h>
#include <string.h>

npg_status npg_placement_parse(npg_placement *map, const char *axes)
{
    const char *c = axes;
    bool is_used[3] = {false, false, false};
    *map = (npg_placement){.scale = 1};
    for (int a = 0; a < 3; a++) {
        map->sign[a] = *c == '-' ? -1 : 1;
        if (*c == '-' || *c == '+') c++;
        if (*c < 'x' || *c > 'z' || is_used[*c - 'x'])
            return npg_error(
                NPG_USAGE, "option axes: \"%s\" does not name x, y and z once each, as xyz or xz-y do", axes);
        is_used[*c - 'x'] = true;
        map->from[a] = *c++ - 'x';
    }
    if (*c) return npg_error(NPG_USAGE, "option axes: \"%s\" goes on after the third axis", axes);
    /* A cyclic order of the axes keeps the handedness, a swap of two changes it, and so does each sign. */
    bool is_cyclic = map->from[1] == (map->from[0] + 1) % 3;
    map->is_mirror = is_cyclic != (map->sign[0] * map->sign[1] * map->sign[2] > 0);
    return NPG_OK;
}

void npg_place_point(const npg_placement *map, double out[3], const double world[3])
{
    double from_centre[3];
    for (int a = 0; a < 3; a++) from_centre[a] = world[a] - map->centre[a];
    for (int a = 0; a < 3; a++) out[a] = map->scale * map->sign[a] * from_centre[map->from[a]];
}

void npg_place_points(const npg_placement *map, double *out, const npg_frame_box *box, const float *unit,
                      size_t count)
{
    npg_box_unit_to_world(box, out, unit, count);
    for (size_t i = 0; i < count; i++) npg_place_point(map, out + 3 * i, out + 3 * i);
}

void npg_place_normals(const npg_placement *map, float *out, const float *normals, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        const float n[3] = {normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]};
        for (size_t a = 0; a < 3; a++) out[3 * i + a] = map->sign[a] < 0 ? -n[map->from[a]] : n[map->from[a]];
    }
}

void npg_place_faces(const npg_placement *map, uint32_t *out, const uint32_t *faces, size_t face_count)
{
    for (size_t f = 0; f < face_count; f++)
        for (size_t k = 0; k < 3; k++) out[3 * f + k] = faces[3 * f + (map->is_mirror ? 2 - k : k)];
}

void npg_place_corners(const npg_placement *map, float *out, const float *corners, size_t face_count)
{
    for (size_t f = 0; f < face_count; f++)
        for (size_t k = 0; k < 3; k++)
            memcpy(out + 6 * f + 2 * k, corners + 6 * f + 2 * (map->is_mirror ? 2 - k : k), 2 * sizeof *out);
}

double npg_place_largest(const npg_placement *map, const npg_frame_box *box)
{
    double largest = 0;
    for (int a = 0; a < 3; a++)
        largest = fmax(largest, fabs(box->origin[a] + box->centre[a] - map->centre[a]));
    return map->scale * (largest + NPG_UNIT_EXTENT / box->scale);
}
