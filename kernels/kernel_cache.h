/* Kernel cache: where PoCL keeps compiled kernels.  Its cache is not safe between processes and goes stale
 * between versions, so each version of neupig has a few folders of its own; a process takes the first that no
 * other one has locked.  With all of them in use it works in a private folder that is removed at the end. */
#ifndef NPG_KERNEL_CACHE_H
#define NPG_KERNEL_CACHE_H

#include <stdbool.h>

#include "status.h"

/* Point the driver at the folder.  Call before the first OpenCL call; later calls count only.  A cache folder
 * that the user has set (POCL_CACHE_DIR) is left alone.  NPG_DISK when no folder can be made. */
npg_status npg_kernel_cache_enter(void);
void npg_kernel_cache_leave(void);

#endif
