/* Mesh tools: properties of a triangle mesh that several stages need.  V vertices, F faces, E edges. */
#ifndef NPG_MESH_TOOLS_H
#define NPG_MESH_TOOLS_H

#include "pipeline/mesh.h"

/* Unit vertex normals, face normals weighted by area; a vertex without area gets (0, 0, 1).
 * normals: V x 3. */
void npg_mesh_vertex_normals(float *normals, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                             size_t face_count);

/* Give a mesh new vertex normals, of these.  NPG_MEMORY. */
npg_status npg_mesh_make_normals(npg_mesh *mesh);

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

/* Keep the faces whose keep_face is not 0 and the vertices they use, in order.
 * Vertex data goes with them. */
npg_status npg_mesh_keep_faces(npg_mesh **mesh, const uint8_t *keep_face);

/* out (count x 3) = the rows of rows (x 3) that which[] names. */
void npg_rows_gather(float *out, const float *rows, const uint32_t *which, size_t count);

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

#endif
