/* The mesh room within: the steps from points to the reference. */
#ifndef NPG_MESH_INTERNAL_H
#define NPG_MESH_INTERNAL_H

#include <jansson.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/surface.h"
#include "pipeline/frame_box.h"
#include "track/track.h"

/* Report: what is said while the reference is made, as figures of the stage's report and lines of the log.
 *
 * Called on the thread of the worker's stage alone. */

/* Put a figure into the report of the worker's stage, in the place of an earlier one with this key. */
void npg_mesh_note(npg_worker *worker, const char *key, double value);
void npg_mesh_note_count(npg_worker *worker, const char *key, size_t value);

/* As npg_worker_warn(), of the reference that the run delivers; what is said of those before it (in fusing
 * passes) is for the log alone, and of one that is made again of other cells nothing. */
void npg_mesh_warn(npg_worker *worker, bool partial, int64_t frame, const char *format, ...) NPG_PRINTF(4, 5);

/* Point set: the points that the reference is made from, of the keyframe or of all frames, and how dense they
 * are.  Unit coordinates throughout. */

typedef struct npg_point_set {
    float *points;          /* N x 3, owned                                               */
    float *normals;         /* N x 3, outward, owned; NULL: the keyframe has none         */
    size_t count;           /* N                                                          */
    bool has_given_normals; /* the capture's own; false: estimated from the points       */
    size_t given;           /* points there were, before any was left out                 */
    bool is_fused;          /* of all frames; false: of the keyframe alone                */
    int64_t key_number;     /* the keyframe's, for the log                                */
    double spacing;         /* npg_cloud_spacing()                                        */
    double diagonal;        /* of the points' box                                         */
    double seen_dist;       /* a place was seen when a point is nearer than this          */
    double key_spacing;     /* where is_fused, of the keyframe's points; else 0           */
    double key_noise;       /* of the same, across the surface                            */
    bool is_smooth;         /* smoothed as far as their noise asks for it ...             */
    bool is_rough;          /* ... as a frame's are noisy beyond doubt                    */
    npg_cube_set *empty;    /* space that sensors saw to be empty, owned; NULL: not known */
} npg_point_set;

/* The keyframe's points, an even choice of them where there are many; with `fused` (or NULL) those of all
 * frames, whose points and normals are taken from it.  Of a side of the body (facts.brief) those in empty
 * space are dropped.
 * Figures go into the report of the worker's stage; called on its thread.  The set is to be closed; after a
 * failure it owns nothing.  NPG_MEMORY. */
npg_status npg_point_set_open(npg_point_set *set, npg_worker *worker, const npg_frame *key, npg_fused *fused);
void npg_point_set_close(npg_point_set *set);

/* Reconstruct: from a point set to one clean mesh that can be deformed.
 *
 * In this order:
 *
 *     noisy points are smoothed, and Poisson's surface drawn through them, in which parts that
 *         nearly touch are held apart (npg_poisson_apart())
 *     of its pieces the main one is kept, and what belongs to it
 *     what lies far from every point is trimmed off; of what no point saw, all of it, or it is drawn tight
 *         between what was seen and out of empty space (membrane fairing)
 *     faces are decimated and mended; those of noisy points follow the points' normals */

/* Surface that no point saw: drawn tight, or trimmed where it is a whole side; kept as Poisson closed it;
 * trimmed; as the first, and a shell that is left is closed in the end.  The words of --unseen, in their order. */
typedef enum npg_unseen_way {
    NPG_UNSEEN_AUTO,
    NPG_UNSEEN_KEEP,
    NPG_UNSEEN_TRIM,
    NPG_UNSEEN_CLOSE
} npg_unseen_way;

#define NPG_FACES_PER_POINT 4 /* at most: more would be the mesher's, not the points' */

typedef struct npg_reconstruct_settings {
    int unseen;                   /* npg_unseen_way                                                         */
    bool smooth;                  /* the points, where they are noisy                                       */
    int64_t face_max;             /* and no more faces than NPG_FACES_PER_POINT for each point given        */
    npg_poisson_settings poisson; /* with whom to ask for a stop                                            */
} npg_reconstruct_settings;

/* Faces that a reference has at most. */
size_t npg_face_budget(const npg_reconstruct_settings *settings, const npg_point_set *set);

