/* Mesh tools: small facts about a triangle mesh that several stages need. */
#include "geometry/geometry.h"

#include <math.h>
#include <string.h>

void npg_mesh_vertex_normals(float *normals, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                             size_t face_count)
{
    memset(normals, 0, vert_count * 3 * sizeof *normals);
    for (size_t f = 0; f < face_count; f++) {
        double n[3];
        npg_face_cross(n, vert_pos, faces + 3 * f);
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++)
                normals[3 * (size_t)faces[3 * f + (size_t)k] + (size_t)a] += (float)n[a];
    }
    for (size_t i = 0; i < vert_count; i++) {
        float *n = normals + 3 * i;
        if (npg_vec3_make_unitf(n)) continue;
        n[0] = n[1] = 0;
        n[2] = 1;
    }
}

npg_status npg_mesh_make_normals(npg_mesh *mesh)
{
    npg_release(&mesh->vert_normals);
    NPG_TRY(npg_alloc_array(&mesh->vert_normals, NPG_FOR_MESH, mesh->vert_count, 3 * sizeof(float)));
    npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, mesh->vert_count, mesh->faces,
                            mesh->face_count);
    return NPG_OK;
}

/* Sorted by `lo` or `hi`, in place of each the order before; start: zeros, one more than vertices. */
static void sort_by(npg_half_edge *out, const npg_half_edge *halves, size_t count, bool by_hi,
                    uint32_t *start, size_t vert_count)
{
    for (size_t i = 0; i < count; i++) start[(by_hi ? halves[i].hi : halves[i].lo) + 1]++;
    for (size_t v = 0; v < vert_count; v++) start[v + 1] += start[v];
    for (size_t i = 0; i < count; i++) out[start[by_hi ? halves[i].hi : halves[i].lo]++] = halves[i];
}

