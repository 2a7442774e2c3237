/* Probe: whether the OpenCL drivers can be asked for their devices at all. */
#ifndef NPG_PROBE_H
#define NPG_PROBE_H

#include "pipeline/status.h"

/* More OpenCL platforms (drivers), and devices of all together, than these are neither asked nor listed. */
#define NPG_PLATFORMS_MAX 16
#define NPG_DEVICES_MAX   32

/* What neupig-devices prints when it has got through. */
#define NPG_PROBE_ANSWER "asked\n"

/* Ask them first in a process of its own (devices_main.c): a driver that can't work on a machine may end
 * the process that asks, as PoCL does in a root without /sys, and a library must not end its host.  Once
 * per process when all is well, about 30 ms.  NPG_DEVICE with the driver's last line and what is missing;
 * errors that a driver returns are left to the caller's own call.  Threads: any. */
npg_status npg_probe_drivers(void);

#endif
