/* Store: one file that records are appended to, each with its checksum; what a resumed run needs.
 *
 *     per record: "NPGREC01", kind (8 bytes, padded with 0), index, of, size, XXH3 of these and of the content;
 *     then `size` bytes of content: per block its name (32 bytes, padded with 0), its size (8 bytes), its
 *     bytes, padding with 0 to a multiple of 8
 *
 * A record is whole or not there: its head is written last.  A file is read to the first record that is not
 * whole.  Of records with the same kind, index and `of` the last one counts.  Records that nobody needs any
 * more are forgotten, and once these are more than half of the file it is written anew without them.
 *
 * Numbers are as the machine has them: a file belongs to the kind of machine that wrote it.
 * Any thread may read; who writes has the store to himself until the record ends. */
#ifndef NPG_STORE_H
#define NPG_STORE_H

#include <stdbool.h>

#include "pipeline/memory.h"

#define NPG_BLOCK_NAME 32

/* What kinds there are.  Their index, and what they are of: */
#define NPG_RECORD_STATE  "state"  /* of the run behind a solved window, numbered; 0                   */
#define NPG_RECORD_INSIDE "inside" /* inside the window after the state of this number (-1: none); 0   */
#define NPG_RECORD_POSE   "pose"   /* of a frame, its place in time; what it was found from (a hash)   */
#define NPG_RECORD_FRAME  "frame"  /* that came from a live source, counted as they came; 0                */
#define NPG_RECORD_GROUP  "group"  /* of frames that were followed together, counted in a pass; the same */

typedef struct npg_record_id {
    char kind[8];
    int64_t index;
    uint64_t of;
} npg_record_id;

typedef struct npg_store npg_store;
typedef struct npg_record npg_record;

/* The file at `path` (kept as a copy), made where there is none; what follows the last whole record is cut off.
 * Nameless: one in the folder (NULL: that of temporary files) that has no name, and ends with the process.  NPG_DISK, NPG_MEMORY. */
npg_status npg_store_open(npg_store **store, const char *path);
npg_status npg_store_open_nameless(npg_store **store, const char *folder);
void npg_store_close(npg_store **store);

/* Where the file is damaged, to be said to the user; "" where it is not.  A run that was killed while it wrote
 * leaves no damage. */
const char *npg_store_damage(const npg_store *store);

/* Give the file another name, in the place of whatever has it. */
npg_status npg_store_rename(npg_store *store, const char *path);

/* ---- writing ---- */

/* Begin a record; what fails until its end is remembered and comes back from there.  Waits for another thread
 * that is writing one. */
void npg_store_begin(npg_store *store, const char *kind, int64_t index, uint64_t of);

/* Add a block; names are shorter than NPG_BLOCK_NAME and different. */
npg_status npg_store_put(npg_store *store, const char *name, const void *data, size_t size);

/* An array that a struct points to, as a block; NULL is no block. */
typedef struct npg_store_array {
    char name[NPG_BLOCK_NAME];
    size_t offset, count, row; /* of the pointer in the struct; rows, and bytes of each */
} npg_store_array;
npg_status npg_store_put_arrays(npg_store *store, const void *owner, const npg_store_array *arrays,
                                size_t count);

/* The record is whole, and after with_sync safe on disk.  After a failure, this or an earlier one (`status`),
 * nothing of it remains. */
npg_status npg_store_end(npg_store *store, npg_status status, bool with_sync);

/* All records that are whole are safe on disk. */
npg_status npg_store_sync(npg_store *store);

/* Forget records that are not needed. */
npg_status npg_store_forget(npg_store *store, bool (*is_needed)(const npg_record_id *id, const void *user),
                            const void *user);

/* ---- reading ---- */

/* How many there are of a kind and `of`, and the largest index of a kind, -1 where there is none. */
size_t npg_store_count(npg_store *store, const char *kind, uint64_t of);
int64_t npg_store_last(npg_store *store, const char *kind);
bool npg_store_has(npg_store *store, const char *kind, int64_t index, uint64_t of);

/* A record with all its content, to npg_record_close().  NPG_BAD_INPUT: there is none, or it was damaged since. */
npg_status npg_store_read(npg_store *store, npg_record **record, const char *kind, int64_t index,
                          uint64_t of);
void npg_record_close(npg_record **record);

/* A block's bytes, aligned to 8; a loan until the record closes.  NULL where there is none. */
const void *npg_record_find(const npg_record *record, const char *name, size_t *size);

/* Copy a block that must have exactly this size.  NPG_BAD_INPUT. */
npg_status npg_record_get(const npg_record *record, const char *name, void *data, size_t size);

/* The arrays of a struct, where there is a block; what the pointers had before is released.  NPG_BAD_INPUT: one
 * has another size. */
npg_status npg_record_get_arrays(const npg_record *record, void *owner, const npg_store_array *arrays,
                                 size_t count, npg_purpose purpose);

#endif
