/* Synthetic rigs: depth and colour images of a textured body, with rig.json (samples/guide/rigs.md). */
#ifndef NPG_SYNTH_RIG_H
#define NPG_SYNTH_RIG_H

#include "tools/synth/synth_points.h"

/* The texture: colour of a place of the body at rest (metres), sRGB. */
void npg_synth_colour(uint8_t rgba[4], const double rest[3]);

/* FOLDER/rig.json and a folder per camera of the ring. */
npg_status npg_synth_rig_begin(const char *folder, const npg_scan *capture);

/* Images of one frame of every camera: mesh is the body posed, rest the same vertices at rest; noise_m:
 * Gaussian deviation of the depths. */
npg_status npg_synth_rig_frame(const char *folder, const npg_scan *capture, const npg_mesh *mesh,
                               const npg_mesh *rest, int64_t frame, double noise_m);

#endif
