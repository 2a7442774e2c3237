/* k-d tree of N points: a balanced tree over leaves of up to 16 points. */
#include "geometry/geometry.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "pipeline/memory.h"
#include "pipeline/parallel.h"

#define LANES       16  /* points of a leaf at most: one wide register of floats */
#define DEPTH_MAX   32  /* of a tree of 2^32 points                              */
#define QUERIES_MIN 512 /* worth a thread */

typedef struct leaf { /* lanes without a point are infinitely far away, their index is UINT32_MAX */
    float at[3][LANES];
    uint32_t index[LANES];
} leaf;

typedef struct split { /* along the axis the left half ends at lo, the right one begins at hi */
    float lo, hi;
    int axis;
} split;

struct npg_kdtree {
    npg_arena arena;
    const float *points; /* loan */
    size_t count, inner; /* inner node i has the children 2 i + 1 and 2 i + 2; inner + 1 leaves follow */
    split *splits;       /* inner */
    leaf *leaves;        /* inner + 1 */
    float lo[3], hi[3];  /* box of all points */
};

/* ---- building ---- */

typedef struct item {
    float at[3];
    uint32_t index;
} item;

static size_t inner_for(size_t count)
{
    size_t leaves = 1;
    while ((count + leaves - 1) / leaves > LANES) leaves *= 2;
    return leaves - 1;
}

size_t npg_kdtree_memory(size_t count)
{
    size_t inner = inner_for(count);
    return sizeof(npg_kdtree) + inner * sizeof(split) + (inner + 1) * sizeof(leaf) + count * sizeof(item);
}

/* The middle one of three items that are taken at random, so that no order of the points is a bad one. */
static float pivot_of(const item *items, ptrdiff_t first, ptrdiff_t last, int axis, uint64_t *random)
{
    float x[3];
    for (int k = 0; k < 3; k++) {
        *random = *random * 6364136223846793005u + 1442695040888963407u; /* Knuth's MMIX */
        x[k] = items[first + (ptrdiff_t)((*random >> 33) % (uint64_t)(last - first + 1))].at[axis];
    }
    float lo = x[0] < x[1] ? x[0] : x[1], hi = x[0] < x[1] ? x[1] : x[0];
    return x[2] < lo ? lo : x[2] < hi ? x[2] : hi;
}

/* Bring to its place the item that sorting would put at `middle`, and those below it before it (C. A. R.
 * Hoare, Find, 1961). */
static void select_item(item *items, size_t count, size_t middle, int axis)
{
    ptrdiff_t first = 0, last = (ptrdiff_t)count - 1, wanted = (ptrdiff_t)middle;
    uint64_t random = count;
    while (first < last) {
        float pivot = pivot_of(items, first, last, axis, &random);
        ptrdiff_t i = first, j = last;
        while (i <= j) {
            while (items[i].at[axis] < pivot) i++;
            while (pivot < items[j].at[axis]) j--;
            if (i > j) break;
            item other = items[i];
            items[i++] = items[j];
            items[j--] = other;
        }
        if (j < wanted) first = i;
        if (wanted < i) last = j;
    }
}

static void bounds_of(float lo[3], float hi[3], const item *items, size_t count)
{
    for (int a = 0; a < 3; a++) lo[a] = hi[a] = items[0].at[a];
    for (size_t i = 1; i < count; i++)
        for (int a = 0; a < 3; a++) {
            float x = items[i].at[a];
            lo[a] = x < lo[a] ? x : lo[a];
            hi[a] = x > hi[a] ? x : hi[a];
        }
}

static void fill_leaf(leaf *l, const item *items, size_t count)
{
    for (size_t k = 0; k < LANES; k++) {
        for (int a = 0; a < 3; a++) l->at[a][k] = k < count ? items[k].at[a] : INFINITY;
        l->index[k] = k < count ? items[k].index : UINT32_MAX;
    }
}

/* The items become node `node` and all below it. */
static void build(npg_kdtree *tree, size_t node, item *items, size_t count)
{
    float lo[3], hi[3];
    int axis = 0;
    if (node >= tree->inner) {
        fill_leaf(&tree->leaves[node - tree->inner], items, count);
        return;
    }
    bounds_of(lo, hi, items, count);
    for (int a = 1; a < 3; a++)
        if (hi[a] - lo[a] > hi[axis] - lo[axis]) axis = a;
    size_t left = (count + 1) / 2;
    select_item(items, count, left, axis);
    bounds_of(lo, hi, items, left);
    tree->splits[node] = (split){.lo = hi[axis], .hi = items[left].at[axis], .axis = axis};
    build(tree, 2 * node + 1, items, left);
    build(tree, 2 * node + 2, items + left, count - left);
}