/* In turns by what counts least first, as each sort keeps the order before: less than half of the time of qsort(). */
npg_status npg_mesh_half_edges(npg_half_edge **out, const uint32_t *faces, size_t face_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t count = 3 * face_count, vert_count = 0, at[2] = {0, 0};
    for (uint32_t c = 0; c < count; c++) {
        if (faces[c] >= vert_count) vert_count = (size_t)faces[c] + 1;
        at[1] += faces[c] < faces[npg_next_corner(c)];
    }
    npg_half_edge *halves = NULL, *by_hi = npg_arena_take(&scratch, count, sizeof *by_hi);
    uint32_t *start = npg_arena_take(&scratch, 2 * (vert_count + 1), sizeof *start);
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_alloc_array(&halves, NPG_FOR_MESH, count, sizeof *halves);
    if (!status) {
        for (uint32_t c = 0; c < count; c++) {
            uint32_t a = faces[c], b = faces[npg_next_corner(c)];
            halves[at[a >= b]++] = (npg_half_edge){a < b ? a : b, a < b ? b : a, c, a >= b};
        }
        sort_by(by_hi, halves, count, true, start, vert_count);
        sort_by(halves, by_hi, count, false, start + vert_count + 1, vert_count);
        *out = halves;
    }
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_mesh_edges(uint32_t (**edges)[2], size_t *edge_count, const uint32_t *faces, size_t face_count)
{
    npg_half_edge *halves;
    size_t count = 0;
    *edges = NULL;
    *edge_count = 0;
    NPG_TRY(npg_mesh_half_edges(&halves, faces, face_count));
    for (size_t i = 0; i < 3 * face_count; i++) count += i == 0 || !npg_same_edge(&halves[i - 1], &halves[i]);
    npg_status status = npg_alloc_array(edges, NPG_FOR_MESH, count, sizeof **edges);
    for (size_t i = 0; i < 3 * face_count && !status; i++) {
        if (i && npg_same_edge(&halves[i - 1], &halves[i])) continue;
        (*edges)[*edge_count][0] = halves[i].lo;
        (*edges)[(*edge_count)++][1] = halves[i].hi;
    }
    npg_release(&halves);
    return status;
}

npg_status npg_mesh_neighbours_open(npg_mesh_neighbours *out, const npg_mesh *mesh)
{
    uint32_t(*edges)[2];
    size_t count, n = mesh->vert_count;
    *out = (npg_mesh_neighbours){NULL, NULL};
    NPG_TRY(npg_mesh_edges(&edges, &count, mesh->faces, mesh->face_count));
    npg_status status = npg_alloc_array(&out->start, NPG_FOR_MESH, n + 2, sizeof *out->start);
    if (!status) status = npg_alloc_array(&out->of, NPG_FOR_MESH, 2 * count + 1, sizeof *out->of);
    /* start[v + 1] is where the next one of v goes: in the end the start of v + 1 */
    for (size_t e = 0; e < 2 * count && !status; e++) out->start[edges[e / 2][e % 2] + 2]++;
    for (size_t v = 0; v < n && !status; v++) out->start[v + 2] += out->start[v + 1];
    for (size_t e = 0; e < 2 * count && !status; e++)
        out->of[out->start[edges[e / 2][e % 2] + 1]++] = edges[e / 2][1 - e % 2];
    npg_release(&edges);
    if (status) npg_mesh_neighbours_close(out);
    return status;
}

void npg_mesh_neighbours_close(npg_mesh_neighbours *neighbours)
{
    npg_release(&neighbours->start);
    npg_release(&neighbours->of);
}

npg_status npg_mesh_twins(uint32_t *twin, const uint32_t *faces, size_t face_count)
{
    npg_half_edge *halves;
    size_t count = 3 * face_count;
    NPG_TRY(npg_mesh_half_edges(&halves, faces, face_count));
    for (size_t i = 0, next; i < count; i = next) {
        for (next = i + 1; next < count && npg_same_edge(&halves[i], &halves[next]);) next++;
        bool is_pair = next - i == 2 && halves[i].is_back != halves[i + 1].is_back;
        for (size_t k = i; k < next; k++)
            twin[halves[k].corner] = is_pair ? halves[2 * i + 1 - k].corner : UINT32_MAX;
    }
    npg_release(&halves);
    return NPG_OK;
}

npg_status npg_mesh_components(uint32_t *component_of, size_t *component_count, size_t vert_count,
                               const uint32_t *faces, size_t face_count)
{
    uint32_t *parent;
    NPG_TRY(npg_alloc_array(&parent, NPG_FOR_MESH, vert_count, sizeof *parent));
    for (size_t i = 0; i < vert_count; i++) parent[i] = (uint32_t)i;
    for (size_t f = 0; f < face_count; f++)
        for (int k = 1; k < 3; k++) {
            npg_set_join(parent, faces[3 * f], faces[3 * f + (size_t)k]);
        }
    size_t count = 0;
    for (size_t i = 0; i < vert_count; i++) {
        uint32_t root = npg_set_root(parent, (uint32_t)i);
        component_of[i] = root == i ? (uint32_t)count++ : component_of[root];
    }
    *component_count = count;
    npg_release(&parent);
    return NPG_OK;
}

void npg_face_middle(float middle[3], const float *vert_pos, const uint32_t face[3])
{
    for (size_t a = 0; a < 3; a++)
        middle[a] = vert_pos[3 * (size_t)face[0] + a] / 3 + vert_pos[3 * (size_t)face[1] + a] / 3 +
                    vert_pos[3 * (size_t)face[2] + a] / 3;
}

double npg_face_area(const float *vert_pos, const uint32_t face[3])
{
    double n[3];
    npg_face_cross(n, vert_pos, face);
    return 0.5 * npg_vec3_length(n);
}

double npg_mesh_area(const npg_mesh *mesh)
{
    double sum = 0;
    for (size_t f = 0; f < mesh->face_count; f++) sum += npg_face_area(mesh->vert_pos, mesh->faces + 3 * f);
    return sum;
}

double npg_mesh_volume(const npg_mesh *mesh)
{
    double sum = 0;
    for (size_t f = 0; f < mesh->face_count; f++) {
        double n[3];
        const float *a = mesh->vert_pos + 3 * (size_t)mesh->faces[3 * f];
        npg_face_cross(n, mesh->vert_pos, mesh->faces + 3 * f);
        sum += n[0] * (double)a[0] + n[1] * (double)a[1] + n[2] * (double)a[2];
    }
    return sum / 6; /* tetrahedra from the origin to every face: a . (b x c) / 6 = a . face_cross / 6 */
}

double npg_vertex_areas(double *areas, const float *vert_pos, size_t vert_count, const uint32_t *faces,
                        size_t face_count)
{
    double sum = 0, normal[3];
    for (size_t i = 0; i < vert_count; i++) areas[i] = 0;
    for (size_t f = 0; f < face_count; f++) {
        double area = npg_face_normal(normal, vert_pos, faces + 3 * f);
        for (size_t k = 0; k < 3; k++) areas[faces[3 * f + k]] += area / 3;
        sum += area;
    }
    return sum;
}

static void count_edge(npg_manifold *out, const npg_half_edge *run, size_t uses)
{
    out->edge_count++;
    out->border_edges += uses == 1;
    out->crowded_edges += uses > 2;
    out->misoriented_edges += uses == 2 && run[0].is_back == run[1].is_back;
}

npg_status npg_mesh_manifold(npg_manifold *out, const npg_mesh *mesh)
{
    npg_half_edge *halves;
    uint8_t *is_used;
    size_t count = 3 * mesh->face_count;
    *out = (npg_manifold){0};
    NPG_TRY(npg_alloc(&is_used, NPG_FOR_MESH, mesh->vert_count));
    npg_status status = npg_mesh_half_edges(&halves, mesh->faces, mesh->face_count);
    for (size_t i = 0, next; i < count && !status; i = next) {
        for (next = i + 1; next < count && npg_same_edge(&halves[i], &halves[next]);) next++;
        count_edge(out, halves + i, next - i);
    }
    for (size_t f = 0; f < mesh->face_count; f++) {
        const uint32_t *face = mesh->faces + 3 * f;
        for (int k = 0; k < 3; k++) is_used[face[k]] = 1;
        out->degenerate_faces += face[0] == face[1] || face[1] == face[2] || face[2] == face[0] ||
                                 !(npg_face_area(mesh->vert_pos, face) > 0);
    }
    for (size_t i = 0; i < mesh->vert_count; i++) out->unused_vertices += !is_used[i];
    npg_release(&is_used);
    if (!status) npg_release(&halves);
    return status;
}

/* How many of n vertices are in the list; seen: room for n. */
static size_t count_distinct(const uint32_t *list, size_t count, uint32_t *seen, size_t n)
{
    size_t distinct = 0;
    memset(seen, 0, n * sizeof *seen);
    for (size_t i = 0; i < count; i++) {
        distinct += seen[list[i]] == 0;
        seen[list[i]] = 1;
    }
    return distinct;
}

npg_status npg_mesh_border(uint8_t *is_border, bool *found, const npg_mesh *mesh)
{
    uint32_t *twins;
    bool is_open = false;
    memset(is_border, 0, mesh->vert_count);
    NPG_TRY(npg_alloc_array(&twins, NPG_FOR_MESH, mesh->face_count, 3 * sizeof *twins));
    npg_status status = npg_mesh_twins(twins, mesh->faces, mesh->face_count);
    for (size_t h = 0; h < 3 * mesh->face_count && !status; h++) {
        if (twins[h] != UINT32_MAX) continue;
        is_open = true;
        is_border[mesh->faces[h]] = is_border[mesh->faces[h - h % 3 + (h + 1) % 3]] = 1;
    }
    npg_release(&twins);
    if (found) *found = is_open;
    return status;
}

/* Border loops: components of the border's edges, each taken as a face with two equal corners. */
static npg_status count_border_loops(size_t *loops, const npg_mesh *mesh)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t count = 0, pieces, n = mesh->vert_count;
    uint32_t *twin = npg_arena_take(&scratch, mesh->face_count, 3 * sizeof *twin);
    uint32_t *flat = npg_arena_take(&scratch, 3 * mesh->face_count, 3 * sizeof *flat);
    uint32_t *component = npg_arena_take(&scratch, n, sizeof *component);
    *loops = 0;
    npg_status status = npg_arena_status(&scratch);
    if (!status) status = npg_mesh_twins(twin, mesh->faces, mesh->face_count);
    for (size_t i = 0; i < 3 * mesh->face_count && !status; i++) {
        if (twin[i] != UINT32_MAX) continue;
        flat[3 * count] = flat[3 * count + 1] = mesh->faces[i];
        flat[3 * count++ + 2] = mesh->faces[i - i % 3 + (i + 1) % 3];
    }
    if (!status) status = npg_mesh_components(component, &pieces, n, flat, count);
    /* every vertex off the border is a component of its own */
    if (!status) *loops = pieces + count_distinct(flat, 3 * count, component, n) - n;
    npg_arena_release(&scratch);
    return status;
}

