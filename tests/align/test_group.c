/* Group: what a group leaves is where the next one starts, also when it went through bytes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "align/align_internal.h"

enum { NODES = 2, KEY = 10 };

static void add_frame(npg_group *group, int64_t index, double turn)
{
    npg_waiting *w;
    npg_frame frame = {.index = index};
    assert_int_equal(npg_group_add(&w, group, &frame), NPG_OK);
    npg_side *way = group->ways[index < KEY];
    if (index != KEY) npg_side_step_on(way, index);
    for (int i = 0; i < NODES * NPG_POSE_SIZE; i++) w->pose[i] = way->now[i] = turn;
    w->cloud.count = 1;
    w->tracked.steps = 1;
    way->index = index;
    way->has_now = true;
    way->now_tracked = w->tracked;
    if (index == KEY) npg_side_copy(group->ways[1], way);
}

static void finish(npg_group *group)
{
    npg_recover_frame frames[8];
    size_t count = npg_group_list(group, frames);
    npg_group_take(group, frames, count);
    npg_group_clear(group);
}

/* The first group of a pass: the key, two frames after it and one before it. */
static void first_group(npg_group *group)
{
    assert_int_equal(npg_group_open(group, NODES), NPG_OK);
    add_frame(group, KEY, 0);
    add_frame(group, KEY + 1, 1);
    add_frame(group, KEY + 2, 2);
    add_frame(group, KEY - 1, -1);
}

static void assert_indices(const npg_recover_frame *frames, size_t count, size_t wanted,
                           const int64_t *indices)
{
    assert_int_equal(count, wanted);
    for (size_t i = 0; i < wanted; i++) assert_int_equal(frames[i].index, indices[i]);
}

/* What waits, and of the group before the last two frames of either side, the key once. */
static void frames_are_listed_in_order(void **state)
{
    npg_group group;
    npg_recover_frame frames[8];
    (void)state;
    first_group(&group);
    assert_indices(frames, npg_group_list(&group, frames), 4, (int64_t[]){9, 10, 11, 12});
    for (int i = 0; i < 4; i++) assert_false(frames[i].is_fixed);
    finish(&group);
    assert_indices(frames, npg_group_list(&group, frames), 4, (int64_t[]){9, 10, 11, 12});
    for (int i = 0; i < 4; i++) assert_true(frames[i].is_fixed);
    add_frame(&group, KEY + 3, 3);
    add_frame(&group, KEY - 2, -2);
    assert_indices(frames, npg_group_list(&group, frames), 6, (int64_t[]){8, 9, 10, 11, 12, 13});
    npg_group_close(&group);
}

/* A pose that was found for a waiting frame is what its side ends with, not the one it was followed to. */
static void sides_end_with_what_was_found(void **state)
{
    npg_group group;
    npg_recover_frame frames[8];
    (void)state;
    first_group(&group);
    size_t count = npg_group_list(&group, frames);
    frames[2].pose[0] = 10; /* frame 11 */
    frames[3].pose[0] = 20; /* frame 12 */
    frames[3].tracked.steps = 7;
    npg_group_take(&group, frames, count);
    assert_int_equal(group.frames[2].tracked.steps, 7);
    npg_group_clear(&group);
    assert_int_equal(group.sides[0]->index, 12);
    assert_int_equal(group.sides[1]->index, 9);
    assert_int_equal(group.sides[0]->now_tracked.steps, 7);
    assert_true(group.sides[0]->now[0] == 20 && group.ways[0]->now[0] == 20);
    assert_true(group.sides[0]->now[NPG_POSE_SIZE * NODES] == 10 && group.sides[1]->now[0] == -1);
    npg_group_close(&group);
}

static void bytes_bring_both_sides_back(void **state)
{
    npg_group group, again;
    (void)state;
    first_group(&group);
    finish(&group);
    assert_int_equal(npg_group_open(&again, NODES), NPG_OK);
    npg_group_begin(&again, group.sides[0]);
    assert_memory_equal(group.sides[0], again.sides[0], npg_group_bytes(&group));
    assert_int_equal(again.ways[0]->index, 12);
    assert_true(again.ways[0]->now[0] == 2 && again.ways[1]->now[0] == -1);
    npg_group_close(&group);
    npg_group_close(&again);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(frames_are_listed_in_order),
                                       cmocka_unit_test(sides_end_with_what_was_found),
                                       cmocka_unit_test(bytes_bring_both_sides_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