static void build_all(npg_kdtree *tree, item *items)
{
    for (size_t i = 0; i < tree->count; i++) {
        memcpy(items[i].at, tree->points + 3 * i, sizeof items[i].at);
        items[i].index = (uint32_t)i;
    }
    bounds_of(tree->lo, tree->hi, items, tree->count);
    build(tree, 0, items, tree->count);
}

npg_status npg_kdtree_open(npg_kdtree **out, const float *points, size_t point_count)
{
    item *items;
    *out = NULL;
    NPG_REQUIRE(points && point_count >= 1 && point_count < UINT32_MAX);
    NPG_TRY(npg_object_open(out, NPG_FOR_QUERY, sizeof **out));
    npg_kdtree *tree = *out;
    tree->points = points;
    tree->count = point_count;
    tree->inner = inner_for(point_count);
    tree->splits = npg_arena_take(&tree->arena, tree->inner, sizeof *tree->splits);
    tree->leaves = npg_arena_take(&tree->arena, tree->inner + 1, sizeof *tree->leaves);
    npg_status status = npg_arena_status(&tree->arena);
    if (!status) status = npg_alloc_array(&items, NPG_FOR_QUERY, point_count, sizeof *items);
    if (!status) build_all(tree, items);
    if (!status) npg_release(&items);
    if (status) npg_kdtree_close(out);
    return status;
}

void npg_kdtree_close(npg_kdtree **slot)
{
    npg_object_close(slot);
}

void npg_kdtree_leave_out(npg_kdtree *tree, const uint8_t *keep)
{
    for (size_t l = 0; l <= tree->inner; l++)
        for (size_t k = 0; k < LANES; k++) {
            leaf *at = &tree->leaves[l];
            if (at->index[k] == UINT32_MAX || keep[at->index[k]]) continue;
            for (int a = 0; a < 3; a++) at->at[a][k] = INFINITY;
            at->index[k] = UINT32_MAX;
        }
}

size_t npg_kdtree_groups(const npg_kdtree *tree, uint32_t *order, uint32_t *first)
{
    size_t groups = 0, count = 0;
    for (size_t l = 0; l <= tree->inner; l++) {
        if (l % (NPG_KDTREE_GROUP / LANES) == 0) first[groups++] = (uint32_t)count;
        for (size_t k = 0; k < LANES; k++)
            if (tree->leaves[l].index[k] < UINT32_MAX) order[count++] = tree->leaves[l].index[k];
    }
    first[groups] = (uint32_t)count;
    return groups;
}

/* ---- searching ---- */

#define INLINE static inline __attribute__((always_inline)) /* into every width of its caller */

/* A half of the tree that is still to be searched, and how far off it is along each axis.  dist_sq is not
 * above that of any point in it, rounding included: it is made by the same operations from parts none of
 * which is larger. */
typedef struct branch {
    float x, y, z, dist_sq;
    size_t node;
} branch;

typedef struct walk {
    branch waiting[DEPTH_MAX];
    size_t count;
} walk;

INLINE float sum_of_squares(float x, float y, float z)
{
    return (x * x + y * y) + z * z;
}

INLINE float outside(float x, float lo, float hi)
{
    return x < lo ? lo - x : x > hi ? x - hi : 0;
}

INLINE void begin_walk(walk *w, const npg_kdtree *tree, const float q[3])
{
    const float *lo = tree->lo, *hi = tree->hi;
    w->waiting[0] = (branch){
        .x = outside(q[0], lo[0], hi[0]), .y = outside(q[1], lo[1], hi[1]), .z = outside(q[2], lo[2], hi[2])};
    w->count = 1;
}

/* The next leaf that may hold a point no farther than `worst`, nearer halves first; NULL: none is left.
 * Offsets stay in registers: selecting by axis is quicker than an array that is written and read at once. */
INLINE const leaf *next_leaf(walk *w, const npg_kdtree *tree, const float q[3], float worst)
{
    const branch *at = w->waiting + w->count;
    do {
        if (at-- == w->waiting) {
            w->count = 0;
            return NULL;
        }
    } while (at->dist_sq > worst);
    float x = at->x, y = at->y, z = at->z;
    size_t node = at->node;
    branch *next = w->waiting + (at - w->waiting);
    while (node < tree->inner) {
        const split *s = &tree->splits[node];
        float before = q[s->axis] - s->lo, behind = s->hi - q[s->axis];
        bool is_left = before < behind; /* nearer to the left half's end than to the right one's beginning */
        float off = is_left ? behind : before;
        next->x = s->axis == 0 ? off : x;
        next->y = s->axis == 1 ? off : y;
        next->z = s->axis == 2 ? off : z;
        next->dist_sq = sum_of_squares(next->x, next->y, next->z);
        next->node = 2 * node + 1 + is_left;
        node = 2 * node + 2 - is_left;
        next += next->dist_sq <= worst;
    }
    w->count = (size_t)(next - w->waiting);
    return &tree->leaves[node - tree->inner];
}

