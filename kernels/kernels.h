/* Door of the kernels: their self-test, and the order that points lie in.
 *
 * device.h: devices, their buffers, programs and tuning. */
#ifndef NPG_KERNELS_H
#define NPG_KERNELS_H

#include "kernels/runtime/device.h"

/* Run every op once, small, and compare with the known answers.  NPG_DEVICE names the op that computes wrong. */
npg_status npg_kernels_self_test(npg_device *device);

/* Order of points along a Morton curve of their own box: order[i] is the index of the i-th.
 * Points are finite. */
npg_status npg_morton_order(uint32_t *order, const float *points, size_t count);

#endif
