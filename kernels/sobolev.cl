/* sobolev: x = (I + lambda L)^-1 y on every grid level, exactly.
 *
 * L of an n^3 grid is the Kronecker sum of three matrices of paths, which an orthonormal matrix C (n x n)
 * diagonalises (sobolev.c).  So the solve is C on each axis, a division by the sum of eigenvalues, C^T on each axis: six passes, no iteration.  Paper:
 * section on the objectives, "Preconditioning"; the published code iterates conjugate gradients instead.
 *
 * levels: [L][NPG_GRID] (layout.h); the node (i, j, k) of a level is row
 * first + (i n + j) n + k with 32 channels.  A line is one of the n^2 rows of nodes along the axis of the pass.
 * Levels with n = 0 (no smoothing) are copied: they have `count` lines of one node, count in the matrix field. */

typedef struct line_of {
    int n, first, stride, level, line;
} line_of;

inline line_of find_line(global const int *levels, int L, int line, int axis)
{
    int l = 0;
    while (l + 1 < L && line >= levels[NPG_GRID * (l + 1) + NPG_GRID_LINE]) l++;
    levels += NPG_GRID * l;
    int n = levels[NPG_GRID_NODES], first = levels[NPG_GRID_ROW];
    line -= levels[NPG_GRID_LINE];
    if (n == 0) return (line_of){0, first + line, 0, l, line};
    int a = line / n, b = line % n;
    int start = axis == 0 ? a * n + b : axis == 1 ? a * n * n + b : (a * n + b) * n;
    return (line_of){n, first + start, axis == 0 ? n * n : axis == 1 ? n : 1, l, line};
}

/* One pass.  matrices: C of each level, row-major; back = 1 multiplies by C^T.  scale = 1 divides the result by
 * 1 + lambda[l] (e_i + e_a + e_b), e the eigenvalues eigen[eigen_first[l] + k].  Only the pass over
 * axis 2 may scale.  Global size: (lines). */
kernel void sobolev_pass(global float *out, global const float *in, global const int *levels,
                         global const float *matrices, global const float *eigen, global const int *eigen_first,
                         global const float *lambda, int L, int lines, int axis, int back,
                         int scale)
{
    if (get_global_id(0) >= (size_t)lines) return;
    line_of at = find_line(levels, L, get_global_id(0), axis);
    if (at.n == 0) {
        vstore16(vload16(2 * at.first, in), 2 * at.first, out);
        vstore16(vload16(2 * at.first + 1, in), 2 * at.first + 1, out);
        return;
    }
    global const float *m = matrices + levels[NPG_GRID * at.level + NPG_GRID_MATRIX];
    global const float *e = eigen + eigen_first[at.level];
    float e_line = e[at.line / at.n] + e[at.line % at.n];
    for (int i = 0; i < at.n; i++) {
        float16 a = 0.0f, b = 0.0f;
        for (int j = 0; j < at.n; j++) {
            float16 c = (float16)(back ? m[j * at.n + i] : m[i * at.n + j]);
            size_t row = at.first + j * at.stride;
            a = fma(c, vload16(2 * row, in), a);
            b = fma(c, vload16(2 * row + 1, in), b);
        }
        float s = scale ? 1.0f / (1.0f + lambda[at.level] * (e_line + e[i])) : 1.0f;
        size_t row = at.first + i * at.stride;
        vstore16(s * a, 2 * row, out);
        vstore16(s * b, 2 * row + 1, out);
    }
}
