/* The poses of the coarse alignment stay rotations, however many frames they are carried on. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "tracker.h"

static void turn_about_z(double *pose, double angle)
{
    npg_pose_rest(pose, 1);
    pose[0] = pose[4] = cos(angle);
    pose[1] = -sin(angle);
    pose[3] = sin(angle);
    pose[9] = angle;
}

static void extrapolation_goes_on_for_ever(void **state)
{
    enum { FRAMES = 2000 };
    double poses[3][NPG_POSE_SIZE], wanted[NPG_POSE_SIZE];
    (void)state;
    turn_about_z(poses[0], 0.0);
    turn_about_z(poses[1], 0.01);
    for (int frame = 2; frame < FRAMES; frame++) {
        npg_pose_extrapolate(poses[2], poses[1], poses[0], 1);
        memcpy(poses[0], poses[1], sizeof poses[0]);
        memcpy(poses[1], poses[2], sizeof poses[1]);
    }
    turn_about_z(wanted, 0.01 * (FRAMES - 1));
    for (int i = 0; i < NPG_POSE_SIZE; i++) assert_true(fabs(poses[1][i] - wanted[i]) < 1e-6);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(extrapolation_goes_on_for_ever)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
