/* Record: what a solved window leaves on disk so that the deformation can be had again at any time, at frames
 * and between them, without the capture and without the meshes (replay.h).
 *
 *     OUT/job/motion_000012.npg     of the 12th window, an archive (pipeline/archive.h) that stays:
 *
 *     window     npg_record_facts
 *     rest       V x 3 floats: the reference, unit coordinates
 *
 * without alignment
 *
 *     decoder    its parameters (npg_mlp_param_count floats)
 *     layers     int64_t: its hidden layers, where they are not two
 *     time       parameters of a learned time code and their moments, doubles; else empty
 *     features   V x NPG_LATENT_CHANNELS floats: what the latent grids give at the vertices
 *
 * where frames come aligned
 *
 *     pose.I     V x 3 floats: frame I after this window, for all frames of the window
 *
 * 12 V bytes a frame, or about 1.2 MB and 128 V bytes a window. */
#ifndef NPG_RECORD_H
#define NPG_RECORD_H

#include "optimize/window.h"

#define NPG_RECORD_LAYERS 2 /* hidden layers of a decoder whose record does not name them */

typedef struct npg_record_facts {                        /* no padding: the same bytes every time */
    int64_t first, last, new_first, new_last, direction; /* as npg_window                         */
    npg_plan time_plan;                                  /* what npg_window_time() needs          */
    int64_t is_aligned, vert_count;
    int64_t rotation, time_kind, frequencies, width_1, width_2;
    uint64_t seed; /* of the time code */
    double slope, time_span;
} npg_record_facts;

/* What a record is of; all loans. */
typedef struct npg_record_source {
    npg_window_solver *solver; /* has just solved the window */
    const npg_fit_settings *settings;
    const npg_facts *facts;
    const npg_window *window;
    npg_held *held; /* holds the window's frames, in any order */
    size_t held_count;
    uint64_t seed;
} npg_record_source;

/* Write the record of a window.  The file appears whole or not at all.  NPG_DISK, NPG_MEMORY. */
npg_status npg_record_save(const char *path, const npg_record_source *source);

#endif
