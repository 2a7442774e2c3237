/* latent: grid features sampled at the reference vertices, z(v) = tanh(sum_k weight[v][k] node[index[v][k]]).
 *
 * The vertices and normals never move, so trilinear weights are a constant sparse matrix: K entries per vertex
 * forward, its transpose as row lists backward; no atomics, equal input gives equal bits.  The mean over levels is
 * part of the weights.  Every node has 32 channels, two vectors a and b of 16, of which its level uses a part
 * (channel ranges). */

/* z: [rows][32]; index, weight: [rows][K]; nodes: [node_count][32].  Global size: (rows). */
kernel void latent_sample(global float *z, global const float *nodes, global const int *index,
                          global const float *weight, int K, int rows)
{
    size_t v = get_global_id(0);
    if (v >= (size_t)rows) return;
    float16 a = 0.0f, b = 0.0f;
    for (size_t k = v * K; k < (v + 1) * K; k++) {
        float16 w = (float16)(weight[k]);
        a = fma(w, vload16(2 * index[k], nodes), a);
        b = fma(w, vload16(2 * index[k] + 1, nodes), b);
    }
    vstore16(tanh(a), 2 * v, z);
    vstore16(tanh(b), 2 * v + 1, z);
}

/* dz, in place: through the tanh, dz (1 - z^2).  Global size: (rows). */
kernel void latent_tanh_back(global float *dz, global const float *z, int rows)
{
    size_t v = get_global_id(0);
    if (v >= (size_t)rows) return;
    for (size_t i = 2 * v; i < 2 * v + 2; i++) {
        float16 y = vload16(i, z);
        vstore16(vload16(i, dz) * (1.0f - y * y), i, dz);
    }
}

/* dnodes[n] = sum over the vertices that sample n of weight dz, in the channels [lo, hi) that the node uses.
 * start: [node_count + 1]; vertex, weight: [entries]; channels: [node_count] ranges.
 * Global size: (node_count). */
kernel void latent_back(global float *dnodes, global const float *dz, global const int *start,
                        global const int *vertex, global const float *weight, global const int *channels,
                        int node_count)
{
    const int16 lane = (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    size_t n = get_global_id(0);
    if (n >= (size_t)node_count) return;
    float16 a = 0.0f, b = 0.0f;
    for (int k = start[n]; k < start[n + 1]; k++) {
        float16 w = (float16)(weight[k]);
        a = fma(w, vload16(2 * vertex[k], dz), a);
        b = fma(w, vload16(2 * vertex[k] + 1, dz), b);
    }
    int lo = NPG_CHANNEL_FIRST(channels[n]), hi = NPG_CHANNEL_END(channels[n]);
    vstore16(select((float16)(0.0f), a, lane >= lo && lane < hi), 2 * n, dnodes);
    vstore16(select((float16)(0.0f), b, lane + 16 >= lo && lane + 16 < hi), 2 * n + 1, dnodes);
}
