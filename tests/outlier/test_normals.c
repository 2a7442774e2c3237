/* Normals: directions, sides, given ones mended, sensors, noise. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "mesh/surface.h"
#include "outlier/normals.h"
#include "outlier/outlier_internal.h"
#include "pipeline/memory.h"
#include "tests/support/shapes.h"

#define N 2000

static float points[3 * N], truth[3 * N], normals[3 * N];

static double dot_of(size_t i)
{
    double sum = 0;
    for (size_t a = 0; a < 3; a++) sum += (double)truth[3 * i + a] * (double)normals[3 * i + a];
    return sum;
}

static size_t wrong_sides(void)
{
    size_t count = 0;
    for (size_t i = 0; i < N; i++) count += dot_of(i) < 0;
    return count;
}

static void random_sides(shape_random *r)
{
    for (size_t i = 0; i < N; i++)
        for (size_t a = 0, turned = shape_uniform(r) < 0.5; a < 3 && turned; a++)
            normals[3 * i + a] = -normals[3 * i + a];
}

static void directions_of_a_sphere(void **state)
{
    (void)state;
    shape_random r = {1};
    double worst = 1;
    shape_sphere(points, truth, N, 2, &r);
    assert_int_equal(npg_normals_estimate(normals, points, N, 12), NPG_OK);
    for (size_t i = 0; i < N; i++) worst = fmin(worst, fabs(dot_of(i)));
    assert_true(worst > 0.9);
}

static void sides_from_nothing(void **state)
{
    (void)state;
    const double plate[3] = {1, 0.8, 0.04}, cube[3] = {0.5, 0.5, 0.5};
    for (int which = 0; which < 5; which++) {
        shape_random r = {7 + (uint64_t)which};
        if (which == 0) shape_sphere(points, truth, N, 1, &r);
        if (which == 1) shape_torus(points, truth, N, 1, 0.25, &r);
        if (which == 2) shape_box(points, truth, N, plate, &r);
        if (which == 3) shape_box(points, truth, N, cube, &r);
        if (which == 4) shape_limbs(points, truth, N, &r);
        assert_int_equal(npg_normals_make(normals, points, N), NPG_OK);
        /* a plate's rim is thinner than the neighbourhoods: its directions, and so its
         * sides, are ambiguous */
        assert_true(wrong_sides() < (which == 2 ? N / 25 : which == 4 ? N / 100 : N / 200));
    }
}

/* By the winding number each bulge of a sheet faces out.  Which side it has is nobody's to say, but it is one. */
static void a_sheet_has_one_side(void **state)
{
    (void)state;
    shape_random r = {31};
    for (size_t i = 0; i < N; i++) {
        float x = (float)shape_uniform(&r) * 2 - 1, y = (float)shape_uniform(&r) * 1.2f, *p = points + 3 * i;
        float slope = 0.9f * cosf(3 * x), length = sqrtf(1 + slope * slope);
        memcpy(p, (float[]){x, y, 0.3f * sinf(3 * x)}, 3 * sizeof *p);
        memcpy(truth + 3 * i, (float[]){-slope / length, 0, 1 / length}, 3 * sizeof *p);
    }
    assert_int_equal(npg_normals_make(normals, points, N), NPG_OK);
    size_t wrong = wrong_sides();
    assert_true(wrong < N / 100 || wrong > N - N / 100);
}

/* Two shallow caps, rim to rim at 33 degrees: smooth enough there for a seam of a sheet, but they enclose something. */
static void the_faces_of_a_blade_keep_their_sides(void **state)
{
    (void)state;
    shape_random r = {37};
    for (size_t i = 0; i < N; i++) {
        float angle = (float)(2 * M_PI * shape_uniform(&r)), from = sqrtf((float)shape_uniform(&r)),
              side = i % 2 ? 1 : -1;
        float x = from * cosf(angle), y = from * sinf(angle), length = sqrtf(1 + 0.09f * from * from);
        memcpy(points + 3 * i, (float[]){x, y, side * 0.15f * (1 - from * from)}, 3 * sizeof *points);
        memcpy(truth + 3 * i, (float[]){0.3f * x / length, 0.3f * y / length, side / length},
               3 * sizeof *points);
    }
    assert_int_equal(npg_normals_make(normals, points, N), NPG_OK);
    assert_true(wrong_sides() < N / 25);
}

