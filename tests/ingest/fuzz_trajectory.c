/* Fuzz target of trajectories, lists of images with times and places of sensors, for
 * libFuzzer.  The first byte says which. */
#include <math.h>

#include "ingest/rig/rig_internal.h"
#include "outlier/outlier_internal.h"
#include "tests/support/fuzz_target.h"

static void read_list(const char *path, bool is_trajectory)
{
    npg_stamped_list list;
    npg_arena arena = {.purpose = NPG_FOR_FILES};
    npg_status status =
        is_trajectory ? npg_read_trajectory(&list, &arena, path) : npg_read_image_list(&list, &arena, path);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "list");
    for (size_t i = 0; !status && is_trajectory && i < list.count; i++)
        for (int k = 0; k < 12; k++) expect(isfinite(list.items[i].pose[k]), "a pose that is not finite");
    npg_arena_release(&arena);
}

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
    if (!size) return 0;
    const char *path = fuzz_file(&fd, "a.log", data + 1, size - 1);
    fuzz_bound(20 * size); /* a line of eight digits becomes an entry of 128 bytes */
    if (data[0] % 4 == 0) read_list(path, true);
    if (data[0] % 4 == 1) read_list(path, false);
    if (data[0] % 4 > 1) read_sensors(path);
    fuzz_end();
    return 0;
}
