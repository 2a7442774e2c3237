/* Geometry: what all rooms use of points, meshes and their motion.  A section says which file has it.  (What
 * sensors say of the space around them: sensor_space.h.) */
#ifndef NPG_GEOMETRY_H
#define NPG_GEOMETRY_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"
#include "pipeline/memory.h"
#include "pipeline/mesh.h"

/* vec3: three numbers as a vector, and the cross product and normal of a face.
 *
 * Sums go from x to z, differences are taken in double: another order would change the last digit, and with
 * it the bytes of a result.  Names with an f compute in float, for data that is float and large. */

static inline double npg_vec3_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline float npg_vec3_dotf(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double npg_vec3_length(const double a[3])
{
    return sqrt(npg_vec3_dot(a, a));
}

static inline float npg_vec3_lengthf(const float a[3])
{
    return sqrtf(npg_vec3_dotf(a, a));
}

static inline bool npg_vec3_is_finitef(const float a[3])
{
    return isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
}

/* out = a - b; out may be a or b. */
static inline void npg_vec3_sub(double out[3], const double a[3], const double b[3])
{
    for (int i = 0; i < 3; i++) out[i] = a[i] - b[i];
}

/* out = to - from, of points that are float. */
static inline void npg_vec3_between(double out[3], const float from[3], const float to[3])
{
    for (int i = 0; i < 3; i++) out[i] = (double)to[i] - (double)from[i];
}

/* Distance of two points that are float. */
static inline double npg_vec3_distance(const float a[3], const float b[3])
{
    double d[3];
    npg_vec3_between(d, a, b);
    return npg_vec3_length(d);
}

/* edge: its vertices. */
static inline double npg_edge_length(const float *vert_pos, const uint32_t edge[2])
{
    return npg_vec3_distance(vert_pos + 3 * (size_t)edge[0], vert_pos + 3 * (size_t)edge[1]);
}

/* out = a x b; out is neither of them. */
static inline void npg_vec3_cross(double out[3], const double a[3], const double b[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* Scale to length 1; false, and nothing is changed, where the length is 0 (or no number). */
static inline bool npg_vec3_make_unit(double v[3])
{
    double length = npg_vec3_length(v);
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length > 0;
}

/* Two unit vectors that span the plane across n, which is one, too: right-handed, x first. */
static inline void npg_vec3_span_plane(double x[3], double y[3], const double n[3])
{
    int least = fabs(n[0]) < fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) < fabs(n[least])) least = 2;
    npg_vec3_cross(x, (const double[3]){least == 0, least == 1, least == 2}, n);
    npg_vec3_make_unit(x);
    npg_vec3_cross(y, n, x);
}

static inline bool npg_vec3_make_unitf(float v[3])
{
    float length = npg_vec3_lengthf(v);
    /* the squares of so small ones leave the range of float: normals by area in a mesh of 1e-9 units */
    if (length < 1e-18f) length = (float)npg_vec3_distance((const float[3]){0}, v);
    for (int i = 0; i < 3 && length > 0; i++) v[i] /= length;
    return length > 0;
}

/* Cross product of a face's edges from its first corner: along its normal, twice its area long. */
static inline void npg_face_cross(double out[3], const float *vert_pos, const uint32_t face[3])
{
    const float *first = vert_pos + 3 * (size_t)face[0];
    double u[3], v[3];
    npg_vec3_between(u, first, vert_pos + 3 * (size_t)face[1]);
    npg_vec3_between(v, first, vert_pos + 3 * (size_t)face[2]);
    npg_vec3_cross(out, u, v);
}

/* Unit normal, 0 for a face without area; returns the area. */
static inline double npg_face_normal(double normal[3], const float *vert_pos, const uint32_t face[3])
{
    npg_face_cross(normal, vert_pos, face);
    double length = npg_vec3_length(normal);
    for (int i = 0; i < 3; i++) normal[i] = length > 0 ? normal[i] / length : 0;
    return length / 2;
}

/* Cholesky: small dense symmetric systems, n x n, row by row; only lower halves are read and written. */

/* m = L L' in place.  m is positive definite; a square on the diagonal that rounding has taken below `least`
 * counts as that. */
static inline void npg_cholesky_factor(double *m, size_t n, double least)
{
    for (size_t j = 0; j < n; j++)
        for (size_t i = j; i < n; i++) {
            double sum = m[i * n + j];
            for (size_t k = 0; k < j; k++) sum -= m[i * n + k] * m[j * n + k];
            m[i * n + j] = i == j ? sqrt(fmax(sum, least)) : sum / m[j * n + j];
        }
}

/* x = (L L')^-1 x. */
static inline void npg_cholesky_solve(const double *l, size_t n, double *x)
{
    for (size_t i = 0; i < n; i++) {
        for (size_t k = 0; k < i; k++) x[i] -= l[i * n + k] * x[k];
        x[i] /= l[i * n + i];
    }
    for (size_t i = n; i-- > 0;) {
        for (size_t k = i + 1; k < n; k++) x[i] -= l[k * n + i] * x[k];
        x[i] /= l[i * n + i];
    }
}

/* Robust: weights of residuals, and when two normals agree; one name for each in all rooms. */

/* Standard deviations of normal noise per median deviation. */
#define NPG_DEVIATIONS_PER_MEDIAN 1.4826

/* Cosine of two normals: above it they are of one side of a thin part, below minus that of both. */
#define NPG_SAME_SIDE 0.3f

/* Below this cosine a normal speaks against another. */
#define NPG_AGAINST (-0.2)

/* Geman and McClure's weight of a residual, given squared: 1 at 0, a quarter at `width`. */
static inline double npg_geman_mcclure(double residual_sq, double width)
{
    double share = 1 / (1 + residual_sq / (width * width));
    return share * share;
}

/* Rigid: the rotation and translation that take one set of points closest to another. */

/* rotation (3 x 3, rows) and translation that make sum_i |R from_i + t - to_i|^2 least (N x 3 each); R is a
 * rotation also where a mirror would fit better.  Where the points leave it open (fewer than three, on one
 * line) it is one of the best.
 *
 * Based on: Berthold Horn, Closed-form solution of absolute orientation using unit quaternions, 1987:
 * the quaternion is the eigenvector of the largest eigenvalue of a symmetric 4 x 4 matrix
 * of the points' products. */
void npg_rigid_fit(double rotation[3][3], double translation[3], const float *from, const float *to,
                   size_t count);

/* k-d tree of N points: exact nearest neighbours on the host.
 *
 * Leaves hold about twelve points side by side, so that a leaf is searched with the processor's wide
 * registers; the points of a leaf are near each other, and so are those of the leaves that follow it, which
 * is the order to ask for all points' neighbours in (npg_kdtree_each).  Distances are (dx^2 + dy^2) + dz^2
 * in float; every result is exact in them, whatever the points look like. */

#define NPG_KDTREE_NEIGHBOURS 256 /* that npg_kdtree_each() can give */

typedef struct npg_kdtree npg_kdtree;

/* points: N x 3, finite; a loan that must outlive the tree.  1 <= N < 2^32 - 1.  NPG_MEMORY. */
npg_status npg_kdtree_open(npg_kdtree **tree, const float *points, size_t point_count);
void npg_kdtree_close(npg_kdtree **tree);

/* Bytes that a tree of so many points takes while it is made, the most it ever does. */
size_t npg_kdtree_memory(size_t point_count);

/* The k nearest points of each of M queries, nearest first; ties go to the lower index.  index and dist_sq
 * are M x k; where the tree has fewer than k points the rest is UINT32_MAX and infinity.  Uses `threads`
 * threads (0: one per core); the result does not depend on it.  NPG_MEMORY. */
npg_status npg_kdtree_nearest(const npg_kdtree *tree, uint32_t *index, float *dist_sq, const float *queries,
                              size_t query_count, size_t k, int threads);

/* The k nearest of N points (N x 3) of each query, by a tree for this call alone, on all cores. */
npg_status npg_points_nearest(uint32_t *index, float *dist_sq, const float *points, size_t point_count,
                              const float *queries, size_t query_count, size_t k);

/* The same in arrays of the arena's, M x k each; fails as well where an earlier take from it was refused. */
typedef struct npg_neighbours {
    uint32_t *index;
    float *dist_sq;
} npg_neighbours;
npg_status npg_neighbours_take(npg_neighbours *out, npg_arena *arena, const float *points, size_t point_count,
                               const float *queries, size_t query_count, size_t k);

/* yes[i] = whether query i has a point of the tree no farther than its own radius, given squared; in the
 * calling thread. */
void npg_kdtree_any_within(const npg_kdtree *tree, uint8_t *yes, const float *queries, const float *radius_sq,
                           size_t query_count);

/* One point of the tree and its k nearest points, itself among them, as npg_kdtree_nearest() gives them; the
 * lists are valid until it returns. */
typedef void npg_kdtree_visit(void *user, uint32_t point, const uint32_t *index, const float *dist_sq);

/* Visit all points that are not left out; where `only` is not NULL, those alone whose entry in it is not 0.
 * Points come in the tree's order, from several threads at once: a visit may write only what belongs to its
 * point.  k <= NPG_KDTREE_NEIGHBOURS. */
npg_status npg_kdtree_each(const npg_kdtree *tree, size_t k, const uint8_t *only, npg_kdtree_visit *visit,
                           void *user, int threads);

/* The tree's points in its order (N), in groups of at most NPG_KDTREE_GROUP that lie together, half of that at least where
 * there are several: first (N / (NPG_KDTREE_GROUP / 2) + 2) has where each begins, and N.  Returns how many there are. */
#define NPG_KDTREE_GROUP 64 /* about the root of what winding sums go over: near and far cost alike */
size_t npg_kdtree_groups(const npg_kdtree *tree, uint32_t *order, uint32_t *first);

/* Leave out the points whose entry in keep (N) is 0: no later search finds them. */
void npg_kdtree_leave_out(npg_kdtree *tree, const uint8_t *keep);

/* Mesh tools: properties of a triangle mesh that several stages need.  V vertices, F faces, E edges. */

/* Unit vertex normals, face normals weighted by area; a vertex without area gets (0, 0, 1).
 * normals: V x 3. */
void npg_mesh_vertex_normals(float *normals, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                             size_t face_count);

/* Give a mesh new vertex normals, of these.  NPG_MEMORY. */
npg_status npg_mesh_make_normals(npg_mesh *mesh);

static inline uint32_t npg_next_corner(uint32_t corner)
{
    return corner - corner % 3 + (corner + 1) % 3;
}

/* A directed edge of a face, from corner 3 f + k to the next one. */
typedef struct npg_half_edge {
    uint32_t lo, hi, corner;
    bool is_back; /* it goes from hi to lo */
} npg_half_edge;

static inline bool npg_same_edge(const npg_half_edge *a, const npg_half_edge *b)
{
    return a->lo == b->lo && a->hi == b->hi;
}

/* The 3 F of a mesh by edges; of one edge first those from lo to hi, then by corner.  To be given to npg_release();
 * NPG_MEMORY. */
npg_status npg_mesh_half_edges(npg_half_edge **halves, const uint32_t *faces, size_t face_count);

/* The E distinct undirected edges as vertex pairs (lower index first), sorted; *edges
 * is owned by the caller. */
npg_status npg_mesh_edges(uint32_t (**edges)[2], size_t *edge_count, const uint32_t *faces,
                          size_t face_count);

/* Vertices along the edges of each, in the order of npg_mesh_edges(): those of v are of[start[v]] up to, and
 * without, of[start[v + 1]]. */
typedef struct npg_mesh_neighbours {
    uint32_t *start, *of; /* V + 1, 2 E; owned */
} npg_mesh_neighbours;
npg_status npg_mesh_neighbours_open(npg_mesh_neighbours *neighbours, const npg_mesh *mesh);
void npg_mesh_neighbours_close(npg_mesh_neighbours *neighbours);

/* twin[3 f + k] = the half-edge (numbered so, by its first corner) of the face on the other side of the edge
 * from corner k to the next; UINT32_MAX on a border, or where an edge is not used by two faces in opposite
 * directions.  twin: F x 3. */
npg_status npg_mesh_twins(uint32_t *twin, const uint32_t *faces, size_t face_count);

/* is_border (V): whether a vertex lies on the border; *found (or NULL): whether there is one.  NPG_MEMORY. */
npg_status npg_mesh_border(uint8_t *is_border, bool *found, const npg_mesh *mesh);

/* out (width) = the mean over a face's corners of rows (V x width), by a hit's weights. */
static inline void npg_hit_blend(float *out, const npg_surface_hit *hit, const uint32_t *faces,
                                 const float *rows, size_t width)
{
    const uint32_t *corners = faces + 3 * (size_t)hit->face;
    for (size_t i = 0; i < width; i++) {
        out[i] = 0;
        for (size_t k = 0; k < 3; k++) out[i] += hit->weights[k] * rows[width * corners[k] + i];
    }
}

/* Whether the closest point of the surface lies on its border: corners are those of the face that was hit. */
static inline bool npg_hit_on_border(const npg_surface_hit *hit, const uint32_t corners[3],
                                     const uint8_t *is_border)
{
    float on_border = 0;
    for (int k = 0; k < 3; k++)
        if (is_border[corners[k]]) on_border += hit->weights[k];
    return on_border >= 0.999f; /* weights of 1 on border vertices, but for rounding */
}

/* Component of every vertex (0.. *component_count - 1, in order of first vertex) over the faces; vertices
 * without a face are components of their own. */
npg_status npg_mesh_components(uint32_t *component_of, size_t *component_count, size_t vert_count,
                               const uint32_t *faces, size_t face_count);

/* How many those are. */
npg_status npg_mesh_count_components(size_t *count, const npg_mesh *mesh);

/* The mean of a face's three vertices. */
void npg_face_middle(float middle[3], const float *vert_pos, const uint32_t face[3]);

/* Area of one face, and signed volume and area of all (positive volume: faces look outward). */
double npg_face_area(const float *vert_pos, const uint32_t face[3]);
double npg_mesh_area(const npg_mesh *mesh);
double npg_mesh_volume(const npg_mesh *mesh);

/* A third of the area of the faces around each vertex (V), and their sum. */
double npg_vertex_areas(double *areas, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                        size_t face_count);

/* Edges by the number of faces that use them, and faces that use one in the wrong direction. */
typedef struct npg_manifold {
    size_t edge_count, border_edges, crowded_edges /* > 2 faces */, misoriented_edges, degenerate_faces,
        unused_vertices;
} npg_manifold;
npg_status npg_mesh_manifold(npg_manifold *out, const npg_mesh *mesh);

/* NPG_BAD_INPUT, naming the file and the first vertex whose position is not finite. */
npg_status npg_mesh_require_finite(const npg_mesh *mesh, const char *path);

/* Handles of all components together, by Euler:
 * (2 components - vertices + edges - faces - border loops) / 2. */
npg_status npg_mesh_handles(int64_t *handles, const npg_mesh *mesh);

/* A mesh of these faces over the whole's vertices: those that they use, in order, with their data (of corners:
 * without), and which of the whole each one is; both are the caller's. */
npg_status npg_mesh_of_faces(npg_mesh **out, uint32_t **which, const npg_mesh *whole, const uint32_t *faces,
                             size_t face_count);

/* Keep the faces whose keep_face is not 0 and the vertices they use, likewise. */
npg_status npg_mesh_keep_faces(npg_mesh **mesh, const uint8_t *keep_face);

/* out (count x 3) = the rows of rows (x 3) that which[] names. */
void npg_rows_gather(float *out, const float *rows, const uint32_t *which, size_t count);

/* The i-th of `count` directions that are spread evenly over the sphere (a Fibonacci lattice). */
static inline void npg_direction_spread(double direction[3], size_t i, size_t count)
{
    const double turn = 2.399963229728653; /* the golden angle */
    double z = 1 - (2 * (double)i + 1) / (double)count, r = sqrt(1 - z * z);
    direction[0] = r * cos(turn * (double)i);
    direction[1] = r * sin(turn * (double)i);
    direction[2] = z;
}

/* Which of n things is the i-th of `count` that are spread evenly over them. */
static inline size_t npg_spread_index(size_t i, size_t count, size_t n)
{
    return i * n / count;
}

/* Copy at most `most` of the points (N x 3), evenly by their order, and of their normals where there are any.
 * Returns how many. */
size_t npg_points_spread(float *out, float *out_normals, size_t most, const float *points,
                         const float *normals, size_t point_count);

/* Keep the points (N x 3), and their normals (or NULL), whose keep is not 0, in order; returns how many. */
size_t npg_points_keep(float *points, float *normals, size_t point_count, const uint8_t *keep);

/* Sets: which things belong together, as a forest of parents (union-find).
 *
 * parent[i] = i makes i a set of its own.  The lowest member of a set is its root, so that the result does
 * not depend on the order of the joins. */

/* The lowest member of i's set; the way there is shortened. */
static inline uint32_t npg_set_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static inline void npg_set_join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = npg_set_root(parent, a);
    b = npg_set_root(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
}

/* Patch: the largest connected part of a surface whose vertices are marked. */

typedef struct npg_patch {
    double share;  /* of the surface's area; 0 where no vertex is marked      */
    float at[3];   /* mean of its vertices, weighted by area; NaN without any */
    double radius; /* from there to its farthest vertex; 0 without any        */
} npg_patch;

/* The largest by area; marked vertices belong together where an edge of the mesh joins them.  is_marked: V;
 * vert_pos: V x 3, the mesh in any pose; vert_areas: V, of that pose (npg_vertex_areas()); position, radius
 * and areas in its unit.  NPG_MEMORY. */
npg_status npg_patch_largest(npg_patch *patch, const uint8_t *is_marked, const float *vert_pos,
                             const double *vert_areas, const npg_mesh *mesh);

/* The same of N things at pos (N x 3) that were joined (npg_set_join()), by weight (NULL: 1 each); is_marked
 * NULL: all are. */
npg_status npg_patch_of_sets(npg_patch *patch, uint32_t *parents, const uint8_t *is_marked, const float *pos,
                             const double *weights, size_t count);

/* Query: what the library itself asks of a surface beyond the public npg_surface_closest() (neupig.h):
 * closest points with a hint where to begin, and rays.
 *
 * All functions are thread-safe among themselves (not beside npg_surface_move), split their batch over
 * `threads` threads (0: one per core) and give the same answer for every number of threads. */

/* The closest surface point (closest face: the smallest squared distance as float, ties to the lower face
 * index).  hits[i] for points[i] (N x 3).  start_face (N, or NULL) names a face that is likely near; the
 * search then begins with the distance to it: it only saves time, where it is wrong (out of range, too) the
 * answer is the same.  A point that is not finite gets face = UINT32_MAX and dist_sq = infinity.  NPG_MEMORY. */
npg_status npg_surface_closest_near(const npg_surface *surface, npg_surface_hit *hits, const float *points,
                                    size_t point_count, const uint32_t *start_face, int threads);

/* The same of a mesh as it lies, without hints, on all cores. */
npg_status npg_mesh_closest(npg_surface_hit *hits, const npg_mesh *mesh, const float *points,
                            size_t point_count);

typedef struct npg_ray {
    float origin[3], direction[3]; /* any length; t is measured in lengths of the direction */
    float t_min, t_max;
} npg_ray;

typedef struct npg_ray_hit {
    uint32_t face;    /* UINT32_MAX: nothing hit              */
    float weights[3]; /* barycentric weights of the point hit */
    float t;          /* where; infinity without a hit        */
    bool is_back;     /* the face was hit from its back       */
} npg_ray_hit;

/* The first face each of N rays meets within t_min..t_max, from either side. */
npg_status npg_surface_rays(const npg_surface *surface, npg_ray_hit *hits, const npg_ray *rays,
                            size_t ray_count, int threads);

/* The exact closest point of one face to p: weights and squared distance (computed in double, relative to p,
 * so that it stays exact far from the origin).  Degenerate faces count as their edges. */
void npg_face_closest(npg_surface_hit *hit, const float *vert_pos, const uint32_t *faces, uint32_t face,
                      const float p[3]);

/* Metrics: how close a predicted mesh sequence is to a ground truth, by the measures of the method's paper.
 *
 * Both surfaces are sampled uniformly by area.  With a the samples of the prediction, b those of the truth,
 * d the distance from a sample to the nearest one of the other side in units of `diagonal`, n their face
 * normals:
 *
 *   CD    0.5 (mean d(a,b)^2 + mean d(b,a)^2) x 1e5
 *   NC    0.5 (mean |n_a . n_b| both ways)
 *   F     harmonic mean of precision (share of a with d <= tau) and recall (share of b with d <= tau)
 *   Corr  every predicted vertex is tied to the nearest vertex of the truth in the first frame; the mean
 *         distance between the two in a later frame
 *
 * Meshes must have been read relative to the same origin.  The same input gives the same figures. */

typedef struct npg_metrics_settings {
    size_t sample_count; /* on either side                                                 */
    double tau;          /* of the F-score, in diagonals: 0.005                            */
    double diagonal;     /* of the box of the first frame's truth, in the meshes' own unit */
    uint64_t seed;
} npg_metrics_settings;

/* Fill cd to recall of one frame.  A truth without faces is a cloud: all its points stand for the samples, and its
 * vert_normals, if any, for the normals.  NPG_BAD_INPUT for a prediction without area or a truth without
 * points; NPG_MEMORY.  Cost: O(S log S) for S samples; memory about 80 S bytes. */
npg_status npg_metrics_compare(npg_eval_figures *out, const npg_mesh *predicted, const npg_mesh *truth,
                               const npg_metrics_settings *settings, uint64_t frame);

/* For every predicted vertex the nearest vertex of the truth; *truth_of (V entries) is the caller's. */
npg_status npg_metrics_tie(uint32_t **truth_of, const npg_mesh *predicted, const npg_mesh *truth);

/* Mean distance of the tied vertices in a frame, in diagonals. */
double npg_metrics_drift(const npg_mesh *predicted, const npg_mesh *truth, const uint32_t *truth_of,
                         double diagonal);

/* S samples of a mesh, uniform by area: positions (S x 3), unit face normals (S x 3; zero for a face without
 * area).  NPG_BAD_INPUT when the mesh has no area. */
npg_status npg_mesh_sample(float *pos, float *normals, const npg_mesh *mesh, size_t sample_count,
                           uint64_t seed, uint64_t frame, uint64_t purpose);

/* Diagonal of the box of N x 3 points. */
double npg_points_diagonal(const float *points, size_t point_count);

/* Skinning: where points of a deformed surface's neighbourhood are when the surface is at rest.
 *
 *     x = c + R^T (p - c')
 *
 * c' is the point of the deformed surface closest to p, c the same point of the reference, R the rotation of
 * the surface there: its faces' frames, averaged over the neighbourhood. */

typedef struct npg_skin npg_skin;

/* A point at rest, and the surface it was carried by. */
typedef struct npg_skinned {
    float point[3];  /* x */
    float normal[3]; /* the point's own, turned back; without one the surface's */
    float foot[3];   /* c */
    float facing[3]; /* the surface's normal at c */
    float offset;    /* (p - c') along the deformed surface's normal */
    float dist;      /* |p - c'| */
    bool is_beyond;  /* c' is on the surface's border: the point lies past what is known */
    float agreement; /* cosine of the point's normal and the surface's; 1 without one */
} npg_skinned;

/* A counted reference of the mesh is kept.  NPG_MEMORY. */
npg_status npg_skin_open(npg_skin **skin, npg_mesh *reference);
void npg_skin_close(npg_skin **skin);

/* Whether the reference has a border. */
bool npg_skin_is_open(const npg_skin *skin);

/* The surface is now where vert_unit (V x 3) says. */
void npg_skin_pose(npg_skin *skin, const float *vert_unit);

/* out (N) of points (N x 3, unit) with their normals (N x 3, or NULL).  Uses all cores; the result does not
 * depend on how many.  The reference has normals.  NPG_MEMORY. */
npg_status npg_skin_to_rest(npg_skin *skin, npg_skinned *out, const float *points, const float *normals,
                            size_t count);

/* The other way: where a place near the surface at rest is now, p = c' + R (place - c).  hit: the point of
 * the reference that it hangs on.  Thread-safe but for npg_skin_pose(). */
void npg_skin_from_rest(const npg_skin *skin, float now[3], const npg_surface_hit *hit, const float place[3]);

/* Bytes that it takes at most. */
size_t npg_skin_memory(size_t vert_count, size_t points);

/* Attach: points tied to a surface, carried along when it moves: each hangs on the closest point of the surface at
 * rest as npg_skin_from_rest() has it, so that one on the surface stays on it, one off it keeps its distance, and a
 * rigid motion is followed exactly.  Directions (normals) turn by the same R.  For one thread at a time. */

typedef struct npg_attachment npg_attachment;

/* Tie N points (N x 3, in the unit of rest->vert_pos) to a mesh at rest.  normals (N x 3, unit length)
 * may be NULL; with them a point of a thin part is tied to the side its normal looks to:
 * where the closest face looks the other way and one that looks its way lies on the line of the normal
 * within reach (NPG_ATTACH_REACH of the mesh's diagonal), it takes that one.  Both are copied;
 * the mesh is held by reference.  NPG_BAD_INPUT names the first point that is not finite; NPG_USAGE
 * for a mesh without faces; NPG_MEMORY. */
npg_status npg_attach_open(npg_attachment **attachment, npg_mesh *rest, const float *points,
                           const float *normals, size_t point_count);

#define NPG_ATTACH_REACH 0.02 /* of the diagonal: parts that thin have two sides so near; set by trial */

/* Points tied farther away than dist (in the mesh's unit), and the worst of them: its number, and the largest
 * distance of all points.  *worst is 0 without points. */
void npg_attach_far(const npg_attachment *attachment, double dist, size_t *far_count, size_t *worst,
                    double *worst_dist);

/* Where the points are when the mesh's vertices are at vert_pos (V x 3): pos N x 3; normals N x 3 or NULL,
 * only with normals at open. */
npg_status npg_attach_move(npg_attachment *attachment, const float *vert_pos, double *pos, float *normals);

/* NULL inside is fine. */
void npg_attach_close(npg_attachment **attachment);

/* Proxy: a decimated copy of a mesh whose vertices are vertices of it.
 *
 * What is true of a vertex of the copy (its position in a frame, what carries it) is read from the whole
 * mesh's rows, so that a step of the fit costs the same however fine the reference is. */

/* Vertices of the surface that frames are aligned and matched with: where the reference has more, it is
 * thinned for that.  By trial: above, distances to it gain nothing, and only the time grows
 * (tests/bed/decisions.md, "Fine references"). */
#define NPG_PROXY_SURFACE 10000

typedef struct npg_proxy {
    npg_mesh *mesh;   /* T vertices, with what the whole's have; counted reference */
    uint32_t *vertex; /* T, ascending: which vertex of the whole each one is                  */
} npg_proxy;

/* About vert_target vertices by edge collapse (meshoptimizer); with 0, or where no more than a fifth would
 * go, all that have a face.  whole is a loan during the call. */
npg_status npg_proxy_open(npg_proxy **proxy, const npg_mesh *whole, size_t vert_target);
void npg_proxy_close(npg_proxy **proxy);

/* out (T x 3) = the rows of rows (of the whole, x 3) that belong to the copy's vertices. */
void npg_proxy_gather(const npg_proxy *proxy, float *out, const float *rows);

/* Cells: cubes of space by key, a table of them, and a set of cubes with a value in between. */

/* In which cube of this side a point of a surface lies and which octant it faces, as 63 bits: two sides of a
 * thin part have cells of their own.  Coordinates have 20 bits: the unit box in cells of 4e-6 fits. */
uint64_t npg_cell_key(const float point[3], const float facing[3], double side);

/* The key of the cube of twice the side around a cell. */
uint64_t npg_cell_key_of_double(uint64_t key);

/* Keys, numbered in the order in which they were met (open addressing). */
typedef struct npg_cell_table {
    npg_arena arena; /* of both; the owner's arrays by number may be taken from it, too */
    uint64_t *keys;  /* count                                             */
    uint32_t *place; /* 2^bits places: the number of a key, NPG_CELL_NONE */
    size_t count, most;
    int bits;
} npg_cell_table;

#define NPG_CELL_NONE UINT32_MAX

/* Room for `most` keys.  NPG_MEMORY; the table is then to be closed all the same. */
npg_status npg_cell_table_open(npg_cell_table *table, size_t most);
void npg_cell_table_close(npg_cell_table *table);

/* The number of a key, NPG_CELL_NONE where it is new. */
uint32_t npg_cell_find(const npg_cell_table *table, uint64_t key);

/* The number of a key, the next one where it is new; there must be room. */
uint32_t npg_cell_add(npg_cell_table *table, uint64_t key);

/* Bytes of one. */
size_t npg_cell_table_memory(size_t most);

/* Cube set: cubes of one size, with a value in between: 1 in the middle of a cube of the set, 0 in the middle
 * of any other, linear along each axis from middle to middle. */
typedef struct npg_cube_set npg_cube_set;

/* middles: K x 3, of cubes [i side, (i + 1) side) of whole i.  NPG_MEMORY. */
npg_status npg_cube_set_open(npg_cube_set **set, const float *middles, size_t count, double side);
void npg_cube_set_close(npg_cube_set **set);

double npg_cube_set_side(const npg_cube_set *set);

/* 0..1 */
double npg_cube_set_value(const npg_cube_set *set, const float place[3]);

/* Colours: many samples of one place to one robust colour, and the colours of a cloud to vertices.
 *
 * All colours are sRGB as cameras and scanners write it, one byte a channel. */

/* Alpha of a colour that was seen, and of one that its neighbours lent.  Both are opaque for every viewer. */
#define NPG_COLOUR_SEEN 255
#define NPG_COLOUR_LENT 254

#define NPG_COLOUR_STEP  16 /* levels between two knots */
#define NPG_COLOUR_KNOTS 17 /* 0, 16, .. 256            */

/* Samples of one place: per channel a histogram over knots.  A sample is shared between its two knots so that
 * their mean is the sample; so means over knots are exact, in 102 bytes however many samples come (beyond
 * four thousand the earlier ones count half). */
typedef struct npg_colour_sums {
    uint16_t knots[3][NPG_COLOUR_KNOTS];
} npg_colour_sums;

void npg_colour_add(npg_colour_sums *sums, const uint8_t rgb[3]);

/* The mean of the samples that lie within two knots of the median, per channel: highlights, and what an
 * occluder left, do not count.  False, and 0, without a sample. */
bool npg_colour_mean(uint8_t rgb[3], const npg_colour_sums *sums);

/* A cloud with colours. */
typedef struct npg_coloured {
    const float *points;    /* N x 3                                  */
    const float *normals;   /* N x 3 or NULL                          */
    const uint8_t *colours; /* N x 4; alpha 0: this point has no colour */
    size_t count;
} npg_coloured;

/* out (V x 4) = colours of the vertices (V x 3, normals V x 3): the mean of the nearest points, weighted by
 * distance, whose normals face the same way; alpha NPG_COLOUR_SEEN.  All 0 for a vertex without such a point
 * within `reach` or three spacings of the points, what is more.  Uses all cores; the result does not depend
 * on how many.  NPG_MEMORY. */
npg_status npg_colour_vertices(uint8_t *out, const float *verts, const float *normals, size_t vert_count,
                               const npg_coloured *cloud, double reach);

/* Vertices without a colour (alpha 0) take the mean of their coloured neighbours, from the rim inwards, with
 * alpha NPG_COLOUR_LENT; pieces without any colour become grey. */
npg_status npg_colour_fill(uint8_t *colours, const npg_mesh *mesh);

#endif
