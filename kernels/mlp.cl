/* mlp: the decoder psi of the paper's section on the temporal deformation model.
 *
 *     y = (z(v), gamma(t))        h1 = f(z W1z + c_t)     h2 = f(h1 W2 + b2)     out = h2 W3 + b3
 *     c_t = gamma(t) W1t + b1     f(x) = x for x > 0, SLOPE x else
 *
 * The first layer is split: z W1z is computed once per vertex, c_t once per frame (op "time"), and the sum is made
 * when it is needed.  The backward pass forms h1 again from both rather than keep it.
 *
 * Layouts.  Vertices come in blocks of ROWS.  A matrix with one row per vertex and C columns is stored in panels:
 * [block][C / 32][ROWS][32], so that all operands of the inner products are contiguous.  Weights K x C are stored
 * [C / 32][K][32].  One work-item handles whole blocks with register tiles of MR rows x 32 columns; a work-group is
 * one work-item, and group g of G takes the blocks g, g + G, ...  Every sum over vertices is made per group, in a
 * fixed order, and added over groups by mlp_reduce: equal input and equal G give equal bits.
 *
 * Build constants: ROWS (multiple of MR), MR, CZ (columns of z, multiple of 32), W1, W2 (multiples of 32), SLOPE.
 * Padded rows take part in the products; their output gradient must be 0, then they change nothing. */

#define BLOCK(C) ((size_t)ROWS * (C))
#define WMAX (W1 > W2 ? W1 : W2)

/* Offsets (floats) in the parameters, in their gradient and in a group's sums of it; w1t and b1 of op "time" follow
 * in the first two. */
#define AT_W2 0
#define AT_W3 (AT_W2 + (size_t)W1 * W2)
#define AT_B2 (AT_W3 + (size_t)W2 * 16)
#define AT_B3 (AT_B2 + W2)
#define AT_W1Z (AT_B3 + 16)
#define AT_END (AT_W1Z + (size_t)CZ * W1)

/* acc (MR x 32) += rows r0.. of a block a (K columns, panels) x packed weights b (K x 32). */
#define TILE_ADD(acc, a, b, K, r0)                                                                                   \
    for (int kp_ = 0; kp_ < (K); kp_ += 32) {                                                                        \
        global const float *a_ = (a) + ((size_t)kp_ * ROWS + (size_t)(r0) * 32);                                     \
        global const float *b_ = (b) + (size_t)kp_ * 32;                                                             \
        for (int k_ = 0; k_ < 32; k_++) {                                                                            \
            float16 b0_ = vload16(0, b_ + 32 * k_), b1_ = vload16(1, b_ + 32 * k_);                                  \
            _Pragma("unroll") for (int i_ = 0; i_ < MR; i_++)                                                        \
            {                                                                                                        \
                float16 s_ = (float16)(a_[32 * i_ + k_]);                                                            \
                acc[i_][0] = fma(s_, b0_, acc[i_][0]);                                                               \
                acc[i_][1] = fma(s_, b1_, acc[i_][1]);                                                               \
            }                                                                                                        \
        }                                                                                                            \
    }

#define TILE_FILL(acc, v0, v1)                                                                                       \
    _Pragma("unroll") for (int i_ = 0; i_ < MR; i_++)                                                                \
    {                                                                                                                \
        acc[i_][0] = v0;                                                                                             \
        acc[i_][1] = v1;                                                                                             \
    }

