/* Memory: alignment, zeroes, counting by purpose, the limit, growing, injected failures, arenas, a user allocator. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/memory.h"

static int nothing_left(void **state)
{
    (void)state;
    npg_memory_set_limit(0);
    npg_memory_fail_at(0, false);
    return npg_memory_used() != 0;
}

static void blocks_are_aligned_zero_and_counted(void **state)
{
    (void)state;
    for (size_t size = 1; size < 5000; size = size * 3 / 2 + 1) {
        unsigned char *block;
        assert_int_equal(npg_alloc(&block, NPG_FOR_MESH, size), NPG_OK);
        assert_int_equal((uintptr_t)block % 64, 0);
        for (size_t i = 0; i < size; i++) assert_int_equal(block[i], 0);
        memset(block, 0xff, size);
        assert_int_equal(npg_memory_used(), size);
        assert_true(npg_memory_peak() >= size);
        npg_release(&block);
        assert_null(block);
        assert_int_equal(npg_memory_used(), 0);
    }
}

static void nothing_is_a_block_too(void **state)
{
    (void)state;
    void *block = (void *)1;
    assert_int_equal(npg_alloc(&block, NPG_FOR_RUN, 0), NPG_OK);
    assert_null(block);
    npg_release(&block);
    assert_int_equal(npg_alloc_array(&block, NPG_FOR_RUN, 0, 8), NPG_OK);
    assert_null(block);
}

static void impossible_sizes_fail_cleanly(void **state)
{
    (void)state;
    void *block = (void *)1;
    assert_int_equal(npg_alloc_array(&block, NPG_FOR_FIT, SIZE_MAX / 2, 3), NPG_MEMORY);
    assert_null(block);
    assert_int_equal(npg_alloc(&block, NPG_FOR_FIT, SIZE_MAX), NPG_MEMORY);
    assert_int_equal(npg_alloc(&block, NPG_FOR_FIT, SIZE_MAX - 64), NPG_MEMORY);
    assert_int_equal(npg_alloc(&block, NPG_FOR_FIT, (size_t)1 << 60), NPG_MEMORY);
    assert_non_null(strstr(npg_error_text(), "fit"));
    assert_int_equal(npg_memory_used(), 0);
}

static void the_limit_holds(void **state)
{
    (void)state;
    void *a, *b;
    npg_memory_set_limit(3 << 20);
    assert_int_equal(npg_alloc(&a, NPG_FOR_FRAMES, 2 << 20), NPG_OK);
    assert_int_equal(npg_alloc(&b, NPG_FOR_FRAMES, 2 << 20), NPG_MEMORY);
    assert_non_null(strstr(npg_error_text(), "limit of 3 MiB"));
    assert_int_equal(npg_memory_count(NPG_FOR_DEVICE, 2 << 20), NPG_MEMORY);
    assert_int_equal(npg_memory_used(), 2 << 20);
    assert_int_equal(npg_memory_count(NPG_FOR_DEVICE, 1 << 20), NPG_OK);
    assert_int_equal(npg_memory_count(NPG_FOR_DEVICE, -(1 << 20)), NPG_OK);
    npg_release(&a);
}

static void growing_keeps_the_content(void **state)
{
    (void)state;
    int *values = NULL;
    size_t capacity = 0;
    for (int i = 0; i < 1000; i++) {
        assert_int_equal(npg_grow(&values, &capacity, (size_t)i + 1, sizeof *values, NPG_FOR_RUN), NPG_OK);
        assert_int_equal(values[i], 0);
        values[i] = i;
    }
    for (int i = 0; i < 1000; i++) assert_int_equal(values[i], i);
    size_t before = capacity;
    npg_memory_fail_at(1, false);
    assert_int_equal(npg_grow(&values, &capacity, capacity + 1, sizeof *values, NPG_FOR_RUN), NPG_MEMORY);
    assert_int_equal(capacity, before);
    assert_int_equal(values[999], 999);
    assert_int_equal(npg_grow(&values, &capacity, SIZE_MAX / 2, sizeof *values, NPG_FOR_RUN), NPG_MEMORY);
    npg_release(&values);
}

static void the_nth_request_fails(void **state)
{
    (void)state;
    void *block;
    npg_memory_fail_at(3, false);
    for (int i = 1; i <= 5; i++) {
        assert_int_equal(npg_alloc(&block, NPG_FOR_RUN, 8), i == 3 ? NPG_MEMORY : NPG_OK);
        npg_release(&block);
    }
    npg_memory_fail_at(2, true);
    for (int i = 1; i <= 5; i++) {
        assert_int_equal(npg_alloc(&block, NPG_FOR_RUN, 8), i >= 2 ? NPG_MEMORY : NPG_OK);
        npg_release(&block);
    }
}

static void an_arena_frees_all_at_once(void **state)
{
    (void)state;
    npg_arena arena = {.purpose = NPG_FOR_MESH};
    int *numbers = npg_arena_take(&arena, 1000, sizeof *numbers);
    assert_int_equal((uintptr_t)numbers % 64, 0);
    for (int i = 0; i < 1000; i++) assert_int_equal(numbers[i], 0);
    memset(numbers, 0xff, 1000 * sizeof *numbers);
    assert_null(npg_arena_take(&arena, 0, 8)); /* nothing is no failure */
    int *copy = npg_arena_copy(&arena, numbers, 1000, sizeof *copy);
    assert_memory_equal(copy, numbers, 1000 * sizeof *copy);
    assert_string_equal(npg_arena_text(&arena, "walker"), "walker");
    assert_int_equal(npg_arena_status(&arena), NPG_OK);
    assert_int_equal(npg_memory_used(), 8007);
    npg_arena_release(&arena);
    assert_int_equal(npg_memory_used(), 0);
    npg_arena_release(&arena); /* an empty one, too */
}

