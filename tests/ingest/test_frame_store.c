/* Frame store: what goes in comes out, from memory and from disk, and nothing is left behind. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <dirent.h>
#include <stdlib.h>
#include <unistd.h>

#include "ingest/ingest_internal.h"

enum { FRAMES = 6, POINTS = 100 };

static float coordinate(int64_t index, size_t i)
{
    return (float)index * 1000 + (float)i;
}

static void make_frame(npg_frame *frame, int64_t index, uint32_t fields, bool has_normals)
{
    *frame = (npg_frame){.index = index, .number = 10 + index, .fields = fields, .point_count = POINTS};
    assert_int_equal(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, POINTS, 3 * sizeof(float)), NPG_OK);
    for (size_t i = 0; i < 3 * POINTS; i++) frame->pos_local[i] = coordinate(index, i);
    if (!has_normals) return;
    assert_int_equal(npg_alloc_array(&frame->normals, NPG_FOR_FRAMES, POINTS, 3 * sizeof(float)), NPG_OK);
    for (size_t i = 0; i < 3 * POINTS; i++) frame->normals[i] = -coordinate(index, i);
    /* those of a rig carry these, too */
    assert_int_equal(npg_alloc_array(&frame->colours, NPG_FOR_FRAMES, POINTS, 4), NPG_OK);
    assert_int_equal(npg_alloc_array(&frame->sensors, NPG_FOR_FRAMES, POINTS, 1), NPG_OK);
    assert_int_equal(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, 2, 3 * sizeof(float)), NPG_OK);
    frame->sensor_count = 2;
    for (size_t i = 0; i < 6; i++) frame->sensor_local[i] = coordinate(index, i + 5);
    for (size_t i = 0; i < 4 * POINTS; i++) frame->colours[i] = (uint8_t)(index + (int64_t)i);
    for (size_t i = 0; i < POINTS; i++) frame->sensors[i] = (uint8_t)(index + (int64_t)i % 3);
}

static void put(npg_frame_store *store, int64_t index, uint32_t fields, bool has_normals)
{
    npg_frame frame;
    make_frame(&frame, index, fields, has_normals);
    frame.cleaning.isolated = (size_t)index;
    assert_int_equal(npg_frame_store_put(store, &frame, fields & NPG_FIELD_CLEAN), NPG_OK);
    npg_frame_clear(&frame);
}

static void expect(npg_frame_store *store, int64_t index, bool has_normals, bool give_away)
{
    npg_frame frame = {0};
    assert_int_equal(npg_frame_store_get(store, &frame, index, give_away), NPG_OK);
    assert_int_equal(frame.index, index);
    assert_int_equal(frame.number, 10 + index);
    assert_int_equal(frame.point_count, POINTS);
    assert_int_equal(frame.cleaning.isolated, index);
    assert_int_equal(frame.normals != NULL, has_normals);
    for (size_t i = 0; i < 3 * POINTS; i++) {
        assert_true(frame.pos_local[i] == coordinate(index, i));
        if (has_normals) assert_true(frame.normals[i] == -coordinate(index, i));
    }
    assert_int_equal(frame.colours != NULL, has_normals);
    assert_int_equal(frame.sensors != NULL, has_normals);
    assert_int_equal(frame.sensor_count, has_normals ? 2 : 0);
    for (size_t i = 0; i < 3 * frame.sensor_count; i++)
        assert_true(frame.sensor_local[i] == coordinate(index, i + 5));
    for (size_t i = 0; i < POINTS && has_normals; i++) {
        for (size_t c = 4 * i; c < 4 * i + 4; c++)
            assert_int_equal(frame.colours[c], (uint8_t)(index + (int64_t)c));
        assert_int_equal(frame.sensors[i], (uint8_t)(index + (int64_t)i % 3));
    }
    npg_frame_clear(&frame);
}

static bool is_empty(const char *folder)
{
    DIR *list = opendir(folder);
    size_t count = 0;
    assert_non_null(list);
    while (readdir(list)) count++;
    closedir(list);
    return count == 2; /* itself and its parent */
}

