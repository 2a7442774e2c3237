#ifndef NPG_OPTIMIZE_SOLVER_H
#define NPG_OPTIMIZE_SOLVER_H

#include <jansson.h>

#include "optimize/energy.h"
#include "pipeline/plan.h"
#include "pipeline/stage.h"
#include "pipeline/store.h"

/* Solver: what finds a window's motion.  All are rows of one table, npg_solvers.
 *
 *     joint  vertices: the energy of aligned poses (energy.h) by conjugate gradients
 *     grids  a field over the reference and time, the paper's latent grids and decoder, that moves the smoothed
 *            poses to where the same energy is least
 *     paper  the same field from the reference itself, without poses: the paper's distance of all vertices */

typedef struct npg_grid_settings {
    int64_t grid_base, grid_step, grid_levels;
    int64_t position_channels, normal_channels; /* |z_p| and |z_n|, together NPG_LATENT_CHANNELS at most */
    double lambda, lambda_growth, grid_rate, grid_rate_growth;
    int64_t width_1, width_2; /* of the decoder: npg_mlp_shape */
    double mlp_rate;
    int64_t frequencies; /* M of the time code, which has 2 M values */
} npg_grid_settings;

typedef struct npg_paper_settings {
    int confidence; /* npg_confidence of grids/fit.h */
    double isometry, welsch;
} npg_paper_settings;

typedef struct npg_solver_settings {
    int64_t epochs; /* or steps, at most; 0: frames stay as they are */
    npg_energy_settings energy;
    npg_grid_settings grid;
    npg_paper_settings paper;
} npg_solver_settings;

/* What a solver is opened with; all but the settings are loans that outlive it. */
typedef struct npg_solver_setup {
    const npg_solver_settings *settings;
    const npg_facts *facts;    /* reference and box are known                         */
    npg_mesh *surface;         /* what moves: the thinned reference, or itself        */
    struct npg_device *device; /* NULL for those that need none                       */
    uint64_t seed;
} npg_solver_setup;

/* A frame of a window: its points (x 3, unit; normals may be NULL), and where an earlier window has put the
 * surface, or NULL. */
typedef struct npg_solver_frame {
    int64_t index;
    const float *points, *normals, *solved;
    size_t point_count;
} npg_solver_frame;

/* One window, its frames in order of time. */
typedef struct npg_problem {
    const npg_solver_settings *settings;
    const npg_window *window;
    const npg_solver_frame *frames;
    size_t count;       /* T                                                                      */
    npg_energy *energy; /* at the smoothed poses; NULL without poses                              */
    float *result;      /* T x W x 3: the way from these poses; without them the positions        */
} npg_problem;

/* How a window went; lengths in units. */
typedef struct npg_solved {
    int64_t steps;
    double energy;   /* what is left of it, as a share of that of the smoothed poses; 1 without poses */
    double distance; /* of the paper's fit: Chamfer, mean over the frames                            */
    double isometry; /* and mean change of an edge                                                   */
} npg_solved;

typedef struct npg_solver_step {
    int64_t step, steps; /* how many there were, how many there will be at most */
    double loss;
} npg_solver_step;

/* Asked after each step; anything but NPG_OK ends the solve with that status. */
typedef npg_status npg_solver_watch(void *user, const npg_solver_step *step);

/* What a state is written for: after window `at`, or inside the one after it. */
typedef struct npg_solver_moment {
    bool is_inside;
    int64_t at;
    npg_window window;
    const char *grids_path; /* where latent grids go, NULL inside a window */
} npg_solver_moment;

typedef struct npg_solver {
    const char *name;
    bool needs_device, needs_poses;
    npg_status (*open)(void **solver, const npg_solver_setup *setup); /* NULL, as close: nothing is kept */
    npg_status (*solve)(void *solver, npg_solved *solved, const npg_problem *problem, npg_solver_watch *watch,
                        void *user);
    /* Bytes at most for a surface of so many vertices, windows of so many frames of so many points. */
    size_t (*memory)(const npg_solver_settings *settings, size_t verts, size_t frames, size_t points);
    /* What goes from window to window, or how far the window at work is; NULL where nothing does. */
    npg_status (*save)(void *solver, npg_store *store, const npg_solver_moment *moment);
    npg_status (*restore)(void *solver, const npg_record *record);
    bool keeps_inside; /* the window at work can be gone on from after any step: windows are long */
    void (*close)(void **solver);
} npg_solver;

/* Epochs of each of the paper's windows: one of several starts near where it is to end, and has a tenth of those of
 * one over all frames, which starts at the reference. */
int64_t npg_paper_epochs(const npg_solver_settings *settings, const npg_plan *plan);

extern const npg_solver npg_solver_joint, npg_solver_grids, npg_solver_paper;

#endif
