/* Mesh mend: make a mesh manifold and unfolded. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "geometry/limits.h"
#include "mesh/mesh_internal.h"

#define HOLE_MAX 32 /* edges of a hole that is filled       */

/* ---- duplicate and degenerate faces ---- */

typedef struct face_key {
    uint32_t sorted[3], face;
    int parity; /* 0: an even permutation of sorted, 1: the other way round */
} face_key;

static face_key key_of(const uint32_t *face, uint32_t f)
{
    face_key key = {{face[0], face[1], face[2]}, f, 0};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            if (key.sorted[k] > key.sorted[k + 1]) {
                uint32_t swap = key.sorted[k];
                key.sorted[k] = key.sorted[k + 1];
                key.sorted[k + 1] = swap;
                key.parity ^= 1;
            }
    return key;
}

static int same_face(const face_key *a, const face_key *b)
{
    return !memcmp(a->sorted, b->sorted, sizeof a->sorted);
}

static int by_face(const void *left, const void *right)
{
    const face_key *a = left, *b = right;
    for (int i = 0; i < 3; i++)
        if (a->sorted[i] != b->sorted[i]) return a->sorted[i] < b->sorted[i] ? -1 : 1;
    return a->face < b->face ? -1 : a->face > b->face;
}

/* Of faces over the same three vertices, opposite ones cancel (every edge keeps its balance of directions)
 * and at most one is left. */
static void keep_one_of(const face_key *keys, size_t count, uint8_t *keep_face, npg_mending *done)
{
    ptrdiff_t balance = 0;
    for (size_t i = 0; i < count; i++) balance += keys[i].parity ? -1 : 1;
    for (size_t i = 0; i < count; i++) keep_face[keys[i].face] = 0;
    for (size_t i = 0; i < count && balance; i++)
        if (keys[i].parity == (balance < 0)) {
            keep_face[keys[i].face] = 1;
            break;
        }
    done->duplicate += count - (balance != 0);
}

/* Degenerate faces, and all but one (or all, where they cancel out) of those with the same corners go. */
static void choose_faces(uint8_t *keep_face, face_key *keys, const npg_mesh *mesh, npg_mending *done)
{
    size_t count = mesh->face_count;
    for (size_t f = 0; f < count; f++) {
        keys[f] = key_of(mesh->faces + 3 * f, (uint32_t)f);
        keep_face[f] = keys[f].sorted[0] != keys[f].sorted[1] && keys[f].sorted[1] != keys[f].sorted[2];
        done->degenerate += !keep_face[f];
    }
    if (count) qsort(keys, count, sizeof *keys, by_face);
    for (size_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && same_face(&keys[i], &keys[next]);) next++;
        if (next - i > 1 && keep_face[keys[i].face]) keep_one_of(keys + i, next - i, keep_face, done);
    }
}

static npg_status drop_faces(npg_mesh **mesh, npg_mending *done)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t count = (*mesh)->face_count, before = done->degenerate + done->duplicate;
    face_key *keys = npg_arena_take(&scratch, count, sizeof *keys);
    uint8_t *keep_face = npg_arena_take(&scratch, count, 1);
    npg_status status = npg_arena_status(&scratch);
    if (!status) choose_faces(keep_face, keys, *mesh, done);
    if (!status && done->degenerate + done->duplicate > before) status = npg_mesh_keep_faces(mesh, keep_face);
    npg_arena_release(&scratch);
    return status;
}

/* ---- one fan per vertex ---- */

/* Join the corners that two faces share along an edge both use in opposite directions.  Where more than two
 * faces meet, they are taken in pairs in their order and the pairs come apart. */
