/* chamfer: the robust Chamfer distance of each frame and its gradient (paper: "Deformation Loss").
 *
 *     cd = sum_v w d_v^2 + sum_p w d_p^2,   w = exp(-(d^2)^2 / (2 alpha^2)), held constant in the gradient
 *
 * d_v: vertex to its nearest target point, d_p: target point to its nearest vertex.  Sums, not means.  A frame
 * has LOCAL work-items; each owns every LOCAL-th block of 16 vertices, walks both lists in order and adds what pulls at
 * its own: no atomics, equal input gives equal bits. */

inline float weight_of(float dist_sq, float falloff)
{
    return exp(-dist_sq * dist_sq * falloff);
}

/* cd: [frames].  g: dL/dx per frame like x, overwritten.  x: moving vertices (blocks, per frame);
 * points: targets; to_points / to_verts: nearest indices; forward / reverse: the slots (op nearest) of the searches
 * vertex -> point and point -> vertex.  falloff = 1 / (2 alpha^2), 0 for plain squared distances.
 * Global size: one group of LOCAL items per frame, frames first ... */
GROUP_KERNEL
chamfer_frame(global float *cd, global float *g, global const float *x, global const float *points,
              global const int *to_points, global const int *to_verts, global const int *forward,
              global const int *reverse, float falloff, int rows, int first, int count)
{
    local float sums[LOCAL];
    size_t frame = first + get_group_id(0);
    if (frame >= (size_t)(first + count)) return;
    global const int *f = forward + frame * NPG_SLOT, *r = reverse + frame * NPG_SLOT;
    global float *grad = g + (size_t)f[NPG_SLOT_QUERY_BLOCK] * NPG_POINT_BLOCK;
    int real = f[NPG_SLOT_QUERIES], point_count = r[NPG_SLOT_QUERIES];
    x += (size_t)f[NPG_SLOT_QUERY_BLOCK] * NPG_POINT_BLOCK;
    points += (size_t)f[NPG_SLOT_POINT_BLOCK] * NPG_POINT_BLOCK;
    to_points += f[NPG_SLOT_RESULT];
    to_verts += r[NPG_SLOT_RESULT];
    float sum_v = 0.0f, sum_p = 0.0f;
    for (int block = ITEM; block < rows / NPG_LANES; block += LOCAL) {
        float part = 0.0f;
        for (int lane = 0; lane < NPG_LANES; lane++) {
            int v = block * NPG_LANES + lane, p = v < real ? to_points[v] : 0;
            size_t at = (size_t)block * NPG_POINT_BLOCK + lane, to = NPG_POINT_AT(p);
            float3 d = POINT(x, at) - POINT(points, to);
            float dist_sq = d.x * d.x + d.y * d.y + d.z * d.z;
            float w = v < real ? weight_of(dist_sq, falloff) : 0.0f;
            part += v < real ? w * dist_sq : 0.0f;
            grad[at] = 2.0f * w * d.x;
            grad[at + NPG_LANES] = 2.0f * w * d.y;
            grad[at + 2 * NPG_LANES] = 2.0f * w * d.z;
        }
        sum_v += part;
    }
    for (int start = 0; start < point_count; start += NPG_LANES) {
        float part = 0.0f;
        for (int p = start; p < min(start + NPG_LANES, point_count); p++) {
            int v = to_verts[p];
            if (v / NPG_LANES % LOCAL != ITEM) continue; /* another item's vertex */
            size_t at = NPG_POINT_AT(v), to = NPG_POINT_AT(p);
            float3 d = POINT(x, at) - POINT(points, to);
            float dist_sq = d.x * d.x + d.y * d.y + d.z * d.z;
            float w = weight_of(dist_sq, falloff);
            part += w * dist_sq;
            grad[at] += 2.0f * w * d.x;
            grad[at + NPG_LANES] += 2.0f * w * d.y;
            grad[at + 2 * NPG_LANES] += 2.0f * w * d.z;
        }
        sum_p += part;
    }
    sums[ITEM] = sum_v + sum_p;
    if (LOCAL > 1) barrier(CLK_LOCAL_MEM_FENCE);
    if (ITEM != 0) return;
    float total = sums[0];
    for (int i = 1; i < LOCAL; i++) total += sums[i];
    cd[frame] = total;
}
