/* Gradients of the plain twins against central differences of the twins, in double. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "kernels/motion.h"
#include "pipeline/memory.h"
#include "pipeline/random.h"
#include "tests/kernels/twins/twins.h"
#include "tests/support/slope.h"

enum { CHANNELS = NPG_LATENT_CHANNELS, VERTS = 213, POINTS = 249, EDGES = 2 * VERTS - 3 };

static npg_random numbers;
static npg_arena arena;

static int open_case(void **state)
{
    (void)state;
    numbers = npg_random_stream(3, 10, 0);
    arena = (npg_arena){.purpose = NPG_FOR_RUN};
    return 0;
}

static int close_case(void **state)
{
    (void)state;
    npg_arena_release(&arena);
    return 0;
}

static double *zeros(size_t count)
{
    double *values = npg_arena_take(&arena, count, sizeof *values);
    assert_non_null(values);
    return values;
}

static void fill(double *values, size_t count, double scale)
{
    for (size_t i = 0; i < count; i++) values[i] = scale * (2 * npg_random_real(&numbers) - 1);
}

static double *drawn(size_t count, double scale)
{
    double *values = zeros(count);
    fill(values, count, scale);
    return values;
}

static double *copy_of(const double *values, size_t count)
{
    return memcpy(zeros(count), values, count * sizeof *values);
}

static float *narrow(const double *values, size_t count)
{
    float *out = npg_arena_take(&arena, count, sizeof *out);
    assert_non_null(out);
    for (size_t i = 0; i < count; i++) out[i] = (float)values[i];
    return out;
}

static void expect_slopes(double error)
{
    print_message("gradient off by %.2g\n", error);
    assert_true(error <= 1e-5);
}

/* ---- latent ---- */

typedef struct features {
    npg_samples samples;
    size_t real;
    double *nodes, *z, *dz;
} features;

static double value_of_features(void *user)
{
    features *f = user;
    double sum = 0;
    npg_latent_sample_ref(f->z, f->nodes, &f->samples);
    for (size_t i = 0; i < f->real * CHANNELS; i++) sum += f->dz[i] * f->z[i];
    return sum;
}

static void latent(void **state)
{
    features f = {.real = 5};
    npg_levels levels = {0};
    size_t rows = NPG_PADDED(f.real);
    double error = 0;
    (void)state;
    for (int l = 0; l < 3; l++)
        npg_levels_add(&levels, (npg_level){NPG_LEVEL_POSITION, 2 + 3 * l, 0, 0, 0, 30, 1.0 / 3, 0.4, 1});
    npg_levels_add(&levels, (npg_level){NPG_LEVEL_NORMAL, 4, 0, 0, 30, 32, 1, 0.4, 1});
    const float *positions = narrow(drawn(f.real * 3, 1.05), f.real * 3); /* some outside the cube */
    const float *normals = narrow(drawn(f.real * 3, 1), f.real * 3);
    assert_int_equal(npg_samples_open(&f.samples, &levels, positions, normals, f.real, rows), 0);
    f.nodes = drawn(levels.row_count * CHANNELS, 1);
    f.z = zeros(rows * CHANNELS);
    f.dz = zeros(rows * CHANNELS);
    fill(f.dz, f.real * CHANNELS, 1);
    double *slope = zeros(levels.row_count * CHANNELS);
    value_of_features(&f);
    npg_latent_back_ref(slope, f.dz, f.z, &f.samples);
    /* channels that a level does not use have no gradient by definition: check those it uses */
    for (size_t n = 0; n < f.samples.node_count; n += 7) {
        size_t first = (size_t)NPG_CHANNEL_FIRST(f.samples.channels[n]),
               end = (size_t)NPG_CHANNEL_END(f.samples.channels[n]), at = n * CHANNELS + first;
        check_slope(&error, f.nodes + at, slope + at, end - first, 3, 1e-5, value_of_features, &f);
    }
    npg_samples_close(&f.samples);
    expect_slopes(error);
}

/* ---- mlp ---- */

typedef struct decoder {
    npg_mlp_shape shape;
    double *params, *z, *code, *dout, out[NPG_MLP_OUT];
} decoder;

