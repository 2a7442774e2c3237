/* Forms: what other programs read, made of a run's meshes in one pass over the frames.
 *
 *     OUT/motion.pc2, motion.mdd     point caches for OUT/reference.obj, same order of the vertices
 *     OUT/motion.glb                 glTF with morph targets; motion_000.glb and so on when it is long
 *     OUT/motion.usda                points as time samples
 *     OUT/motion.npz                 arrays for NumPy
 *     OUT/obj/<prefix>_0000.obj      a second sequence, where the first one is PLY
 *     OUT/volumes/<prefix>_0000.vdb  level set of every frame
 *     OUT/latents/window_000000.vdb  latent grids of every window
 *     OUT/exports.jsonl              one line per file of these, with size and checksum
 *
 * The mesh sequence is written while frames are solved, which is not the order of time, and is what a
 * resumed run continues.  The other forms are made from those files when all are there: one pass in the
 * order of time writes all of them.  So no form needs a state of its own to be resumed, a broken-off pass is
 * simply made again, and the bytes do not depend on how often that happened.  One file per form
 * (write_<form>.c), one row per form in forms.c.
 *
 * Threads: one pass belongs to one thread. */
#ifndef NPG_FORMS_H
#define NPG_FORMS_H

#include <jansson.h>

#include "pipeline/mesh.h"

#define NPG_FORMS_MAX 16

typedef struct npg_form_log npg_form_log;

/* What a writer may know before the first pose.  Everything is as written: after axes, scale and centre. */
typedef struct npg_form_facts {
    const char *output;              /* OUT                                                  */
    const char *prefix;              /* of files that are numbered                           */
    int width;                       /* digits of their number at least                      */
    size_t vert_count;               /* V                                                    */
    size_t face_count;               /* F                                                    */
    const uint32_t *faces;           /* F x 3, counter-clockwise from outside                */
    const float *rest;               /* V x 3: the reference                                 */
    const uint8_t *colours;          /* V x 4 RGBA, sRGB as scanners write it, or NULL       */
    const float *uvs;                /* V x 2 or NULL                                        */
    const float *corner_uvs;         /* F x 3 x 2 or NULL: where vertices have more than one */
    const char *like;                /* OBJ file whose lines an OBJ keeps, or NULL           */
    bool turns_faces;                /* and its faces are to be turned over                  */
    bool has_normals;                /* poses have normals                                   */
    bool has_pose_colours;           /* poses have colours of their own                      */
    int64_t pose_count;              /* T, meshes there are; -1: not known yet               */
    int64_t first_index, last_index; /* of the poses                                         */
    double fps;
    double metres_per_unit;
    bool is_z_up;                          /* else y                                                      */
    double largest, diagonal;              /* coordinate, and of the box; 0: not known yet                */
    double longest;                        /* side of the box                                             */
    double voxel_share;                    /* a level set's voxel, in longest sides                       */
    bool has_grids;                        /* OUT/job holds the latent grids of this run's windows        */
    const struct npg_placement *placement; /* the capture's coordinates to these; NULL: they are the same */
    npg_form_log *log;                     /* where files are noted                                       */
} npg_form_facts;

typedef struct npg_pose {
    int64_t index, number;  /* of the frame                */
    const float *pos;       /* V x 3                       */
    const float *normals;   /* V x 3 or NULL (has_normals) */
    const uint8_t *colours; /* V x 4 or NULL (has_pose_colours) */
} npg_pose;

/* A form.  state is zeroed before open; close is called after open in any case and removes
 * what is not finished. */
typedef struct npg_form {
    const char *name, *help;
    bool is_float;       /* keeps positions as float: far from 0 that is too coarse                   */
    bool has_fixed_rate; /* has no times of its own: a frame without a mesh repeats the one before it */
    size_t state_size;
    /* NPG_USAGE when the form can't hold such a capture (vert_count at most, pose_count -1 where unknown).
     * May be NULL. */
    npg_status (*check)(const npg_form_facts *facts);
    uint64_t (*bytes)(const npg_form_facts *facts); /* on disk, about; 0: can't be told */
    npg_status (*open)(void *state, const npg_form_facts *facts);
    npg_status (*pose)(void *state, const npg_pose *pose); /* in the order of time */
    npg_status (*finish)(void *state);
    void (*close)(void *state);
} npg_form;

/* Ends with NULL. */
extern const npg_form *const npg_forms[];

/* ---- what a run was asked for ---- */

typedef struct npg_form_choice {
    bool is_obj; /* the sequence of the run itself is OBJ, else PLY */
    bool is_chosen[NPG_FORMS_MAX];
} npg_form_choice;

/* list: "ply,glb,..." or "".  is_obj: the sequence's format where the list names none; obj beside ply becomes
 * a sequence of its own.  NPG_USAGE names what is no form. */
npg_status npg_forms_choose(npg_form_choice *choice, const char *list, bool is_obj);

/* Whether a list that npg_forms_choose() takes has this name. */
bool npg_forms_name(const char *list, const char *name);

bool npg_forms_any(const npg_form_choice *choice);

/* Names of all that is made, the sequence first; a new array. */
json_t *npg_forms_json(const npg_form_choice *choice);

/* NPG_USAGE when one of the forms can't hold the capture; the text says which and why. */
npg_status npg_forms_check(const npg_form_choice *choice, const npg_form_facts *facts);

/* On disk, about. */
uint64_t npg_forms_bytes(const npg_form_choice *choice, const npg_form_facts *facts);

/* ---- making them ---- */

typedef struct npg_form_watch {
    bool (*should_stop)(void *user);
    void *user;
    int64_t repeated; /* out: frames without a mesh that forms of a fixed rate filled */
} npg_form_watch;

/* Remove all that forms of earlier runs left in OUT. */
npg_status npg_forms_clear(const char *output);

/* Make them of the meshes that OUT/frames.jsonl lists.  Of facts pose_count, first_index, last_index and log
 * are filled here.  NPG_DISK, NPG_BAD_INPUT (a mesh that is not the one listed), NPG_USAGE (a form can't hold
 * what is there), NPG_STOPPED. */
npg_status npg_forms_write(const npg_form_choice *choice, npg_form_facts *facts, npg_form_watch *watch);

/* A writer's word that OUT/<file> is in place with `pose_count` poses from index first on. */
npg_status npg_form_made(npg_form_log *log, const char *form, const char *file, int64_t first,
                         int64_t pose_count);

#endif
