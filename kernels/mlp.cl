/* mlp: the decoder psi of the paper's section on the temporal deformation model.
 *
 *     y = (z(v), gamma(t))        h_1 = f(z W1z + c_t)     h_2 = f(h_1 W_2 + b_2)
 *     c_t = gamma(t) W1t + b1     out = h_2 head + bias    f(x) = x for x > 0, SLOPE x else
 *
 * The first layer has W1 units, the second W2.  The first is split: z W1z is computed once per vertex, c_t once
 * per frame (op "time"), and the sum is made when it is needed.  The backward pass forms h_1 again from both
 * rather than keep it; h_2 is kept.
 *
 * Layouts.  Vertices come in blocks of ROWS.  A matrix with one row per vertex and C columns is stored in panels:
 * [block][C / 32][ROWS][32], so that all operands of the inner products are contiguous.  Weights K x C are stored
 * [C / 32][K][32].  A work-group of LOCAL items handles whole blocks, and group g of G takes the blocks g, g + G, ...
 * Of a product an item computes columns of its own, NV vectors of VW floats wide, in register tiles of MR rows.  Every
 * sum over vertices is made per group, in a fixed order, and added over groups by mlp_reduce: equal input and equal
 * constants give equal bits.
 *
 * Build constants: CZ (columns of z, multiple of 32), W1, W2 (multiples of 32), SLOPE; and from
 * the tuning of the device ROWS (multiple of MR and HR), MR, VW, NV (VW * NV divides 32), GR (divides 32), HR,
 * LOCAL, SPAN.
 * Padded rows take part in the products; their output gradient must be 0, then they change nothing. */

#define PASTE_(a, b) a##b
#define PASTE(a, b)  PASTE_(a, b)
#define REAL         PASTE(float, VW)
#define LOAD         PASTE(vload, VW)
#define STORE        PASTE(vstore, VW)
#define TW           (VW * NV) /* columns of a tile */

/* The columns of this item among C, each tile's first: c. */
#define FOR_COLUMNS(c, C) for (int c = ITEM * TW; c < (C); c += LOCAL * TW)

/* Where column c of a block, or of weights with K rows, begins. */
#define COLUMN(rows, c) ((size_t)((c) / NPG_PANEL) * NPG_PANEL * (rows) + (c) % NPG_PANEL)

#define BLOCK(C) ((size_t)ROWS * (C))
#define WMAX     (W1 > W2 ? W1 : W2)

/* Blocks of WMAX columns that a group computes in: h_1, and the gradient before the second rectifier. */
#define SCRATCH (2 * BLOCK(WMAX))

/* Offsets (floats) in the parameters, in their gradient and in a group's sums of it; w1t and b1 of op "time"
 * follow in the first two.  W_2 is first. */
#define AT_HEAD      ((size_t)W1 * W2)
#define AT_B2        (AT_HEAD + (size_t)W2 * NPG_MLP_HEAD_ROW)
#define AT_HEAD_BIAS (AT_B2 + W2)
#define AT_W1Z       (AT_HEAD_BIAS + NPG_MLP_HEAD_ROW)
#define AT_END       (AT_W1Z + (size_t)CZ * W1)

/* The same for the transposes; that of W_2 lies as it does. */
#define AT_W1Z_BACK  AT_HEAD
#define AT_HEAD_BACK (AT_W1Z_BACK + (size_t)CZ * W1)

#define UNROLL _Pragma("unroll")

/* acc (MR x TW) += rows r0.. of a block a (K columns, panels) x the columns of packed weights that begin at b. */
#define TILE_ADD(acc, a, b, K, r0)                                                                                   \
    for (int kp_ = 0; kp_ < (K); kp_ += NPG_PANEL) {                                                                 \
        global const float *a_ = (a) + ((size_t)kp_ * ROWS + (size_t)(r0) * NPG_PANEL);                              \
        global const float *b_ = (b) + (size_t)kp_ * NPG_PANEL;                                                      \
        for (int k_ = 0; k_ < NPG_PANEL; k_++) {                                                                     \
            REAL w_[NV];                                                                                             \
            UNROLL for (int j_ = 0; j_ < NV; j_++) w_[j_] = LOAD(j_, b_ + NPG_PANEL * k_);                           \
            UNROLL for (int i_ = 0; i_ < MR; i_++)                                                                   \
            {                                                                                                        \
                REAL s_ = (REAL)(a_[NPG_PANEL * i_ + k_]);                                                           \
                UNROLL for (int j_ = 0; j_ < NV; j_++) acc[i_][j_] = fma(s_, w_[j_], acc[i_][j_]);                   \
            }                                                                                                        \
        }                                                                                                            \
    }