static void given_normals_are_mended(void **state)
{
    (void)state;
    size_t flipped, all = 0;
    shape_random r = {3};
    shape_torus(points, truth, N, 1, 0.3, &r);
    memcpy(normals, truth, sizeof truth);
    assert_int_equal(npg_normals_mend(normals, &flipped, points, N), NPG_OK);
    assert_int_equal(flipped, 0);
    /* a whole patch and some single ones */
    for (size_t i = 0; i < N; i++) {
        int in_patch = points[3 * i] > 1.1f && points[3 * i + 2] > 0;
        if (!in_patch && i % 97) continue;
        for (size_t a = 0; a < 3; a++) normals[3 * i + a] = -normals[3 * i + a];
        all++;
    }
    assert_true(wrong_sides() == all && all > 60);
    assert_int_equal(npg_normals_mend(normals, &flipped, points, N), NPG_OK);
    assert_true(wrong_sides() <= 4);
    assert_true(flipped >= all - 4 && flipped <= all + 4);
}

static void normals_given_inward_are_turned(void **state)
{
    (void)state;
    size_t flipped;
    shape_random r = {5};
    shape_sphere(points, truth, N, 1, &r);
    for (size_t i = 0; i < 3 * N; i++) normals[i] = -truth[i];
    assert_int_equal(npg_normals_mend(normals, &flipped, points, N), NPG_OK);
    assert_int_equal(flipped, N);
    assert_int_equal(wrong_sides(), 0);
}

/* Both sides of a sheet thinner than the points are apart: nothing but what is given says which is which. */
static void sides_of_a_thin_sheet_are_believed(void **state)
{
    (void)state;
    const double sheet[3] = {1, 0.8, 0.01};
    size_t flipped;
    shape_random r = {29};
    shape_box(points, truth, N, sheet, &r);
    memcpy(normals, truth, sizeof truth);
    assert_int_equal(npg_normals_mend(normals, &flipped, points, N), NPG_OK);
    assert_true(wrong_sides() <= N / 100); /* of the rim */
}

static void the_scale_does_not_matter(void **state)
{
    (void)state;
    static float small[3 * N], first[3 * N];
    shape_random r = {11};
    shape_limbs(points, truth, N, &r);
    assert_int_equal(npg_normals_make(first, points, N), NPG_OK);
    for (size_t i = 0; i < 3 * N; i++) small[i] = points[i] / 1024;
    assert_int_equal(npg_normals_make(normals, small, N), NPG_OK);
    for (size_t i = 0; i < N; i++) {
        float same = 0;
        for (size_t a = 0; a < 3; a++) same += first[3 * i + a] * normals[3 * i + a];
        assert_true(same > 0.99f);
    }
}

static void a_sensor_decides(void **state)
{
    (void)state;
    const double sensor[3] = {0, 0, -5}, inside[3] = {0, 0, 0}, far[3] = {-1e9, -1e9, -1e9};
    size_t flipped, seen = 0;
    bool yes;
    shape_random r = {13};
    shape_sphere(points, truth, N, 1, &r);
    assert_int_equal(npg_cloud_is_single_view(&yes, points, N, sensor), NPG_OK);
    assert_false(yes); /* the far side is there as well */
    assert_int_equal(npg_cloud_is_single_view(&yes, points, N, inside), NPG_OK);
    assert_false(yes);
    assert_int_equal(npg_cloud_is_single_view(&yes, points, N, far), NPG_OK);
    assert_false(yes); /* depths from there don't differ in floats */
    for (size_t i = 0; i < N; i++)
        if (points[3 * i + 2] < -0.2f) {
            memmove(points + 3 * seen, points + 3 * i, 3 * sizeof(float));
            memmove(truth + 3 * seen++, truth + 3 * i, 3 * sizeof(float));
        }
    assert_int_equal(npg_cloud_is_single_view(&yes, points, seen, sensor), NPG_OK);
    assert_true(yes);
    memcpy(normals, truth, sizeof truth);
    random_sides(&r);
    npg_normals_face_sensor(normals, &flipped, points, seen,
                            (const float[]){(float)sensor[0], (float)sensor[1], (float)sensor[2]});
    assert_true(flipped > seen / 4);
    for (size_t i = 0; i < seen; i++) assert_true(dot_of(i) > 0.99);
}

