/* Colours: robust means, and from points to vertices. */
#include "geometry/geometry.h"

#include <math.h>
#include <string.h>

#define NEAREST  12   /* points that a vertex is coloured from                                   */
#define FACING   0.2f /* least cosine of the normals: the other side of a thin part has its own  */
#define SPACINGS 3    /* of the points, within which one may colour a vertex                     */
#define SAMPLE   512  /* points whose spacing is measured                                        */
#define TRIM     2    /* knots to each side of the median that count                             */
#define GREY     128

/* ---- robust means ---- */

void npg_colour_add(npg_colour_sums *sums, const uint8_t rgb[3])
{
    for (size_t c = 0; c < 3; c++) {
        size_t below = rgb[c] / NPG_COLOUR_STEP, rest = rgb[c] % NPG_COLOUR_STEP;
        uint16_t *knots = sums->knots[c];
        if (knots[below] > UINT16_MAX - NPG_COLOUR_STEP || knots[below + 1] > UINT16_MAX - NPG_COLOUR_STEP)
            for (size_t k = 0; k < NPG_COLOUR_KNOTS; k++) knots[k] /= 2;
        knots[below] = (uint16_t)(knots[below] + NPG_COLOUR_STEP - rest);
        knots[below + 1] = (uint16_t)(knots[below + 1] + rest);
    }
}

bool npg_colour_mean(uint8_t rgb[3], const npg_colour_sums *sums)
{
    for (size_t c = 0; c < 3; c++) {
        const uint16_t *knots = sums->knots[c];
        uint64_t all = 0, half = 0, weight = 0, sum = 0;
        int median = 0;
        for (int k = 0; k < NPG_COLOUR_KNOTS; k++) all += knots[k];
        rgb[c] = 0;
        if (!all) return false;
        for (; 2 * (half + knots[median]) < all; median++) half += knots[median];
        for (int k = median - TRIM; k <= median + TRIM; k++) {
            if (k < 0 || k >= NPG_COLOUR_KNOTS) continue;
            weight += knots[k];
            sum += (uint64_t)knots[k] * (uint64_t)k;
        }
        uint64_t mean = (2 * sum * NPG_COLOUR_STEP + weight) / (2 * weight);
        rgb[c] = mean > 255 ? 255 : (uint8_t)mean;
    }
    return true;
}

/* ---- from points to vertices ---- */

typedef struct colouring {
    npg_arena arena;
    float *points, *normals; /* M x 3 of the points with a colour; normals may be NULL */
    const uint8_t **of;      /* M: their colours, loans                                */
    size_t count;
} colouring;

static npg_status take_points(colouring *c, const npg_coloured *cloud)
{
    size_t most = 0;
    for (size_t i = 0; i < cloud->count; i++) most += cloud->colours[4 * i + 3] > 0;
    c->points = npg_arena_take(&c->arena, most, 3 * sizeof *c->points);
    c->of = npg_arena_take(&c->arena, most, sizeof *c->of);
    if (cloud->normals) c->normals = npg_arena_take(&c->arena, most, 3 * sizeof *c->normals);
    NPG_TRY(npg_arena_status(&c->arena));
    for (size_t i = 0; i < cloud->count; i++) {
        if (!cloud->colours[4 * i + 3]) continue;
        memcpy(c->points + 3 * c->count, cloud->points + 3 * i, 3 * sizeof(float));
        if (c->normals) memcpy(c->normals + 3 * c->count, cloud->normals + 3 * i, 3 * sizeof(float));
        c->of[c->count++] = cloud->colours + 4 * i;
    }
    return NPG_OK;
}

/* Mean distance of a point to its neighbour, over a sample. */
static npg_status spacing_of(const colouring *c, double *spacing)
{
    float samples[3 * SAMPLE] = {0}, dist_sq[2 * SAMPLE];
    uint32_t index[2 * SAMPLE];
    size_t step = c->count / SAMPLE + 1, count = 0, used = 0;
    for (size_t i = 0; i < c->count && count < SAMPLE; i += step, count++)
        memcpy(samples + 3 * count, c->points + 3 * i, 3 * sizeof(float));
    NPG_TRY(npg_points_nearest(index, dist_sq, c->points, c->count, samples, count, 2));
    *spacing = 0;
    for (size_t i = 0; i < count; i++) {
        if (!isfinite(dist_sq[2 * i + 1])) continue;
        *spacing += sqrt((double)dist_sq[2 * i + 1]);
        used++;
    }
    if (used) *spacing /= (double)used;
    return NPG_OK;
}

