/* Archive: named blocks of bytes in one file that is read whole or not at all.
 *
 *     "NPGARCH1"
 *     per block: name (32 bytes, padded with 0), size (8 bytes), the bytes, padding with 0 to a multiple of 8
 *     a last block "end" of 8 bytes: XXH3 of all bytes before it
 *
 * Numbers are as the machine has them: a file belongs to the kind of machine that wrote it.
 * One thread at a time. */
#ifndef NPG_ARCHIVE_H
#define NPG_ARCHIVE_H

#include "pipeline/memory.h"

#define NPG_BLOCK_NAME 32

/* ---- writing ---- */

typedef struct npg_archive_writer npg_archive_writer;

/* The file appears under its name with npg_archive_commit() (see file.h).  NPG_DISK, NPG_MEMORY. */
npg_status npg_archive_create(npg_archive_writer **writer, const char *path);

/* Add a block; names are shorter than NPG_BLOCK_NAME and different.  A failed write is remembered and comes
 * back from commit. */
npg_status npg_archive_put(npg_archive_writer *writer, const char *name, const void *data, size_t size);

/* Closes the writer in any case. */
npg_status npg_archive_commit(npg_archive_writer **writer);

/* Close without a result: nothing remains on disk.  NULL is fine. */
void npg_archive_discard(npg_archive_writer **writer);

/* ---- reading ---- */

typedef struct npg_archive npg_archive;

/* Read a file and check all of it.  NPG_BAD_INPUT says what is wrong with it. */
npg_status npg_archive_open(npg_archive **archive, const char *path);
void npg_archive_close(npg_archive **archive);

/* A block's bytes, aligned to 8; a loan until the archive closes.  NULL where there is none. */
const void *npg_archive_find(const npg_archive *archive, const char *name, size_t *size);

/* Copy a block that must have exactly this size.  NPG_BAD_INPUT. */
npg_status npg_archive_get(const npg_archive *archive, const char *name, void *data, size_t size);

/* ---- checksums ---- */

/* XXH3 of the first `limit` bytes of a file (UINT64_MAX: all).  NPG_DISK when it can't be read, NPG_BAD_INPUT
 * when it is shorter than a limit. */
npg_status npg_hash_file(uint64_t *hash, const char *path, uint64_t limit);

#endif
