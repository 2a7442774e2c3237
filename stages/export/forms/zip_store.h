/* Zip store: a ZIP file of members that are not compressed and whose sizes are known before.
 *
 * Members may be written side by side, a piece of each at a time: every place in the file is known from the
 * start; checksums are put in at the end.  ZIP64 records where a size or place needs them (4 GiB). */
#ifndef NPG_ZIP_STORE_H
#define NPG_ZIP_STORE_H

#include "pipeline/file.h"

#define NPG_ZIP_NAME 64

typedef struct npg_zip_member {
    char name[NPG_ZIP_NAME];
    uint64_t size;
    /* kept by the functions below */
    uint64_t header_at, data_at, filled;
    uint32_t crc;
} npg_zip_member;

typedef struct npg_zip {
    npg_file *file;
    npg_zip_member *members; /* a loan */
    size_t count;
    uint64_t large; /* numbers from here on take ZIP64 records: NPG_ZIP_LARGE but in tests */
} npg_zip;

#define NPG_ZIP_LARGE UINT64_C(0xffffffff)

/* Begin the file: names and sizes of all members are set.  The last one is the longest for speed. */
npg_status npg_zip_open(npg_zip *zip, const char *path, npg_zip_member *members, size_t count,
                        uint64_t large);

/* The next bytes of a member.  Those of the last one go straight to the end of the file. */
npg_status npg_zip_put(npg_zip *zip, size_t member, const void *data, size_t size);

/* All members must be full.  Closes in any case. */
npg_status npg_zip_commit(npg_zip *zip);
void npg_zip_discard(npg_zip *zip);

/* CRC-32 (IEEE) of what `crc` (0 at first) stands for, followed by these bytes. */
uint32_t npg_crc32(uint32_t crc, const void *data, size_t size);

#endif