/* Bit k is set where the point of lane k is no farther than `worst`. */
INLINE unsigned near_lanes(float dist_sq[LANES], const leaf *l, const float q[3], float worst)
{
    unsigned near = 0;
    for (int k = 0; k < LANES; k++)
        dist_sq[k] = sum_of_squares(l->at[0][k] - q[0], l->at[1][k] - q[1], l->at[2][k] - q[2]);
    for (int k = 0; k < LANES; k++) near |= dist_sq[k] <= worst ? 1u << k : 0;
    return near;
}

/* ---- nearest ---- */

/* A squared distance and an index as one number: distances are not negative, so their bits are in order. */
INLINE uint64_t key_of(float dist_sq, uint32_t index)
{
    uint32_t bits;
    memcpy(&bits, &dist_sq, sizeof bits);
    return (uint64_t)bits << 32 | index;
}

INLINE float dist_of(uint64_t key)
{
    uint32_t bits = (uint32_t)(key >> 32);
    float dist_sq;
    memcpy(&dist_sq, &bits, sizeof dist_sq);
    return dist_sq;
}

/* The k nearest of a query, ascending, and what bounds those of the next one. */
typedef struct nearest {
    size_t k;
    uint64_t *keys; /* k, a loan */
    float last[3];  /* the query before */
} nearest;

/* A k-th neighbour is no farther than that of the query before, and the way there: what is beyond needs no
 * look.  With room for rounding, that of the smallest numbers included. */
INLINE float bound_of(const nearest *n, const float q[3])
{
    float way = sum_of_squares(q[0] - n->last[0], q[1] - n->last[1], q[2] - n->last[2]);
    float bound = sqrtf(dist_of(n->keys[n->k - 1])) + sqrtf(way);
    return bound * bound * 1.0001f + 1e-37f;
}

INLINE void insert(nearest *n, uint64_t key)
{
    size_t at = n->k - 1;
    if (key >= n->keys[at]) return;
    for (; at > 0 && n->keys[at - 1] > key; at--) n->keys[at] = n->keys[at - 1];
    n->keys[at] = key;
}

INLINE void take_leaf(nearest *n, const leaf *l, const float q[3])
{
    float dist_sq[LANES];
    unsigned near = near_lanes(dist_sq, l, q, dist_of(n->keys[n->k - 1]));
    for (; near; near &= near - 1) {
        int lane = __builtin_ctz(near);
        insert(n, key_of(dist_sq[lane], l->index[lane]));
    }
}

/* has_last: keys and last are those of a query before on this tree. */
INLINE void find_nearest(nearest *n, const npg_kdtree *tree, const float q[3], bool has_last)
{
    walk w;
    const leaf *l;
    float bound = has_last ? bound_of(n, q) : INFINITY;
    if (!(bound < INFINITY)) bound = INFINITY; /* NaN of infinities */
    for (size_t i = 0; i < n->k; i++) n->keys[i] = key_of(bound, UINT32_MAX);
    begin_walk(&w, tree, q);
    while ((l = next_leaf(&w, tree, q, dist_of(n->keys[n->k - 1])))) take_leaf(n, l, q);
    memcpy(n->last, q, sizeof n->last);
}

INLINE void unpack(uint32_t *index, float *dist_sq, const nearest *n)
{
    for (size_t i = 0; i < n->k; i++) {
        index[i] = (uint32_t)n->keys[i];
        dist_sq[i] = dist_of(n->keys[i]);
    }
}

/* ---- all points, leaf by leaf: the next one is near ---- */

typedef struct each {
    const npg_kdtree *tree;
    size_t k, parts;
    const uint8_t *only;
    npg_kdtree_visit *visit;
    void *user;
} each;

NPG_WIDE static void visit_leaves(const each *e, size_t first, size_t end)
{
    uint64_t keys[NPG_KDTREE_NEIGHBOURS];
    uint32_t index[NPG_KDTREE_NEIGHBOURS];
    float dist_sq[NPG_KDTREE_NEIGHBOURS];
    nearest n = {.k = e->k, .keys = keys};
    bool has_last = false;
    for (size_t i = first * LANES; i < end * LANES; i++) {
        uint32_t point = e->tree->leaves[i / LANES].index[i % LANES];
        if (point == UINT32_MAX || (e->only && !e->only[point])) continue;
        find_nearest(&n, e->tree, e->tree->points + 3 * (size_t)point, has_last);
        has_last = true;
        unpack(index, dist_sq, &n);
        e->visit(e->user, point, index, dist_sq);
    }
}

