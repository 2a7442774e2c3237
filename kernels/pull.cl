/* pull: known correspondences between points of the moving surface and target points, and their gradient.
 *
 *     r = sum_i b_i x_{v_i} + q          loss = sum w ((1 - a) (n . r)^2 + a |r|^2)
 *
 * A surface point is a fixed combination of three vertices plus a constant; q is that constant less the target.  n is
 * the surface's normal there: distances along the surface count by the small share a only, so that the surface may
 * slide.  Our own; it takes the place of the Chamfer distance once a coarse alignment has brought surface and points
 * together (align/tracker.h). */

/* pulls: [..][16] floats = v0 v1 v2 (as int bits) w | b0 b1 b2 a | q x y z 0 | n x y z 0, those of frame f from
 * start[f] to start[f + 1].  x, g: blocks, frame after frame; g is overwritten.  loss: [frames].  A frame has LOCAL
 * work-items (build constant, from the tuning of the device); each owns every LOCAL-th block of 16 vertices, walks
 * the list in order and adds what pulls at its own: equal input gives equal bits.  Global size: one group of LOCAL
 * items per frame, frames first ... */
#define IS_MINE(v) ((v) / NPG_LANES % LOCAL == ITEM)

GROUP_KERNEL
pull_frame(global float *loss, global float *g, global const float *x, global const float *pulls,
           global const int *start, int rows, int first, int count)
{
    local float sums[LOCAL];
    size_t frame = first + get_group_id(0);
    if (frame >= (size_t)(first + count)) return;
    x += frame * rows * 3;
    g += frame * rows * 3;
    for (int block = ITEM; block < rows / NPG_LANES; block += LOCAL)
        for (int i = 0; i < NPG_POINT_BLOCK; i++) g[block * NPG_POINT_BLOCK + i] = 0.0f;
    float total = 0.0f, part = 0.0f;
    for (int k = start[frame]; k < start[frame + 1]; k++) {
        global const float *p = pulls + (size_t)k * NPG_PULL_FLOATS;
        int3 v = as_int3((float3)(p[0], p[1], p[2]));
        bool mine0 = IS_MINE(v.x), mine1 = IS_MINE(v.y), mine2 = IS_MINE(v.z);
        if (k % 64 == 0) { /* float sums of at most 64 terms, summed in turn, round less than one long sum */
            total += part;
            part = 0.0f;
        }
        if (!mine0 && !mine1 && !mine2) continue;
        size_t a0 = NPG_POINT_AT(v.x), a1 = NPG_POINT_AT(v.y), a2 = NPG_POINT_AT(v.z);
        float3 r = p[4] * POINT(x, a0) + p[5] * POINT(x, a1) + p[6] * POINT(x, a2) + (float3)(p[8], p[9], p[10]);
        float3 n = (float3)(p[12], p[13], p[14]);
        float along = p[7], w = p[3], over = dot(n, r);
        float3 pull = 2.0f * w * ((1.0f - along) * over * n + along * r);
        if (mine0) part += w * ((1.0f - along) * over * over + along * dot(r, r));
        for (int axis = 0; axis < 3; axis++) {
            float d = axis == 0 ? pull.x : axis == 1 ? pull.y : pull.z;
            if (mine0) g[a0 + NPG_LANES * axis] += p[4] * d;
            if (mine1) g[a1 + NPG_LANES * axis] += p[5] * d;
            if (mine2) g[a2 + NPG_LANES * axis] += p[6] * d;
        }
    }
    sums[ITEM] = total + part;
    if (LOCAL > 1) barrier(CLK_LOCAL_MEM_FENCE);
    if (ITEM != 0) return;
    total = sums[0];
    for (int i = 1; i < LOCAL; i++) total += sums[i];
    loss[frame] = total;
}
