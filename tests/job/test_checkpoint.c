/* Grids come back from OpenVDB bit by bit; plans of appended frames. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "optimize/grids/vdb_grids.h"
#include "pipeline/plan.h"
#include "pipeline/random.h"
#include "tests/job/read_levels.h"
#include "tests/support/group_folder.h"

/* ---- grids ---- */

static npg_levels some_levels(void)
{
    npg_levels levels = {0};
    npg_levels_add(&levels, (npg_level){.nodes = 2, .channel_end = 30, .lambda = 0.4});
    npg_levels_add(&levels, (npg_level){.nodes = 11, .channel_end = 30, .lambda = 0.6});
    npg_levels_add(&levels,
                   (npg_level){.kind = NPG_LEVEL_NORMAL, .nodes = 4, .channel_first = 30, .channel_end = 32});
    return levels;
}

static bool is_filled(const npg_levels *levels, size_t row, int channel)
{
    for (int l = 0; l < levels->count; l++) {
        const npg_level *level = &levels->level[l];
        if (row >= level->first_row && row < level->first_row + level->row_count)
            return channel >= level->channel_first && channel < level->channel_end;
    }
    return false;
}

static void grids_come_back_bit_by_bit(void **state)
{
    (void)state;
    npg_levels levels = some_levels();
    size_t count = levels.row_count * NPG_LATENT_CHANNELS;
    const npg_vdb_place place = {{10, 20, 30}, 0.5, 3, 8, 1};
    float *rows = calloc(count, sizeof *rows), *read = calloc(count, sizeof *read);
    npg_random random = npg_random_stream(7, 0, 0);
    for (size_t i = 0; i < count; i++)
        if (is_filled(&levels, i / NPG_LATENT_CHANNELS, (int)(i % NPG_LATENT_CHANNELS)))
            rows[i] = i % 5 ? (float)npg_random_gauss(&random) * 1e-3f : i % 2 ? -0.0f : 0.0f;
    const char *path = in_folder(&folder, "grids.vdb");
    assert_int_equal(npg_vdb_save_levels(path, &levels, rows, &place), NPG_OK);
    assert_true(read_levels(path, &levels, read));
    assert_memory_equal(rows, read, count * sizeof *rows);
    free(rows);
    free(read);
}

/* ---- plans ---- */

/* Appended frames are read once each, after what they share is solved. */
static void check_appended(npg_plan plan)
{
    int64_t next = 0, solved = plan.appended_at;
    assert_int_equal(npg_plan_read_count(&plan), plan.frame_count - plan.appended_at);
    for (int64_t w = 0; w < npg_plan_window_count(&plan, -1); w++) {
        npg_window window = npg_plan_window(&plan, w, -1);
        assert_int_equal(window.new_first, solved);
        assert_true(window.first >= window.new_first - plan.overlap && window.first >= 0);
        assert_int_equal(window.last, window.new_last);
        for (int64_t i = window.new_first; i <= window.new_last; i++)
            assert_int_equal(npg_plan_frame(&plan, next++), i);
        assert_int_equal(npg_plan_read_before(&plan, w, -1), next);
        solved = window.new_last + 1;
        assert_int_equal(npg_plan_is_last_forward(&plan, w), solved == plan.frame_count);
    }
    assert_int_equal(solved, plan.frame_count);
}

static void appended_frames_get_windows_of_their_own(void **state)
{
    (void)state;
    for (int64_t frames = 1; frames <= 20; frames++)
        for (int64_t key = 0; key < frames; key += 2)
            for (int64_t overlap = 0; overlap < 5; overlap++)
                for (int64_t more = 1; more < 12; more++) {
                    npg_plan first = {.frame_count = frames, .key = key, .window = 6, .overlap = overlap};
                    npg_plan longer = npg_plan_append(&first, frames + more);
                    npg_plan longest = npg_plan_append(&longer, frames + more + 3);
                    npg_window was = npg_plan_key_window(&first, -1), is = npg_plan_key_window(&longest, -1);
                    check_appended(longer);
                    check_appended(longest);
                    assert_int_equal(was.first, is.first);
                    assert_int_equal(was.last, is.last);
                }
}

static void windows_say_what_is_read_before_them(void **state)
{
    (void)state;
    for (int64_t frames = 1; frames <= 30; frames++)
        for (int64_t key = 0; key < frames; key++) {
            npg_plan plan = {.frame_count = frames, .key = key, .window = 6, .overlap = 2};
            int64_t sum = 0, ends = 0;
            for (int64_t w = 0; w < npg_plan_window_count(&plan, -1); w++) {
                npg_window window = npg_plan_window(&plan, w, -1);
                sum += window.new_last - window.new_first + 1;
                assert_int_equal(npg_plan_read_before(&plan, w, -1), sum);
                ends += npg_plan_is_last_forward(&plan, w);
            }
            assert_int_equal(ends, 1);
            assert_int_equal(sum, npg_plan_read_count(&plan));
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(grids_come_back_bit_by_bit),
        cmocka_unit_test(appended_frames_get_windows_of_their_own),
        cmocka_unit_test(windows_say_what_is_read_before_them),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
