/* A device that the tests of a program share: open_device and close_device are their group's
 * set-up and teardown. */
#ifndef NPG_TEST_GROUP_DEVICE_H
#define NPG_TEST_GROUP_DEVICE_H

#include "kernels/runtime/device.h"

static npg_device *device;

static int open_device(void **state)
{
    (void)state;
    if (npg_device_open(&device, "auto", NULL)) fail_msg("%s", npg_error_text());
    return 0;
}

static int close_device(void **state)
{
    (void)state;
    npg_device_close(&device);
    return 0;
}

#endif