/* *mesh (unit coordinates, without normals, faces counter-clockwise from outside; owned by the caller, NULL
 * on failure) from the set, whose points and normals may be smoothed and turned in place.  *invented_share
 * gets the share of the area, 0..1, that no point saw and that was kept, as measured before decimation.
 * Where the brief leaves it open the mesh has nothing that was not seen.
 * Figures and warnings go to the report and the log of the worker's stage; called on its thread.  It uses all
 * cores, and the same input gives the same mesh.
 * NPG_BAD_INPUT: the set has no normals, or is one that npg_poisson() refuses.  NPG_FAILED: npg_poisson()
 * failed, or no surface lies near the points or nothing but shreds.
 * NPG_MEMORY, NPG_STOPPED.  Faces that are still turned over after all mending are a warning. */
npg_status npg_reconstruct(npg_mesh **mesh, double *invented_share, npg_worker *worker, npg_point_set *set,
                           const npg_reconstruct_settings *settings);

/* Gap widening: keep parts of a body that nearly touch from being joined by the reconstruction.
 *
 * Poisson closes a gap that is narrower than the points are apart, and a bridge once made stretches into
 * a web in every frame where the parts move away from each other.  So points that face each other across a
 * narrow gap are first moved away from it, into their own part, until the gap is wide enough to survive; the
 * surface is made; then its vertices are moved back by what the points around them were moved.  The surface
 * ends where the points are, without the bridge.
 *
 *     s_i = -n_i max(0, (w h - g_i) / 2), smoothed over the neighbours on the same side
 *
 * g_i: distance to the nearest point that faces point i, normals against each other and the gap outside of both, h: the points' spacing, w: see
 * gap_widening.c.
 * The way back is not exact: a vertex goes by the mean of what the points around it, on its side of the gap, went.  So the
 * surface is then drawn to its points twice: each vertex by the mean of the gaps along the normals that the points
 * around it have to the surface.
 * Not in the paper. */

/* N points and where they are for the reconstruction. */
typedef struct npg_gap_widening {
    const float *points, *normals; /* N x 3, loans; outward                               */
    size_t count;                  /* N                                                   */
    double spacing;                /* h, as npg_cloud_spacing() gives it                  */
    float *shift, *shifted;        /* N x 3: how far each point goes, and to where        */
    size_t moved;                  /* points that go at all                               */
    npg_arena arena;
} npg_gap_widening;

/* NPG_MEMORY. */
npg_status npg_gaps_widen(npg_gap_widening *widening, const float *points, const float *normals, size_t count,
                          double spacing);
void npg_gaps_close(npg_gap_widening *widening);

/* Move the vertices of a mesh made from the shifted points back.  NPG_MEMORY. */
npg_status npg_gaps_bring_back(const npg_gap_widening *widening, npg_mesh *mesh);

/* Densify: points between those of thin parts.
 *
 * A shin of a dozen points, an ear or a feather has the points of its other side as near as those of its own.
 * The octree of the reconstruction is as fine as the points are dense, so there both sides share its cells
 * and the part is lost.  The normals say more than the points alone do: halfway along the curved edge that
 * two neighbours on one side span lies another point of the surface,
 *
 *     m = (p_i + p_j) / 2 + ((d . n_j) n_j - (d . n_i) n_i) / 8,    d = p_j - p_i,
 *
 * with the normal n_i + n_j.  Points that have one of another side nearby get such points to their nearest
 * neighbours.  The normals must be measured ones: such as are estimated from points mix both sides.  Based
 * on: A. Vlachos et al., Curved PN Triangles, 2001 (the edge).  Not in the paper. */

/* points and normals (outward, unit): N x 3 each.  dense_points and dense_normals (*dense_count x 3 each, owned
 * by the caller): the given ones first, those that are added behind.  spacing: of the points, as
 * npg_cloud_spacing() gives it.  Equal input gives equal bits.  NPG_MEMORY: both are then NULL. */
npg_status npg_cloud_densify(float **dense_points, float **dense_normals, size_t *dense_count,
                             const float *points, const float *normals, size_t count, double spacing);

