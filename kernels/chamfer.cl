/* chamfer: the robust Chamfer distance of each frame and its gradient (paper: "Deformation Loss").
 *
 *     cd = sum_v w d_v^2 + sum_p w d_p^2,   w = exp(-(d^2)^2 / (2 alpha^2)), held constant in the gradient
 *
 * d_v: vertex to its nearest target point, d_p: target point to its nearest vertex.  Sums, not means.  A frame
 * has LOCAL work-items; each owns every LOCAL-th block of 16 vertices, walks both lists in order and adds what pulls at
 * its own: no atomics, equal input gives equal bits. */

#define SLOT 8

inline float weight_of(float dist_sq, float falloff)
{
    return exp(-dist_sq * dist_sq * falloff);
}

/* cd: [frames].  g: dL/dx per frame like x, overwritten.  x: moving vertices ([rows / 16][3][16] per frame);
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
    global const int *f = forward + frame * SLOT, *r = reverse + frame * SLOT;
    global float *grad = g + (size_t)f[1] * 48;
    x += (size_t)f[1] * 48;
    points += (size_t)f[3] * 48;
    float sum_v = 0.0f, sum_p = 0.0f;
    for (int block = ITEM; block < rows / 16; block += LOCAL) {
        float part = 0.0f;
        for (int lane = 0; lane < 16; lane++) {
            int v = block * 16 + lane, p = v < f[0] ? to_points[f[5] + v] : 0;
            size_t at = (size_t)block * 48 + lane, to = (size_t)(p / 16) * 48 + p % 16;
            float3 d = (float3)(x[at] - points[to], x[at + 16] - points[to + 16], x[at + 32] - points[to + 32]);
            float dist_sq = d.x * d.x + d.y * d.y + d.z * d.z;
            float w = v < f[0] ? weight_of(dist_sq, falloff) : 0.0f;
            part += v < f[0] ? w * dist_sq : 0.0f;
            grad[at] = 2.0f * w * d.x;
            grad[at + 16] = 2.0f * w * d.y;
            grad[at + 32] = 2.0f * w * d.z;
        }
        sum_v += part;
    }
    for (int start = 0; start < r[0]; start += 16) {
        float part = 0.0f;
        for (int p = start; p < min(start + 16, r[0]); p++) {
            int v = to_verts[r[5] + p];
            if (v / 16 % LOCAL != ITEM) continue;
            size_t at = (size_t)(v / 16) * 48 + v % 16, to = (size_t)(p / 16) * 48 + p % 16;
            float3 d = (float3)(x[at] - points[to], x[at + 16] - points[to + 16], x[at + 32] - points[to + 32]);
            float dist_sq = d.x * d.x + d.y * d.y + d.z * d.z;
            float w = weight_of(dist_sq, falloff);
            part += w * dist_sq;
            grad[at] += 2.0f * w * d.x;
            grad[at + 16] += 2.0f * w * d.y;
            grad[at + 32] += 2.0f * w * d.z;
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
