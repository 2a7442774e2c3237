/* Colours: many samples of one place to one robust colour, and the colours of a cloud to vertices.
 *
 * All colours are sRGB as cameras and scanners write it, one byte a channel. */
#ifndef NPG_COLOURS_H
#define NPG_COLOURS_H

#include <stdint.h>

#include "pipeline/mesh.h"

/* Alpha of a colour that was seen, and of one that its neighbours lent.  Both are opaque for every viewer. */
#define NPG_COLOUR_SEEN 255
#define NPG_COLOUR_LENT 254

#define NPG_COLOUR_STEP  16 /* levels between two knots */
#define NPG_COLOUR_KNOTS 17 /* 0, 16, .. 256            */

/* Samples of one place: per channel a histogram over knots.  A sample is shared between its two knots so that
 * their mean is the sample; so means over knots are exact, in 102 bytes however many samples come (beyond
 * four thousand the earlier ones count half). */
typedef struct npg_colour_sums {
    uint16_t knots[3][NPG_COLOUR_KNOTS];
} npg_colour_sums;

void npg_colour_add(npg_colour_sums *sums, const uint8_t rgb[3]);

/* The mean of the samples that lie within two knots of the median, per channel: highlights, and what an
 * occluder left, do not count.  False, and 0, without a sample. */
bool npg_colour_mean(uint8_t rgb[3], const npg_colour_sums *sums);

/* A cloud with colours. */
typedef struct npg_coloured {
    const float *points;    /* N x 3                                  */
    const float *normals;   /* N x 3 or NULL                          */
    const uint8_t *colours; /* N x 4; alpha 0: this point has no colour */
    size_t count;
} npg_coloured;

/* out (V x 4) = colours of the vertices (V x 3, normals V x 3): the mean of the nearest points, weighted by
 * distance, whose normals face the same way; alpha NPG_COLOUR_SEEN.  All 0 for a vertex without such a point
 * within `reach` or three spacings of the points, what is more.  Uses all cores; the result does not depend
 * on how many.  NPG_MEMORY. */
npg_status npg_colour_vertices(uint8_t *out, const float *verts, const float *normals, size_t vert_count,
                               const npg_coloured *cloud, double reach);

/* Vertices without a colour (alpha 0) take the mean of their coloured neighbours, from the rim inwards, with
 * alpha NPG_COLOUR_LENT; pieces without any colour become grey. */
npg_status npg_colour_fill(uint8_t *colours, const npg_mesh *mesh);

#endif