static npg_status join_corners(uint32_t *parent, const npg_mesh *mesh)
{
    npg_half_edge *halves;
    size_t count = 3 * mesh->face_count;
    NPG_TRY(npg_mesh_half_edges(&halves, mesh->faces, mesh->face_count));
    for (uint32_t c = 0; c < count; c++) parent[c] = c;
    for (size_t i = 0, back, next; i < count; i = next) {
        for (next = i + 1; next < count && npg_same_edge(&halves[i], &halves[next]);) next++;
        for (back = i; back < next && !halves[back].is_back;) back++;
        for (size_t k = i, first_back = back; k < first_back && back < next; k++, back++) {
            uint32_t a = halves[k].corner, b = halves[back].corner;
            npg_set_join(parent, a, npg_next_corner(b));
            npg_set_join(parent, npg_next_corner(a), b);
        }
    }
    npg_release(&halves);
    return NPG_OK;
}

/* number[c] of each fan's root corner c: the vertex that the fan is now; returns how many are new. */
static size_t number_fans(uint32_t *number, uint32_t *first, uint32_t *parent, const npg_mesh *mesh)
{
    size_t corners = 3 * mesh->face_count, extra = 0;
    memset(first, 0xff, mesh->vert_count * sizeof *first);
    for (uint32_t c = 0; c < corners; c++) {
        uint32_t root = npg_set_root(parent, c), v = mesh->faces[c];
        if (root != c) continue;
        number[c] = first[v] == UINT32_MAX ? v : (uint32_t)(mesh->vert_count + extra++);
        if (first[v] == UINT32_MAX) first[v] = c;
    }
    return extra;
}

static npg_status copy_fans(npg_mesh **slot, const uint32_t *number, uint32_t *parent, size_t extra)
{
    npg_mesh *mesh = *slot, *out;
    NPG_TRY(npg_mesh_open(&out, mesh->vert_count + extra, mesh->face_count));
    memcpy(out->vert_pos, mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
    for (uint32_t c = 0; c < 3 * mesh->face_count; c++) {
        out->faces[c] = number[npg_set_root(parent, c)];
        memcpy(out->vert_pos + 3 * (size_t)out->faces[c], mesh->vert_pos + 3 * (size_t)mesh->faces[c],
               3 * sizeof(float));
    }
    npg_mesh_unref(slot);
    *slot = out;
    return NPG_OK;
}

/* The corners of each fan become one vertex; the first fan of a vertex keeps it, others get a copy. */
static npg_status split(npg_mesh **slot, npg_mending *done)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    const npg_mesh *mesh = *slot;
    size_t corners = 3 * mesh->face_count, extra = 0;
    uint32_t *parent = npg_arena_take(&scratch, corners, sizeof *parent);
    uint32_t *number = npg_arena_take(&scratch, corners, sizeof *number);
    uint32_t *first = npg_arena_take(&scratch, mesh->vert_count, sizeof *first);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = join_corners(parent, mesh);
    if (!status) extra = number_fans(number, first, parent, mesh);
    if (!status && extra) status = copy_fans(slot, number, parent, extra);
    if (!status) done->split_vertices += extra;
    npg_arena_release(&scratch);
    return status;
}

/* ---- small holes ---- */

/* The border's successor of a vertex: a face uses next -> vertex and none uses vertex -> next. */
static npg_status find_border(uint32_t *next, const npg_mesh *mesh)
{
    npg_half_edge *halves;
    size_t count = 3 * mesh->face_count;
    memset(next, 0xff, mesh->vert_count * sizeof *next);
    NPG_TRY(npg_mesh_half_edges(&halves, mesh->faces, mesh->face_count));
    for (size_t i = 0, end; i < count; i = end) {
        const npg_half_edge *first = &halves[i];
        for (end = i + 1; end < count && npg_same_edge(first, &halves[end]);) end++;
        if (first->is_back != halves[end - 1].is_back) continue;
        next[first->is_back ? first->lo : first->hi] = first->is_back ? first->hi : first->lo;
    }
    npg_release(&halves);
    return NPG_OK;
}

/* The closed loop along the border from a vertex, its length; 0 if it is longer than HOLE_MAX
 * or comes back elsewhere. */
