/* Live plan: whatever the length that an open source turns out to have, its windows cover it, and a stage
 * that solves them as frames come holds few. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "pipeline/plan.h"

enum { FRAMES_MAX = 60 };

typedef struct solver { /* what a stage does that solves windows as their frames come */
    npg_plan plan;
    int64_t total; /* -1 while open */
    int64_t window_at;
    int is_held[FRAMES_MAX], is_solved[FRAMES_MAX];
    int64_t held_count, held_max;
    int64_t came[FRAMES_MAX], came_count; /* in order of arrival */
} solver;

static int is_complete(const solver *s, const npg_window *window)
{
    for (int64_t t = window->first; t <= window->last; t++)
        if (t >= FRAMES_MAX || !s->is_held[t]) return 0;
    return 1;
}

static void solve(solver *s, const npg_window *window)
{
    for (int64_t t = window->first; t <= window->last; t++) {
        int is_new = t >= window->new_first && t <= window->new_last;
        assert_int_equal(s->is_solved[t], !is_new);
        s->is_solved[t] = 1;
    }
    int64_t shared = window->last - window->first - (window->new_last - window->new_first);
    assert_true(!window->direction || shared >= s->plan.overlap);
}

static void let_go(solver *s, int64_t solved_window)
{
    for (int64_t t = 0; t < FRAMES_MAX; t++)
        if (s->is_held[t] && s->is_solved[t] &&
            !npg_plan_is_needed_after(&s->plan, t, solved_window, s->total)) {
            s->is_held[t] = 0;
            s->held_count--;
        }
}

/* What a state on disk says of the windows so far: the frames that came for them, and no other. */
static void check_state(const solver *s)
{
    int64_t read = npg_plan_read_before(&s->plan, s->window_at, s->total), count = 0;
    int64_t place = npg_plan_next_place(&s->plan, read, s->total);
    for (int64_t t = 0; t < FRAMES_MAX && (s->total < 0 || t < s->total); t++) {
        assert_int_equal(npg_plan_is_read(&s->plan, t, read, s->total), s->is_solved[t]);
        count += s->is_solved[t];
    }
    assert_int_equal(read, count);
    assert_int_equal(npg_plan_frame(&s->plan, place - 1), s->came[read - 1]);
    if (read < s->came_count && s->total < 0)
        assert_int_equal(npg_plan_frame(&s->plan, place), s->came[read]);
}

static void solve_what_is_complete(solver *s)
{
    while (s->window_at < npg_plan_window_count(&s->plan, s->total)) {
        npg_window window = npg_plan_window(&s->plan, s->window_at, s->total);
        if (!is_complete(s, &window)) return;
        solve(s, &window);
        check_state(s);
        let_go(s, s->window_at++);
    }
}

static void take(solver *s, int64_t index)
{
    assert_false(s->is_held[index] || s->is_solved[index]);
    s->is_held[index] = 1;
    s->came[s->came_count++] = index;
    if (++s->held_count > s->held_max) s->held_max = s->held_count;
    solve_what_is_complete(s);
}

/* Frames come in the plan's order; the source ends after `total`. */
static void check(npg_plan plan, int64_t total)
{
    solver s = {.plan = plan, .total = -1};
    int64_t came = 0;
    for (int64_t i = 0; came < total; i++) {
        int64_t index = npg_plan_frame(&plan, i);
        assert_true(index >= 0 && (i || index == plan.key));
        assert_int_equal(npg_plan_place(&plan, index), i);
        if (index >= total) continue;
        take(&s, index);
        came++;
    }
    s.total = total;
    solve_what_is_complete(&s);
    let_go(&s, s.window_at - 1); /* what waited for a window that never came */
    assert_int_equal(s.window_at, npg_plan_window_count(&plan, total));
    assert_int_equal(s.held_count, 0);
    for (int64_t t = 0; t < total; t++) assert_true(s.is_solved[t]);
    int ends_in_first = total <= npg_plan_window(&plan, 0, -1).last;
    assert_true(s.held_max <= (ends_in_first ? plan.key + plan.window : 2 * plan.window));
}

static void open_plans_cover_what_comes(void **state)
{
    (void)state;
    for (int64_t look_ahead = 1; look_ahead <= 25; look_ahead += 3)
        for (int64_t key = 0; key < look_ahead; key++)
            for (int64_t window = 2; window <= 30; window += 4)
                for (int64_t overlap = 0; overlap < window; overlap += 3)
                    for (int64_t total = look_ahead + 1; total <= FRAMES_MAX; total += 7)
                        check((npg_plan){.frame_count = NPG_FRAMES_OPEN,
                                         .key = key,
                                         .window = window,
                                         .overlap = overlap},
                              total);
}

static void ordinary_plans_are_as_they_were(void **state)
{
    (void)state;
    npg_plan plan = {.frame_count = 50, .key = 20, .window = 12, .overlap = 4};
    assert_int_equal(npg_plan_window_count(&plan, -1), npg_plan_window_count(&plan, -1));
    for (int64_t i = 0; i < plan.frame_count; i++) {
        assert_int_equal(npg_plan_frame(&plan, i), npg_plan_frame(&plan, i));
        assert_int_equal(npg_plan_place(&plan, npg_plan_frame(&plan, i)), i);
    }
    for (int64_t w = 0; w < npg_plan_window_count(&plan, -1); w++) {
        npg_window a = npg_plan_window(&plan, w, -1), b = npg_plan_window(&plan, w, -1);
        assert_true(a.first == b.first && a.last == b.last);
        assert_true(a.new_first == b.new_first && a.new_last == b.new_last && a.direction == b.direction);
        for (int64_t t = 0; t < plan.frame_count; t++) {
            int is_needed = 0;
            for (int64_t later = w + 1; later < npg_plan_window_count(&plan, -1); later++) {
                npg_window window = npg_plan_window(&plan, later, -1);
                is_needed |= t >= window.first && t <= window.last;
            }
            assert_int_equal(npg_plan_is_needed_after(&plan, t, w, -1), is_needed);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(open_plans_cover_what_comes),
                                       cmocka_unit_test(ordinary_plans_are_as_they_were)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
