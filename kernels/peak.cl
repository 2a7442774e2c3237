/* peak: what the machine can do at most, to hold the kernels' figures against. */

/* 12 x 2 independent chains of multiply-adds on vectors of 16: 2 * 16 * 24 operations a round.
 * Global size: (items); sink: [items]. */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void peak_multiply_add(global float *sink, int rounds, float a,
                                                                             float b)
{
    float16 acc[24], sum = 0.0f;
    _Pragma("unroll") for (int i = 0; i < 24; i++) acc[i] = (float16)(b * (i + 1));
    for (int r = 0; r < rounds; r++)
    {
        _Pragma("unroll") for (int i = 0; i < 24; i++) acc[i] = fma(acc[i], (float16)(a), (float16)(b));
    }
    _Pragma("unroll") for (int i = 0; i < 24; i++) sum += acc[i];
    sink[get_global_id(0)] = sum.s0 + sum.s7 + sum.sf;
}

/* to = from, `vectors` of 16 floats for each item: 128 bytes moved per vector.  Global size: (items). */
__attribute__((reqd_work_group_size(1, 1, 1))) kernel void peak_copy(global float *to, global const float *from,
                                                                     int vectors)
{
    size_t first = get_global_id(0) * vectors;
    for (size_t i = first; i < first + vectors; i++) vstore16(vload16(i, from), i, to);
}