/* sums (K x 32, packed) += a^T b over the ROWS rows of a block a (K columns) and one panel b. */
#define TILE_GRAD(sums, a, b, K)                                                                                     \
    for (int k0_ = 0; k0_ < (K); k0_ += 8) {                                                                         \
        global const float *a_ = (a) + (size_t)(k0_ / 32) * 32 * ROWS + k0_ % 32;                                    \
        global float *s_ = (sums) + (size_t)k0_ * 32;                                                                \
        float16 g_[8][2];                                                                                            \
        _Pragma("unroll") for (int i_ = 0; i_ < 8; i_++)                                                             \
        {                                                                                                            \
            g_[i_][0] = vload16(2 * i_, s_);                                                                         \
            g_[i_][1] = vload16(2 * i_ + 1, s_);                                                                     \
        }                                                                                                            \
        for (int r_ = 0; r_ < ROWS; r_++) {                                                                          \
            float16 b0_ = vload16(0, (b) + 32 * r_), b1_ = vload16(1, (b) + 32 * r_);                                \
            _Pragma("unroll") for (int i_ = 0; i_ < 8; i_++)                                                         \
            {                                                                                                        \
                float16 v_ = (float16)(a_[32 * r_ + i_]);                                                            \
                g_[i_][0] = fma(v_, b0_, g_[i_][0]);                                                                 \
                g_[i_][1] = fma(v_, b1_, g_[i_][1]);                                                                 \
            }                                                                                                        \
        }                                                                                                            \
        _Pragma("unroll") for (int i_ = 0; i_ < 8; i_++)                                                             \
        {                                                                                                            \
            vstore16(g_[i_][0], 2 * i_, s_);                                                                         \
            vstore16(g_[i_][1], 2 * i_ + 1, s_);                                                                     \
        }                                                                                                            \
    }

inline float16 leaky(float16 x)
{
    return select(SLOPE * x, x, isgreater(x, (float16)(0.0f)));
}

/* d through leaky, where y = leaky(x) has the sign of x. */
inline float16 leaky_back(float16 d, float16 y)
{
    return select(SLOPE * d, d, isgreater(y, (float16)(0.0f)));
}

/* h1 of one block for one frame. */
inline void first_layer(global float *h1, global const float *p, global const float *c)
{
    for (int panel = 0; panel < W1; panel += 32) {
        float16 c0 = vload16(0, c + panel), c1 = vload16(1, c + panel);
        global const float *from = p + (size_t)panel * ROWS;
        global float *to = h1 + (size_t)panel * ROWS;
        for (int r = 0; r < ROWS; r++) {
            vstore16(leaky(vload16(0, from + 32 * r) + c0), 0, to + 32 * r);
            vstore16(leaky(vload16(1, from + 32 * r) + c1), 1, to + 32 * r);
        }
    }
}

/* p [blocks][W1 panels] = z [blocks][CZ panels] x w1z (packed CZ x W1).  Global size: (G). */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void mlp_input(global float *p, global const float *z,
                                                                     global const float *params, int blocks)
{
    global const float *w1z = params + AT_W1Z;
    for (int block = get_global_id(0); block < blocks; block += get_global_size(0))
        for (int panel = 0; panel < W1; panel += 32)
            for (int r0 = 0; r0 < ROWS; r0 += MR) {
                float16 acc[MR][2];
                TILE_FILL(acc, (float16)(0.0f), (float16)(0.0f))
                TILE_ADD(acc, z + block * BLOCK(CZ), w1z + (size_t)panel * CZ, CZ, r0)
                global float *to = p + block * BLOCK(W1) + (size_t)panel * ROWS + 32 * r0;
                _Pragma("unroll") for (int i = 0; i < MR; i++)
                {
                    vstore16(acc[i][0], 2 * i, to);
                    vstore16(acc[i][1], 2 * i + 1, to);
                }
            }
}

inline void second_layer(global float *h2, global const float *h1, global const float *w2, global const float *b2)
{
    for (int panel = 0; panel < W2; panel += 32) {
        float16 bias0 = vload16(0, b2 + panel), bias1 = vload16(1, b2 + panel);
        for (int r0 = 0; r0 < ROWS; r0 += MR) {
            float16 acc[MR][2];
            TILE_FILL(acc, bias0, bias1)
            TILE_ADD(acc, h1, w2 + (size_t)panel * W1, W1, r0)
            global float *to = h2 + (size_t)panel * ROWS + 32 * r0;
            _Pragma("unroll") for (int i = 0; i < MR; i++)
            {
                vstore16(leaky(acc[i][0]), 2 * i, to);
                vstore16(leaky(acc[i][1]), 2 * i + 1, to);
            }
        }
    }
}