static void colour_vertex(uint8_t out[4], const colouring *c, const float *normal, const uint32_t *index,
                          const float *dist_sq, double reach, double spacing)
{
    double sums[3] = {0}, all = 0, width = 2 * spacing * spacing + 1e-30;
    memset(out, 0, 4);
    for (size_t k = 0; k < NEAREST && index[k] != UINT32_MAX; k++) {
        if ((double)dist_sq[k] > reach * reach) break;
        if (c->normals) {
            const float *own = c->normals + 3 * (size_t)index[k];
            /* A point without a direction, (0, 0, 0), speaks for any. */
            if (npg_vec3_dotf(own, own) > 0 && npg_vec3_dotf(own, normal) < FACING) continue;
        }
        double w = exp(-((double)dist_sq[k] - (double)dist_sq[0]) / width);
        for (int a = 0; a < 3; a++) sums[a] += w * c->of[index[k]][a];
        all += w;
    }
    if (!(all > 0)) return;
    for (int a = 0; a < 3; a++) out[a] = (uint8_t)(sums[a] / all + 0.5);
    out[3] = NPG_COLOUR_SEEN;
}

static npg_status colour_all(uint8_t *out, colouring *c, const float *verts, const float *normals, size_t v,
                             double reach)
{
    npg_neighbours near;
    double spacing;
    NPG_TRY(spacing_of(c, &spacing));
    NPG_TRY(npg_neighbours_take(&near, &c->arena, c->points, c->count, verts, v, NEAREST));
    reach = fmax(reach, SPACINGS * spacing);
    for (size_t i = 0; i < v; i++)
        colour_vertex(out + 4 * i, c, normals + 3 * i, near.index + NEAREST * i, near.dist_sq + NEAREST * i,
                      reach, spacing);
    return NPG_OK;
}

npg_status npg_colour_vertices(uint8_t *out, const float *verts, const float *normals, size_t vert_count,
                               const npg_coloured *cloud, double reach)
{
    colouring c = {.arena.purpose = NPG_FOR_QUERY};
    memset(out, 0, 4 * vert_count);
    npg_status status = take_points(&c, cloud);
    if (!status && c.count) status = colour_all(out, &c, verts, normals, vert_count, reach);
    npg_arena_release(&c.arena);
    return status;
}

/* ---- where nothing was seen ---- */

/* One ring of vertices beside coloured ones; false when there was none. */
static bool fill_ring(uint8_t *colours, const npg_mesh_neighbours *n, uint8_t *fresh, size_t v)
{
    bool any = false;
    memset(fresh, 0, 4 * v);
    for (size_t i = 0; i < v; i++) {
        unsigned sums[3] = {0}, count = 0;
        if (colours[4 * i + 3]) continue;
        for (uint32_t k = n->start[i]; k < n->start[i + 1]; k++) {
            const uint8_t *other = colours + 4 * (size_t)n->of[k];
            if (!other[3]) continue;
            for (int a = 0; a < 3; a++) sums[a] += other[a];
            count++;
        }
        if (!count) continue;
        for (size_t a = 0; a < 3; a++) fresh[4 * i + a] = (uint8_t)((sums[a] + count / 2) / count);
        fresh[4 * i + 3] = NPG_COLOUR_LENT;
        any = true;
    }
    for (size_t i = 0; i < v; i++)
        if (fresh[4 * i + 3]) memcpy(colours + 4 * i, fresh + 4 * i, 4);
    return any;
}

npg_status npg_colour_fill(uint8_t *colours, const npg_mesh *mesh)
{
    npg_mesh_neighbours neighbours = {0};
    uint8_t *fresh = NULL;
    size_t v = mesh->vert_count, missing = 0;
    for (size_t i = 0; i < v; i++) missing += !colours[4 * i + 3];
    if (!missing) return NPG_OK;
    npg_status status = npg_mesh_neighbours_open(&neighbours, mesh);
    if (!status) status = npg_alloc(&fresh, NPG_FOR_MESH, 4 * v);
    while (!status && fill_ring(colours, &neighbours, fresh, v)) {
    }
    for (size_t i = 0; i < v && !status; i++) {
        if (colours[4 * i + 3]) continue;
        memset(colours + 4 * i, GREY, 3);
        colours[4 * i + 3] = NPG_COLOUR_LENT;
    }
    npg_release(&fresh);
    npg_mesh_neighbours_close(&neighbours);
    return status;
}
