/* VDB file: what OpenVDB writes, on disk as every other file: whole or not at all,
 * and the same bytes each time. */
#ifndef NPG_VDB_FILE_H
#define NPG_VDB_FILE_H

#include <stdint.h>

#include "pipeline/status.h"

/* OpenVDB takes no transform of a smaller voxel: it calls one singular whose determinant is below 3e-15. */
#define NPG_VDB_VOXEL_MIN 2e-5

/* Let save(user, path of a file in memory) write, then put the bytes in place at `path` (file.h).  OpenVDB
 * marks each file with a random identity; it becomes one made of the content.  *hash (may be NULL) gets the
 * file's XXH3.  NPG_DISK and what save returns. */
npg_status npg_vdb_file_write(const char *path, uint64_t *hash,
                              npg_status (*save)(void *user, const char *memory_path), void *user);

#endif
