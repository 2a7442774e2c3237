/* Carry back: where points of a deformed surface's neighbourhood are when the surface is at rest.
 *
 *     x = c + R^T (p - c')
 *
 * c' is the point of the deformed surface closest to p, c the same point of the reference, R the rotation of
 * the surface there: its faces' frames, averaged over the neighbourhood. */
#ifndef NPG_CARRY_BACK_H
#define NPG_CARRY_BACK_H

#include <stdbool.h>

#include "pipeline/mesh.h"

typedef struct npg_carry_back npg_carry_back;

/* A point at rest, and the surface it was carried by. */
typedef struct npg_carried {
    float point[3];  /* x */
    float normal[3]; /* the point's own, turned back; without one the surface's */
    float foot[3];   /* c */
    float facing[3]; /* the surface's normal at c */
    float offset;    /* (p - c') along the deformed surface's normal */
    float dist;      /* |p - c'| */
    bool is_beyond;  /* c' is on the surface's border: the point lies past what is known */
    float agreement; /* cosine of the point's normal and the surface's; 1 without one */
} npg_carried;

/* reference: unit coordinates, with normals; a counted reference is kept.  NPG_MEMORY. */
npg_status npg_carry_back_open(npg_carry_back **carry, npg_mesh *reference);
void npg_carry_back_close(npg_carry_back **carry);

/* Whether the reference has a border. */
bool npg_carry_back_is_open(const npg_carry_back *carry);

/* The surface is now where vert_unit (V x 3) says.  NPG_MEMORY. */
npg_status npg_carry_back_move(npg_carry_back *carry, const float *vert_unit);

/* out (N) of points (N x 3, unit) with their normals (N x 3, or NULL).  Uses all cores; the result does not
 * depend on how many.  NPG_MEMORY. */
npg_status npg_carry_back_points(npg_carry_back *carry, npg_carried *out, const float *points,
                                 const float *normals, size_t count);

/* The other way: where a place near the surface at rest is now, p = c' + R (place - c).  hit: the point of
 * the reference that it hangs on.  Thread-safe but for npg_carry_back_move(). */
void npg_carry_out(const npg_carry_back *carry, float now[3], const npg_surface_hit *hit,
                   const float place[3]);

/* Bytes that it takes at most. */
size_t npg_carry_back_memory(size_t vert_count, size_t points);

#endif
