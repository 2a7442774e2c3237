/* Sheets: one side for a surface that encloses nothing.
 *
 * Its winding number w says no side: by it each bulge faces out, and where the surface bends the other way two sides
 * meet at a seam.  Patches of one side, of points whose neighbours have nearly the same tangent plane, are turned to
 * those beside them, the longest seam first, the smaller part to the larger; but no patch whose mean w is nearer to
 * 1/2, what it is on a closed surface, than to 0, as on a plane: the two faces of a blade meet at a seam, too. */
#include <math.h>
#include <stdlib.h>

#include "geometry/geometry.h"
#include "outlier/normals.h"
#include "pipeline/memory.h"

typedef struct seam { /* between two patches, by their roots, a < b */
    uint32_t a, b, length;
} seam;

typedef struct sheets {
    const float *points;
    float *normals; /* tangent planes' own, with the sides of the field */
    npg_neighbours near;
    uint32_t *patch, *count; /* forest of patches; of roots, points */
    float *number;           /* of roots: sum of w */
    seam *seams;             /* the longest first */
    size_t seam_count;
    uint32_t *part; /* forest of patches that one side goes through ... */
    uint8_t *turn;  /* ... and whether a patch turns against its parent */
    size_t n;
} sheets;

static npg_status take_sheets(sheets *s, npg_arena *arena, const float *points, const float *normals,
                              const npg_neighbours *near, size_t n)
{
    *s = (sheets){.points = points, .near = *near, .n = n};
    s->normals = npg_arena_take(arena, n, 3 * sizeof *s->normals);
    s->patch = npg_arena_take(arena, n, sizeof *s->patch);
    s->part = npg_arena_take(arena, n, sizeof *s->part);
    s->count = npg_arena_copy(arena, NULL, n, sizeof *s->count);
    s->number = npg_arena_copy(arena, NULL, n, sizeof *s->number);
    s->turn = npg_arena_copy(arena, NULL, n, sizeof *s->turn);
    NPG_TRY(npg_arena_status(arena));
    NPG_TRY(npg_normals_estimate(s->normals, points, n, NPG_NEIGHBOURS));
    for (size_t i = 0; i < n; i++) {
        s->patch[i] = s->part[i] = (uint32_t)i;
        if (npg_vec3_dotf(s->normals + 3 * i, normals + 3 * i) >= 0) continue;
        for (size_t a = 0; a < 3; a++) s->normals[3 * i + a] = -s->normals[3 * i + a];
    }
    return NPG_OK;
}

/* Of two neighbours: 1 one side, -1 a seam, 0 neither: a bend, or one before the other. */
static int side_of(const sheets *s, uint32_t i, uint32_t j)
{
    const float *n = s->normals + 3 * (size_t)i, *m = s->normals + 3 * (size_t)j;
    float d[3], same = npg_vec3_dotf(n, m), along_n, along_m, most;
    if (fabsf(same) < (float)M_SQRT1_2) return 0;
    for (size_t a = 0; a < 3; a++) d[a] = s->points[3 * (size_t)j + a] - s->points[3 * (size_t)i + a];
    along_n = npg_vec3_dotf(d, n);
    along_m = npg_vec3_dotf(d, m);
    most = npg_vec3_dotf(d, d) / 2;
    if (along_n * along_n > most || along_m * along_m > most) return 0;
    return same > 0 ? 1 : -1;
}

static void join_patches(sheets *s, const float *number)
{
    for (uint32_t i = 0; i < s->n; i++)
        for (size_t k = 0; k < NPG_AROUND; k++) {
            uint32_t j = s->near.index[NPG_AROUND * i + k];
            if (j == UINT32_MAX) break;
            if (side_of(s, i, j) > 0) npg_set_join(s->patch, i, j);
        }
    for (uint32_t i = 0; i < s->n; i++) {
        uint32_t root = npg_set_root(s->patch, i);
        s->count[root]++;
        s->number[root] += number[i];
    }
}

static int by_patches(const void *left, const void *right)
{
    const seam *l = left, *r = right;
    if (l->a != r->a) return l->a < r->a ? -1 : 1;
    return l->b < r->b ? -1 : l->b > r->b;
}

static int by_length(const void *left, const void *right)
{
    const seam *l = left, *r = right;
    return l->length != r->length ? (l->length > r->length ? -1 : 1) : by_patches(left, right);
}

/* Neighbours at a seam as seams of their own, in `out` unless that is NULL; how many. */
static size_t list_seams(sheets *s, seam *out)
{
    size_t count = 0;
    for (uint32_t i = 0; i < s->n; i++)
        for (size_t k = 0; k < NPG_AROUND; k++) {
            uint32_t j = s->near.index[NPG_AROUND * i + k];
            if (j == UINT32_MAX) break;
            uint32_t a = npg_set_root(s->patch, i), b = npg_set_root(s->patch, j);
            if (a == b || side_of(s, i, j) >= 0) continue;
            if (out) out[count] = (seam){a < b ? a : b, a < b ? b : a, 1};
            count++;
        }
    return count;
}

static npg_status find_seams(sheets *s, npg_arena *arena)
{
    size_t count = list_seams(s, NULL);
    if (!count) return NPG_OK;
    s->seams = npg_arena_take(arena, count, sizeof *s->seams);
    NPG_TRY(npg_arena_status(arena));
    list_seams(s, s->seams);
    qsort(s->seams, count, sizeof *s->seams, by_patches);
    for (size_t i = 0; i < count; i++)
        if (i && !by_patches(s->seams + s->seam_count - 1, s->seams + i))
            s->seams[s->seam_count - 1].length++;
        else
            s->seams[s->seam_count++] = s->seams[i];
    qsort(s->seams, s->seam_count, sizeof *s->seams, by_length);
    return NPG_OK;
}

/* The root of a patch's part; *turned: whether it turns against it. */
static uint32_t part_of(const sheets *s, uint32_t patch, bool *turned)
{
    for (*turned = false; s->part[patch] != patch; patch = s->part[patch]) *turned ^= s->turn[patch];
    return patch;
}

/* A line of points is fewer than the points beside it: patches whose every point has another before it are noise, or
 * the two faces of what is thinner than the points are apart. */
static bool is_sheet(const sheets *s, uint32_t part, uint32_t seam_length)
{
    return seam_length < s->count[part] && s->number[part] < 0.25f * (float)s->count[part];
}

static void turn_parts(sheets *s)
{
    for (size_t i = 0; i < s->seam_count; i++) {
        bool turned[2];
        uint32_t a = part_of(s, s->seams[i].a, &turned[0]), b = part_of(s, s->seams[i].b, &turned[1]);
        uint32_t less = s->count[a] < s->count[b] ? a : b, more = less == a ? b : a;
        if (a == b || !is_sheet(s, less, s->seams[i].length)) continue;
        s->part[less] = more;
        s->turn[less] = turned[0] == turned[1];
        s->count[more] += s->count[less];
        s->number[more] += s->number[less];
    }
}

npg_status npg_sheets_find_away(uint8_t *away, npg_arena *arena, const float *points, const float *normals,
                                const float *number, const npg_neighbours *near, size_t n)
{
    sheets s;
    NPG_TRY(take_sheets(&s, arena, points, normals, near, n));
    join_patches(&s, number);
    NPG_TRY(find_seams(&s, arena));
    turn_parts(&s);
    for (uint32_t i = 0; i < n; i++) {
        bool turned;
        part_of(&s, npg_set_root(s.patch, i), &turned);
        away[i] = turned;
    }
    return NPG_OK;
}
