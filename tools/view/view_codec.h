/* Codec of the page's numbers: what changes little from frame to frame and from vertex to vertex takes
 * little.
 *
 * A block is numbers (int32), made small by prediction, then packed:
 *
 *   predict  what is left of v[i] after the rounded mean of the values at lower vertices that share a face
 *            with it: floor((2 sum + n) / (2 n)), each as often as faces have it; without any, after v[i - 1]
 *   pack     zigzag (0, -1, 1, -2 ... become 0, 1, 2, 3 ...), four planes of bytes (all lowest bytes first,
 *            then all second ones ...), zlib
 *
 * All of it is integers, so that the page (web/src/codec.js) has the very same numbers back.  On a dancer of
 * 175 frames and 9971 vertices this takes 62 % of what meshoptimizer's vertex codec takes of the same
 * differences, and the browser brings the decoder. */
#ifndef NPG_VIEW_CODEC_H
#define NPG_VIEW_CODEC_H

#include "pipeline/mesh.h"

/* Bytes that grow; begins zeroed. */
typedef struct npg_bytes {
    uint8_t *data; /* owned: npg_release() */
    size_t size, capacity;
} npg_bytes;

npg_status npg_bytes_add(npg_bytes *bytes, const void *data, size_t size);

/* Of each vertex the lower ones that share a face with it: those of v are of[start[v]] up to, and without,
 * of[start[v + 1]]. */
typedef struct npg_view_links {
    size_t vert_count;
    uint32_t *start, *of; /* V + 1; owned */
} npg_view_links;

npg_status npg_view_links_open(npg_view_links *links, const npg_mesh *mesh);
void npg_view_links_close(npg_view_links *links);

/* left[i] for the V values; another array than values. */
void npg_view_predict(const npg_view_links *links, int32_t *left, const int32_t *values);

/* Append packed numbers.  *packed_size, where not NULL, gets the bytes they took.  NPG_MEMORY. */
npg_status npg_view_pack(npg_bytes *out, size_t *packed_size, const int32_t *values, size_t count);

/* The grid that positions are rounded to. */
typedef struct npg_view_grid {
    double origin[3], step;
} npg_view_grid;

#define NPG_VIEW_GRID_MAX (1 << 24) /* numbers on the grid, from 0 */

/* grid = (p - origin) / step, rounded, within 0 .. NPG_VIEW_GRID_MAX.  p: count x 3, finite; out: 3 x count,
 * the x of all points first. */
void npg_view_round(const npg_view_grid *grid, int32_t *out, const float *points, size_t count);

#endif
