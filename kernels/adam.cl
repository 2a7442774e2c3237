/* adam: one step of Adam (Kingma and Ba, 2015), with a learning rate per row.
 *
 *     m = b1 m + (1 - b1) g     v = b2 v + (1 - b2) g^2     p -= rate c1 m / (sqrt(v) c2 + eps)
 *
 * c1 = 1 / (1 - b1^step), c2 = 1 / sqrt(1 - b2^step), made by the host in double. */

/* p, m, v, g: [count]; rate: [ceil(count / row)].  SPAN: values of a work-item (build
 * constant, from the tuning of the device).  Global size: (ceil(count / SPAN)). */
kernel void adam_step(global float *p, global float *m, global float *v, global const float *g,
                      global const float *rate, int count, int row, float b1, float b2, float eps, float c1, float c2)
{
    int end = min((int)get_global_id(0) * SPAN + SPAN, count);
    for (int i = get_global_id(0) * SPAN; i < end; i++) {
        float mi = b1 * m[i] + (1.0f - b1) * g[i];
        float vi = b2 * v[i] + (1.0f - b2) * g[i] * g[i];
        m[i] = mi;
        v[i] = vi;
        p[i] -= rate[i / row] * c1 * mi / (sqrt(vi) * c2 + eps);
    }
}