static size_t follow(uint32_t *loop, const uint32_t *next, uint32_t from)
{
    size_t count = 0;
    uint32_t at = from;
    do {
        if (count == HOLE_MAX || at == UINT32_MAX) return 0;
        loop[count++] = at;
        at = next[at];
    } while (at != from);
    return count >= 3 ? count : 0;
}

/* Fill the holes of a border of edge_count edges: a vertex and a face for each edge are enough room. */
static npg_status add_holes(npg_mesh **slot, uint32_t *next, size_t edge_count, npg_mending *done)
{
    npg_mesh *mesh = *slot, *out;
    uint32_t loop[HOLE_MAX];
    NPG_TRY(npg_mesh_open(&out, mesh->vert_count + edge_count, mesh->face_count + edge_count));
    memcpy(out->vert_pos, mesh->vert_pos, mesh->vert_count * 3 * sizeof(float));
    memcpy(out->faces, mesh->faces, mesh->face_count * 3 * sizeof(uint32_t));
    size_t vert_count = mesh->vert_count, face_count = mesh->face_count;
    for (uint32_t v = 0; v < mesh->vert_count; v++) {
        size_t count = next[v] == UINT32_MAX ? 0 : follow(loop, next, v);
        if (!count) continue;
        for (size_t k = 0; k < count; k++) next[loop[k]] = UINT32_MAX;
        done->holes++;
        if (count == 3) {
            memcpy(out->faces + 3 * face_count++, loop, 3 * sizeof *loop);
            continue;
        }
        for (size_t k = 0; k < count; k++) {
            uint32_t face[3] = {(uint32_t)vert_count, loop[k], loop[(k + 1) % count]};
            memcpy(out->faces + 3 * face_count++, face, sizeof face);
            for (size_t a = 0; a < 3; a++)
                out->vert_pos[3 * vert_count + a] += mesh->vert_pos[3 * (size_t)loop[k] + a] / (float)count;
        }
        vert_count++;
    }
    out->vert_count = vert_count;
    out->face_count = face_count;
    npg_mesh_unref(slot);
    *slot = out;
    return NPG_OK;
}

/* Holes of a few edges get a vertex in their middle (three edges: just the face).
 * Larger ones are openings. */
static npg_status fill_holes(npg_mesh **slot, npg_mending *done)
{
    uint32_t *next;
    size_t vert_count = (*slot)->vert_count, edge_count = 0;
    NPG_TRY(npg_alloc_array(&next, NPG_FOR_MESH, vert_count, sizeof *next));
    npg_status status = find_border(next, *slot);
    for (size_t v = 0; v < vert_count && !status; v++) edge_count += next[v] != UINT32_MAX;
    if (!status && edge_count) status = add_holes(slot, next, edge_count, done);
    npg_release(&next);
    return status;
}

/* ---- folds ---- */

static double face_normal(double n[3], const npg_mesh *mesh, size_t f)
{
    const uint32_t *face = mesh->faces + 3 * f;
    const float *first = mesh->vert_pos + 3 * (size_t)face[0];
    double u[3], v[3];
    npg_vec3_between(u, first, mesh->vert_pos + 3 * (size_t)face[1]);
    npg_vec3_between(v, first, mesh->vert_pos + 3 * (size_t)face[2]);
    npg_vec3_cross(n, u, v);
    double area2 = npg_vec3_length(n);
    double edges = u[0] * u[0] + u[1] * u[1] + u[2] * u[2] + v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
    return edges > 0 ? area2 / edges : 0; /* shape: 0 without area, 0.43 for an equilateral one */
}

/* Sum of the area-weighted face normals at every vertex. */
static void sum_at_vertices(double *sum, const npg_mesh *mesh)
{
    memset(sum, 0, mesh->vert_count * 3 * sizeof *sum);
    for (size_t f = 0; f < mesh->face_count; f++) {
        double n[3];
        face_normal(n, mesh, f);
        for (size_t k = 0; k < 3; k++)
            for (size_t a = 0; a < 3; a++) sum[3 * (size_t)mesh->faces[3 * f + k] + a] += n[a];
    }
}