/* sums (K x TW columns, packed) += a^T b over the ROWS rows of a block a (K columns) and the columns b. */
#define TILE_GRAD(sums, a, b, K)                                                                                     \
    for (int k0_ = 0; k0_ < (K); k0_ += GR) {                                                                        \
        global const float *a_ = (a) + (size_t)(k0_ / NPG_PANEL) * NPG_PANEL * ROWS + k0_ % NPG_PANEL;               \
        global float *s_ = (sums) + (size_t)k0_ * NPG_PANEL;                                                         \
        REAL g_[GR][NV];                                                                                             \
        UNROLL for (int i_ = 0; i_ < GR; i_++)                                                                       \
        {                                                                                                            \
            UNROLL for (int j_ = 0; j_ < NV; j_++) g_[i_][j_] = LOAD(j_, s_ + NPG_PANEL * i_);                       \
        }                                                                                                            \
        for (int r_ = 0; r_ < ROWS; r_++) {                                                                          \
            REAL w_[NV];                                                                                             \
            UNROLL for (int j_ = 0; j_ < NV; j_++) w_[j_] = LOAD(j_, (b) + NPG_PANEL * r_);                          \
            UNROLL for (int i_ = 0; i_ < GR; i_++)                                                                   \
            {                                                                                                        \
                REAL v_ = (REAL)(a_[NPG_PANEL * r_ + i_]);                                                           \
                UNROLL for (int j_ = 0; j_ < NV; j_++) g_[i_][j_] = fma(v_, w_[j_], g_[i_][j_]);                     \
            }                                                                                                        \
        }                                                                                                            \
        UNROLL for (int i_ = 0; i_ < GR; i_++)                                                                       \
        {                                                                                                            \
            UNROLL for (int j_ = 0; j_ < NV; j_++) STORE(g_[i_][j_], j_, s_ + NPG_PANEL * i_);                       \
        }                                                                                                            \
    }

inline REAL leaky(REAL x)
{
    return select(SLOPE * x, x, isgreater(x, (REAL)(0.0f)));
}

/* d through leaky, where y = leaky(x) has the sign of x. */
inline REAL leaky_back(REAL d, REAL y)
{
    return select(SLOPE * d, d, isgreater(y, (REAL)(0.0f)));
}

/* h1 of one block for one frame. */
inline void first_layer(global float *h1, global const float *p, global const float *c)
{
    FOR_COLUMNS(col, W1)
    {
        REAL c_[NV];
        UNROLL for (int j = 0; j < NV; j++) c_[j] = LOAD(j, c + col);
        global const float *from = p + COLUMN(ROWS, col);
        global float *to = h1 + COLUMN(ROWS, col);
        for (int r = 0; r < ROWS; r++)
        {
            int at = NPG_PANEL * r;
            UNROLL for (int j = 0; j < NV; j++) STORE(leaky(LOAD(j, from + at) + c_[j]), j, to + at);
        }
    }
}

/* out (one block, C columns) = a (K columns) x w (packed K x C). */
#define PRODUCT(out, a, w, K, C)                                                                                     \
    FOR_COLUMNS(col, C)                                                                                              \
    {                                                                                                                \
        for (int r0 = 0; r0 < ROWS; r0 += MR) {                                                                      \
            REAL acc[MR][NV];                                                                                        \
            UNROLL for (int i = 0; i < MR; i++)                                                                      \
            {                                                                                                        \
                UNROLL for (int j = 0; j < NV; j++) acc[i][j] = (REAL)(0.0f);                                        \
            }                                                                                                        \
            TILE_ADD(acc, a, (w) + COLUMN(K, col), K, r0)                                                            \
            global float *to = (out) + COLUMN(ROWS, col) + NPG_PANEL * r0;                                           \
            UNROLL for (int i = 0; i < MR; i++)                                                                      \
            {                                                                                                        \
                UNROLL for (int j = 0; j < NV; j++) STORE(acc[i][j], j, to + NPG_PANEL * i);                         \
            }                                                                                                        \
        }                                                                                                            \
    }

