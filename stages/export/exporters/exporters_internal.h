/* Exporters: what other programs read, made of a run's meshes in one pass over the frames.
 *
 *     OUT/motion.pc2, motion.mdd     point caches for OUT/reference.obj, same order of the vertices
 *     OUT/motion.glb                 glTF with morph targets; motion_000.glb and so on when it is long
 *     OUT/motion.usda                points as time samples
 *     OUT/motion.npz                 arrays for NumPy
 *     OUT/volumes/<prefix>_0000.vdb  level set of every frame
 *     OUT/ply/, OUT/obj/             a second sequence
 *     OUT/exports.partial.jsonl      while they are made, one line per file of these, with size and checksum; done.json
 *                                    takes them over
 *
 * The mesh sequence is written while frames are solved, which is not the order of time, and is what a
 * resumed run continues.  The other formats are made from those files when all are there: one pass in the
 * order of time writes all of them.  So no exporter needs a state of its own to be resumed, a broken-off
 * pass is simply made again, and the bytes do not depend on how often that happened.  One file per
 * format (write_<format>.c), one row per format in exporters.c.
 *
 * Threads: one pass belongs to one thread. */
#ifndef NPG_EXPORTERS_INTERNAL_H
#define NPG_EXPORTERS_INTERNAL_H

#include <jansson.h>

#include "export/files.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

#define NPG_EXPORTERS_MAX 16

/* What a writer may know before the first pose.  Everything is as written: after axes, scale and centre. */
typedef struct npg_export_facts {
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
    bool is_z_up;             /* else y                                                      */
    double largest, diagonal; /* coordinate, and of the box; 0: not known yet                */
    double longest;           /* side of the box                                             */
    double voxel_share;       /* a level set's voxel, in longest sides                       */
    npg_file *list;           /* where files are noted                                       */
} npg_export_facts;

typedef struct npg_pose {
    int64_t index, number;  /* of the frame                */
    const float *pos;       /* V x 3                       */
    const float *normals;   /* V x 3 or NULL (has_normals) */
    const uint8_t *colours; /* V x 4 or NULL (has_pose_colours) */
    const char *path;       /* of its own file, of an exporter that has a folder */
} npg_pose;

/* What every state begins with. */
typedef struct npg_writer {
    const npg_export_facts *facts;
    npg_file *file; /* exporter->file, open; written and committed by the pass */
} npg_writer;

/* An exporter.  state is zeroed but for its npg_writer before open; close is called after open in any case and
 * removes what is not finished. */
typedef struct npg_exporter {
    const char *name;
    const char *file;            /* all poses in one file of this name                                     */
    const char *folder, *ending; /* or one file a pose, <folder>/<prefix>_<number>.<ending> */
    bool is_float;       /* keeps positions as float: far from 0 that is too coarse                   */
    bool is_surface;     /* has no points without faces                                               */
    bool with_reference; /* is of no use without OUT/reference.obj                                        */
    bool has_fixed_rate; /* has no times of its own: a frame without a mesh repeats the one before it */
    size_t state_size;
    /* NPG_USAGE when the format can't hold such a capture (vert_count at most, pose_count -1 where unknown).
     * May be NULL. */
    npg_status (*check)(const npg_export_facts *facts);
    uint64_t (*bytes)(const npg_export_facts *facts);      /* on disk, about; pose_count is known */
    npg_status (*open)(void *state);                       /* may be NULL, as those after pose */
    npg_status (*pose)(void *state, const npg_pose *pose); /* in the order of time */
    npg_status (*finish)(void *state);
    void (*close)(void *state);
} npg_exporter;

/* Ends with NULL. */
extern const npg_exporter *const npg_exporters[];

/* ---- what a run was asked for ---- */

typedef struct npg_export_choice {
    bool is_obj;                                   /* the sequence of the run itself is OBJ, else PLY */
    bool has_sequence;                             /* the list names PLY or OBJ */
    const npg_exporter *chosen[NPG_EXPORTERS_MAX]; /* in the order of the table; NULL behind them */
} npg_export_choice;

