/* Membrane: Gauss and Seidel's sweeps over the unseen vertices, in their order; and the second side of a shell. */
#include "mesh/mesh_internal.h"

#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"

#define SWEEPS_MOST   400
#define RELAXATION    1.7  /* beyond the mean: successive over-relaxation */
#define SWEEPS_PUSHED 100  /* pushed and drawn, nothing settles */
#define PUSH          0.3  /* of a cube's side */
#define PUSHES_MOST   10   /* of a vertex, in a sweep */
#define WELL_IN       0.9  /* of a cube's value: not at the border */
#define SETTLED       1e-5 /* of the unit box: a sweep that moves nothing farther ends it */

/* How far the vertex went. */
static double relax(npg_mesh *mesh, const npg_mesh_neighbours *r, size_t v)
{
    double mean[3] = {0, 0, 0}, moved = 0;
    size_t count = r->start[v + 1] - r->start[v];
    for (uint32_t i = r->start[v]; i < r->start[v + 1]; i++)
        for (size_t a = 0; a < 3; a++) mean[a] += (double)mesh->vert_pos[3 * (size_t)r->of[i] + a];
    for (size_t a = 0; a < 3 && count; a++) {
        float *x = &mesh->vert_pos[3 * v + a];
        double step = RELAXATION * (mean[a] / (double)count - (double)*x);
        *x += (float)step;
        moved += step * step;
    }
    return sqrt(moved);
}

enum { STAYS, DOUBTFUL, UNSEEN, MOVES, PUSHED /* moves, and was in empty space */ };

/* From the vertices that are `from`, over those that are `over`: what is reached becomes `to`.  Returns how many;
 * `ends` (V) is for their list. */
static size_t spread(uint8_t *kind, uint32_t *ends, const npg_mesh_neighbours *r, size_t n, uint8_t from,
                     uint8_t over, uint8_t to)
{
    size_t count = 0, reached = 0;
    for (size_t v = 0; v < n; v++)
        if (kind[v] == from) ends[count++] = (uint32_t)v;
    for (size_t i = 0; i < count; i++)
        for (uint32_t at = r->start[ends[i]]; at < r->start[ends[i] + 1]; at++) {
            uint32_t v = r->of[at];
            if (kind[v] != over) continue;
            kind[v] = to;
            ends[count++] = v;
            reached++;
        }
    return reached;
}

/* Poisson's balloon begins where points end, and is near them there: with what is farther from all points than
 * seen_dist goes what hangs on it and is farther than half of that.  Unseen vertices move where their piece of the mesh
 * has seen ones; without any they would fall into a point. */
static size_t choose_moving(uint8_t *kind, uint32_t *ends, const npg_mesh_neighbours *r, const float *dist,
                            size_t n, double seen_dist)
{
    for (size_t v = 0; v < n; v++)
        kind[v] = (double)dist[v] > seen_dist ? UNSEEN : 2 * (double)dist[v] > seen_dist ? DOUBTFUL : STAYS;
    spread(kind, ends, r, n, UNSEEN, DOUBTFUL, UNSEEN);
    for (size_t v = 0; v < n; v++)
        if (kind[v] == DOUBTFUL) kind[v] = STAYS;
    return spread(kind, ends, r, n, STAYS, UNSEEN, MOVES);
}

/* What moves, and what keeps it from where it may not be. */
typedef struct moving {
    npg_mesh *mesh;
    npg_mesh_neighbours r;
    uint8_t *kind;             /* V */
    const npg_cube_set *empty; /* or NULL */
    npg_ray *inward;           /* V: from the flat surface, where there is an empty space */
    npg_ray_hit *facing;       /* V: the side opposite, which is pushed the other way     */
} moving;

/* Whether a vertex that goes a step inward of the flat surface stays on its side of the middle. */
static bool has_room(const moving *m, size_t v, double step)
{
    const npg_ray *way = &m->inward[v];
    double gone = 0;
    for (size_t a = 0; a < 3; a++)
        gone += (double)(m->mesh->vert_pos[3 * v + a] - way->origin[a]) * (double)way->direction[a];
    return gone + step <= (double)m->facing[v].t / 2;
}