static void noise_is_told_from_curvature(void **state)
{
    (void)state;
    double sigma, before = 0, after = 0;
    shape_random r = {17};
    shape_torus(points, truth, N, 1, 0.3, &r);
    assert_int_equal(npg_cloud_noise(&sigma, points, NULL, N), NPG_OK);
    assert_true(sigma < 0.002);
    for (size_t i = 0; i < 3 * N; i++) points[i] += (float)(0.01 * shape_gauss(&r));
    assert_int_equal(npg_cloud_noise(&sigma, points, NULL, N), NPG_OK);
    assert_true(sigma > 0.007 && sigma < 0.013);
    memcpy(normals, truth, sizeof truth);
    for (int pass = 0; pass < 2; pass++) {
        double sum = 0;
        for (size_t i = 0; i < N; i++) {
            const float *p = points + 3 * i;
            double off = hypot(hypot((double)p[0], (double)p[1]) - 1, (double)p[2]) - 0.3;
            sum += off * off;
        }
        *(pass ? &after : &before) = sqrt(sum / N);
        if (!pass) assert_int_equal(npg_cloud_smooth(points, normals, N, 24), NPG_OK);
    }
    assert_true(after < 0.6 * before);
}

static void the_same_every_time(void **state)
{
    (void)state;
    static float again[3 * N];
    shape_random r = {19};
    shape_limbs(points, truth, N, &r);
    assert_int_equal(npg_normals_make(normals, points, N), NPG_OK);
    assert_int_equal(npg_normals_make(again, points, N), NPG_OK);
    assert_memory_equal(normals, again, sizeof again);
}

static void refused_memory_is_survived(void **state)
{
    (void)state;
    shape_random r = {23};
    size_t before = npg_memory_used(), few = 300, refused = 0;
    shape_sphere(points, truth, few, 1, &r);
    for (uint64_t n = 1;; n += 1 + n / 64) { /* later ones are mostly of the same places */
        size_t flipped;
        memcpy(normals, truth, sizeof truth);
        npg_memory_fail_at(n, true);
        npg_status status = npg_normals_mend(normals, &flipped, points, few);
        if (!status) status = npg_normals_make(normals, points, few);
        if (!status) status = npg_cloud_smooth(points, normals, few, 12);
        npg_memory_fail_at(0, false);
        assert_int_equal(npg_memory_used(), before);
        if (!status) break;
        assert_int_equal(status, NPG_MEMORY);
        refused++;
    }
    assert_true(refused > 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(directions_of_a_sphere),
                                       cmocka_unit_test(sides_from_nothing),
                                       cmocka_unit_test(given_normals_are_mended),
                                       cmocka_unit_test(normals_given_inward_are_turned),
                                       cmocka_unit_test(the_scale_does_not_matter),
                                       cmocka_unit_test(a_sensor_decides),
                                       cmocka_unit_test(noise_is_told_from_curvature),
                                       cmocka_unit_test(the_same_every_time),
                                       cmocka_unit_test(refused_memory_is_survived),
                                       cmocka_unit_test(sides_of_a_thin_sheet_are_believed),
                                       cmocka_unit_test(a_sheet_has_one_side),
                                       cmocka_unit_test(the_faces_of_a_blade_keep_their_sides)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