/* The face's normal against what the other faces around its corners say. */
static bool is_turned(const double *sum, const npg_mesh *mesh, size_t f)
{
    double n[3], others[3] = {0};
    if (face_normal(n, mesh, f) < 1e-6) return true;
    for (size_t a = 0; a < 3; a++)
        for (size_t k = 0; k < 3; k++) others[a] += sum[3 * (size_t)mesh->faces[3 * f + k] + a] - n[a];
    double nn = npg_vec3_dot(n, n), oo = npg_vec3_dot(others, others);
    return npg_vec3_dot(n, others) < NPG_AGAINST * sqrt(nn * oo);
}

static size_t find_flipped(uint8_t *is_flipped, double *sum, const npg_mesh *mesh)
{
    size_t count = 0;
    sum_at_vertices(sum, mesh);
    for (size_t f = 0; f < mesh->face_count; f++) {
        bool turned = is_turned(sum, mesh, f);
        if (is_flipped) is_flipped[f] = turned;
        count += turned;
    }
    return count;
}

npg_status npg_mesh_flipped(size_t *count, uint8_t *is_flipped, const npg_mesh *mesh)
{
    double *sum;
    NPG_TRY(npg_alloc_array(&sum, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof *sum));
    *count = find_flipped(is_flipped, sum, mesh);
    npg_release(&sum);
    return NPG_OK;
}

/* One round: every vertex of a turned face goes to the middle of the neighbours it has over faces. */
static void smooth_round(npg_mesh *mesh, const uint8_t *is_flipped, double *sum, uint32_t *weight)
{
    memset(sum, 0, mesh->vert_count * 3 * sizeof *sum);
    memset(weight, 0, mesh->vert_count * sizeof *weight);
    for (size_t c = 0; c < 3 * mesh->face_count; c++) {
        uint32_t v = mesh->faces[c], to = mesh->faces[npg_next_corner((uint32_t)c)];
        for (size_t a = 0; a < 3; a++) {
            sum[3 * (size_t)v + a] += (double)mesh->vert_pos[3 * (size_t)to + a];
            sum[3 * (size_t)to + a] += (double)mesh->vert_pos[3 * (size_t)v + a];
        }
        weight[v]++;
        weight[to]++;
    }
    for (size_t c = 0; c < 3 * mesh->face_count; c++)
        for (size_t a = 0; a < 3 && is_flipped[c / 3]; a++) {
            size_t v = mesh->faces[c];
            mesh->vert_pos[3 * v + a] = (float)(sum[3 * v + a] / weight[v]);
        }
}

/* Where smoothing does not help, the turned face's shortest edge shrinks to its middle. */
static void collapse_flipped(npg_mesh *mesh, const uint8_t *is_flipped)
{
    for (size_t f = 0; f < mesh->face_count; f++) {
        uint32_t *face = mesh->faces + 3 * f;
        float least = INFINITY;
        size_t at = 0;
        for (size_t k = 0; k < 3 && is_flipped[f]; k++) {
            const float *p = mesh->vert_pos + 3 * (size_t)face[k],
                        *q = mesh->vert_pos + 3 * (size_t)face[(k + 1) % 3];
            float d[3] = {p[0] - q[0], p[1] - q[1], p[2] - q[2]};
            float length_sq = npg_vec3_dotf(d, d);
            if (length_sq < least) {
                least = length_sq;
                at = k;
            }
        }
        uint32_t keep = face[at], gone = face[(at + 1) % 3];
        if (!is_flipped[f] || keep == gone) continue;
        for (size_t a = 0; a < 3; a++) {
            float *to = mesh->vert_pos + 3 * (size_t)keep + a;
            *to = 0.5f * (*to + mesh->vert_pos[3 * (size_t)gone + a]);
        }
        for (size_t c = 0; c < 3 * mesh->face_count; c++)
            if (mesh->faces[c] == gone) mesh->faces[c] = keep;
    }
}

