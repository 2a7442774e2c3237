/* Ring: order, capacity as back-pressure, the end and the abort from either side, with two threads. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <time.h>

#include "pipeline/memory.h"
#include "pipeline/ring.h"

static npg_chunk *chunk_of(int64_t index)
{
    npg_chunk *chunk;
    npg_frame frame = {.index = index};
    assert_int_equal(npg_chunk_open(&chunk, 1), NPG_OK);
    npg_chunk_add(chunk, &frame);
    return chunk;
}

static void keeps_order_and_delivers_after_the_end(void **state)
{
    (void)state;
    npg_ring *ring;
    assert_int_equal(npg_ring_open(&ring, 3), NPG_OK);
    for (int64_t round = 0; round < 5; round++) {
        for (int64_t i = 0; i < 3; i++) {
            npg_chunk *chunk = chunk_of(3 * round + i);
            assert_int_equal(npg_ring_push(ring, &chunk), NPG_OK);
            assert_null(chunk);
        }
        if (round == 4) npg_ring_end(ring);
        for (int64_t i = 0; i < 3; i++) {
            npg_chunk *chunk = NULL;
            assert_int_equal(npg_ring_pop(ring, &chunk), NPG_OK);
            assert_int_equal(npg_chunk_frame(chunk, 0)->index, 3 * round + i);
            npg_chunk_close(&chunk);
        }
    }
    npg_chunk *chunk = NULL;
    assert_int_equal(npg_ring_pop(ring, &chunk), NPG_END);
    assert_int_equal(npg_ring_pop(ring, &chunk), NPG_END);
    chunk = chunk_of(0);
    assert_int_equal(npg_ring_push(ring, &chunk), NPG_USAGE);
    assert_non_null(chunk);
    npg_chunk_close(&chunk);
    npg_ring_close(&ring);
    assert_null(ring);
    npg_ring_close(&ring);
}

static void abort_frees_and_stays(void **state)
{
    (void)state;
    npg_ring *ring;
    size_t before = npg_memory_used();
    assert_int_equal(npg_ring_open(&ring, 2), NPG_OK);
    npg_chunk *chunk = chunk_of(1), *second = NULL;
    assert_int_equal(npg_ring_push(ring, &chunk), NPG_OK);
    npg_ring_abort(ring);
    npg_ring_end(ring); /* too late: the ring stays aborted */
    assert_int_equal(npg_ring_pop(ring, &second), NPG_ABORTED);
    assert_null(second);
    chunk = chunk_of(2);
    assert_int_equal(npg_ring_push(ring, &chunk), NPG_ABORTED);
    assert_non_null(chunk);
    npg_chunk_close(&chunk);
    npg_ring_close(&ring);
    assert_int_equal(npg_memory_used(), before);
}

static void closing_frees_what_is_inside(void **state)
{
    (void)state;
    npg_ring *ring;
    size_t before = npg_memory_used();
    assert_int_equal(npg_ring_open(&ring, 4), NPG_OK);
    for (int i = 0; i < 3; i++) {
        npg_chunk *chunk = chunk_of(i);
        assert_int_equal(npg_ring_push(ring, &chunk), NPG_OK);
    }
    npg_ring_close(&ring);
    assert_int_equal(npg_memory_used(), before);
}

/* ---- two threads ---- */

typedef struct duet {
    npg_ring *ring;
    int64_t count;
    atomic_llong pushed, popped, most_inside;
    npg_status end;
} duet;

static void *produce(void *argument)
{
    duet *d = argument;
    for (int64_t i = 0; i < d->count; i++) {
        npg_chunk *chunk;
        npg_frame frame = {.index = i};
        if (npg_chunk_open(&chunk, 1)) break;
        npg_chunk_add(chunk, &frame);
        d->end = npg_ring_push(d->ring, &chunk);
        npg_chunk_close(&chunk);
        if (d->end) return NULL;
        long long inside = atomic_fetch_add(&d->pushed, 1) + 1 - atomic_load(&d->popped);
        if (inside > atomic_load(&d->most_inside)) atomic_store(&d->most_inside, inside);
    }
    npg_ring_end(d->ring);
    return NULL;
}

static void *consume(void *argument)
{
    duet *d = argument;
    for (int64_t i = 0;; i++) {
        npg_chunk *chunk = NULL;
        d->end = npg_ring_pop(d->ring, &chunk);
        if (d->end) return NULL;
        if (npg_chunk_frame(chunk, 0)->index != i) d->count = -1;
        atomic_fetch_add(&d->popped, 1);
        npg_chunk_close(&chunk);
    }
}