/* list: "ply,glb,..." or "".  sequence: what the run's own is ("ply", "obj"), NULL: as the list says.  A second one
 * becomes an exporter.  NPG_USAGE names what is no format. */
npg_status npg_exporters_choose(npg_export_choice *choice, const char *list, const char *sequence);

/* Whether the format of this name is made of the meshes. */
bool npg_exporters_has(const npg_export_choice *choice, const char *name);

/* Names of all that is made, the sequence first, with commas between; to be given to free().  NULL: no memory. */
char *npg_exporters_list(const npg_export_choice *choice);

/* The same as a new array. */
json_t *npg_exporters_json(const npg_export_choice *choice);

/* NPG_USAGE when one of the formats can't hold the capture; the text says which and why. */
npg_status npg_exporters_check(const npg_export_choice *choice, const npg_export_facts *facts);

/* On disk, about. */
uint64_t npg_exporters_bytes(const npg_export_choice *choice, const npg_export_facts *facts);

/* ---- making them ---- */

typedef struct npg_export_watch {
    bool (*should_stop)(void *user);
    void *user;
    int64_t repeated; /* out: frames without a mesh that formats of a fixed rate filled */
} npg_export_watch;

/* Whether something of this name in OUT is a format's. */
bool npg_exporters_own(const char *name);

/* Remove all that formats of earlier runs left in OUT. */
npg_status npg_exporters_clear(const char *output);

/* Make them of the meshes that OUT/frames.jsonl lists.  Of facts pose_count, first_index, last_index and list
 * are filled here.  NPG_DISK, NPG_BAD_INPUT (a mesh that is not the one listed), NPG_USAGE (a format
 * can't hold what is there), NPG_STOPPED. */
npg_status npg_exporters_write(const npg_export_choice *choice, npg_export_facts *facts,
                               npg_export_watch *watch);

/* The same of poses that are at hand: begin, then for each repeat and pose, finish; end in any case. */
typedef struct npg_exporters_pass {
    const npg_export_choice *choice;
    npg_export_facts *facts; /* all are known but list */
    void *states[NPG_EXPORTERS_MAX];
    npg_pose last;    /* a loan until the next pose */
    int64_t repeated; /* out: see npg_export_watch  */
} npg_exporters_pass;
npg_status npg_exporters_begin(npg_exporters_pass *pass);

/* Formats of a fixed rate show the last pose up to that before index; its arrays are still there. */
npg_status npg_exporters_repeat(npg_exporters_pass *pass, int64_t index);
npg_status npg_exporters_pose(npg_exporters_pass *pass, const npg_pose *pose);
npg_status npg_exporters_finish(npg_exporters_pass *pass);
void npg_exporters_end(npg_exporters_pass *pass);

/* Lines of the files that were made: "form", "file", "first", "frames", "bytes", "xxh3".  The form of
 * OUT/reference.obj, which all point caches share: */
#define NPG_EXPORT_LIST_NAME "exports.partial.jsonl"
#define NPG_EXPORT_REFERENCE "reference"

/* A writer's word that OUT/<file> is in place with `pose_count` poses from index first on. */
npg_status npg_export_made(const npg_export_facts *facts, const char *format, const char *file, int64_t first,
                           int64_t pose_count);

/* Make OUT/<name>, a folder. */
npg_status npg_export_folder(const char *output, const char *name);

/* ---- the results' folder and its last file ---- */

/* NPG_DISK when fewer bytes than these are free where OUT lies, with those of the earlier mesh files in OUT
 * that will be removed. */
npg_status npg_folder_has_room(const char *output, uint64_t bytes);

/* Whether a run was here before. */
bool npg_folder_has_run(const char *output);

/* NPG_USAGE when OUT/meshes holds mesh files that this run would not write over: their numbering would mix
 * with the run's; and any where no run was before.  numbers: the frames' numbers, sorted; with none every mesh file is in the way. */
npg_status npg_folder_check(const char *output, const npg_mesh_names *names, const int64_t *numbers,
                            size_t number_count);