static npg_status visit_share(void *user, size_t part)
{
    const each *e = user;
    size_t leaves = e->tree->inner + 1;
    visit_leaves(e, leaves * part / e->parts, leaves * (part + 1) / e->parts);
    return NPG_OK;
}

npg_status npg_kdtree_each(const npg_kdtree *tree, size_t k, const uint8_t *only, npg_kdtree_visit *visit,
                           void *user, int threads)
{
    each e = {.tree = tree, .k = k, .only = only, .visit = visit, .user = user};
    NPG_REQUIRE(k >= 1 && k <= NPG_KDTREE_NEIGHBOURS && threads >= 0);
    e.parts = npg_parallel_parts(tree->count, QUERIES_MIN, (size_t)threads);
    return npg_parallel(visit_share, &e, e.parts);
}

/* ---- any queries ---- */

typedef struct search {
    const npg_kdtree *tree;
    uint32_t *index;
    float *dist_sq;
    const float *queries;
    size_t count, k, parts;
} search;

NPG_WIDE static void search_nearest(const search *s, uint64_t *keys, size_t first, size_t end)
{
    nearest n = {.k = s->k, .keys = keys};
    for (size_t i = first; i < end; i++) {
        find_nearest(&n, s->tree, s->queries + 3 * i, i > first);
        unpack(s->index + i * s->k, s->dist_sq + i * s->k, &n);
    }
}

static npg_status nearest_share(void *user, size_t part)
{
    const search *s = user;
    size_t first = s->count * part / s->parts, end = s->count * (part + 1) / s->parts;
    uint64_t few[NPG_KDTREE_NEIGHBOURS], *keys = few;
    if (s->k > NPG_KDTREE_NEIGHBOURS) NPG_TRY(npg_alloc_array(&keys, NPG_FOR_QUERY, s->k, sizeof *keys));
    search_nearest(s, keys, first, end);
    if (keys != few) npg_release(&keys);
    return NPG_OK;
}

static void take_lists(void *user, uint32_t point, const uint32_t *index, const float *dist_sq)
{
    const search *s = user;
    memcpy(s->index + point * s->k, index, s->k * sizeof *index);
    memcpy(s->dist_sq + point * s->k, dist_sq, s->k * sizeof *dist_sq);
}

npg_status npg_kdtree_nearest(const npg_kdtree *tree, uint32_t *index, float *dist_sq, const float *queries,
                              size_t query_count, size_t k, int threads)
{
    search s = {
        .tree = tree, .index = index, .dist_sq = dist_sq, .queries = queries, .count = query_count, .k = k};
    NPG_REQUIRE(k >= 1 && threads >= 0);
    if (queries == tree->points && query_count == tree->count && k <= NPG_KDTREE_NEIGHBOURS)
        return npg_kdtree_each(tree, k, NULL, take_lists, &s, threads); /* in an order that is quicker */
    s.parts = npg_parallel_parts(query_count, QUERIES_MIN, (size_t)threads);
    return npg_parallel(nearest_share, &s, s.parts);
}

npg_status npg_points_nearest(uint32_t *index, float *dist_sq, const float *points, size_t point_count,
                              const float *queries, size_t query_count, size_t k)
{
    npg_kdtree *tree;
    NPG_TRY(npg_kdtree_open(&tree, points, point_count));
    npg_status status = npg_kdtree_nearest(tree, index, dist_sq, queries, query_count, k, 0);
    npg_kdtree_close(&tree);
    return status;
}

npg_status npg_neighbours_take(npg_neighbours *out, npg_arena *arena, const float *points, size_t point_count,
                               const float *queries, size_t query_count, size_t k)
{
    out->index = npg_arena_take(arena, query_count, k * sizeof *out->index);
    out->dist_sq = npg_arena_take(arena, query_count, k * sizeof *out->dist_sq);
    NPG_TRY(npg_arena_status(arena));
    return npg_points_nearest(out->index, out->dist_sq, points, point_count, queries, query_count, k);
}

NPG_WIDE void npg_kdtree_any_within(const npg_kdtree *tree, uint8_t *yes, const float *queries,
                                    const float *radius_sq, size_t query_count)
{
    float dist_sq[LANES];
    for (size_t i = 0; i < query_count; i++) {
        const float *q = queries + 3 * i;
        const leaf *l;
        walk w;
        yes[i] = 0;
        begin_walk(&w, tree, q);
        while (!yes[i] && (l = next_leaf(&w, tree, q, radius_sq[i])))
            yes[i] = near_lanes(dist_sq, l, q, radius_sq[i]) != 0;
    }
}