static void stall(void)
{
    nanosleep(&(struct timespec){0, 3000000}, NULL);
}

/* Pop until the end; the consumer stalls on purpose every so often. */
static int64_t consume_with_stalls(duet *d, npg_status *end)
{
    int64_t next = 0;
    for (;; next++) {
        npg_chunk *chunk = NULL;
        if (next % 250 == 0) stall();
        *end = npg_ring_pop(d->ring, &chunk);
        if (*end) return next;
        assert_int_equal(npg_chunk_frame(chunk, 0)->index, next);
        npg_chunk_close(&chunk);
        atomic_fetch_add(&d->popped, 1);
    }
}

static void threads_pass_everything_in_order(void **state)
{
    static const size_t capacities[] = {1, 2, 3, 8};
    (void)state;
    for (size_t i = 0; i < sizeof capacities / sizeof *capacities; i++) {
        duet d = {.count = 3000};
        npg_status end;
        pthread_t producer;
        assert_int_equal(npg_ring_open(&d.ring, capacities[i]), NPG_OK);
        assert_int_equal(pthread_create(&producer, NULL, produce, &d), 0);
        assert_int_equal(consume_with_stalls(&d, &end), 3000);
        pthread_join(producer, NULL);
        assert_int_equal(end, NPG_END);
        assert_int_equal(d.end, NPG_OK);
        /* one more than the capacity can be between the pop and the count of it */
        assert_true(atomic_load(&d.most_inside) <= (long long)capacities[i] + 1);
        npg_ring_close(&d.ring);
    }
}

static void a_full_ring_holds_its_producer_until_abort(void **state)
{
    (void)state;
    duet d = {.count = 100};
    pthread_t producer;
    size_t before = npg_memory_used();
    assert_int_equal(npg_ring_open(&d.ring, 2), NPG_OK);
    assert_int_equal(pthread_create(&producer, NULL, produce, &d), 0);
    while (atomic_load(&d.pushed) < 2) sched_yield();
    npg_ring_abort(d.ring);
    pthread_join(producer, NULL);
    assert_int_equal(d.end, NPG_ABORTED);
    assert_int_equal(atomic_load(&d.pushed), 2);
    npg_ring_close(&d.ring);
    assert_int_equal(npg_memory_used(), before);
}

static void an_empty_ring_holds_its_consumer_until(void (*leave)(npg_ring *), npg_status expected)
{
    duet d = {0};
    pthread_t consumer;
    assert_int_equal(npg_ring_open(&d.ring, 2), NPG_OK);
    assert_int_equal(pthread_create(&consumer, NULL, consume, &d), 0);
    npg_chunk *chunk = chunk_of(0);
    assert_int_equal(npg_ring_push(d.ring, &chunk), NPG_OK);
    while (atomic_load(&d.popped) < 1) sched_yield();
    leave(d.ring);
    pthread_join(consumer, NULL);
    assert_int_equal(d.end, expected);
    assert_int_equal(d.count, 0);
    npg_ring_close(&d.ring);
}

static void an_empty_ring_holds_its_consumer(void **state)
{
    (void)state;
    for (int i = 0; i < 50; i++) {
        an_empty_ring_holds_its_consumer_until(npg_ring_end, NPG_END);
        an_empty_ring_holds_its_consumer_until(npg_ring_abort, NPG_ABORTED);
    }
}

static void no_memory_is_said(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    for (uint64_t n = 1; n <= 2; n++) {
        npg_ring *ring = NULL;
        npg_memory_fail_at(n, false);
        assert_int_equal(npg_ring_open(&ring, 2), NPG_MEMORY);
        npg_memory_fail_at(0, false);
        assert_null(ring);
    }
    assert_int_equal(npg_memory_used(), before);
    npg_ring *ring = NULL;
    assert_int_equal(npg_ring_open(&ring, 0), NPG_USAGE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(keeps_order_and_delivers_after_the_end),
        cmocka_unit_test(abort_frees_and_stays),
        cmocka_unit_test(closing_frees_what_is_inside),
        cmocka_unit_test(threads_pass_everything_in_order),
        cmocka_unit_test(a_full_ring_holds_its_producer_until_abort),
        cmocka_unit_test(an_empty_ring_holds_its_consumer),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
