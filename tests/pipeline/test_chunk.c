/* Chunk: moving frames in, copies, keeping points; JSON of texts that are not UTF-8. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "pipeline/chunk.h"
#include "pipeline/stage.h"

static npg_frame frame_of(size_t point_count)
{
    npg_frame frame = {.index = 3, .number = 30, .point_count = point_count, .vert_count = 2};
    assert_int_equal(npg_copy_text(&frame.path, "some/where.ply"), NPG_OK);
    assert_int_equal(npg_alloc_array(&frame.pos_local, NPG_FOR_FRAMES, point_count, 12), NPG_OK);
    assert_int_equal(npg_alloc_array(&frame.normals, NPG_FOR_FRAMES, point_count, 12), NPG_OK);
    assert_int_equal(npg_alloc_array(&frame.vert_unit, NPG_FOR_FRAMES, 2, 12), NPG_OK);
    for (size_t i = 0; i < 3 * point_count; i++) {
        frame.pos_local[i] = (float)i;
        frame.normals[i] = -(float)i;
    }
    return frame;
}

static void frames_move_into_a_chunk(void **state)
{
    (void)state;
    npg_chunk *chunk;
    npg_frame frame = frame_of(4);
    assert_int_equal(npg_chunk_open(&chunk, 2), NPG_OK);
    npg_chunk_add(chunk, &frame);
    assert_null(frame.pos_local);
    assert_null(frame.path);
    assert_int_equal(npg_chunk_count(chunk), 1);
    assert_int_equal(npg_chunk_capacity(chunk), 2);
    assert_int_equal(npg_chunk_frame(chunk, 0)->number, 30);
    assert_true(npg_chunk_frame(chunk, 0)->pos_local[11] == 11);
    npg_chunk_close(&chunk);
    assert_null(chunk);
    npg_chunk_close(&chunk);
    assert_int_equal(npg_memory_used(), 0);
    assert_int_equal(npg_chunk_open(&chunk, 0), NPG_USAGE);
}

static void a_copy_is_independent(void **state)
{
    (void)state;
    npg_frame frame = frame_of(5), copy;
    assert_int_equal(npg_frame_copy(&copy, &frame), NPG_OK);
    assert_memory_equal(copy.pos_local, frame.pos_local, 60);
    assert_memory_equal(copy.normals, frame.normals, 60);
    assert_string_equal(copy.path, frame.path);
    assert_ptr_not_equal(copy.vert_unit, frame.vert_unit);
    npg_frame_clear(&frame);
    assert_int_equal(frame.point_count, 0);
    assert_true(copy.pos_local[14] == 14);
    npg_frame_clear(&copy);
    npg_frame empty = {0};
    assert_int_equal(npg_frame_copy(&copy, &empty), NPG_OK);
    assert_null(copy.pos_local);
    npg_frame_clear(&copy);
    assert_int_equal(npg_memory_used(), 0);
}

static void a_copy_without_memory_leaves_nothing(void **state)
{
    (void)state;
    npg_frame frame = frame_of(5), copy;
    size_t before = npg_memory_used();
    for (uint64_t n = 1; n <= 4; n++) {
        npg_memory_fail_at(n, false);
        assert_int_equal(npg_frame_copy(&copy, &frame), NPG_MEMORY);
        npg_memory_fail_at(0, false);
        assert_null(copy.pos_local);
        assert_int_equal(npg_memory_used(), before);
    }
    npg_frame_clear(&frame);
}

static void kept_points_keep_order_and_normals(void **state)
{
    (void)state;
    npg_frame frame = frame_of(6);
    const uint8_t keep[6] = {0, 1, 0, 1, 1, 0};
    npg_frame_keep(&frame, keep);
    assert_int_equal(frame.point_count, 3);
    const float expected[3] = {3, 9, 12};
    for (size_t i = 0; i < 3; i++) {
        assert_true(frame.pos_local[3 * i] == expected[i]);
        assert_true(frame.normals[3 * i + 2] == -expected[i] - 2);
    }
    const uint8_t none[3] = {0, 0, 0};
    npg_frame_keep(&frame, none);
    assert_int_equal(frame.point_count, 0);
    npg_frame_clear(&frame);
}

static void any_bytes_become_json(void **state)
{
    const char *const cases[][2] = {{"plain", "plain"},
                                    {"gr\xc3\xbc\xc3\x9f", "gr\xc3\xbc\xc3\x9f"},
                                    {"latin \xfc!", "latin ?!"},
                                    {"cut \xc3", "cut ?"},
                                    {"long \xc0\xaf", "long ??"},
                                    {"half \xed\xa0\x80", "half ???"},
                                    {"\xf0\x9f\x90\x8e \xf5", "\xf0\x9f\x90\x8e ?"},
                                    {"", ""}};
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        json_t *value = npg_json_text(cases[i][0]);
        assert_string_equal(json_string_value(value), cases[i][1]);
        json_decref(value);
    }
    assert_true(json_is_null(npg_json_text(NULL)));
    assert_true(json_is_null(npg_json_real((double)NAN)));
    assert_true(json_is_null(npg_json_real((double)INFINITY)));
    json_t *real = npg_json_real(0.5);
    assert_true(json_real_value(real) == 0.5);
    json_decref(real);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(frames_move_into_a_chunk),
        cmocka_unit_test(a_copy_is_independent),
        cmocka_unit_test(a_copy_without_memory_leaves_nothing),
        cmocka_unit_test(kept_points_keep_order_and_normals),
        cmocka_unit_test(any_bytes_become_json),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
