/* Apart: keep parts of a body that nearly touch from being joined by the reconstruction.
 *
 * Poisson closes a gap that is narrower than the points are apart, and a weld once made stretches into a web
 * in every frame where the parts move away from each other.  So points that face each other across a narrow
 * gap are first moved away from it, into their own part, until the gap is wide enough to survive; the surface
 * is made; then its vertices are moved back by what the points around them were moved.  The surface ends
 * where the points are, without the weld.
 *
 *     s_i = -n_i max(0, (w h - g_i) / 2), smoothed over the neighbours on the same side
 *
 * g_i: distance to the nearest point that faces point i (contact.h), h: the points' spacing, w: see apart.c.
 * The way back is not exact: a vertex goes by the mean of what the points around it went.  Tight, the surface
 * is then drawn to its points twice: each vertex by the mean of the gaps along the normals that the points
 * around it have to the surface.  Loose, it stays as it is, and the parts keep a little of their distance.
 * Not in the paper. */
#ifndef NPG_APART_H
#define NPG_APART_H

#include "pipeline/mesh.h"

typedef enum npg_apart_way { NPG_APART_TIGHT, NPG_APART_LOOSE, NPG_APART_NOT } npg_apart_way;

/* N points and where they are for the reconstruction. */
typedef struct npg_apart {
    const float *points, *normals; /* N x 3, loans; outward                               */
    size_t count;                  /* N                                                   */
    double spacing;                /* h, as npg_cloud_spacing() gives it                  */
    npg_apart_way way;             /* tight or loose                                      */
    float *shift, *shifted;        /* N x 3: how far each point goes, and to where        */
    size_t moved;                  /* points that go at all                               */
    npg_arena arena;
} npg_apart;

/* NPG_MEMORY. */
npg_status npg_apart_open(npg_apart *apart, const float *points, const float *normals, size_t count,
                          double spacing, npg_apart_way way);
void npg_apart_close(npg_apart *apart);

/* Move the vertices of a mesh made from the shifted points back.  normals may have been
 * turned since.  NPG_MEMORY. */
npg_status npg_apart_bring_back(const npg_apart *apart, npg_mesh *mesh);

#endif
