/* Rigid ICP: a body that has gone elsewhere and turned is found there, also where a limb of it moved on its own,
 * and also turned about where a guess says so; poses that differ are less alike than those that do not. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pipeline/random.h"
#include "track/track.h"

enum { POINTS = 2000 };

/* A box of unequal sides, and on it a limb of a sixth of the points, lifted by `lift`. */
static void make_body(float *points, double lift, uint64_t seed)
{
    npg_random random = npg_random_stream(seed, 0, 0);
    const double sides[3] = {1, 0.5, 0.25};
    for (int i = 0; i < POINTS; i++) {
        double x[3];
        for (int k = 0; k < 3; k++) x[k] = (npg_random_real(&random) - 0.5) * sides[k];
        int face = i % 3;
        x[face] = x[face] > 0 ? sides[face] / 2 : -sides[face] / 2;
        if (i % 6 == 0) { /* the limb leans over by its lift */
            double height = npg_random_real(&random);
            x[0] = 0.4 + 0.05 * x[0] + height * 0.5 * sin(lift);
            x[1] = 0.25 + height * 0.5 * cos(lift);
            x[2] *= 0.2;
        }
        for (int k = 0; k < 3; k++) points[3 * i + k] = (float)x[k];
    }
}

static npg_rigid some_motion(double angle)
{
    return (npg_rigid){.rotation = {{cos(angle), 0, sin(angle)}, {0, 1, 0}, {-sin(angle), 0, cos(angle)}},
                       .translation = {4, -1, 2}};
}

static void move(float *points, const npg_rigid *m)
{
    for (int i = 0; i < POINTS; i++) {
        double x[3] = {(double)points[3 * i], (double)points[3 * i + 1], (double)points[3 * i + 2]};
        for (int r = 0; r < 3; r++)
            points[3 * i + r] = (float)(m->rotation[r][0] * x[0] + m->rotation[r][1] * x[1] +
                                        m->rotation[r][2] * x[2] + m->translation[r]);
    }
}

/* Largest angle between rows, radians. */
static double angle_between(const npg_rigid *a, const npg_rigid *b)
{
    double least = 1;
    for (int r = 0; r < 3; r++) {
        double cosine = 0;
        for (int c = 0; c < 3; c++) cosine += a->rotation[r][c] * b->rotation[r][c];
        least = fmin(least, cosine);
    }
    return acos(least);
}

/* The angle by which the motion that is found differs from the true one. */
static double find(double *unlike, double angle, double lift, double guessed)
{
    static float first[3 * POINTS], second[3 * POINTS];
    npg_look from, to;
    npg_rigid motion = some_motion(angle), guess = some_motion(guessed), found;
    make_body(first, 0.2, 1);
    make_body(second, lift, 2);
    move(second, &motion);
    assert_int_equal(npg_look_open(&from, first, POINTS), NPG_OK);
    assert_int_equal(npg_look_open(&to, second, POINTS), NPG_OK);
    assert_int_equal(npg_rigid_icp(&found, unlike, &from, &to, &guess), NPG_OK);
    npg_look_close(&from);
    npg_look_close(&to);
    double off = angle_between(&found, &motion);
    print_message("turned by %.1f, limb at %.1f: off by %.3f, unlike %.5f\n", angle, lift, off, *unlike);
    return off;
}

static void the_motion_of_the_whole_is_found(void **state)
{
    double same, other, turned;
    (void)state;
    assert_true(find(&same, 0.4, 0.2, 0) < 0.05);
    assert_true(find(&other, 0.4, 1.2, 0) < 0.1);
    assert_true(other > 2 * same);
    assert_true(find(&turned, 2.8, 0.2, 2.6) < 0.05);
    assert_true(turned < 1.5 * same);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_motion_of_the_whole_is_found)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
