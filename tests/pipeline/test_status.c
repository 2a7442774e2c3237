/* Status: texts per thread, prefixes, errno, exit codes and names. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <pthread.h>
#include <string.h>

#include "pipeline/status.h"

static void texts_are_kept_and_prefixed(void **state)
{
    (void)state;
    assert_int_equal(npg_error(NPG_BAD_INPUT, "%s: line %d", "a.ply", 7), NPG_BAD_INPUT);
    assert_string_equal(npg_error_text(), "a.ply: line 7");
    assert_int_equal(npg_error_prefix(NPG_BAD_INPUT, "frame %d", 3), NPG_BAD_INPUT);
    assert_string_equal(npg_error_text(), "frame 3: a.ply: line 7");
    assert_int_equal(npg_error_prefix(NPG_OK, "nothing"), NPG_OK);
    assert_int_equal(npg_error_prefix(NPG_END, "nothing"), NPG_END);
    assert_string_equal(npg_error_text(), "frame 3: a.ply: line 7");
    npg_error(NPG_FAILED, "again: %s", npg_error_text()); /* the text itself as an argument */
    assert_string_equal(npg_error_text(), "again: frame 3: a.ply: line 7");
    npg_error_set(NPG_DISK, "100% full");
    assert_string_equal(npg_error_text(), "100% full");
}

static void a_text_is_one_line_of_bounded_length(void **state)
{
    (void)state;
    char name[3000];
    memset(name, 'x', sizeof name);
    name[sizeof name - 1] = 0;
    npg_error(NPG_FAILED, "two\nlines\r\tand \x1b[31m");
    assert_string_equal(npg_error_text(), "two?lines??and ?[31m");
    npg_error(NPG_FAILED, "%s", name);
    assert_true(strlen(npg_error_text()) < 1100);
    for (int i = 0; i < 5; i++) npg_error_prefix(NPG_FAILED, "%s", name);
    assert_true(strlen(npg_error_text()) < 1100);
}

static void errno_decides_the_status(void **state)
{
    const struct {
        int cause;
        npg_status status;
    } cases[] = {{ENOSPC, NPG_DISK}, {EROFS, NPG_DISK},    {EIO, NPG_DISK},         {EDQUOT, NPG_DISK},
                 {EFBIG, NPG_DISK},  {ENOMEM, NPG_MEMORY}, {ENOENT, NPG_BAD_INPUT}, {EACCES, NPG_BAD_INPUT}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        errno = cases[i].cause;
        assert_int_equal(npg_error_errno(NPG_BAD_INPUT, "can't do %s", "it"), cases[i].status);
        assert_non_null(strstr(npg_error_text(), strerror(cases[i].cause)));
    }
}

static void *fail_elsewhere(void *argument)
{
    if (*npg_error_text()) return argument;
    npg_error(NPG_FAILED, "of the other thread");
    return NULL;
}

static void threads_have_texts_of_their_own(void **state)
{
    pthread_t other;
    void *wrong;
    npg_error(NPG_FAILED, "mine");
    assert_int_equal(pthread_create(&other, NULL, fail_elsewhere, state), 0);
    pthread_join(other, &wrong);
    assert_null(wrong);
    assert_string_equal(npg_error_text(), "mine");
}

static void exit_codes_are_the_documented_ones(void **state)
{
    const struct {
        npg_status status;
        int code;
    } cases[] = {{NPG_OK, 0},       {NPG_FAILED, 1},   {NPG_USAGE, 2},   {NPG_BAD_INPUT, 3},
                 {NPG_DEVICE, 4},   {NPG_DISK, 5},     {NPG_MEMORY, 6},  {NPG_PARTIAL, 7},
                 {NPG_STOPPED, 75}, {NPG_DIVERGED, 1}, {NPG_ABORTED, 1}, {NPG_END, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(npg_status_exit_code(cases[i].status), cases[i].code);
        assert_string_not_equal(npg_status_name(cases[i].status), "unknown");
    }
    assert_string_equal(npg_status_name((npg_status)-99), "unknown");
    assert_int_equal(npg_status_exit_code((npg_status)-99), 1);
    assert_string_equal(npg_version(), "0.1.0");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(texts_are_kept_and_prefixed),
        cmocka_unit_test(a_text_is_one_line_of_bounded_length),
        cmocka_unit_test(errno_decides_the_status),
        cmocka_unit_test(threads_have_texts_of_their_own),
        cmocka_unit_test(exit_codes_are_the_documented_ones),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
