/* Proxy: a decimated copy of a mesh whose vertices are vertices of it.
 *
 * What is true of a vertex of the copy (its position in a frame, what carries it) is read from the whole
 * mesh's rows, so that a step of the fit costs the same however fine the reference is. */
#ifndef NPG_PROXY_H
#define NPG_PROXY_H

#include "pipeline/mesh.h"

/* Vertices of the surface that frames are aligned and matched with: where the reference has more, it is
 * thinned for that.  By trial: above, distances to it gain nothing, and only the time grows
 * (tests/bed/decisions.md, "Fine references"). */
#define NPG_PROXY_SURFACE 10000

typedef struct npg_proxy {
    npg_mesh *mesh;   /* T vertices, with normals and mask where the whole has them; counted reference */
    uint32_t *vertex; /* T, ascending: which vertex of the whole each one is                  */
} npg_proxy;

/* About vert_target vertices by edge collapse (meshoptimizer); with 0, or where no more than a fifth would
 * go, all that have a face.  whole is a loan during the call. */
npg_status npg_proxy_open(npg_proxy **proxy, const npg_mesh *whole, size_t vert_target);
void npg_proxy_close(npg_proxy **proxy);

/* out (T x 3) = the rows of rows (of the whole, x 3) that belong to the copy's vertices. */
void npg_proxy_gather(const npg_proxy *proxy, float *out, const float *rows);

#endif
