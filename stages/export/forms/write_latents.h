/* Latents: the latent grids of a run's windows for other programs. */
#ifndef NPG_WRITE_LATENTS_H
#define NPG_WRITE_LATENTS_H

#include "export/forms/forms.h"

/* OUT/latents/window_000000.vdb of every OUT/job/window_000000.vdb there is (vdb_latents.h says what is
 * in them); nothing without facts->has_grids.  NPG_DISK, NPG_BAD_INPUT. */
npg_status npg_latents_write(const npg_form_facts *facts);

#endif
