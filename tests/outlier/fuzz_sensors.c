/* Fuzz target of places of sensors, for libFuzzer. */
#include "outlier/outlier_internal.h"
#include "tests/support/fuzz_target.h"

static void read_sensors(const char *path)
{
    const npg_origin origin = {.known = true};
    npg_sensors sensors;
    npg_status status = npg_sensors_open(&sensors, path);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "places of sensors");
    npg_frame frame = {.number = 1, .index = 1};
    if (!status) status = npg_sensors_set(&sensors, &frame, &origin);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "sensors of a frame");
    expect(frame.sensor_count <= NPG_FRAME_SENSORS_MOST, "too many sensors");
    npg_frame_clear(&frame);
    npg_sensors_close(&sensors);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    const char *path = fuzz_file(&fd, "a.txt", data, size);
    fuzz_bound(20 * size); /* a short line becomes an entry of several numbers */
    read_sensors(path);
    fuzz_end();
    return 0;
}