/* Membrane fairing: surface that no point saw, drawn tight between what was seen.
 *
 * Poisson closes what it does not know with a balloon: under the soles of feet, below a skirt.  The least
 * surface is the better guess: every unseen vertex goes to the mean of its neighbours,
 *
 *     x_v = sum_{w ~ v} x_w / |{w ~ v}|,
 *
 * while the seen ones stay, and pieces of the mesh without any.  What then lies in space that sensors saw to
 * be empty is pushed inward between the sweeps, out of it.  Not in the paper. */

typedef struct npg_faired {
    size_t moved;  /* vertices */
    size_t pushed; /* those of them that were in empty space */
} npg_faired;

/* Move, in place, the vertices of the mesh that are farther than seen_dist from all N points (N x 3), and those
 * that hang on them and are farther than half of it: the balloon begins where points end.  The mesh's normals are
 * left as they are.  empty (or NULL): space that sensors saw to be empty.  NPG_MEMORY. */
npg_status npg_mesh_fair(npg_mesh *mesh, npg_faired *done, const float *points, size_t point_count,
                         double seen_dist, const npg_cube_set *empty);

/* Close every piece of a mesh that has a border, whose faces are manifold and turned one way: it gets a second
 * side, a copy of its own faces that look the other way, joined to it along the border, which is drawn tight
 * as above between it while the first side stays.  So a hole becomes an opening from one side to the other.
 * The first vertices and faces stay those they were; normals are dropped.  *added: vertices of second sides.
 * NPG_MEMORY: *mesh may then be closed or not. */
npg_status npg_mesh_close(npg_mesh **mesh, size_t *added);

/* Share of the area, by the middles of faces, that lies in the cubes and not at their border. */
double npg_mesh_share_in(const npg_mesh *mesh, const npg_cube_set *cubes);

/* Normal-guided denoising: a mesh of noisy points, turned the way that the points' normals say.
 *
 * A surface through noisy points has their bumps.  The points' normals, each from many points around it, are
 * much nearer the truth than the slopes between bumps.  So each face f of centre c gets a target from the
 * points around it that face its way,
 *
 *     t_f = sum_i w_i n_i / | sum_i w_i n_i |,   w_i = exp(-|p_i - c|^2 / 2 s^2) max(n_i . n_f, 0)^2,
 *
 * with s = 0.6 mean edges, and a few times every vertex goes to where its faces are nearest their targets'
 * planes:
 *
 *     v += 1 / |F_v|  sum_{f ~ v} t_f (t_f . (c_f - v)).
 *
 * That shrinks what is thin.  So nothing stays of the way that all vertices of a neighbourhood went together:
 * its mean over six rings is taken back.  Based on: X. Sun, P. Rosin, R. Martin, F. Langbein, Fast and
 * Effective Feature-Preserving Mesh Denoising, 2007 (the vertices' step).  Not in the paper. */

/* Move the mesh's vertices, in place; its normals are left as they are.  points, normals: N x 3, oriented,
 * N >= 1; faces without points near them keep their slope.  Equal input gives equal bits.  NPG_MEMORY. */
npg_status npg_mesh_denoise(npg_mesh *mesh, const float *points, const float *normals, size_t point_count);

/* Keep the faces whose keep_face (F) is not 0.  *share gets the share of the area that went. */
npg_status npg_mesh_keep_share(npg_mesh **mesh, double *share, const uint8_t *keep_face);

/* Unseen: which vertices of the finished reference no point supports that it was made from. */

/* Set mesh->vert_unseen: the vertices that are farther than dist_max from all N points (N x 3).  NPG_MEMORY. */
npg_status npg_mesh_mark_unseen(npg_mesh *mesh, const float *points, size_t point_count, double dist_max);

/* Take the mark from vertices that none of the sensors (S x 3, in the mesh's coordinates) can see past the mesh
 * itself, which has its normals.  offset: surface nearer than that hides nothing.  NPG_MEMORY. */
npg_status npg_unseen_excuse(npg_mesh *mesh, const float *sensors, size_t sensor_count, double offset);

/* *share: of the mesh's area that is marked; *largest: its largest connected part.  NPG_MEMORY. */
npg_status npg_unseen_measure(double *share, npg_patch *largest, const npg_mesh *mesh);

/* Where that part lies, for the report: {share, at, radius} in world units, and in words into text; JSON null
 * and "" where it has no area. */
json_t *npg_unseen_place(const npg_patch *largest, const npg_frame_box *box, char *text, size_t size);

#endif
