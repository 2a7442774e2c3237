/* Apart: shifts of points that face each other, and the way back. */
#include "mesh/apart.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "geometry/kdtree.h"
#include "geometry/mesh_tools.h"
#include "geometry/query.h"
#include "geometry/vec3.h"
#include "mesh/contact.h"

#define NEIGHBOURS    48 /* in which a facing point is looked for */
#define SMOOTH_OVER   12 /* neighbours                            */
#define SMOOTH_ROUNDS 3
#define BACK_OVER     6  /* points around a vertex           */
#define BACK_AMONG    16 /* nearest ones that they are among */

typedef struct manner {
    double wide;       /* a gap that survives, in spacings                         */
    bool is_one_sided; /* a vertex goes by points on its own side of the gap alone */
    int rounds;        /* times that the surface is then drawn to its points       */
} manner;

static const manner manners[] = {[NPG_APART_TIGHT] = {1.2, true, 2}, [NPG_APART_LOOSE] = {1.5, false, 0}};

/* ---- gaps ---- */

static float push_of(size_t i, const uint32_t *near, const float *dist_sq, const float *points,
                     const float *normals, size_t n, double wide)
{
    for (size_t k = 0; k < NEIGHBOURS && near[k] < n; k++) {
        double gap = sqrt((double)dist_sq[k]);
        if (gap >= wide) break;
        if (near[k] == i) continue;
        size_t j = near[k];
        if (npg_points_face(points + 3 * i, normals + 3 * i, points + 3 * j, normals + 3 * j))
            return (float)((wide - gap) / 2);
    }
    return 0;
}

/* A point takes the mean push of its neighbours on the same side, if that is more than its own. */
static void smooth(float *out, const float *push, const uint32_t *near, const float *normals, size_t n)
{
    for (size_t i = 0; i < n; i++) {
        float sum = 0, weight = 0;
        for (size_t k = 0; k < SMOOTH_OVER; k++) {
            size_t j = near[NEIGHBOURS * i + k];
            if (j >= n) break;
            if (npg_vec3_dotf(normals + 3 * i, normals + 3 * j) < 0.3f) continue;
            sum += push[j];
            weight += 1;
        }
        out[i] = weight > 0 ? fmaxf(push[i], sum / weight) : push[i];
    }
}

static npg_status measure_pushes(float *push, const npg_apart *apart)
{
    npg_kdtree *tree = NULL;
    float *dist_sq = NULL, *smoothed = NULL;
    uint32_t *near = NULL;
    const float *points = apart->points, *normals = apart->normals;
    size_t n = apart->count;
    npg_status status = npg_alloc_array(&dist_sq, NPG_FOR_MESH, n, NEIGHBOURS * sizeof(float));
    if (!status) status = npg_alloc_array(&near, NPG_FOR_MESH, n, NEIGHBOURS * sizeof(uint32_t));
    if (!status) status = npg_alloc_array(&smoothed, NPG_FOR_MESH, n, sizeof(float));
    if (!status) status = npg_kdtree_open(&tree, points, n);
    if (!status) status = npg_kdtree_nearest(tree, near, dist_sq, points, n, NEIGHBOURS, 0);
    for (size_t i = 0; i < n && !status; i++)
        push[i] = push_of(i, near + NEIGHBOURS * i, dist_sq + NEIGHBOURS * i, points, normals, n,
                          manners[apart->way].wide * apart->spacing);
    for (int round = 0; round < SMOOTH_ROUNDS && !status; round++) {
        smooth(smoothed, push, near, normals, n);
        memcpy(push, smoothed, n * sizeof(float));
    }
    npg_kdtree_close(&tree);
    npg_release(&dist_sq);
    npg_release(&near);
    npg_release(&smoothed);
    return status;
}

npg_status npg_apart_open(npg_apart *apart, const float *points, const float *normals, size_t n,
                          double spacing, npg_apart_way way)
{
    float *push = NULL;
    NPG_REQUIRE(n && spacing > 0 && way != NPG_APART_NOT);
    *apart = (npg_apart){.points = points, .normals = normals, .count = n, .spacing = spacing, .way = way};
    npg_status status = npg_alloc_array(&apart->shift, NPG_FOR_MESH, n, 3 * sizeof(float));
    if (!status) status = npg_alloc_array(&apart->shifted, NPG_FOR_MESH, n, 3 * sizeof(float));
    if (!status) status = npg_alloc_array(&push, NPG_FOR_MESH, n, sizeof(float));
    if (!status) status = measure_pushes(push, apart);
    for (size_t i = 0; i < n && !status; i++) apart->moved += push[i] > 0;
    for (size_t i = 0; i < 3 * n && !status; i++) {
        apart->shift[i] = -push[i / 3] * normals[i];
        apart->shifted[i] = points[i] + apart->shift[i];
    }
    npg_release(&push);
    if (status) npg_apart_close(apart);
    return status;
}

void npg_apart_close(npg_apart *apart)
{
    npg_release(&apart->shift);
    npg_release(&apart->shifted);
}

/* ---- back ---- */

/* The points around a vertex, on its side of the gap, and how much each counts. */
typedef struct around {
    uint32_t point[BACK_OVER];
    float weight[BACK_OVER];
    int count;
} around;

typedef struct way_back {
    const npg_apart *apart;
    npg_mesh *mesh;
    around *of;            /* V, owned */
    npg_surface_hit *hits; /* N, owned */
    float *gaps;           /* N x 3, owned: from the surface to each point, along its normal */
} way_back;