/* *left is the number of faces that are still turned; their shortest edges are then collapsed. */
static npg_status unfold(npg_mesh *mesh, npg_mending *done, size_t *left)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    double *sum = npg_arena_take(&scratch, mesh->vert_count, 3 * sizeof *sum);
    uint32_t *weight = npg_arena_take(&scratch, mesh->vert_count, sizeof *weight);
    uint8_t *is_flipped = npg_arena_take(&scratch, mesh->face_count, 1);
    npg_status status = npg_arena_status(&scratch);
    *left = status ? 0 : find_flipped(is_flipped, sum, mesh);
    done->flipped += *left;
    for (int round = 0; round < NPG_ROUNDS_MOST && *left; round++) {
        smooth_round(mesh, is_flipped, sum, weight);
        *left = find_flipped(is_flipped, sum, mesh);
    }
    if (*left) collapse_flipped(mesh, is_flipped);
    npg_arena_release(&scratch);
    return status;
}

/* ---- edges of more than two faces that splitting could not part ---- */

/* Whether the next one goes the same way along the same edge. */
static bool is_used_twice(const npg_half_edge *half)
{
    return npg_same_edge(half, half + 1) && half->is_back == half[1].is_back;
}

/* Of the faces that use an edge in one direction only the first is kept. */
static npg_status drop_crowded(npg_mesh **mesh, npg_mending *done, size_t *dropped)
{
    npg_half_edge *halves;
    uint8_t *keep_face = NULL;
    size_t face_count = (*mesh)->face_count;
    *dropped = 0;
    NPG_TRY(npg_mesh_half_edges(&halves, (*mesh)->faces, face_count));
    npg_status status = npg_alloc(&keep_face, NPG_FOR_MESH, face_count);
    if (!status) memset(keep_face, 1, face_count);
    for (size_t i = 1; i < 3 * face_count && !status; i++) {
        uint32_t face = halves[i].corner / 3;
        if (!is_used_twice(&halves[i - 1]) || !keep_face[face]) continue;
        keep_face[face] = 0;
        ++*dropped;
    }
    done->duplicate += *dropped;
    if (!status && *dropped) status = npg_mesh_keep_faces(mesh, keep_face);
    npg_release(&halves);
    npg_release(&keep_face);
    return status;
}

npg_status npg_mesh_mend(npg_mesh **mesh, npg_mending *done)
{
    memset(done, 0, sizeof *done);
    for (int round = 0; round < NPG_ROUNDS_MOST; round++) {
        size_t dropped, left;
        NPG_TRY(drop_faces(mesh, done));
        if (!(*mesh)->face_count) break;
        NPG_TRY(split(mesh, done));
        NPG_TRY(drop_crowded(mesh, done, &dropped));
        if (dropped) NPG_TRY(split(mesh, done));
        NPG_TRY(fill_holes(mesh, done));
        NPG_TRY(unfold(*mesh, done, &left));
        if (!left) break;
    }
    return NPG_OK;
}

/* ---- check ---- */

npg_status npg_mesh_require_manifold(const npg_mesh *mesh, const char *name)
{
    npg_half_edge *halves;
    size_t count = 3 * mesh->face_count;
    npg_status status = NPG_OK;
    NPG_TRY(npg_mesh_half_edges(&halves, mesh->faces, mesh->face_count));
    for (size_t i = 0; i < count && !status; i++) {
        uint32_t face = halves[i].corner / 3;
        if (halves[i].lo == halves[i].hi)
            status = npg_error(NPG_BAD_INPUT, "%s: face %u uses vertex %u twice", name, face, halves[i].lo);
        /* A directed edge used once at most means: two faces at most, and they agree on the outside. */
        else if (i && is_used_twice(&halves[i - 1]))
            status = npg_error(NPG_BAD_INPUT,
                               "%s is not a manifold: "
                               "faces %u and %u both use the edge from vertex %u to vertex %u "
                               "in this direction",
                               name, halves[i - 1].corner / 3, face, mesh->faces[halves[i].corner],
                               mesh->faces[npg_next_corner(halves[i].corner)]);
    }
    npg_release(&halves);
    return status;
}
