/* Synthetic bodies: from a distance field to a closed manifold with even triangles. */
#include <math.h>
#include <string.h>

#include "tools/synth/synth.h"

/* Each cube is cut into six tetrahedra around its diagonal, so that neighbours
 * share their faces' cuts and the result is closed and manifold by construction.
 * Corner c of a cube is at (c & 1, c >> 1 & 1, c >> 2). */
static const int tetrahedra[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                     {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};

typedef struct field {
    npg_arena arena; /* of what follows      */
    size_t size[3];  /* nodes along each axis */
    double lo[3], cell;
    double *value;      /* at every node; never 0                                          */
    uint32_t (*cut)[7]; /* the vertex on the edge from a node in each of 7 directions, + 1 */
    float *vert_pos;
    uint32_t *faces;
    size_t vert_count, vert_room, face_count, face_room;
} field;

static void node_position(const field *f, size_t node, double p[3])
{
    size_t at[3] = {node % f->size[0], node / f->size[0] % f->size[1], node / f->size[0] / f->size[1]};
    for (int k = 0; k < 3; k++) p[k] = f->lo[k] + f->cell * (double)at[k];
}

static npg_status open_field(field *f, npg_distance_fn *distance, const void *user, const double lo[3],
                             const double hi[3], double cell)
{
    size_t count = 1;
    *f = (field){.arena = {.purpose = NPG_FOR_MESH}, .cell = cell};
    for (int k = 0; k < 3; k++) {
        f->lo[k] = lo[k];
        f->size[k] = (size_t)ceil((hi[k] - lo[k]) / cell) + 1;
        count *= f->size[k];
    }
    f->value = npg_arena_take(&f->arena, count, sizeof *f->value);
    f->cut = npg_arena_take(&f->arena, count, sizeof *f->cut);
    NPG_TRY(npg_arena_status(&f->arena));
    for (size_t n = 0; n < count; n++) {
        double p[3];
        node_position(f, n, p);
        f->value[n] = distance(p, user);
        if (fabs(f->value[n]) < 1e-9) f->value[n] = 1e-9; /* no vertex lies on a node: each is on one edge */
    }
    return NPG_OK;
}

/* The node at a corner of the cube that begins at a node. */
static size_t node_at(const field *f, size_t cube, int corner)
{
    return cube + (size_t)(corner & 1) +
           f->size[0] * ((size_t)(corner >> 1 & 1) + f->size[1] * (size_t)(corner >> 2));
}

/* The vertex where the edge between two corners crosses the surface, made when first asked for. */
static npg_status cut_edge(field *f, size_t cube, int from, int to, uint32_t *vertex)
{
    size_t a = node_at(f, cube, from < to ? from : to), b = node_at(f, cube, from < to ? to : from);
    uint32_t *slot = &f->cut[a][(from ^ to) - 1]; /* the corners of an edge lie one behind the other */
    if (!*slot) {
        double pa[3], pb[3], t = f->value[a] / (f->value[a] - f->value[b]);
        NPG_TRY(npg_arena_grow(&f->arena, &f->vert_pos, &f->vert_room, f->vert_count + 1, 3 * sizeof(float)));
        node_position(f, a, pa);
        node_position(f, b, pb);
        t = fmin(fmax(t, 0.05), 0.95); /* vertices that nearly coincide would give faces without area */
        for (int k = 0; k < 3; k++) f->vert_pos[3 * f->vert_count + k] = (float)(pa[k] + t * (pb[k] - pa[k]));
        *slot = (uint32_t)++f->vert_count;
    }
    *vertex = *slot - 1;
    return NPG_OK;
}

static npg_status add_face(field *f, uint32_t a, uint32_t b, uint32_t c)
{
    NPG_TRY(npg_arena_grow(&f->arena, &f->faces, &f->face_room, f->face_count + 1, 3 * sizeof *f->faces));
    memcpy(f->faces + 3 * f->face_count++, (uint32_t[3]){a, b, c}, 3 * sizeof(uint32_t));
    return NPG_OK;
}

/* The corners come in an order of positive orientation. */
static npg_status march_tetrahedron(field *f, size_t cube, const int corner[4])
{
    int inside[4], outside[4], in = 0, out = 0;
    uint32_t v[4];
    for (int c = 0; c < 4; c++) {
        if (f->value[node_at(f, cube, corner[c])] < 0)
            inside[in++] = c;
        else
            outside[out++] = c;
    }
    if (!in || !out) return NPG_OK;
    if (in == 2) {
        for (int e = 0; e < 4; e++)
            NPG_TRY(cut_edge(f, cube, corner[inside[e == 1 || e == 2]], corner[outside[e >= 2]], &v[e]));
        /* v: (i0,o0) (i1,o0) (i1,o1) (i0,o1), a quad; its sense follows the parity
         * of the order of corners. */
        bool odd = (inside[0] + inside[1]) % 2 == 0;
        NPG_TRY(odd ? add_face(f, v[0], v[1], v[2]) : add_face(f, v[0], v[2], v[1]));
        return odd ? add_face(f, v[0], v[2], v[3]) : add_face(f, v[0], v[3], v[2]);
    }
    int apex = in == 1 ? inside[0] : outside[0], *base = in == 1 ? outside : inside;
    for (int e = 0; e < 3; e++) NPG_TRY(cut_edge(f, cube, corner[apex], corner[base[e]], &v[e]));
    bool odd = (apex % 2 == 1) == (in == 1);
    return odd ? add_face(f, v[0], v[2], v[1]) : add_face(f, v[0], v[1], v[2]);
}

static npg_status march(field *f)
{
    for (size_t z = 0; z + 1 < f->size[2]; z++)
        for (size_t y = 0; y + 1 < f->size[1]; y++)
            for (size_t x = 0; x + 1 < f->size[0]; x++)
                for (int t = 0; t < 6; t++)
                    NPG_TRY(march_tetrahedron(f, x + f->size[0] * (y + f->size[1] * z), tetrahedra[t]));
    return NPG_OK;
}

/* ---- even triangles ---- */

/* Newton's steps along the gradient of the distance. */
static void back_to_surface(float *p, npg_distance_fn *distance, const void *user, double cell)
{
    const double h = 0.01 * cell;
    for (int step = 0; step < 3; step++) {
        double at[3] = {(double)p[0], (double)p[1], (double)p[2]}, gradient[3], length_sq = 0;
        double value = distance(at, user);
        for (int k = 0; k < 3; k++) {
            double ahead[3] = {at[0], at[1], at[2]}, behind[3] = {at[0], at[1], at[2]};
            ahead[k] += h;
            behind[k] -= h;
            gradient[k] = (distance(ahead, user) - distance(behind, user)) / (2 * h);
            length_sq += gradient[k] * gradient[k];
        }
        if (length_sq < 1e-6) return;
        for (int k = 0; k < 3; k++) p[k] = (float)(at[k] - value * gradient[k] / length_sq);
    }
}

/* Move every vertex half way to the middle of its neighbours, then back onto the surface; several rounds. */
static npg_status even_out(npg_mesh *mesh, npg_distance_fn *distance, const void *user, double cell)
{
    enum { ROUNDS = 8 };
    uint32_t(*edges)[2];
    size_t edge_count;
    double *sums;
    NPG_TRY(npg_mesh_edges(&edges, &edge_count, mesh->faces, mesh->face_count));
    npg_status status = npg_alloc_array(&sums, NPG_FOR_MESH, mesh->vert_count, 4 * sizeof *sums);
    for (int round = 0; round < ROUNDS && !status; round++) {
        memset(sums, 0, mesh->vert_count * 4 * sizeof *sums);
        for (size_t e = 0; e < edge_count; e++)
            for (int end = 0; end < 2; end++) {
                double *sum = sums + 4 * (size_t)edges[e][end];
                for (int k = 0; k < 3; k++) sum[k] += (double)mesh->vert_pos[3 * (size_t)edges[e][!end] + k];
                sum[3] += 1;
            }
        for (size_t v = 0; v < mesh->vert_count; v++) {
            float *p = mesh->vert_pos + 3 * v;
            const double *sum = sums + 4 * v;
            for (int k = 0; k < 3; k++) p[k] = (float)(0.5 * (double)p[k] + 0.5 * sum[k] / sum[3]);
            back_to_surface(p, distance, user, cell);
        }
    }
    npg_release(&sums);
    npg_release(&edges);
    return status;
}

static npg_status check_closed(const npg_mesh *mesh)
{
    npg_manifold facts;
    size_t components;
    NPG_TRY(npg_mesh_manifold(&facts, mesh));
    NPG_TRY(npg_mesh_count_components(&components, mesh));
    if (facts.border_edges || facts.crowded_edges || facts.misoriented_edges || facts.degenerate_faces ||
        components != 1 || npg_mesh_volume(mesh) <= 0)
        return npg_error(NPG_FAILED,
                         "the body's surface is not one closed manifold (%zu border, %zu crowded, "
                         "%zu turned edges, %zu faces without area, %zu parts); try a smaller --cell",
                         facts.border_edges, facts.crowded_edges, facts.misoriented_edges,
                         facts.degenerate_faces, components);
    return NPG_OK;
}

npg_status npg_body_mesh(npg_mesh **out, npg_distance_fn *distance, const void *user, const double lo[3],
                         const double hi[3], double cell)
{
    field f;
    npg_mesh *mesh = NULL;
    npg_status status = open_field(&f, distance, user, lo, hi, cell);
    if (!status) status = march(&f);
    if (!status) status = npg_mesh_open(&mesh, f.vert_count, f.face_count);
    if (!status) {
        memcpy(mesh->vert_pos, f.vert_pos, f.vert_count * 3 * sizeof(float));
        memcpy(mesh->faces, f.faces, f.face_count * 3 * sizeof(uint32_t));
        status = even_out(mesh, distance, user, cell);
    }
    npg_arena_release(&f.arena);
    if (!status) status = check_closed(mesh);
    if (status) npg_mesh_unref(&mesh);
    *out = mesh;
    return status;
}