static void choose_around(around *to, const float *vert_normal, const uint32_t *near, const float *dist_sq,
                          const npg_apart *apart)
{
    float scale = 0;
    for (size_t k = 0; k < BACK_AMONG && near[k] < apart->count && to->count < BACK_OVER; k++) {
        bool is_across = npg_vec3_dotf(vert_normal, apart->normals + 3 * (size_t)near[k]) <= 0;
        if (is_across && manners[apart->way].is_one_sided) continue;
        if (!to->count) scale = dist_sq[k] + 1e-12f;
        to->weight[to->count] = scale / (dist_sq[k] + scale);
        to->point[to->count++] = near[k];
    }
}

static npg_status find_around(way_back *w)
{
    npg_kdtree *tree = NULL;
    float *dist_sq = NULL, *normals = NULL;
    uint32_t *near = NULL;
    const npg_mesh *m = w->mesh;
    size_t v = m->vert_count;
    npg_status status = npg_alloc_array(&dist_sq, NPG_FOR_MESH, v, BACK_AMONG * sizeof(float));
    if (!status) status = npg_alloc_array(&near, NPG_FOR_MESH, v, BACK_AMONG * sizeof(uint32_t));
    if (!status) status = npg_alloc_array(&normals, NPG_FOR_MESH, v, 3 * sizeof(float));
    if (!status) status = npg_kdtree_open(&tree, w->apart->shifted, w->apart->count);
    if (!status) status = npg_kdtree_nearest(tree, near, dist_sq, m->vert_pos, v, BACK_AMONG, 0);
    if (!status) npg_mesh_vertex_normals(normals, m->vert_pos, v, m->faces, m->face_count);
    for (size_t i = 0; i < v && !status; i++)
        choose_around(&w->of[i], normals + 3 * i, near + BACK_AMONG * i, dist_sq + BACK_AMONG * i, w->apart);
    npg_kdtree_close(&tree);
    npg_release(&dist_sq);
    npg_release(&near);
    npg_release(&normals);
    return status;
}

/* The weighted mean of the rows (x 3) that belong to the points around a vertex. */
static void mean_around(float mean[3], const around *of, const float *rows)
{
    float weight = 0;
    mean[0] = mean[1] = mean[2] = 0;
    for (int k = 0; k < of->count; k++) {
        weight += of->weight[k];
        for (size_t a = 0; a < 3; a++) mean[a] += of->weight[k] * rows[3 * (size_t)of->point[k] + a];
    }
    for (size_t a = 0; a < 3 && weight > 0; a++) mean[a] /= weight;
}

/* Vertices around which points were moved go where the rows of these say. */
static void move(const way_back *w, const float *rows, float sign)
{
    for (size_t i = 0; i < w->mesh->vert_count; i++) {
        float way[3], went[3];
        mean_around(went, &w->of[i], w->apart->shift);
        if (npg_vec3_dotf(went, went) <= 0) continue;
        mean_around(way, &w->of[i], rows);
        for (size_t a = 0; a < 3; a++) w->mesh->vert_pos[3 * i + a] += sign * way[a];
    }
}

/* What is farther from the surface than points are from each other is none of it. */
static npg_status measure_gaps(way_back *w)
{
    const npg_mesh *m = w->mesh;
    const npg_apart *apart = w->apart;
    npg_surface *surface;
    NPG_TRY(npg_surface_open(&surface, m->vert_pos, m->vert_count, m->faces, m->face_count));
    npg_status status =
        npg_surface_closest_near(surface, w->hits, apart->points, apart->count, NULL, NULL, 0);
    npg_surface_close(&surface);
    for (size_t i = 0; i < apart->count && !status; i++) {
        const npg_surface_hit *hit = &w->hits[i];
        const uint32_t *corner = m->faces + 3 * (size_t)hit->face;
        const float *point = apart->points + 3 * i, *normal = apart->normals + 3 * i;
        float along = 0;
        for (size_t a = 0; a < 3; a++) {
            float on = 0;
            for (size_t k = 0; k < 3; k++) on += hit->weights[k] * m->vert_pos[3 * (size_t)corner[k] + a];
            along += (point[a] - on) * normal[a];
        }
        bool is_of_it = (double)hit->dist_sq < apart->spacing * apart->spacing;
        for (size_t a = 0; a < 3; a++) w->gaps[3 * i + a] = is_of_it ? along * normal[a] : 0;
    }
    return status;
}

npg_status npg_apart_bring_back(const npg_apart *apart, npg_mesh *mesh)
{
    way_back w = {.apart = apart, .mesh = mesh};
    size_t n = apart->count;
    if (!apart->moved) return NPG_OK;
    npg_status status = npg_alloc_array(&w.of, NPG_FOR_MESH, mesh->vert_count, sizeof *w.of);
    if (!status) status = npg_alloc_array(&w.hits, NPG_FOR_MESH, n, sizeof *w.hits);
    if (!status) status = npg_alloc_array(&w.gaps, NPG_FOR_MESH, n, 3 * sizeof(float));
    if (!status) status = find_around(&w);
    if (!status) move(&w, apart->shift, -1);
    for (int round = 0; round < manners[apart->way].rounds && !status; round++) {
        status = measure_gaps(&w);
        if (!status) move(&w, w.gaps, 1);
    }
    npg_release(&w.of);
    npg_release(&w.hits);
    npg_release(&w.gaps);
    return status;
}
