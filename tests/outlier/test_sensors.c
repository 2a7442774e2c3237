/* Sensors: the places in option sensor and in its file; what is refused, with its line. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "outlier/outlier_internal.h"
#include "tests/support/temp_folder.h"

static const npg_origin origin = {true, {10, 20, 30}};

static void assert_sensor(const npg_frame *frame, size_t i, float x, float y, float z)
{
    assert_true(i < frame->sensor_count);
    assert_true(frame->sensor_local[3 * i] == x && frame->sensor_local[3 * i + 1] == y &&
                frame->sensor_local[3 * i + 2] == z);
}

static void places_stand_still(void **state)
{
    npg_sensors s;
    npg_frame frame = {.index = 5, .number = 105};
    (void)state;
    assert_int_equal(npg_sensors_open(&s, "11,22,33"), NPG_OK);
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_OK);
    assert_int_equal(frame.sensor_count, 1);
    assert_sensor(&frame, 0, 1, 2, 3);
    npg_sensors_close(&s);
    assert_int_equal(npg_sensors_open(&s, "10,20,30:-1e1,.5,-3:12,20,30"), NPG_OK);
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_OK);
    assert_int_equal(frame.sensor_count, 3);
    assert_sensor(&frame, 0, 0, 0, 0);
    assert_sensor(&frame, 1, -20, -19.5f, -33);
    assert_sensor(&frame, 2, 2, 0, 0);
    npg_sensors_close(&s);
    npg_frame_clear(&frame);
    assert_int_equal(npg_memory_used(), 0);
}

static temp_folder folder;

static npg_status open_text(npg_sensors *s, const char *text)
{
    static char path[512];
    snprintf(path, sizeof path, "%s", in_folder(&folder, "sensors.txt"));
    assert_int_equal(write_text_file(path, text), 0);
    return npg_sensors_open(s, path);
}

static void a_file_has_a_line_per_frame_or_numbers(void **state)
{
    npg_sensors s;
    npg_frame frame = {.index = 1, .number = 7};
    (void)state;
    assert_int_equal(open_text(&s, "# x y z\n10 20 30\r\n\n 11\t21 31 \n12 22 32"), NPG_OK);
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_OK);
    assert_int_equal(frame.sensor_count, 1);
    assert_sensor(&frame, 0, 1, 1, 1);
    frame.index = 3;
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "no place of a sensor for frame 3"));
    npg_sensors_close(&s);
    assert_int_equal(open_text(&s, "9 1 1 1\n7 13 20 30\n-2 0 0 0\n7 10 24 30\n"), NPG_OK);
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_OK);
    assert_int_equal(frame.sensor_count, 2);
    assert_sensor(&frame, 0, 3, 0, 0);
    assert_sensor(&frame, 1, 0, 4, 0);
    npg_sensors_close(&s);
    npg_frame_clear(&frame);
    assert_int_equal(npg_memory_used(), 0);
}

static void what_is_no_place_is_refused(void **state)
{
    static const char *const options[] = {"1,2",     "1,2,x",  "1,2,3,4",   "",
                                          "nan,0,0", "1,2,3:", "1,2,3:4,5", "no/file"};
    static const struct {
        const char *text, *says;
    } files[] = {{"", "no place of a sensor"},
                 {"# nothing\n\n", "no place of a sensor"},
                 {"1 2 3\n1 2\n", "line 2: neither"},
                 {"1 2 3 4 5\n", "line 1: neither"},
                 {"1 2 3\n\n7 1 2 3\n", "line 3: 4 numbers"},
                 {"1 2 x\n", "line 1: number 3"},
                 {"1 inf 2\n", "line 1: number 2"},
                 {"1.5 1 2 3\n", "line 1: 1.5 is no frame's number"},
                 {"1e300 1 2 3\n", "is no frame's number"}};
    npg_sensors s;
    (void)state;
    for (size_t i = 0; i < sizeof options / sizeof *options; i++) {
        assert_int_equal(npg_sensors_open(&s, options[i]), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), "option sensor"));
    }
    for (size_t i = 0; i < sizeof files / sizeof *files; i++) {
        assert_int_equal(open_text(&s, files[i].text), NPG_BAD_INPUT);
        assert_non_null(strstr(npg_error_text(), "sensors.txt"));
        if (!strstr(npg_error_text(), files[i].says)) fail_msg("%s: %s", files[i].says, npg_error_text());
    }
    assert_int_equal(npg_memory_used(), 0);
}

static void too_many_sensors_of_a_frame_are_refused(void **state)
{
    static char text[100 * 16];
    npg_sensors s;
    npg_frame frame = {.number = 4};
    (void)state;
    for (size_t i = 0; i <= NPG_FRAME_SENSORS_MOST; i++) strcat(text, "4 1 2 3\n");
    assert_int_equal(open_text(&s, text), NPG_OK);
    assert_int_equal(npg_sensors_set(&s, &frame, &origin), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "more than 64"));
    npg_sensors_close(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(places_stand_still),
                                       cmocka_unit_test(a_file_has_a_line_per_frame_or_numbers),
                                       cmocka_unit_test(what_is_no_place_is_refused),
                                       cmocka_unit_test(too_many_sensors_of_a_frame_are_refused)};
    if (open_temp_folder(&folder)) return 1;
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    close_temp_folder(&folder);
    return failed;
}