/* p [blocks][W1 panels] = z [blocks][CZ panels] x w1z (packed CZ x W1).  Global size: G groups. */
GROUP_KERNEL mlp_input(global float *p, global const float *z, global const float *params, int blocks)
{
    global const float *w1z = params + AT_W1Z;
    for (int block = get_group_id(0); block < blocks; block += get_num_groups(0))
    {
        PRODUCT(p + block * BLOCK(W1), z + block * BLOCK(CZ), w1z, CZ, W1)
    }
}

/* h2 (one block) = f(h1 w + b). */
inline void second_layer(global float *h2, global const float *h1, global const float *w, global const float *b)
{
    FOR_COLUMNS(col, W2)
    {
        for (int r0 = 0; r0 < ROWS; r0 += MR) {
            REAL acc[MR][NV];
            UNROLL for (int i = 0; i < MR; i++)
            {
                UNROLL for (int j = 0; j < NV; j++) acc[i][j] = LOAD(j, b + col);
            }
            TILE_ADD(acc, h1, w + COLUMN(W1, col), W1, r0)
            global float *to = h2 + COLUMN(ROWS, col) + NPG_PANEL * r0;
            UNROLL for (int i = 0; i < MR; i++)
            {
                UNROLL for (int j = 0; j < NV; j++) STORE(leaky(acc[i][j]), j, to + NPG_PANEL * i);
            }
        }
    }
}

/* out (ROWS x 8) = h2 w + b; w has rows of 16, columns 7..15 are 0. */
inline void head_layer(global float *out, global const float *h2, global const float *head,
                       global const float *bias)
{
    for (int r0 = ITEM * HR; r0 < ROWS; r0 += LOCAL * HR) {
        float8 acc[HR];
        UNROLL for (int i = 0; i < HR; i++) acc[i] = vload8(0, bias);
        for (int panel = 0; panel < W2; panel += NPG_PANEL) {
            global const float *a = h2 + (size_t)panel * ROWS + NPG_PANEL * r0;
            for (int k = 0; k < NPG_PANEL; k++) {
                float8 w = vload8(2 * (panel + k), head);
                UNROLL for (int i = 0; i < HR; i++) acc[i] = fma((float8)(a[NPG_PANEL * i + k]), w, acc[i]);
            }
        }
        UNROLL for (int i = 0; i < HR; i++) vstore8(acc[i], r0 + i, out);
    }
}

/* For the frames first_frame ...: out [all frames][blocks * ROWS][8] and, for the backward pass,
 * h2 [frames][blocks][W2 panels].  c: [all frames][W1].  scratch: [G][SCRATCH].  Global size: G groups. */
GROUP_KERNEL mlp_forward(global float *out, global float *h2, global const float *p, global const float *c,
                         global const float *params, global float *scratch, int blocks, int frames,
                         int first_frame)
{
    size_t group = get_group_id(0);
    global float *h1 = scratch + group * SCRATCH;
    for (int item = group; item < blocks * frames; item += get_num_groups(0)) {
        size_t frame = item / blocks, block = item % blocks;
        global float *mine = h2 + (frame * blocks + block) * BLOCK(W2);
        first_layer(h1, p + block * BLOCK(W1), c + (first_frame + frame) * W1);
        SYNC
        second_layer(mine, h1, params, params + AT_B2);
        SYNC
        size_t first_row = ((first_frame + frame) * blocks + block) * ROWS;
        head_layer(out + first_row * NPG_MLP_OUT, mine, params + AT_HEAD, params + AT_HEAD_BIAS);
    }
}

