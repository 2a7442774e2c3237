/* Kernel cache: where PoCL keeps compiled kernels.  Its cache is not safe between processes and goes stale
 * between versions, so each version of neupig has its own folder, used by the process that holds its
 * lock; any other process works in a private folder that is removed at the end, or, if it was killed, by a
 * later one. */
#ifndef NPG_KERNEL_CACHE_H
#define NPG_KERNEL_CACHE_H

#include <stdbool.h>

#include "pipeline/status.h"

/* Point the driver at the folder.  Call before the first OpenCL call; later calls count only.  A cache folder
 * that the user has set (POCL_CACHE_DIR) is left alone.  NPG_DISK when no folder can be made. */
npg_status npg_kernel_cache_enter(void);
void npg_kernel_cache_leave(void);

/* Path of a file in this version's folder, whether it is there or not; false when there is no such
 * folder.  Only the process that holds the folder may write binaries there. */
bool npg_kernel_cache_path(char *out, size_t size, const char *name);
bool npg_kernel_cache_is_ours(void);

#endif
