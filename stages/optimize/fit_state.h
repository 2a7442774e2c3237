/* What a fit knows after a window, to a file and back. */
#ifndef NPG_FIT_STATE_H
#define NPG_FIT_STATE_H

#include "pipeline/store.h"
#include "optimize/fit.h"
#include "optimize/vdb_grids.h"

/* Optimiser, decoder and time code go into the store (blocks "fit.*"), the latent grids into an OpenVDB
 * file at grids_path whose checksum becomes the block "grids.hash".  A table that holds more than dense grids
 * (hashed levels) goes into the store whole, too. */
npg_status npg_fit_save(npg_fit *fit, npg_store *store, const char *grids_path, const npg_vdb_place *place);

/* Into a fit that was opened with the same settings and reference.  NPG_BAD_INPUT. */
npg_status npg_fit_restore(npg_fit *fit, const npg_record *record, const char *grids_path);

#endif
