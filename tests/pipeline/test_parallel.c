/* Parallel: every part is done once, whoever asks and from wherever, and the lowest failure is told. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pipeline/parallel.h"

#define PARTS  1000
#define INSIDE 7
#define ASKING 4 /* threads at once */

static npg_status count_up(void *user, size_t part)
{
    ((int *)user)[part]++;
    return NPG_OK;
}

static void assert_once(const int *counts, size_t count)
{
    for (size_t i = 0; i < count; i++) assert_int_equal(counts[i], 1);
}

static void every_part_is_done_once(void **state)
{
    static int counts[PARTS];
    (void)state;
    for (size_t n = 0; n <= PARTS; n = 3 * n + 1) {
        memset(counts, 0, sizeof counts);
        assert_int_equal(npg_parallel(count_up, counts, n), NPG_OK);
        assert_once(counts, n);
    }
}

static npg_status ask_inside(void *user, size_t part)
{
    return npg_parallel(count_up, (int *)user + INSIDE * part, INSIDE);
}

static void *ask(void *user)
{
    return npg_parallel(ask_inside, user, PARTS) ? user : NULL;
}

static void parts_may_ask_and_so_may_threads(void **state)
{
    static int counts[ASKING][PARTS * INSIDE];
    pthread_t threads[ASKING];
    (void)state;
    for (size_t i = 0; i < ASKING; i++)
        assert_int_equal(pthread_create(&threads[i], NULL, ask, counts[i]), 0);
    for (size_t i = 0; i < ASKING; i++) {
        void *failed;
        pthread_join(threads[i], &failed);
        assert_null(failed);
        assert_once(counts[i], (size_t)PARTS * INSIDE);
    }
}

static npg_status fail_late(void *user, size_t part)
{
    const size_t *first = user;
    return part < *first ? NPG_OK : npg_error(NPG_FAILED, "part %zu", part);
}

static void the_lowest_failure_is_told(void **state)
{
    (void)state;
    for (size_t first = 0; first < PARTS; first += 311) {
        assert_int_equal(npg_parallel(fail_late, &first, PARTS), NPG_FAILED);
        char text[32];
        snprintf(text, sizeof text, "part %zu", first);
        assert_string_equal(npg_error_text(), text);
    }
}

/* The pool's threads are not in it. */
static void a_forked_child_has_threads_of_its_own(void **state)
{
    static int counts[PARTS];
    int status;
    (void)state;
#ifdef __SANITIZE_THREAD__
    skip(); /* it forbids threads in a child of a process that has some */
#endif
    pid_t child = fork();
    if (!child) _exit(npg_parallel(count_up, counts, PARTS) || counts[PARTS - 1] != 1);
    assert_true(child > 0);
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_is_done_once),
        cmocka_unit_test(parts_may_ask_and_so_may_threads),
        cmocka_unit_test(the_lowest_failure_is_told),
        cmocka_unit_test(a_forked_child_has_threads_of_its_own),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
