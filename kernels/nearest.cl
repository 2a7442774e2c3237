/* nearest: the closest of a set of points, for many queries in many frames.
 *
 * A tree holds the points in Morton order in leaves of 16 ([leaf][3][16]); a box block holds the boxes of 16 children
 * ([block][6][16]: low x, y, z, high x, y, z); the level above has a box for each of those, up to one block.  Tests
 * run on 16 boxes or points at once.  Points that move keep their order and leaves: refitting the boxes is enough.
 * A search starts from a known candidate (the answer of the last epoch, or of the neighbouring query), so that it
 * mostly has to confirm it.  Ties go to the candidate, then to the lower index.
 *
 * slots: [frames][8] = {query count, first query leaf, point count, first leaf, first box block, first result,
 * 0, 0}.  Padding of the last leaf repeats the last point. */

#define SLOT 8
#define FAR  1e18f

/* Build constants from the tuning of the device: QUERIES, LOCAL. */

/* Box blocks of the level over `count` children. */
inline int blocks_over(int count)
{
    return (count + 15) / 16;
}

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
    global const int *slot = slots + (first + get_group_id(0)) * SLOT;
    int children = (slot[2] + 15) / 16;
    global const float *from = points + (size_t)slot[3] * 48;
    global float *to = boxes + (size_t)slot[4] * 96;
    for (int level = 0;; level++) {
        int blocks = blocks_over(children), size = level ? 96 : 48;
        for (int i = ITEM; i < blocks * 16; i += LOCAL) {
            global float *box = to + (size_t)(i / 16) * 96 + i % 16;
            for (int axis = 0; axis < 3; axis++) {
                global const float *child = from + (size_t)i * size + 16 * axis;
                bool real = i < children;
                box[16 * axis] = real ? lowest(vload16(0, child)) : FAR;
                box[16 * (axis + 3)] = real ? highest(vload16(0, level ? child + 48 : child)) : -FAR;
            }
        }
        if (blocks == 1) return;
        SYNC
        from = to;
        to += (size_t)blocks * 96;
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
    int stack_node[96], stack_level[96], top = 1;
    stack_node[0] = 0;
    stack_level[0] = levels - 1;
    while (top) {
        int level = stack_level[--top], node = stack_node[top];
        int bits = bits_of(boxes_nearer(boxes + (size_t)(starts[level] + node) * 96, q, best.dist_sq));
        while (bits) {
            int child = node * 16 + 31 - clz(bits & -bits);
            bits &= bits - 1;
            if (level == 0) {
                best = search_leaf(points + (size_t)child * 48, child * 16, q, best);
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
    global const float *leaf = points + (size_t)(index / 16) * 48 + index % 16;
    float3 d = (float3)(leaf[0], leaf[16], leaf[32]) - q;
    return (found){index, d.x * d.x + d.y * d.y + d.z * d.z};
}

/* index: [results], the candidates on entry, the nearest on return.  A work-item answers QUERIES queries.
 * Global size: (ceil(most queries / QUERIES), count). */
kernel void nearest_find(global int *index, global const float *queries, global const float *points,
                         global const float *boxes, global const int *slots, int first_frame,
                         int count)
{
    if (get_global_id(1) >= (size_t)count) return;
    global const int *slot = slots + (first_frame + get_global_id(1)) * SLOT;
    int first = get_global_id(0) * QUERIES, last = min(first + QUERIES, slot[0]), starts[8], levels = 0;
    for (int children = (slot[2] + 15) / 16, start = 0;; levels++) {
        starts[levels] = start;
        children = blocks_over(children);
        start += children;
        if (children == 1) break;
    }
    levels++;
    points += (size_t)slot[3] * 48;
    boxes += (size_t)slot[4] * 96;
    int before = -1;
    for (int i = first; i < last; i++) {
        global const float *block = queries + (size_t)(slot[1] + i / 16) * 48 + i % 16;
        float3 q = (float3)(block[0], block[16], block[32]);
        found best = candidate(points, index[slot[5] + i], q);
        if (before >= 0) {
            found other = candidate(points, before, q);
            if (other.dist_sq < best.dist_sq) best = other;
        }
        best = search(points, boxes, starts, levels, q, best);
        /* repeated points of the last leaf stand for the last one */
        before = min(best.index, slot[2] - 1);
        index[slot[5] + i] = before;
    }
}