/* out (ROWS x 8) = h2 w3 + b3; w3 is W2 x 16, its columns 7..15 are 0. */
inline void head_layer(global float *out, global const float *h2, global const float *w3, global const float *b3)
{
    for (int r0 = 0; r0 < ROWS; r0 += MR) {
        float16 acc[MR];
        _Pragma("unroll") for (int i = 0; i < MR; i++) acc[i] = vload16(0, b3);
        for (int panel = 0; panel < W2; panel += 32) {
            global const float *a = h2 + (size_t)panel * ROWS + 32 * r0;
            for (int k = 0; k < 32; k++) {
                float16 w = vload16(panel + k, w3);
                _Pragma("unroll") for (int i = 0; i < MR; i++) acc[i] = fma((float16)(a[32 * i + k]), w, acc[i]);
            }
        }
        _Pragma("unroll") for (int i = 0; i < MR; i++) vstore8(acc[i].lo, r0 + i, out);
    }
}

/* For the frames first_frame ...: out [all frames][blocks * ROWS][8] and, for the backward pass,
 * h2 [frames][blocks][W2 panels]; with keep = 0 h2 is not kept and has room for G blocks.  c: [all frames][W1].
 * scratch: [G][2] blocks of max(W1, W2).  Global size: (G). */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void
mlp_forward(global float *out, global float *h2, global const float *p, global const float *c,
            global const float *params, global float *scratch, int blocks, int frames, int first_frame, int keep)
{
    size_t group = get_global_id(0);
    global float *h1 = scratch + group * 2 * BLOCK(WMAX);
    for (int item = group; item < blocks * frames; item += get_global_size(0)) {
        size_t frame = item / blocks, block = item % blocks;
        global float *mine = h2 + (keep ? (frame * blocks + block) * BLOCK(W2) : group * BLOCK(W2));
        first_layer(h1, p + block * BLOCK(W1), c + (first_frame + frame) * W1);
        second_layer(mine, h1, params + AT_W2, params + AT_B2);
        head_layer(out + ((first_frame + frame) * blocks + block) * ROWS * 8, mine, params + AT_W3, params + AT_B3);
    }
}

/* d2 = (dout w3^T) f'(h2), and the column sums of d2 into db2. */
inline void head_back(global float *d2, global float *db2, global const float *dout, global const float *h2,
                      global const float *w3t)
{
    for (int panel = 0; panel < W2; panel += 32) {
        float16 w[7][2], sum0 = vload16(0, db2 + panel), sum1 = vload16(1, db2 + panel);
        _Pragma("unroll") for (int o = 0; o < 7; o++)
        {
            w[o][0] = vload16(0, w3t + o * W2 + panel);
            w[o][1] = vload16(1, w3t + o * W2 + panel);
        }
        for (int r = 0; r < ROWS; r++) {
            float16 a0 = 0.0f, a1 = 0.0f;
            _Pragma("unroll") for (int o = 0; o < 7; o++)
            {
                float16 s = (float16)(dout[8 * r + o]);
                a0 = fma(s, w[o][0], a0);
                a1 = fma(s, w[o][1], a1);
            }
            size_t at = (size_t)panel * ROWS + 32 * r;
            a0 = leaky_back(a0, vload16(0, h2 + at));
            a1 = leaky_back(a1, vload16(1, h2 + at));
            vstore16(a0, 0, d2 + at);
            vstore16(a1, 1, d2 + at);
            sum0 += a0;
            sum1 += a1;
        }
        vstore16(sum0, 0, db2 + panel);
        vstore16(sum1, 1, db2 + panel);
    }
}

