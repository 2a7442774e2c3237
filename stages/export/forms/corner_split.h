/* Corner split: vertices doubled where their corners have more than one texture coordinate, for forms that
 * know only one per vertex. */
#ifndef NPG_CORNER_SPLIT_H
#define NPG_CORNER_SPLIT_H

#include "pipeline/mesh.h"

typedef struct npg_corner_split {
    size_t count;      /* G >= V                                     */
    uint32_t *vertex;  /* G: the vertex each one is a copy of, owned */
    float *uvs;        /* G x 2 or NULL, owned                       */
    uint32_t *indices; /* F x 3 of them, owned                       */
} npg_corner_split;

/* corner_uvs (F x 3 x 2) or uvs (V x 2) may be NULL; with both the corners' count.  Without corner_uvs the
 * vertices stay as they are.  Vertices that no face uses are kept.  NPG_MEMORY. */
npg_status npg_corner_split_make(npg_corner_split *split, size_t vert_count, const uint32_t *faces,
                                 size_t face_count, const float *uvs, const float *corner_uvs);
void npg_corner_split_clear(npg_corner_split *split);

#endif