/* d2 (one block) = (dout head^T) f'(h2), and its column sums into db. */
inline void head_back(global float *d2, global float *db, global const float *dout, global const float *h2,
                      global const float *transposed)
{
    FOR_COLUMNS(col, W2)
    {
        REAL w[NPG_MLP_USED][NV], sum[NV];
        UNROLL for (int j = 0; j < NV; j++) sum[j] = LOAD(j, db + col);
        UNROLL for (int o = 0; o < NPG_MLP_USED; o++)
        {
            UNROLL for (int j = 0; j < NV; j++) w[o][j] = LOAD(j, transposed + o * W2 + col);
        }
        for (int r = 0; r < ROWS; r++) {
            size_t at = COLUMN(ROWS, col) + NPG_PANEL * r;
            UNROLL for (int j = 0; j < NV; j++)
            {
                REAL a = 0.0f;
                UNROLL for (int o = 0; o < NPG_MLP_USED; o++) a = fma((REAL)(dout[NPG_MLP_OUT * r + o]), w[o][j], a);
                a = leaky_back(a, LOAD(j, h2 + at));
                STORE(a, j, d2 + at);
                sum[j] += a;
            }
        }
        UNROLL for (int j = 0; j < NV; j++) STORE(sum[j], j, db + col);
    }
}

/* dhead (rows of 16) += h2^T dout, dbias (16) += column sums of dout. */
inline void head_grad(global float *dhead, global float *dbias, global const float *h2,
                      global const float *dout)
{
    if (ITEM == 0) {
        float8 sum = vload8(0, dbias);
        for (int r = 0; r < ROWS; r++) sum += vload8(r, dout);
        vstore8(sum, 0, dbias);
    }
    for (int k0 = ITEM * VW; k0 < W2; k0 += LOCAL * VW) {
        REAL g[NPG_MLP_USED];
        global const float *a = h2 + COLUMN(ROWS, k0);
        UNROLL for (int o = 0; o < NPG_MLP_USED; o++) g[o] = 0.0f;
        for (int r = 0; r < ROWS; r++) {
            REAL v = LOAD(0, a + NPG_PANEL * r);
            UNROLL for (int o = 0; o < NPG_MLP_USED; o++) g[o] = fma((REAL)(dout[NPG_MLP_OUT * r + o]), v, g[o]);
        }
        float lanes[NPG_MLP_USED][VW];
        UNROLL for (int o = 0; o < NPG_MLP_USED; o++) STORE(g[o], 0, lanes[o]);
        for (int k = 0; k < VW; k++)
            for (int o = 0; o < NPG_MLP_USED; o++) dhead[(k0 + k) * NPG_MLP_HEAD_ROW + o] += lanes[o][k];
    }
}

/* (d2 w^T) f'(h1), added to dp1 (one block) over frames, and its column sums into db. */
inline void second_back(global float *dp1, global float *db, global const float *d2, global const float *h1,
                        global const float *transposed)
{
    FOR_COLUMNS(col, W1)
    {
        REAL sum[NV];
        UNROLL for (int j = 0; j < NV; j++) sum[j] = LOAD(j, db + col);
        for (int r0 = 0; r0 < ROWS; r0 += MR) {
            REAL acc[MR][NV];
            size_t at = COLUMN(ROWS, col) + NPG_PANEL * r0;
            UNROLL for (int i = 0; i < MR; i++)
            {
                UNROLL for (int j = 0; j < NV; j++) acc[i][j] = (REAL)(0.0f);
            }
            TILE_ADD(acc, d2, transposed + COLUMN(W2, col), W2, r0)
            UNROLL for (int i = 0; i < MR; i++)
            {
                UNROLL for (int j = 0; j < NV; j++)
                {
                    REAL e = leaky_back(acc[i][j], LOAD(j, h1 + at + NPG_PANEL * i));
                    sum[j] += e;
                    STORE(e + LOAD(j, dp1 + at + NPG_PANEL * i), j, dp1 + at + NPG_PANEL * i);
                }
            }
        }
        UNROLL for (int j = 0; j < NV; j++) STORE(sum[j], j, db + col);
    }
}

/* Gradients for the frames first_frame ... from dout [all frames][blocks * ROWS][8] and the kept h2.
 * sums: [G][AT_END], added to.  dc: [G][all frames][W1], added to at rows first_frame...  dp: [blocks][W1 panels],
 * added to.  transposed: from mlp_transpose.
 * Group g takes the blocks g, g + G, ... with all frames of each.  Global size: G groups. */
