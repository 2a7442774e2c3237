/* PCD through PCL.  The caller has checked the header (read_pcd.c): PCL trusts it. */
#ifndef NPG_PCD_H
#define NPG_PCD_H

#include <stdbool.h>
#include <stdint.h>

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Where the points go: begin once, then add per point with 3 world coordinates, 3 of a normal (0 without
 * has_normals) and a colour (without has_colours it means nothing). */
typedef struct npg_pcd_sink {
    void *user;
    npg_status (*begin)(void *user, size_t point_count, bool has_normals, bool has_colours);
    void (*add)(void *user, const double world[3], const double normal[3], const uint8_t rgba[4]);
} npg_pcd_sink;

/* NPG_BAD_INPUT with the path when PCL refuses the file or it has not expected_count points with x, y, z. */
npg_status npg_pcd_load(const char *path, size_t expected_count, const npg_pcd_sink *sink);

#ifdef __cplusplus
}
#endif
#endif
