/* time: the part of the first layer that depends on the frame alone, c_t = gamma(t) W1t + b1, and its gradient. */

/* c: [frames][width]; code: [frames][M]; params + at: w [M][width], b [width].  Global size: (width, frames). */
kernel void time_rows(global float *c, global const float *code, global const float *params, int at, int M, int width,
                      int frames)
{
    global const float *w = params + at, *b = w + M * width;
    size_t n = get_global_id(0), t = get_global_id(1);
    if (n >= (size_t)width || t >= (size_t)frames) return;
    float sum = b[n];
    for (int j = 0; j < M; j++) sum = fma(code[t * M + j], w[j * width + n], sum);
    c[t * width + n] = sum;
}

/* grad + at: dw [M][width], db [width] from dc, summed over its groups [groups][frames][width].
 * Global size: (width). */
kernel void time_back(global float *grad, global const float *dc, global const float *code, int at, int M, int width,
                      int frames, int groups)
{
    size_t n = get_global_id(0);
    if (n >= (size_t)width) return;
    for (int j = 0; j <= M; j++) {
        float sum = 0.0f;
        for (int t = 0; t < frames; t++) {
            float d = 0.0f;
            for (int g = 0; g < groups; g++) d += dc[((size_t)g * frames + t) * width + n];
            sum += j < M ? code[t * M + j] * d : d;
        }
        grad[at + j * width + n] = sum;
    }
}
