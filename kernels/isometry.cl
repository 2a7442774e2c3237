/* isometry: mean absolute change of edge lengths (paper: "Isometry Loss"), and the sum of both gradients.
 *
 *     iso = sum over half-edges of | |x_i - x_j| - rest |,  each edge counted from both ends
 *
 * Each vertex gathers from its neighbours: start [rows + 1], neighbour and rest [half-edges]. */

/* g: dL/dx of the data term on entry, gain[frame] g + iso_gain d(iso / 2)/dx on return.
 * part: [frames][rows / 16], sums of | | over the half-edges of 16 vertices.  Padding rows have no neighbours.
 * Global size: (rows / 16, count), frames first ... */
kernel void isometry_back(global float *g, global float *part, global const float *x, global const int *start,
                          global const int *neighbour, global const float *rest, global const float *gain,
                          float iso_gain, int rows, int first, int count)
{
    size_t block = get_global_id(0), frame = first + get_global_id(1);
    if (block >= (size_t)rows / 16 || frame >= (size_t)(first + count)) return;
    x += frame * rows * 3;
    g += frame * rows * 3;
    float sum = 0.0f;
    for (size_t lane = 0; lane < 16; lane++) {
        size_t at = block * 48 + lane;
        float3 mine = (float3)(x[at], x[at + 16], x[at + 32]), pull = 0.0f;
        for (int k = start[block * 16 + lane]; k < start[block * 16 + lane + 1]; k++) {
            size_t to = (size_t)(neighbour[k] / 16) * 48 + neighbour[k] % 16;
            float3 e = mine - (float3)(x[to], x[to + 16], x[to + 32]);
            float size = sqrt(e.x * e.x + e.y * e.y + e.z * e.z), change = size - rest[k];
            sum += fabs(change);
            pull += e * (size > 0.0f ? sign(change) / size : 0.0f);
        }
        g[at] = gain[frame] * g[at] + iso_gain * pull.x;
        g[at + 16] = gain[frame] * g[at + 16] + iso_gain * pull.y;
        g[at + 32] = gain[frame] * g[at + 32] + iso_gain * pull.z;
    }
    part[frame * (rows / 16) + block] = sum;
}