static double value_of_decoder(void *user)
{
    decoder *d = user;
    double sum = 0;
    npg_mlp_forward_ref(d->out, d->z, d->code, d->params, &d->shape);
    for (size_t o = 0; o < NPG_MLP_USED; o++) sum += d->dout[o] * d->out[o];
    return sum;
}

static void mlp(void **state)
{
    decoder d = {.shape = {64, 96, 2}};
    size_t count = npg_mlp_places_of(&d.shape).end;
    double error = 0, *grad = zeros(count), *dz = zeros(CHANNELS);
    (void)state;
    d.params = drawn(count, 0.125);
    d.z = drawn(CHANNELS, 1);
    d.code = drawn(2, 1);
    d.dout = drawn(NPG_MLP_USED, 1);
    npg_mlp_backward_ref(grad, dz, d.dout, d.z, d.code, d.params, &d.shape);
    check_slope(&error, d.params, grad, count, 13, 1e-6, value_of_decoder, &d);
    check_slope(&error, d.z, dz, CHANNELS, 1, 1e-6, value_of_decoder, &d);
    expect_slopes(error);
}

/* ---- transform ---- */

typedef struct turn {
    double out[NPG_MLP_USED], rest[3], g[3];
} turn;

static double value_of_turn(void *user)
{
    turn *t = user;
    double x[3];
    npg_transform_ref(x, t->out, t->rest);
    return t->g[0] * x[0] + t->g[1] * x[1] + t->g[2] * x[2];
}

static void transform(void **state)
{
    double error = 0, slope[NPG_MLP_USED];
    (void)state;
    for (int i = 0; i < 50; i++) {
        turn t;
        fill(t.out, NPG_MLP_USED, i < 10 ? 1e-3 : 1.5);
        fill(t.rest, 3, 1);
        fill(t.g, 3, 1);
        npg_transform_back_ref(slope, t.g, t.out, t.rest);
        check_slope(&error, t.out, slope, NPG_MLP_USED, 1, 1e-6, value_of_turn, &t);
    }
    expect_slopes(error);
}

/* ---- losses by position ---- */

typedef struct positions {
    double *x, *g;
    const double *points;
    size_t to_points[VERTS], to_verts[POINTS];
    uint32_t edges[EDGES][2];
    double edge_rest[EDGES];
} positions;

/* Without the robust weight the value and the gradient belong together (the weight is held constant in the
 * latter). */
static double value_of_chamfer(void *user)
{
    positions *p = user;
    return npg_chamfer_pairs_ref(p->g, p->x, VERTS, p->points, POINTS, p->to_points, p->to_verts, 0);
}

static double value_of_isometry(void *user)
{
    positions *p = user;
    memset(p->g, 0, 3 * VERTS * sizeof *p->g);
    return npg_isometry_ref(p->g, p->x, (const uint32_t(*)[2])p->edges, p->edge_rest, EDGES);
}

static void check_loss(slope_function *value, double h, positions *p)
{
    double error = 0;
    value(p);
    const double *slope = copy_of(p->g, 3 * VERTS);
    check_slope(&error, p->x, slope, 3 * VERTS, 5, h, value, p);
    expect_slopes(error);
}

static void losses(void **state)
{
    static positions p;
    double dist_sq;
    (void)state;
    p.x = drawn(3 * VERTS, 0.9);
    p.g = zeros(3 * VERTS);
    p.points = drawn(3 * POINTS, 0.7);
    for (size_t v = 0; v < VERTS; v++)
        p.to_points[v] = npg_nearest_ref(&dist_sq, p.x + 3 * v, p.points, POINTS);
    for (size_t i = 0; i < POINTS; i++)
        p.to_verts[i] = npg_nearest_ref(&dist_sq, p.points + 3 * i, p.x, VERTS);
    for (uint32_t e = 0; e < EDGES; e++) { /* a strip: every vertex with the next two */
        p.edges[e][0] = e / 2;
        p.edges[e][1] = e / 2 + 1 + e % 2;
        p.edge_rest[e] = npg_random_real(&numbers);
    }
    check_loss(value_of_chamfer, 1e-5, &p);
    check_loss(value_of_isometry, 1e-7, &p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(latent, open_case, close_case),
                                       cmocka_unit_test_setup_teardown(mlp, open_case, close_case),
                                       cmocka_unit_test_setup_teardown(transform, open_case, close_case),
                                       cmocka_unit_test_setup_teardown(losses, open_case, close_case)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