/* A vertex in empty space goes inward, out of it; how far. */
static double push(const moving *m, size_t v)
{
    double step = PUSH * npg_cube_set_side(m->empty), moved = 0;
    float *x = &m->mesh->vert_pos[3 * v];
    for (int i = 0; i < PUSHES_MOST && npg_cube_set_value(m->empty, x) > NPG_MAJORITY; i++) {
        if (!has_room(m, v, step)) break;
        for (size_t a = 0; a < 3; a++) x[a] += (float)step * m->inward[v].direction[a];
        moved += step;
        m->kind[v] = PUSHED;
    }
    return moved;
}

static void sweep(const moving *m, int most, bool pushes)
{
    double largest = 1;
    for (int i = 0; i < most && largest > SETTLED; i++) {
        largest = 0;
        for (size_t v = 0; v < m->mesh->vert_count; v++)
            if (m->kind[v] >= MOVES)
                largest = fmax(largest, relax(m->mesh, &m->r, v) + (pushes ? push(m, v) : 0));
    }
}

/* Inward is where the flat surface says: a surface on its way, folded for a moment, would push itself out.  Between
 * thin parts all is empty: what spans them would come out on the far side, but both sides meet in the middle. */
static npg_status push_out(const moving *m, float *normals)
{
    const npg_mesh *mesh = m->mesh;
    npg_surface *flat;
    npg_mesh_vertex_normals(normals, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        npg_ray *way = &m->inward[v];
        for (size_t a = 0; a < 3; a++) {
            way->origin[a] = mesh->vert_pos[3 * v + a];
            way->direction[a] = -normals[3 * v + a];
        }
        way->t_min = (float)(NPG_FEW * npg_cube_set_side(m->empty));
        way->t_max = INFINITY;
    }
    NPG_TRY(npg_surface_open(&flat, mesh->vert_pos, mesh->vert_count, mesh->faces, mesh->face_count));
    npg_status status = npg_surface_rays(flat, m->facing, m->inward, mesh->vert_count, 1);
    npg_surface_close(&flat);
    if (!status) sweep(m, SWEEPS_PUSHED, true);
    return status;
}

npg_status npg_mesh_fair(npg_mesh *mesh, npg_faired *done, const float *points, size_t point_count,
                         double seen_dist, const npg_cube_set *empty)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    moving m = {.mesh = mesh, .empty = empty};
    size_t n = mesh->vert_count;
    bool any = false;
    *done = (npg_faired){0};
    m.kind = npg_arena_take(&scratch, n, sizeof *m.kind);
    float *normals = npg_arena_take(&scratch, empty ? n : 0, 3 * sizeof *normals);
    m.inward = npg_arena_take(&scratch, empty ? n : 0, sizeof *m.inward);
    m.facing = npg_arena_take(&scratch, empty ? n : 0, sizeof *m.facing);
    uint32_t *ends = npg_arena_take(&scratch, n, sizeof *ends);
    float *dist = npg_arena_take(&scratch, n, sizeof *dist);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_points_dist(dist, mesh->vert_pos, n, points, point_count);
    for (size_t v = 0; v < n && !status && !any; v++) any = (double)dist[v] > seen_dist;
    if (any) status = npg_mesh_neighbours_open(&m.r, mesh);
    if (any && !status) done->moved = choose_moving(m.kind, ends, &m.r, dist, n, seen_dist);
    if (done->moved) sweep(&m, SWEEPS_MOST, false);
    if (done->moved && empty) status = push_out(&m, normals);
    for (size_t v = 0; v < n && done->moved; v++) done->pushed += m.kind[v] == PUSHED;
    npg_mesh_neighbours_close(&m.r);
    npg_arena_release(&scratch);
    return status;
}

/* ---- the second side of a shell ---- */

/* back[v]: the vertex behind v, of a piece with a border; else UINT32_MAX.  *count: how many there are. */
static npg_status number_backs(uint32_t *back, size_t *count, const npg_mesh *mesh, const uint32_t *twin)
{
    size_t n = mesh->vert_count;
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    uint32_t *piece = npg_arena_take(&scratch, n, sizeof *piece);
    uint8_t *is_open = npg_arena_take(&scratch, n, 1);
    npg_status status = npg_arena_status(&scratch);
    size_t halves = status ? 0 : 3 * mesh->face_count;
    for (size_t v = 0; v < n && !status; v++) piece[v] = (uint32_t)v;
    for (size_t h = 0; h < halves; h++)
        npg_set_join(piece, mesh->faces[h], mesh->faces[h - h % 3 + (h + 1) % 3]);
    for (size_t h = 0; h < halves; h++)
        if (twin[h] == UINT32_MAX) is_open[npg_set_root(piece, mesh->faces[h])] = 1;
    for (size_t v = 0; v < n && !status; v++)
        back[v] = is_open[npg_set_root(piece, (uint32_t)v)] ? (uint32_t)(n + (*count)++) : UINT32_MAX;
    npg_arena_release(&scratch);
    return status;
}