static void an_arena_remembers_the_first_refusal(void **state)
{
    (void)state;
    npg_arena arena = {.purpose = NPG_FOR_FIT};
    npg_memory_fail_at(2, false);
    assert_non_null(npg_arena_take(&arena, 3, 8));
    assert_null(npg_arena_take(&arena, 5, 8));
    assert_null(npg_arena_take(&arena, 7, 8)); /* the system would give it again */
    assert_int_equal(npg_arena_status(&arena), NPG_MEMORY);
    assert_non_null(strstr(npg_error_text(), "40 bytes for fit"));
    assert_int_equal(npg_memory_used(), 24);
    npg_arena_release(&arena);
    assert_int_equal(npg_arena_status(&arena), NPG_OK); /* a fresh start */
    assert_null(npg_arena_take(&arena, SIZE_MAX / 2, 3));
    assert_int_equal(npg_arena_status(&arena), NPG_MEMORY);
    npg_arena_release(&arena);
}

static void arrays_of_an_arena_grow_in_their_place(void **state)
{
    (void)state;
    enum { ARRAYS = 3 };
    npg_arena arena = {.purpose = NPG_FOR_FIT};
    int *arrays[ARRAYS] = {NULL};
    size_t capacities[ARRAYS] = {0};
    assert_non_null(npg_arena_take(&arena, 1, 1));
    for (int i = 0; i < 300; i++)
        for (int k = 0; k < ARRAYS; k++) { /* the first, the middle and the last of the arena */
            assert_int_equal(npg_arena_grow(&arena, &arrays[k], &capacities[k], (size_t)i + 1, sizeof(int)),
                             NPG_OK);
            arrays[k][i] = 10 * i + k;
        }
    for (int i = 0; i < 300; i++)
        for (int k = 0; k < ARRAYS; k++) assert_int_equal(arrays[k][i], 10 * i + k);
    assert_int_equal(npg_memory_used(), 1 + (capacities[0] + capacities[1] + capacities[2]) * sizeof(int));
    npg_memory_fail_at(1, false);
    assert_int_equal(npg_arena_grow(&arena, &arrays[1], &capacities[1], 100000, sizeof(int)), NPG_MEMORY);
    assert_int_equal(arrays[1][299], 2991);
    assert_int_equal(npg_arena_status(&arena), NPG_MEMORY);
    npg_arena_release(&arena);
}