/* dw3 (W2 x 16) += h2^T dout, db3 (16) += column sums of dout. */
inline void head_grad(global float *dw3, global float *db3, global const float *h2, global const float *dout)
{
    float16 sum = vload16(0, db3);
    for (int r = 0; r < ROWS; r++) sum.lo += vload8(r, dout);
    vstore16(sum, 0, db3);
    for (int k0 = 0; k0 < W2; k0 += 16) {
        float16 g[7];
        global const float *a = h2 + (size_t)(k0 / 32) * 32 * ROWS + k0 % 32;
        _Pragma("unroll") for (int o = 0; o < 7; o++) g[o] = 0.0f;
        for (int r = 0; r < ROWS; r++) {
            float16 v = vload16(0, a + 32 * r);
            _Pragma("unroll") for (int o = 0; o < 7; o++) g[o] = fma((float16)(dout[8 * r + o]), v, g[o]);
        }
        float lanes[7][16];
        _Pragma("unroll") for (int o = 0; o < 7; o++) vstore16(g[o], 0, lanes[o]);
        for (int k = 0; k < 16; k++)
            for (int o = 0; o < 7; o++) dw3[(k0 + k) * 16 + o] += lanes[o][k];
    }
}

/* dp (one block) += (d2 w2^T) f'(h1); dc (W1) += its column sums. */
inline void second_back(global float *dp, global float *dc, global const float *d2, global const float *h1,
                        global const float *w2t)
{
    for (int panel = 0; panel < W1; panel += 32) {
        float16 sum0 = vload16(0, dc + panel), sum1 = vload16(1, dc + panel);
        for (int r0 = 0; r0 < ROWS; r0 += MR) {
            float16 acc[MR][2];
            size_t at = (size_t)panel * ROWS + 32 * r0;
            TILE_FILL(acc, (float16)(0.0f), (float16)(0.0f))
            TILE_ADD(acc, d2, w2t + (size_t)panel * W2, W2, r0)
            _Pragma("unroll") for (int i = 0; i < MR; i++)
            {
                acc[i][0] = leaky_back(acc[i][0], vload16(2 * i, h1 + at));
                acc[i][1] = leaky_back(acc[i][1], vload16(2 * i + 1, h1 + at));
                sum0 += acc[i][0];
                sum1 += acc[i][1];
                vstore16(acc[i][0] + vload16(2 * i, dp + at), 2 * i, dp + at);
                vstore16(acc[i][1] + vload16(2 * i + 1, dp + at), 2 * i + 1, dp + at);
            }
        }
        vstore16(sum0, 0, dc + panel);
        vstore16(sum1, 1, dc + panel);
    }
}

/* Gradients for the frames first_frame ... from dout [all frames][blocks * ROWS][8] and the kept h2.
 * sums: [G][AT_END], added to.  dc: [G][all frames][W1], added to at rows first_frame...  dp: [blocks][W1 panels],
 * added to.  transposed: from mlp_transpose.
 * Group g takes the blocks g, g + G, ... with all frames of each.  Global size: (G). */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void
mlp_backward(global float *dp, global float *sums, global float *dc, global const float *dout, global const float *h2,
             global const float *p, global const float *c, global const float *transposed, global float *scratch, int blocks, int frames, int first_frame, int all_frames)
{
    size_t group = get_global_id(0);
    global float *h1 = scratch + group * 2 * BLOCK(WMAX), *d2 = h1 + BLOCK(WMAX);
    global float *sum = sums + group * AT_END;
    for (int block = group; block < blocks; block += get_global_size(0))
        for (int frame = 0; frame < frames; frame++) {
            size_t item = (size_t)frame * blocks + block;
            global const float *d = dout + ((size_t)(first_frame + frame) * blocks + block) * ROWS * 8;
            global const float *y = h2 + item * BLOCK(W2);
            first_layer(h1, p + block * BLOCK(W1), c + (first_frame + frame) * W1);
            head_back(d2, sum + AT_B2, d, y, transposed + (size_t)W1 * (W2 + CZ));
            head_grad(sum + AT_W3, sum + AT_B3, y, d);
            for (int panel = 0; panel < W2; panel += 32) {
                global const float *d2_panel = d2 + (size_t)panel * ROWS;
                global float *dw2 = sum + AT_W2 + (size_t)panel * W1;
                TILE_GRAD(dw2, h1, d2_panel, W1)
            }
            second_back(dp + block * BLOCK(W1), dc + (group * all_frames + first_frame + frame) * W1, d2, h1, transposed);
        }
}

