/* transform: x = R(q) v + tanh(0.1 d) for every vertex of every frame (paper: "Transformation Mapping").
 * v: its place in the reference, or in a base of the frame's own, as far apart in `rest` as `stride` says (0: all
 * frames have the same).
 *
 * out: [frames][rows][8] = four rotation values, three of translation, one unused.  Positions are in blocks (layout.h),
 * frame after frame.  All kernels of the step work on the frames first .. first + count - 1.
 *
 * q is the offset quaternion (1 + o0, o1, o2, o3), normalised. */

#define REACH 0.1f /* farthest translation along an axis, in units (paper) */

typedef struct turn {
    float s;     /* scalar part of the unit quaternion */
    float3 u;    /* vector part                        */
    float scale; /* 1 / norm before normalising        */
} turn;

inline turn turn_of(float8 o)
{
    float s = 1.0f + o.s0;
    float norm = max(sqrt(s * s + dot(o.s123, o.s123)), 1e-8f);
    return (turn){s / norm, o.s123 / norm, 1.0f / norm};
}

/* x: [frames] x positions; rest: the positions to transform.  Global size: (rows, count). */
kernel void transform_apply(global float *x, global const float *out, global const float *rest, int stride,
                            int rows, int first, int count)
{
    size_t i = get_global_id(0), frame = first + get_global_id(1);
    if (i >= (size_t)rows || frame >= (size_t)(first + count)) return;
    size_t at = NPG_POINT_AT(i);
    float8 o = vload8(frame * rows + i, out);
    turn q = turn_of(o);
    rest += frame * stride;
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
                           global const float *rest, int stride, int rows, int first, int count,
                           int real)
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
        float along = q.s * ds + dot(q.u, du);
        d.s0 = (ds - q.s * along) * q.scale;
        d.s123 = (du - q.u * along) * q.scale;
        float3 bound = tanh(REACH * o.s456);
        d.s456 = f * REACH * (1.0f - bound * bound);
    }
    vstore8(d, frame * rows + i, dout);
}