static void an_object_goes_with_its_arena(void **state)
{
    (void)state;
    struct thing {
        npg_arena arena;
        char *name;
    } * thing;
    assert_int_equal(npg_object_open(&thing, NPG_FOR_FILES, sizeof *thing), NPG_OK);
    thing->name = npg_arena_text(&thing->arena, "walker");
    assert_int_equal(npg_memory_used(), sizeof *thing + 7);
    npg_object_close(&thing);
    assert_null(thing);
    npg_object_close(&thing);
    npg_memory_fail_at(1, false);
    assert_int_equal(npg_object_open(&thing, NPG_FOR_FILES, sizeof *thing), NPG_MEMORY);
    assert_null(thing);
}

/* ---- an allocator of the user's ---- */

static size_t live_blocks;

static void *count_alloc(void *user, size_t align, size_t size)
{
    if (*(size_t *)user == live_blocks) return NULL;
    live_blocks++;
    return aligned_alloc(align, (size + align - 1) / align * align);
}

static void count_release(void *user, void *memory)
{
    (void)user;
    live_blocks--;
    free(memory);
}

static void the_users_allocator_is_asked(void **state)
{
    (void)state;
    size_t most = 2;
    npg_allocator own = {sizeof own, &most, count_alloc, count_release};
    void *a, *b, *c;
    assert_int_equal(npg_memory_set_allocator(&own), NPG_OK);
    assert_int_equal(npg_alloc(&a, NPG_FOR_RUN, 10), NPG_OK);
    assert_int_equal(npg_memory_set_allocator(NULL), NPG_USAGE); /* memory is in use */
    assert_int_equal(npg_alloc(&b, NPG_FOR_RUN, 10), NPG_OK);
    assert_int_equal(npg_alloc(&c, NPG_FOR_RUN, 10), NPG_MEMORY);
    assert_int_equal(live_blocks, 2);
    npg_release(&a);
    npg_release(&b);
    assert_int_equal(live_blocks, 0);
    npg_allocator broken = {sizeof broken, NULL, NULL, count_release};
    assert_int_equal(npg_memory_set_allocator(&broken), NPG_USAGE);
    assert_int_equal(npg_memory_set_allocator(NULL), NPG_OK);
}

static void *churn(void *argument)
{
    for (size_t i = 1; i < 5000; i++) {
        void *block;
        if (npg_alloc(&block, NPG_FOR_QUERY, i % 97 + 1)) return argument;
        npg_release(&block);
    }
    return NULL;
}

static void counters_survive_threads(void **state)
{
    (void)state;
    pthread_t threads[4];
    void *failed;
    for (int i = 0; i < 4; i++) assert_int_equal(pthread_create(&threads[i], NULL, churn, threads), 0);
    for (int i = 0; i < 4; i++) {
        pthread_join(threads[i], &failed);
        assert_null(failed);
    }
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(blocks_are_aligned_zero_and_counted, nothing_left),
        cmocka_unit_test_teardown(nothing_is_a_block_too, nothing_left),
        cmocka_unit_test_teardown(impossible_sizes_fail_cleanly, nothing_left),
        cmocka_unit_test_teardown(the_limit_holds, nothing_left),
        cmocka_unit_test_teardown(growing_keeps_the_content, nothing_left),
        cmocka_unit_test_teardown(the_nth_request_fails, nothing_left),
        cmocka_unit_test_teardown(an_arena_frees_all_at_once, nothing_left),
        cmocka_unit_test_teardown(an_arena_remembers_the_first_refusal, nothing_left),
        cmocka_unit_test_teardown(arrays_of_an_arena_grow_in_their_place, nothing_left),
        cmocka_unit_test_teardown(an_object_goes_with_its_arena, nothing_left),
        cmocka_unit_test_teardown(the_users_allocator_is_asked, nothing_left),
        cmocka_unit_test_teardown(counters_survive_threads, nothing_left),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
