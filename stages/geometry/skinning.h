/* Skinning: where points of a deformed surface's neighbourhood are when the surface is at rest.
 *
 *     x = c + R^T (p - c')
 *
 * c' is the point of the deformed surface closest to p, c the same point of the reference, R the rotation of
 * the surface there: its faces' frames, averaged over the neighbourhood. */
#ifndef NPG_SKINNING_H
#define NPG_SKINNING_H

#include <stdbool.h>

#include "pipeline/mesh.h"

typedef struct npg_skin npg_skin;

/* A point at rest, and the surface it was carried by. */
typedef struct npg_skinned {
    float point[3];  /* x */
    float normal[3]; /* the point's own, turned back; without one the surface's */
    float foot[3];   /* c */
    float facing[3]; /* the surface's normal at c */
    float offset;    /* (p - c') along the deformed surface's normal */
    float dist;      /* |p - c'| */
    bool is_beyond;  /* c' is on the surface's border: the point lies past what is known */
    float agreement; /* cosine of the point's normal and the surface's; 1 without one */
} npg_skinned;

/* reference: unit coordinates, with normals; a counted reference is kept.  NPG_MEMORY. */
npg_status npg_skin_open(npg_skin **skin, npg_mesh *reference);
void npg_skin_close(npg_skin **skin);

/* Whether the reference has a border. */
bool npg_skin_is_open(const npg_skin *skin);

/* The surface is now where vert_unit (V x 3) says.  NPG_MEMORY. */
npg_status npg_skin_pose(npg_skin *skin, const float *vert_unit);

/* out (N) of points (N x 3, unit) with their normals (N x 3, or NULL).  Uses all cores; the result does not
 * depend on how many.  NPG_MEMORY. */
npg_status npg_skin_to_rest(npg_skin *skin, npg_skinned *out, const float *points, const float *normals,
                            size_t count);

/* The other way: where a place near the surface at rest is now, p = c' + R (place - c).  hit: the point of
 * the reference that it hangs on.  Thread-safe but for npg_skin_pose(). */
void npg_skin_from_rest(const npg_skin *skin, float now[3], const npg_surface_hit *hit, const float place[3]);

/* Bytes that it takes at most. */
size_t npg_skin_memory(size_t vert_count, size_t points);

#endif
