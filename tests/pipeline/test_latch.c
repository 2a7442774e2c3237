/* Latch: a waiter is woken by the count and by the abort; nobody waits for what was reached before. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <pthread.h>
#include <unistd.h>

#include "pipeline/ring.h"

typedef struct waiter {
    npg_latch *latch;
    int64_t count;
    npg_status status;
} waiter;

static void *wait_for_count(void *argument)
{
    waiter *w = argument;
    w->status = npg_latch_wait(w->latch, w->count);
    return NULL;
}

static void what_was_reached_needs_no_wait(void **state)
{
    npg_latch *latch;
    (void)state;
    assert_int_equal(npg_latch_open(&latch, -1), NPG_OK);
    assert_int_equal(npg_latch_wait(latch, -1), NPG_OK);
    npg_latch_raise(latch, 3);
    npg_latch_raise(latch, 2); /* never falls */
    assert_int_equal(npg_latch_wait(latch, 3), NPG_OK);
    npg_latch_close(&latch);
    assert_null(latch);
    npg_latch_close(&latch);
}

/* Each of two threads is let go by its own count. */
static void the_count_wakes_who_waits_for_it(void **state)
{
    npg_latch *latch;
    pthread_t threads[2];
    (void)state;
    assert_int_equal(npg_latch_open(&latch, 0), NPG_OK);
    waiter waiters[2] = {{latch, 1, NPG_FAILED}, {latch, 5, NPG_FAILED}};
    for (int i = 0; i < 2; i++) pthread_create(&threads[i], NULL, wait_for_count, &waiters[i]);
    npg_latch_raise(latch, 1);
    pthread_join(threads[0], NULL);
    assert_int_equal(waiters[0].status, NPG_OK);
    for (int64_t count = 2; count <= 5; count++) npg_latch_raise(latch, count);
    pthread_join(threads[1], NULL);
    assert_int_equal(waiters[1].status, NPG_OK);
    npg_latch_close(&latch);
}

static void an_abort_wakes_all_and_stays(void **state)
{
    npg_latch *latch;
    pthread_t threads[2];
    (void)state;
    assert_int_equal(npg_latch_open(&latch, 0), NPG_OK);
    waiter waiters[2] = {{latch, 1, NPG_FAILED}, {latch, 5, NPG_FAILED}};
    for (int i = 0; i < 2; i++) pthread_create(&threads[i], NULL, wait_for_count, &waiters[i]);
    usleep(1000); /* one of them is likely to wait by now; the result is the same if not */
    npg_latch_abort(latch);
    for (int i = 0; i < 2; i++) {
        pthread_join(threads[i], NULL);
        assert_int_equal(waiters[i].status, NPG_ABORTED);
    }
    assert_int_equal(npg_latch_wait(latch, 0), NPG_ABORTED);
    npg_latch_close(&latch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_reached_needs_no_wait),
        cmocka_unit_test(the_count_wakes_who_waits_for_it),
        cmocka_unit_test(an_abort_wakes_all_and_stays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
