/* State mesh: the reference mesh as blocks of a state on disk (store.h). */
#ifndef NPG_STATE_MESH_H
#define NPG_STATE_MESH_H

#include "pipeline/mesh.h"
#include "pipeline/store.h"

/* Add the blocks "reference", "reference.vertices", ... */
npg_status npg_state_put_mesh(npg_store *out, const npg_mesh *mesh);

/* The mesh of these blocks.  Sizes are compared before memory is taken, and indices are checked:
 * NPG_BAD_INPUT where they don't fit together, NPG_MEMORY. */
npg_status npg_state_get_mesh(npg_mesh **mesh, const npg_record *in);

#endif
