/* GLB text: the JSON part of a GLB with one animated mesh. */
#ifndef NPG_GLB_TEXT_H
#define NPG_GLB_TEXT_H

#include "export/forms/forms.h"

#define NPG_GLB_POSES 256 /* in one mesh: what WebGL2 holds for sure */

typedef struct npg_glb_range { /* of an accessor */
    float lo[3], hi[3];
} npg_glb_range;

/* The binary part, in this order, every piece at a multiple of 4:
 *
 *     indices 3F uint32 | base positions G float3 | base normals | colours G uint16x4 | uvs G float2 |
 *     per further pose: position deltas G float3, normal deltas | times T float | weights T (T - 1) float */
typedef struct npg_glb_layout {
    const npg_form_facts *facts;
    size_t vert_count;         /* G                                  */
    size_t pose_count;         /* T of this mesh, NPG_GLB_POSES most */
    int64_t first_index;       /* of its frames                      */
    int64_t segment, segments; /* which of how many files            */
    bool has_uvs;
    npg_glb_range base, delta[NPG_GLB_POSES]; /* delta[0] is not used        */
    float times[NPG_GLB_POSES];               /* seconds from the first pose */
} npg_glb_layout;

/* Offsets in the binary part. */
typedef struct npg_glb_places {
    uint64_t indices, positions, normals, colours, uvs, deltas, times, weights, end;
    uint64_t delta_size; /* of one pose */
} npg_glb_places;

npg_glb_places npg_glb_places_of(const npg_glb_layout *layout);

/* The JSON, padded with blanks to a multiple of 4; to be given to npg_release().  Numbers have a fixed width:
 * the length depends on counts alone, so that ranges and times can be put in when all is written. */
npg_status npg_glb_text(char **text, size_t *length, const npg_glb_layout *layout);

#endif
