/* transform: x = R(q) v + tanh(0.1 d) for every vertex of every frame (paper: "Transformation Mapping").
 *
 * out: [frames][rows][8] = four rotation values, three of translation, one unused.  Positions are in blocks (layout.h),
 * frame after frame.  All kernels of the step work on the frames first .. first + count - 1.
 *
 *     ROTATION 0    offset quaternion (1 + o0, o1, o2, o3), normalised
 *     ROTATION 1    Cayley: the quaternion (1, o1, o2, o3), normalised
 *     ROTATION 2    exponential map of the rotation vector (o1, o2, o3)
 */

#define REACH 0.1f /* farthest translation along an axis, in units (paper) */

typedef struct turn {
    float s;     /* scalar part of the unit quaternion */
    float3 u;    /* vector part                        */
    float scale; /* 1 / norm before normalising        */
} turn;

/* half_sinc(t) = sin(t / 2) / t and its derivative over t, divided by t.  For small t the differences of nearly equal
 * numbers keep too few digits; the first terms of the series are then exact to those of a float. */
inline float half_sinc(float t)
{
    return t > 1e-3f ? sin(0.5f * t) / t : 0.5f - t * t / 48.0f;
}
inline float half_sinc_slope(float t)
{
    return t > 0.05f ? (0.5f * cos(0.5f * t) - sin(0.5f * t) / t) / (t * t) : -1.0f / 24.0f + t * t / 960.0f;
}

inline turn turn_of(float8 o)
{
#if ROTATION == 2
    float t = length(o.s123);
    return (turn){cos(0.5f * t), half_sinc(t) * o.s123, 1.0f};
#else
    float s = ROTATION == 0 ? 1.0f + o.s0 : 1.0f;
    float norm = max(sqrt(s * s + dot(o.s123, o.s123)), 1e-8f);
    return (turn){s / norm, o.s123 / norm, 1.0f / norm};
#endif
}

/* x: [frames] x positions; rest: the positions to transform, `stride` floats
 * from frame to frame (0: the reference in all).  Global size: (rows, count). */
kernel void transform_apply(global float *x, global const float *out, global const float *rest, int stride, int rows,
                            int first, int count)
{
    size_t i = get_global_id(0), frame = first + get_global_id(1);
    if (i >= (size_t)rows || frame >= (size_t)(first + count)) return;
    size_t at = NPG_POINT_AT(i);
    rest += frame * stride;
    float8 o = vload8(frame * rows + i, out);
    turn q = turn_of(o);
    float3 v = POINT(rest, at);
    float3 uv = cross(q.u, v);
    float3 y = v + 2.0f * (q.s * uv + cross(q.u, uv)) + tanh(REACH * o.s456);
    global float *to = x + frame * rows * 3;
    to[at] = y.x;
    to[at + NPG_LANES] = y.y;
    to[at + 2 * NPG_LANES] = y.z;
}

/* dout from g = dL/dx; rows from `real` on are padding and get 0.  Global size: (rows, count). */
kernel void transform_back(global float *dout, global const float *g, global const float *out,
                           global const float *rest, int stride, int rows, int first, int count, int real)
{
    size_t i = get_global_id(0), frame = first + get_global_id(1);
    if (i >= (size_t)rows || frame >= (size_t)(first + count)) return;
    size_t at = NPG_POINT_AT(i);
    global const float *from = g + frame * rows * 3;
    rest += frame * stride;
    float8 o = vload8(frame * rows + i, out), d = 0.0f;
    if (i < (size_t)real) {
        turn q = turn_of(o);
        float3 v = POINT(rest, at);
        float3 f = POINT(from, at);
        float ds = 2.0f * dot(f, cross(q.u, v));
        float3 du = 2.0f * (q.s * cross(v, f) + f * dot(q.u, v) + v * dot(f, q.u) - 2.0f * q.u * dot(f, v));
#if ROTATION == 2
        float t = length(o.s123), slope = half_sinc_slope(t);
        d.s123 = half_sinc(t) * du + o.s123 * (slope * dot(du, o.s123) - 0.5f * half_sinc(t) * ds);
#else
        float along = q.s * ds + dot(q.u, du);
        if (ROTATION == 0) d.s0 = (ds - q.s * along) * q.scale;
        d.s123 = (du - q.u * along) * q.scale;
#endif
        float3 bound = tanh(REACH * o.s456);
        d.s456 = f * REACH * (1.0f - bound * bound);
    }
    vstore8(d, frame * rows + i, dout);
}