npg_status npg_mesh_count_components(size_t *count, const npg_mesh *mesh)
{
    uint32_t *component;
    NPG_TRY(npg_alloc_array(&component, NPG_FOR_MESH, mesh->vert_count, sizeof *component));
    npg_status status =
        npg_mesh_components(component, count, mesh->vert_count, mesh->faces, mesh->face_count);
    npg_release(&component);
    return status;
}

npg_status npg_mesh_handles(int64_t *handles, const npg_mesh *mesh)
{
    npg_manifold manifold;
    size_t components, loops;
    NPG_TRY(npg_mesh_manifold(&manifold, mesh));
    NPG_TRY(count_border_loops(&loops, mesh));
    NPG_TRY(npg_mesh_count_components(&components, mesh));
    int64_t unused = (int64_t)manifold.unused_vertices;
    int64_t euler =
        (int64_t)mesh->vert_count - unused - (int64_t)manifold.edge_count + (int64_t)mesh->face_count;
    *handles = (2 * ((int64_t)components - unused) - euler - (int64_t)loops) / 2;
    return NPG_OK;
}

/* What a vertex has, where the mesh has it. */
static const struct {
    size_t offset, row; /* of the array in npg_mesh, and bytes of a vertex */
} vertex_data[] = {{offsetof(npg_mesh, vert_pos), 3 * sizeof(float)},
                   {offsetof(npg_mesh, vert_normals), 3 * sizeof(float)},
                   {offsetof(npg_mesh, vert_colours), 4},
                   {offsetof(npg_mesh, vert_unseen), 1},
                   {offsetof(npg_mesh, vert_uvs), 2 * sizeof(float)}};