static void frames_come_back_from_memory_and_from_disk(void **state)
{
    (void)state;
    char folder[] = "/tmp/npg_store_XXXXXX";
    assert_non_null(mkdtemp(folder));
    for (int on_disk = 0; on_disk < 2; on_disk++) {
        npg_frame_store *store;
        size_t room = on_disk ? 2 * sizeof(npg_frame) + 3 * POINTS * 12 : 1 << 20;
        assert_int_equal(npg_frame_store_open(&store, room, folder), NPG_OK);
        for (int64_t i = 0; i < FRAMES; i++) put(store, i, NPG_FIELD_CLEAN, i % 2);
        assert_true(is_empty(folder));
        assert_int_equal(npg_frame_store_used(store).disk_bytes > 0, on_disk);
        for (int last = 0; last < 2; last++)
            for (int64_t i = 0; i < FRAMES; i++) expect(store, i, i % 2, last);
        npg_frame_store_close(&store);
    }
    assert_int_equal(rmdir(folder), 0);
}

static void what_finds_no_room_is_left_out(void **state)
{
    (void)state;
    const char *const folders[] = {NULL, "/not/there"};
    for (int f = 0; f < 2; f++) {
        npg_frame_store *store;
        npg_frame frame = {0};
        assert_int_equal(npg_frame_store_open(&store, 100, folders[f]), NPG_OK);
        put(store, 1, NPG_FIELD_CLEAN, true);
        assert_int_equal(npg_frame_store_get(store, &frame, 1, false), NPG_END);
        assert_int_equal(npg_frame_store_get(store, &frame, 7, false), NPG_END);
        assert_int_equal(npg_frame_store_used(store).memory_bytes, 0);
        npg_frame_store_close(&store);
    }
}

/* Raw frames are replaced by clean ones; they never go to disk. */
static void clean_frames_replace_raw_ones(void **state)
{
    (void)state;
    npg_frame_store *store;
    npg_frame frame = {0};
    assert_int_equal(npg_frame_store_open(&store, sizeof(npg_frame) + POINTS * 12, "/tmp"), NPG_OK);
    put(store, 0, NPG_FIELD_POINTS, false);
    put(store, 1, NPG_FIELD_POINTS, false);
    assert_int_equal(npg_frame_store_get(store, &frame, 1, false), NPG_END);
    put(store, 0, NPG_FIELD_CLEAN, false);
    put(store, 1, NPG_FIELD_CLEAN, false);
    expect(store, 0, false, false);
    expect(store, 1, false, false);
    assert_int_equal(npg_frame_store_used(store).disk_bytes, POINTS * 12);
    npg_frame_store_close(&store);
}

static void made_normals_are_kept_beside_the_frame(void **state)
{
    (void)state;
    for (int on_disk = 0; on_disk < 2; on_disk++) {
        npg_frame_store *store;
        npg_frame frame, other;
        size_t room = sizeof(npg_frame) + (on_disk ? 1 : 3) * POINTS * 12;
        assert_int_equal(npg_frame_store_open(&store, room, "/tmp"), NPG_OK);
        put(store, 2, NPG_FIELD_CLEAN, false);
        make_frame(&frame, 2, NPG_FIELD_CLEAN, true);
        assert_false(npg_frame_store_get_normals(store, &frame));
        frame.cleaning.normals_estimated = POINTS;
        npg_frame_store_put_normals(store, &frame);
        expect(store, 2, false, true); /* the frame itself has none, and may be given away */
        make_frame(&other, 2, NPG_FIELD_CLEAN, false);
        assert_true(npg_frame_store_get_normals(store, &other));
        assert_int_equal(other.cleaning.normals_estimated, POINTS);
        assert_memory_equal(other.normals, frame.normals, POINTS * 12);
        npg_frame_clear(&other);
        npg_frame_clear(&frame);
        npg_frame_store_close(&store);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(frames_come_back_from_memory_and_from_disk),
                                       cmocka_unit_test(what_finds_no_room_is_left_out),
                                       cmocka_unit_test(clean_frames_replace_raw_ones),
                                       cmocka_unit_test(made_normals_are_kept_beside_the_frame)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