GROUP_KERNEL mlp_backward(global float *dp, global float *sums, global float *dc, global const float *dout,
                          global const float *h2, global const float *p, global const float *c,
                          global const float *transposed, global float *scratch, int blocks, int frames,
                          int first_frame, int all_frames)
{
    size_t group = get_group_id(0);
    global float *h1 = scratch + group * SCRATCH, *d2 = h1 + BLOCK(WMAX);
    global float *sum = sums + group * AT_END;
    for (int block = group; block < blocks; block += get_num_groups(0))
        for (int frame = 0; frame < frames; frame++) {
            size_t at = first_frame + frame;
            global const float *dy = dout + (at * blocks + block) * ROWS * NPG_MLP_OUT;
            global const float *mine = h2 + ((size_t)frame * blocks + block) * BLOCK(W2);
            global float *dp1 = dp + block * BLOCK(W1), *dc1 = dc + (group * all_frames + at) * W1;
            first_layer(h1, p + block * BLOCK(W1), c + at * W1);
            head_back(d2, sum + AT_B2, dy, mine, transposed + AT_HEAD_BACK);
            head_grad(sum + AT_HEAD, sum + AT_HEAD_BIAS, mine, dy);
            SYNC
            FOR_COLUMNS(col, W2)
            {
                TILE_GRAD(sum + COLUMN(W1, col), h1, d2 + COLUMN(ROWS, col), W1)
            }
            second_back(dp1, dc1, d2, h1, transposed);
            SYNC
        }
}

/* dz [blocks][CZ panels] = dp w1z^T, and the gradient of w1z into each group's sums.  Global size: G groups. */
GROUP_KERNEL mlp_input_back(global float *dz, global float *sums, global const float *dp, global const float *z,
                            global const float *transposed, int blocks)
{
    size_t group = get_group_id(0);
    global const float *w1zt = transposed + AT_W1Z_BACK;
    global float *sum = sums + group * AT_END + AT_W1Z;
    for (int block = group; block < blocks; block += get_num_groups(0)) {
        global const float *d = dp + block * BLOCK(W1), *a = z + block * BLOCK(CZ);
        PRODUCT(dz + block * BLOCK(CZ), d, w1zt, W1, CZ)
        FOR_COLUMNS(col, W1)
        {
            TILE_GRAD(sum + COLUMN(CZ, col), a, d + COLUMN(ROWS, col), CZ)
        }
    }
}

/* grad[i] = sum over groups of sums[g][i], i < AT_END.  Global size: (ceil(AT_END / SPAN)). */
kernel void mlp_reduce(global float *grad, global const float *sums, int groups)
{
    size_t i = get_global_id(0) * SPAN, size = AT_END;
    for (size_t at = i; at < min(i + SPAN, size); at++) {
        float sum = 0.0f;
        for (int g = 0; g < groups; g++) sum += sums[g * size + at];
        grad[at] = sum;
    }
}

/* to (packed, C x K) = transpose of from (packed, K x C); both multiples of 32. */
inline void transpose_panel(global float *to, global const float *from, int K, int C, size_t kp, size_t cp)
{
    for (int k = 0; k < NPG_PANEL; k++)
        for (int c = 0; c < NPG_PANEL; c++)
            to[kp * C + (cp + c) * NPG_PANEL + k] = from[cp * K + (kp + k) * NPG_PANEL + c];
}

/* The transposes that the backward pass multiplies with, in the order W_2^T (packed W2 x W1), w1z^T (packed
 * W1 x CZ), head^T (7 x W2).
 * Global size: (WMAX / 32, WMAX / 32). */
kernel void mlp_transpose(global float *transposed, global const float *params)
{
    size_t kp = get_global_id(0) * NPG_PANEL, cp = get_global_id(1) * NPG_PANEL;
    if (kp < W1 && cp < W2) transpose_panel(transposed, params, W1, W2, kp, cp);
    if (kp < CZ && cp < W1) transpose_panel(transposed + AT_W1Z_BACK, params + AT_W1Z, CZ, W1, kp, cp);
    if (kp != 0 || cp >= W2) return;
    global float *head = transposed + AT_HEAD_BACK;
    for (size_t k = cp; k < cp + NPG_PANEL; k++)
        for (int o = 0; o < NPG_MLP_USED; o++)
            head[o * W2 + k] = params[AT_HEAD + k * NPG_MLP_HEAD_ROW + o];
}