static npg_status copy_vertices(npg_mesh *out, const npg_mesh *whole, const uint32_t *which)
{
    for (size_t i = 0; i < sizeof vertex_data / sizeof *vertex_data; i++) {
        size_t offset = vertex_data[i].offset, row = vertex_data[i].row;
        char *from, *to;
        memcpy(&from, (const char *)whole + offset, sizeof from);
        memcpy(&to, (char *)out + offset, sizeof to);
        if (!from) continue;
        if (!to) NPG_TRY(npg_alloc_array(&to, NPG_FOR_MESH, out->vert_count, row));
        memcpy((char *)out + offset, &to, sizeof to);
        for (size_t v = 0; v < out->vert_count; v++) memcpy(to + v * row, from + which[v] * row, row);
    }
    return NPG_OK;
}

npg_status npg_mesh_of_faces(npg_mesh **out, uint32_t **which, const npg_mesh *whole, const uint32_t *faces,
                             size_t face_count)
{
    npg_arena scratch = {.purpose = NPG_FOR_MESH};
    size_t count = 0, v = whole->vert_count;
    uint32_t *number = npg_arena_take(&scratch, v, sizeof *number);
    *out = NULL;
    *which = NULL;
    npg_status status = npg_arena_status(&scratch);
    for (size_t i = 0; i < 3 * face_count && !status; i++) number[faces[i]] = 1;
    for (size_t i = 0; i < v && !status; i++) number[i] = number[i] ? (uint32_t)count++ : UINT32_MAX;
    if (!status) status = npg_mesh_open(out, count, face_count);
    if (!status) status = npg_alloc_array(which, NPG_FOR_MESH, count, sizeof **which);
    for (size_t i = 0; i < v && !status; i++)
        if (number[i] != UINT32_MAX) (*which)[number[i]] = (uint32_t)i;
    for (size_t i = 0; i < 3 * face_count && !status; i++) (*out)->faces[i] = number[faces[i]];
    if (!status) status = copy_vertices(*out, whole, *which);
    npg_arena_release(&scratch);
    if (!status) return NPG_OK;
    npg_mesh_unref(out);
    npg_release(which);
    return status;
}

npg_status npg_mesh_keep_faces(npg_mesh **slot, const uint8_t *keep_face)
{
    npg_mesh *out = NULL;
    uint32_t *faces, *which;
    size_t kept = 0;
    NPG_TRY(npg_alloc_array(&faces, NPG_FOR_MESH, (*slot)->face_count, 3 * sizeof *faces));
    for (size_t f = 0; f < (*slot)->face_count; f++)
        if (keep_face[f]) memcpy(faces + 3 * kept++, (*slot)->faces + 3 * f, 3 * sizeof *faces);
    npg_status status = npg_mesh_of_faces(&out, &which, *slot, faces, kept);
    npg_release(&faces);
    npg_release(&which);
    if (status) return status;
    npg_mesh_unref(slot);
    *slot = out;
    return NPG_OK;
}

void npg_rows_gather(float *out, const float *rows, const uint32_t *which, size_t count)
{
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) out[3 * i + a] = rows[3 * (size_t)which[i] + a];
}

npg_status npg_mesh_require_finite(const npg_mesh *mesh, const char *path)
{
    for (size_t i = 0; i < 3 * mesh->vert_count; i++)
        if (!isfinite(mesh->vert_pos[i]))
            return npg_error(NPG_BAD_INPUT, "%s: vertex %zu is not finite", path, i / 3);
    return NPG_OK;
}

size_t npg_points_spread(float *out, float *out_normals, size_t most, const float *points,
                         const float *normals, size_t point_count)
{
    size_t count = point_count < most ? point_count : most;
    for (size_t i = 0; i < count; i++) {
        size_t from = npg_spread_index(i, count, point_count);
        memcpy(out + 3 * i, points + 3 * from, 3 * sizeof(float));
        if (normals) memcpy(out_normals + 3 * i, normals + 3 * from, 3 * sizeof(float));
    }
    return count;
}

size_t npg_points_keep(float *points, float *normals, size_t point_count, const uint8_t *keep)
{
    size_t kept = 0;
    for (size_t i = 0; i < point_count; i++) {
        if (!keep[i]) continue;
        memmove(points + 3 * kept, points + 3 * i, 3 * sizeof(float));
        if (normals) memmove(normals + 3 * kept, normals + 3 * i, 3 * sizeof(float));
        kept++;
    }
    return kept;
}
