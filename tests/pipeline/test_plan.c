/* Plan: windows cover the capture, every frame is read once, overlaps are solved before they are needed. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "pipeline/plan.h"

static void check_plan(npg_plan plan)
{
    char *read = calloc((size_t)plan.frame_count, 1), *solved = calloc((size_t)plan.frame_count, 1);
    int64_t next = 0;
    for (int64_t w = 0; w < npg_plan_window_count(&plan, -1); w++) {
        npg_window window = npg_plan_window(&plan, w, -1);
        assert_true(window.first >= 0 && window.last < plan.frame_count && window.first <= window.last);
        for (int64_t i = window.new_first; i <= window.new_last; i++) {
            int64_t frame = npg_plan_frame(&plan, next++);
            assert_true(frame >= window.new_first && frame <= window.new_last);
            assert_int_equal(read[frame]++, 0);
        }
        for (int64_t i = window.first; i <= window.last; i++) {
            int is_new = i >= window.new_first && i <= window.new_last;
            assert_int_equal(solved[i], !is_new);
            solved[i] = 1;
        }
    }
    assert_int_equal(next, plan.frame_count);
    assert_int_equal(npg_plan_frame(&plan, 0), plan.key);
    free(read);
    free(solved);
}

static void windows_cover_the_capture(void **state)
{
    (void)state;
    for (int64_t frames = 1; frames <= 40; frames++)
        for (int64_t key = 0; key < frames; key++)
            for (int64_t window = 2; window <= 41; window += 3)
                for (int64_t overlap = 0; overlap < window; overlap += 3)
                    check_plan(
                        (npg_plan){.frame_count = frames, .key = key, .window = window, .overlap = overlap});
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(windows_cover_the_capture)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