/* dz [blocks][CZ panels] = dp w1z^T, and the gradient of w1z into each group's sums. */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void mlp_input_back(global float *dz, global float *sums,
                                                                          global const float *dp,
                                                                          global const float *z,
                                                                          global const float *transposed, int blocks)
{
    global const float *w1zt = transposed + (size_t)W1 * W2;
    size_t group = get_global_id(0);
    global float *sum = sums + group * AT_END + AT_W1Z;
    for (int block = group; block < blocks; block += get_global_size(0)) {
        global const float *d = dp + block * BLOCK(W1), *a = z + block * BLOCK(CZ);
        for (int panel = 0; panel < CZ; panel += 32)
            for (int r0 = 0; r0 < ROWS; r0 += MR) {
                float16 acc[MR][2];
                TILE_FILL(acc, (float16)(0.0f), (float16)(0.0f))
                TILE_ADD(acc, d, w1zt + (size_t)panel * W1, W1, r0)
                global float *to = dz + block * BLOCK(CZ) + (size_t)panel * ROWS + 32 * r0;
                _Pragma("unroll") for (int i = 0; i < MR; i++)
                {
                    vstore16(acc[i][0], 2 * i, to);
                    vstore16(acc[i][1], 2 * i + 1, to);
                }
            }
        for (int panel = 0; panel < W1; panel += 32) {
            global const float *d_panel = d + (size_t)panel * ROWS;
            global float *dw = sum + (size_t)panel * CZ;
            TILE_GRAD(dw, a, d_panel, CZ)
        }
    }
}

/* grad[i] = sum over groups of sums[g][i], i < AT_END.  Global size: (ceil(AT_END / 16)). */
kernel void mlp_reduce(global float *grad, global const float *sums, int groups)
{
    size_t i = get_global_id(0) * 16, size = AT_END;
    for (size_t at = i; at < min(i + 16, size); at++) {
        float sum = 0.0f;
        for (int g = 0; g < groups; g++) sum += sums[g * size + at];
        grad[at] = sum;
    }
}

/* to (packed, C x K) = transpose of from (packed, K x C); both multiples of 32. */
inline void transpose_panel(global float *to, global const float *from, int K, int C, size_t kp, size_t cp)
{
    for (int k = 0; k < 32; k++)
        for (int c = 0; c < 32; c++) to[kp * C + (cp + c) * 32 + k] = from[cp * K + (kp + k) * 32 + c];
}

/* The transposes that the backward pass multiplies with, in the order w2t (packed W2 x W1), w1zt (packed W1 x CZ),
 * w3t (7 x W2).  Global size: (WMAX / 32, WMAX / 32). */
kernel void mlp_transpose(global float *transposed, global const float *params)
{
    size_t kp = get_global_id(0) * 32, cp = get_global_id(1) * 32;
    if (kp < W1 && cp < W2) transpose_panel(transposed, params + AT_W2, W1, W2, kp, cp);
    if (kp < CZ && cp < W1) transpose_panel(transposed + (size_t)W1 * W2, params + AT_W1Z, CZ, W1, kp, cp);
    if (kp != 0 || cp >= W2) return;
    global float *w3t = transposed + (size_t)W1 * (W2 + CZ);
    for (size_t k = cp; k < cp + 32; k++)
        for (int o = 0; o < 7; o++) w3t[o * W2 + k] = params[AT_W3 + k * 16 + o];
}
