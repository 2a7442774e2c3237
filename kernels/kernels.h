/* Door of the kernels: their self-test.
 *
 * device.h: devices, their buffers, programs and tuning. */
#ifndef NPG_KERNELS_H
#define NPG_KERNELS_H

#include "kernels/runtime/device.h"

/* Run every op once, small, and compare with the known answers.  NPG_DEVICE names the op that computes wrong. */
npg_status npg_kernels_self_test(npg_device *device);

#endif
