/* Log of what a fusing pass found: read back to the bit, as far as it is whole, and by nobody else. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "align/follow_log.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/group_folder.h"
#include "tests/support/shapes.h"

enum { NODES = 5, NUMBERS = NODES * NPG_POSE_SIZE, STATE = 24, GROUPS = 3, FRAMES = 4 };

static npg_mesh *reference;
static const char *path;

static npg_follow_key key_of(uint64_t job)
{
    return (npg_follow_key){job, reference, NODES, STATE};
}

static void make_pose(double pose[NUMBERS], int64_t index)
{
    shape_random random = {(uint64_t)index + 1};
    for (int i = 0; i < NUMBERS; i++) pose[i] = shape_gauss(&random);
}

static void make_state(char state[STATE], int group)
{
    memset(state, 'a' + group, STATE);
}

static npg_follow_log *open_log(uint64_t job, int64_t groups)
{
    npg_follow_log *log;
    int64_t found;
    const npg_follow_key key = key_of(job);
    assert_int_equal(npg_follow_log_open(&log, &found, path, &key), NPG_OK);
    assert_int_equal(found, groups);
    assert_int_equal(npg_follow_log_has_group(log), groups > 0);
    return log;
}

static void add_groups(npg_follow_log *log, int first, int count)
{
    for (int g = first; g < first + count; g++) {
        char state[STATE];
        make_state(state, g);
        for (int i = 0; i < FRAMES; i++) {
            double pose[NUMBERS];
            make_pose(pose, g * FRAMES + i);
            assert_int_equal(npg_follow_log_add(log, g * FRAMES + i, pose), NPG_OK);
        }
        assert_int_equal(npg_follow_log_commit_group(log, state), NPG_OK);
    }
}

static void check_groups(npg_follow_log *log, int count)
{
    for (int g = 0; g < count; g++) {
        char wanted_state[STATE];
        const void *state;
        assert_true(npg_follow_log_has_group(log));
        for (int i = 0; i < FRAMES; i++) {
            double got[NUMBERS], wanted[NUMBERS];
            make_pose(wanted, g * FRAMES + i);
            assert_int_equal(npg_follow_log_read(log, g * FRAMES + i, got), NPG_OK);
            assert_memory_equal(got, wanted, sizeof got);
        }
        make_state(wanted_state, g);
        assert_int_equal(npg_follow_log_end_group(log, &state), NPG_OK);
        assert_memory_equal(state, wanted_state, STATE);
    }
    assert_false(npg_follow_log_has_group(log));
}

static void write_three(void)
{
    unlink(path);
    npg_follow_log *log = open_log(7, 0);
    add_groups(log, 0, GROUPS);
    npg_follow_log_close(&log);
}

static void what_was_found_is_read_back_and_goes_on(void **state)
{
    (void)state;
    write_three();
    npg_follow_log *log = open_log(7, GROUPS);
    check_groups(log, GROUPS);
    add_groups(log, GROUPS, 1);
    npg_follow_log_close(&log);
    log = open_log(7, GROUPS + 1);
    check_groups(log, GROUPS + 1);
    npg_follow_log_close(&log);
}

/* Wherever the file ends, only whole groups count, and what is added then takes the place of the torn one. */
static void a_torn_group_is_not_there(void **state)
{
    struct stat info;
    (void)state;
    write_three();
    assert_int_equal(stat(path, &info), 0);
    off_t group = (info.st_size - 64) / GROUPS;
    for (off_t cut = 1; cut < info.st_size; cut += 97) {
        write_three();
        assert_int_equal(truncate(path, info.st_size - cut), 0);
        int whole = info.st_size - cut < 64 ? 0 : (int)((info.st_size - cut - 64) / group);
        npg_follow_log *log = open_log(7, whole);
        check_groups(log, whole);
        add_groups(log, whole, 1);
        npg_follow_log_close(&log);
        log = open_log(7, whole + 1);
        check_groups(log, whole + 1);
        npg_follow_log_close(&log);
    }
}

static void a_spoilt_byte_ends_the_log(void **state)
{
    struct stat info;
    (void)state;
    write_three();
    assert_int_equal(stat(path, &info), 0);
    off_t group = (info.st_size - 64) / GROUPS;
    for (off_t at = 64; at < info.st_size; at += 61) {
        write_three();
        FILE *file = fopen(path, "r+b");
        assert_non_null(file);
        fseek(file, (long)at, SEEK_SET);
        int byte = fgetc(file);
        fseek(file, (long)at, SEEK_SET);
        fputc(byte ^ 0x55, file);
        fclose(file);
        int whole = (int)((at - 64) / group);
        npg_follow_log *log = open_log(7, whole);
        check_groups(log, whole);
        npg_follow_log_close(&log);
    }
}

static void another_job_or_reference_begins_anew(void **state)
{
    (void)state;
    write_three();
    npg_follow_log *log = open_log(8, 0);
    npg_follow_log_close(&log);
    write_three();
    reference->vert_pos[0] += 1;
    log = open_log(7, 0);
    npg_follow_log_close(&log);
    reference->vert_pos[0] -= 1;
}

static void frames_of_another_order_are_refused(void **state)
{
    double pose[NUMBERS];
    const void *packed;
    (void)state;
    write_three();
    npg_follow_log *log = open_log(7, GROUPS);
    assert_int_equal(npg_follow_log_read(log, 1, pose), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "--restart"));
    assert_int_equal(npg_follow_log_end_group(log, &packed), NPG_BAD_INPUT);
    npg_follow_log_close(&log);
}

static void a_place_that_cannot_be_written_is_named(void **state)
{
    npg_follow_log *log;
    int64_t groups;
    const npg_follow_key key = key_of(1);
    (void)state;
    assert_int_equal(npg_follow_log_open(&log, &groups, "/nowhere/at/all", &key), NPG_DISK);
    assert_null(log);
    assert_non_null(strstr(npg_error_text(), "/nowhere/at/all"));
}

static int set_up(void **state)
{
    if (open_folder(state)) return -1;
    path = in_folder(&folder, "followed.bin");
    reference = ball_mesh(5, 6);
    return 0;
}

static int tear_down(void **state)
{
    npg_mesh_unref(&reference);
    return close_folder(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_found_is_read_back_and_goes_on),
        cmocka_unit_test(a_torn_group_is_not_there),
        cmocka_unit_test(a_spoilt_byte_ends_the_log),
        cmocka_unit_test(another_job_or_reference_begins_anew),
        cmocka_unit_test(frames_of_another_order_are_refused),
        cmocka_unit_test(a_place_that_cannot_be_written_is_named),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
