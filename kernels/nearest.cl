/* nearest: the closest of a set of points, for many queries in many frames.
 *
 * A tree holds the points in Morton order in leaves of 16; a box block holds the boxes of 16 children; the level
 * above has a box for each of those, up to one block.  Tests run on 16 boxes or points at once.  Points that move
 * keep their order and leaves: refitting the boxes is enough.  A search starts from a known candidate (the answer of
 * the last epoch, or of the neighbouring query), so that it mostly has to confirm it.  Ties go to the candidate,
 * then to the lower index.
 *
 * Layouts of points, boxes and slots: layout.h; a leaf is a block of points. */

#define FAR 1e18f /* an empty box begins and ends there; its square is still finite */

/* Build constants from the tuning of the device: QUERIES, LOCAL. */

inline float lowest(float16 v)
{
    float8 a = fmin(v.lo, v.hi);
    float4 b = fmin(a.lo, a.hi);
    float2 c = fmin(b.lo, b.hi);
    return fmin(c.x, c.y);
}

inline float highest(float16 v)
{
    return -lowest(-v);
}

/* Boxes of all levels of the tree of each frame, from its points.  Global size: one group of LOCAL items per frame. */
GROUP_KERNEL
nearest_refit(global float *boxes, global const float *points, global const int *slots, int first, int count)
{
    if (get_group_id(0) >= (size_t)count) return;
    global const int *slot = slots + (first + get_group_id(0)) * NPG_SLOT;
    int children = NPG_BLOCKS(slot[NPG_SLOT_POINTS]);
    global const float *from = points + (size_t)slot[NPG_SLOT_POINT_BLOCK] * NPG_POINT_BLOCK;
    global float *to = boxes + (size_t)slot[NPG_SLOT_BOX_BLOCK] * NPG_BOX_BLOCK;
    for (int level = 0;; level++) {
        int blocks = NPG_BLOCKS(children), size = level ? NPG_BOX_BLOCK : NPG_POINT_BLOCK;
        for (int i = ITEM; i < blocks * NPG_LANES; i += LOCAL) {
            global float *box = to + (size_t)(i / NPG_LANES) * NPG_BOX_BLOCK + i % NPG_LANES;
            for (int axis = 0; axis < 3; axis++) {
                global const float *low = from + (size_t)i * size + NPG_LANES * axis;
                global const float *high = level ? low + 3 * NPG_LANES : low;
                bool real = i < children;
                box[NPG_LANES * axis] = real ? lowest(vload16(0, low)) : FAR;
                box[NPG_LANES * (axis + 3)] = real ? highest(vload16(0, high)) : -FAR;
            }
        }
        if (blocks == 1) return;
        SYNC
        from = to;
        to += (size_t)blocks * NPG_BOX_BLOCK;
        children = blocks;
    }
}

inline int bits_of(int16 mask)
{
    const int16 bit = (int16)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768);
    int16 m = mask & bit;
    int8 a = m.lo | m.hi;
    int4 b = a.lo | a.hi;
    int2 c = b.lo | b.hi;
    return c.x | c.y;
}

inline int16 boxes_nearer(global const float *box, float3 q, float best)
{
    float16 zero = 0.0f;
    float16 x = fmax(fmax(vload16(0, box) - q.x, q.x - vload16(3, box)), zero);
    float16 y = fmax(fmax(vload16(1, box) - q.y, q.y - vload16(4, box)), zero);
    float16 z = fmax(fmax(vload16(2, box) - q.z, q.z - vload16(5, box)), zero);
    return isless(x * x + y * y + z * z, (float16)(best));
}

typedef struct found {
    int index;
    float dist_sq;
} found;

inline found search_leaf(global const float *leaf, int first, float3 q, found best)
{
    float16 x = vload16(0, leaf) - q.x, y = vload16(1, leaf) - q.y, z = vload16(2, leaf) - q.z;
    float16 d = x * x + y * y + z * z;
    float low = lowest(d);
    if (low < best.dist_sq) {
        int bits = bits_of(islessequal(d, (float16)(low)));
        best.dist_sq = low;
        best.index = first + 31 - clz(bits & -bits);
    }
    return best;
}

/* The point nearest to q; best is a candidate.  levels box levels, starts[l] the first block of each. */
inline found search(global const float *points, global const float *boxes, const int *starts, int levels, float3 q,
                    found best)
{
    /* A node pops and pushes at most 16 children: 15 more wait for each level of boxes but the lowest.  The host lets
     * no window have more than 2^25 points (npg_motion_open): 2^21 leaves, so 6 levels of boxes, 76 entries. */
    int stack_node[96], stack_level[96], top = 1;
    stack_node[0] = 0;
    stack_level[0] = levels - 1;
    while (top) {
        int level = stack_level[--top], node = stack_node[top];
        int bits = bits_of(boxes_nearer(boxes + (size_t)(starts[level] + node) * NPG_BOX_BLOCK, q, best.dist_sq));
        while (bits) {
            int child = node * NPG_LANES + 31 - clz(bits & -bits); /* the lowest bit that is set */
            bits &= bits - 1;
            if (level == 0) {
                best = search_leaf(points + (size_t)child * NPG_POINT_BLOCK, child * NPG_LANES, q, best);
            } else {
                stack_node[top] = child;
                stack_level[top++] = level - 1;
            }
        }
    }
    return best;
}

inline found candidate(global const float *points, int index, float3 q)
{
    float3 d = POINT(points, NPG_POINT_AT(index)) - q;
    return (found){index, d.x * d.x + d.y * d.y + d.z * d.z};
}

/* index: [results], the candidates on entry, the nearest on return.  A work-item answers QUERIES queries.
 * Global size: (ceil(most queries / QUERIES), count). */
kernel void nearest_find(global int *index, global const float *queries, global const float *points,
                         global const float *boxes, global const int *slots, int first_frame,
                         int count)
{
    if (get_global_id(1) >= (size_t)count) return;
    global const int *slot = slots + (first_frame + get_global_id(1)) * NPG_SLOT;
    int first = get_global_id(0) * QUERIES, last = min(first + QUERIES, slot[NPG_SLOT_QUERIES]);
    int starts[8], levels = 0; /* 6 levels at most, see search() */
    for (int children = NPG_BLOCKS(slot[NPG_SLOT_POINTS]), start = 0;; levels++) {
        starts[levels] = start;
        children = NPG_BLOCKS(children);
        start += children;
        if (children == 1) break;
    }
    levels++;
    points += (size_t)slot[NPG_SLOT_POINT_BLOCK] * NPG_POINT_BLOCK;
    boxes += (size_t)slot[NPG_SLOT_BOX_BLOCK] * NPG_BOX_BLOCK;
    queries += (size_t)slot[NPG_SLOT_QUERY_BLOCK] * NPG_POINT_BLOCK;
    index += slot[NPG_SLOT_RESULT];
    int before = -1; /* the answer to the query before: Morton neighbours have near answers */
    for (int i = first; i < last; i++) {
        float3 q = POINT(queries, NPG_POINT_AT(i));
        found best = candidate(points, index[i], q);
        if (before >= 0) {
            found other = candidate(points, before, q);
            if (other.dist_sq < best.dist_sq) best = other;
        }
        best = search(points, boxes, starts, levels, q, best);
        /* repeated points of the last leaf stand for the last one */
        before = min(best.index, slot[NPG_SLOT_POINTS] - 1);
        index[i] = before;
    }
}