static void put_face(npg_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    const uint32_t face[3] = {a, b, c};
    memcpy(mesh->faces + 3 * mesh->face_count++, face, sizeof face);
}

/* The faces of the second side, which look the other way, and a strip of two for each edge of the border. */
static void add_backs(npg_mesh *out, const npg_mesh *mesh, const uint32_t *back, const uint32_t *twin)
{
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *v = mesh->faces + 3 * f;
        if (back[v[0]] == UINT32_MAX) continue;
        put_face(out, back[v[0]], back[v[2]], back[v[1]]);
        for (size_t k = 0; k < 3; k++) {
            uint32_t a = v[k], b = v[(k + 1) % 3];
            if (twin[3 * f + k] != UINT32_MAX) continue;
            put_face(out, b, a, back[a]);
            put_face(out, b, back[a], back[b]);
        }
    }
}

static npg_status double_shell(npg_mesh **slot, const uint32_t *back, size_t back_count, const uint32_t *twin)
{
    npg_mesh *mesh = *slot, *out;
    size_t borders = 0, faces = mesh->face_count;
    for (size_t h = 0; h < 3 * faces; h++) borders += twin[h] == UINT32_MAX;
    NPG_TRY(npg_mesh_open(&out, mesh->vert_count + back_count, 2 * (faces + borders)));
    memcpy(out->vert_pos, mesh->vert_pos, mesh->vert_count * 3 * sizeof *out->vert_pos);
    memcpy(out->faces, mesh->faces, faces * 3 * sizeof *out->faces);
    for (size_t v = 0; v < mesh->vert_count; v++)
        if (back[v] != UINT32_MAX)
            memcpy(out->vert_pos + 3 * (size_t)back[v], mesh->vert_pos + 3 * v, 3 * sizeof *out->vert_pos);
    out->face_count = faces;
    add_backs(out, mesh, back, twin);
    npg_mesh_unref(slot);
    *slot = out;
    return NPG_OK;
}

/* Draw the vertices from `first` on tight. */
static npg_status draw_tight(npg_mesh *mesh, size_t first)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    moving m = {.mesh = mesh};
    m.kind = npg_arena_take(&scratch, mesh->vert_count, sizeof *m.kind);
    npg_status status = npg_arena_status(&scratch);
    if (!status) memset(m.kind + first, MOVES, mesh->vert_count - first);
    if (!status) status = npg_mesh_neighbours_open(&m.r, mesh);
    if (!status) sweep(&m, SWEEPS_MOST, false);
    npg_mesh_neighbours_close(&m.r);
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_mesh_close(npg_mesh **mesh, size_t *added)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t n = (*mesh)->vert_count;
    uint32_t *back = npg_arena_take(&scratch, n, sizeof *back);
    uint32_t *twin = npg_arena_take(&scratch, (*mesh)->face_count, 3 * sizeof *twin);
    npg_status status = npg_arena_status(&scratch);
    *added = 0;
    if (!status) status = npg_mesh_twins(twin, (*mesh)->faces, (*mesh)->face_count);
    if (!status) status = number_backs(back, added, *mesh, twin);
    if (!status && *added) status = double_shell(mesh, back, *added, twin);
    if (!status && *added) status = draw_tight(*mesh, n);
    npg_arena_release(&scratch);
    return status;
}

double npg_mesh_share_in(const npg_mesh *mesh, const npg_cube_set *cubes)
{
    double all = 0, in = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        double area = npg_face_area(mesh->vert_pos, face);
        float middle[3];
        npg_face_middle(middle, mesh->vert_pos, face);
        all += area;
        if (npg_cube_set_value(cubes, middle) > WELL_IN) in += area;
    }
    return all > 0 ? in / all : 0;
}
