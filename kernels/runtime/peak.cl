/* peak: what the device can do at most, to hold the kernels' figures against.
 * Build constants, from the tuning of the device: VW, CHAINS, LOCAL. */

#define PASTE_(a, b) a##b
#define PASTE(a, b)  PASTE_(a, b)
#define REAL         PASTE(float, VW)
#define LOAD         PASTE(vload, VW)
#define STORE        PASTE(vstore, VW)

/* CHAINS independent chains of multiply-adds on vectors of VW: 2 VW CHAINS operations a round and item.
 * Global size: groups of LOCAL items; sink: [items]. */
GROUP_KERNEL peak_multiply_add(global float *sink, int rounds,
                                                                                 float a, float b)
{
    REAL acc[CHAINS], sum = 0.0f;
    float lanes[VW], total = 0.0f;
    _Pragma("unroll") for (int i = 0; i < CHAINS; i++) acc[i] = (REAL)(b * (i + 1));
    for (int r = 0; r < rounds; r++)
    {
        _Pragma("unroll") for (int i = 0; i < CHAINS; i++) acc[i] = fma(acc[i], (REAL)(a), (REAL)(b));
    }
    _Pragma("unroll") for (int i = 0; i < CHAINS; i++) sum += acc[i];
    STORE(sum, 0, lanes);
    for (int i = 0; i < VW; i++) total += lanes[i];
    sink[get_global_id(0)] = total;
}

/* to = from, `vectors` of VW floats for each item: 8 VW bytes moved per vector.  Global size: groups of LOCAL items. */
GROUP_KERNEL peak_copy(global float *to, global const float *from,
                                                                         int vectors)
{
    size_t first = get_group_id(0) * vectors * LOCAL + get_local_id(0), end = first + (size_t)vectors * LOCAL;
    for (size_t i = first; i < end; i += LOCAL) STORE(LOAD(i, from), i, to);
}
