/* isometry: mean absolute change of edge lengths (paper: "Isometry Loss"), and the sum of both gradients.
 *
 *     iso = sum over half-edges of | |x_i - x_j| - rest |,  each edge counted from both ends
 *
 * Each vertex gathers from its neighbours: start [rows + 1], neighbour and rest [half-edges]. */

/* g: dL/dx of the data term on entry, gain[frame] g + iso_gain d(iso / 2)/dx on return.
 * part: [frames][blocks], sums of | | over the half-edges of a block's vertices.  Padding rows have no neighbours.
 * Global size: (blocks of the rows, count), frames first ... */
kernel void isometry_back(global float *g, global float *part, global const float *x, global const int *start,
                          global const int *neighbour, global const float *rest, global const float *gain,
                          float iso_gain, int rows, int first, int count)
{
    size_t block = get_global_id(0), frame = first + get_global_id(1);
    if (block >= (size_t)rows / NPG_LANES || frame >= (size_t)(first + count)) return;
    x += frame * rows * 3;
    g += frame * rows * 3;
    float sum = 0.0f;
    for (size_t lane = 0; lane < NPG_LANES; lane++) {
        size_t at = block * NPG_POINT_BLOCK + lane, row = block * NPG_LANES + lane;
        float3 mine = POINT(x, at), pull = 0.0f;
        for (int k = start[row]; k < start[row + 1]; k++) {
            float3 e = mine - POINT(x, NPG_POINT_AT(neighbour[k]));
            float size = sqrt(e.x * e.x + e.y * e.y + e.z * e.z), change = size - rest[k];
            sum += fabs(change);
            pull += e * (size > 0.0f ? sign(change) / size : 0.0f);
        }
        g[at] = gain[frame] * g[at] + iso_gain * pull.x;
        g[at + NPG_LANES] = gain[frame] * g[at + NPG_LANES] + iso_gain * pull.y;
        g[at + 2 * NPG_LANES] = gain[frame] * g[at + 2 * NPG_LANES] + iso_gain * pull.z;
    }
    part[frame * (rows / NPG_LANES) + block] = sum;
}