/* ---- done.json, the last file ---- */

/* Add the entry of OUT/<name> to a list of files, with the size and checksum that it has now. */
npg_status npg_done_add(json_t *files, const char *output, const char *name);

/* OUT/done.json of what stands at its head, and the list of files. */
npg_status npg_done_write(const char *output, const json_t *head, const json_t *files);

/* Add what OUT/NPG_EXPORT_LIST_NAME lists. */
npg_status npg_done_add_exports(json_t *files, const char *output);

/* The same with every file of a run, with has_exports what was exported, too; frame log and list of exports go. */
npg_status npg_done_end(const char *output, const json_t *head, bool has_exports);

/* ---- a run that is done ---- */

/* NPG_USAGE, NPG_BAD_INPUT: job is no run, or is not done; the text says what `verb` needs.  *done is its done.json
 * (json_decref). */
npg_status npg_export_open_done(json_t **done, const char *job, const char *verb);

/* An option of the run, as its done.json has it; "" where it has none. */
const char *npg_done_option(const json_t *done, const char *name);

/* npg_export() by one who has the job's lock. */
npg_status npg_export_locked(npg_exported *made, const char *output, const char *list);

/* ---- a pose as PLY or OBJ ---- */

/* By the path's ending; V x 3, normals may be NULL, colours V x 4, NULL: the reference's.  OBJ with the lines of
 * facts->like where there is one. */
npg_status npg_write_pose(const char *path, const npg_export_facts *facts, const float *pos,
                          const float *normals, const uint8_t *colours);

/* ---- glTF ---- */

#define NPG_GLB_POSES_MOST 256 /* in one mesh: what WebGL2 holds for sure */

/* Vertices doubled where their corners have more than one texture coordinate. */
typedef struct npg_corner_split {
    size_t count;      /* G >= V                              */
    uint32_t *vertex;  /* G: the vertex each one is a copy of */
    float *uvs;        /* G x 2 or NULL                       */
    uint32_t *indices; /* F x 3 of them                       */
} npg_corner_split;

/* Of facts' uvs or corner_uvs, which may be NULL; without corner_uvs the vertices stay as they are.  Vertices that no
 * face uses are kept.  Arrays are the arena's. */
npg_status npg_split_corners(npg_corner_split *split, npg_arena *arena, const npg_export_facts *facts);

/* A GLB whose JSON is known, up to where its binary part begins. */
npg_status npg_glb_begin(npg_file *file, const json_t *root, uint64_t binary_size);

/* The node "capture" with mesh 0: from the files' coordinates to metres with y up. */
json_t *npg_glb_node(const npg_export_facts *facts);

/* ---- faces that close the openings of a surface ---- */

/* Fans over the pieces of a mesh's border, turned as the faces around them, so that mesh and caps together are
 * closed: 3 indices each, to be given to npg_release(); NULL where there is no border.  They need not be flat
 * nor free of crossings.  The border's edges go in circles, as those of oriented faces do.  NPG_MEMORY. */
npg_status npg_border_caps(uint32_t **caps, size_t *cap_count, size_t vert_count, const uint32_t *faces,
                           size_t face_count);

/* ---- level sets of surfaces as OpenVDB files (vdb_surface.cpp) ---- */

typedef struct npg_vdb_surface {
    npg_writer writer;
    const npg_pose *pose;
    uint32_t *faces; /* F x 3, closed, owned */
    size_t face_count;
} npg_vdb_surface;

/* Write the narrow-band level set (half width three voxels, negative inside) of a pose to a file, as the grid
 * "surface"; the file's metadata has npg_index, npg_number, npg_fps, npg_metres_per_unit, npg_up.  NPG_FAILED when
 * nothing of it is inside, so that no surface would come out; NPG_MEMORY. */
npg_status npg_vdb_save_surface(const char *path, const npg_vdb_surface *surface);

/* ---- colours ---- */

/* 0 .. 1, linear light, of sRGB as cameras and scanners write it (IEC 61966-2-1). */
float npg_srgb_to_linear(uint8_t byte);

#endif
