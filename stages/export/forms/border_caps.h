/* Border caps: faces that close the openings of a surface. */
#ifndef NPG_BORDER_CAPS_H
#define NPG_BORDER_CAPS_H

#include "pipeline/mesh.h"

/* Fans over the loops of a mesh's border, turned as the faces around them, so that mesh and caps together are
 * closed: 3 indices each, to be given to npg_release(); NULL where there is no border.  They need not be flat
 * nor free of crossings.  The border's edges go in circles, as those of oriented faces do.  NPG_MEMORY. */
npg_status npg_border_caps(uint32_t **caps, size_t *cap_count, const uint32_t *faces, size_t face_count);

#endif
