/* File: output that appears under its final name only when it is whole.
 *
 * Bytes go to a hidden file beside the final one; commit checks, syncs and renames.  A run that is killed
 * leaves at most the hidden file, which the next attempt overwrites. */
#ifndef NPG_FILE_H
#define NPG_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/memory.h"

typedef struct npg_file npg_file;

/* NPG_DISK with path and cause. */
npg_status npg_file_open(npg_file **file, const char *path);
npg_status npg_file_open_in(npg_file **file, const char *folder, const char *name);

/* A failed write is remembered: later calls do nothing and commit returns it, so callers may check once. */
npg_status npg_file_write(npg_file *file, const void *data, size_t size);
npg_status npg_file_print(npg_file *file, const char *format, ...) NPG_PRINTF(2, 3);

/* Bytes written so far. */
uint64_t npg_file_size(const npg_file *file);

/* Write over bytes that were written before, where a header states sizes of what follows it.  Failures as
 * with npg_file_write(). */
npg_status npg_file_patch(npg_file *file, uint64_t offset, const void *data, size_t size);

/* Bytes that were written, back: all of them are there.  Failures as with npg_file_write(). */
npg_status npg_file_reread(npg_file *file, void *data, size_t size, uint64_t offset);

/* All that was written to `part` behind what was written to file; part is closed without a result. */
npg_status npg_file_append(npg_file *file, npg_file **part);

/* Make the file appear under its name; closes it in any case. */
npg_status npg_file_commit(npg_file **file);

/* The one after success, the other after a failure, which comes back. */
npg_status npg_file_end(npg_file **file, npg_status status);

/* Close without a result: the hidden file is removed.  NULL is fine. */
void npg_file_discard(npg_file **file);

/* Open a plain file for reading; *fd is the caller's, -1 on failure.  Never waits:
 * a pipe or a device in the place of a file is refused.  `failure` is what a file that can't be opened means
 * (NPG_BAD_INPUT, NPG_DISK). */
npg_status npg_file_open_plain(int *fd, const char *path, npg_status failure);

/* Whether a name from a file can be added to a folder without leading out of it: not absolute, no "..". */
bool npg_path_stays(const char *name);

/* NPG_BAD_INPUT, by name, for a file that is not in the folder, at any depth, after all links are followed: what
 * option confine is for. */
npg_status npg_path_confine(const char *path, const char *folder);

/* NPG_USAGE where a symbolic link stands in the place of a folder (option confine). */
npg_status npg_folder_is_own(const char *folder);

/* Make a folder and its parents. */
npg_status npg_make_folder(const char *path);

/* "<folder>/<name>".  NPG_DISK where it is longer than the system takes. */
#define NPG_PATH_SIZE 4096
npg_status npg_path_of(char path[NPG_PATH_SIZE], const char *folder, const char *name);

/* Remove a file of a folder, if it is there.  NPG_DISK. */
npg_status npg_file_remove(const char *folder, const char *name);

/* Make folder and file where they are not there, and lock it as long as *fd is open (-1: it is not).  NPG_USAGE where
 * another process has it locked, unless this one waits; NPG_DISK. */
npg_status npg_file_lock(int *fd, const char *folder, const char *name, bool waits);

/* A path, to be given to npg_release(). */
npg_status npg_join_path(char **out, const char *folder, const char *name);

/* All of the bytes to a place of an open file, and back; whatever signals come between.  *size gets how many
 * there are up to the file's end.  False: errno says why. */
bool npg_write_at(int fd, const void *data, size_t size, int64_t at);
bool npg_read_at(int fd, void *data, size_t *size, int64_t at);

/* The whole of a plain file, and a 0 behind it.  NPG_BAD_INPUT: it can't be read, or is larger than `limit`, as no
 * file of this kind ("camera") is. */
npg_status npg_file_whole(npg_arena *arena, void *bytes, size_t *size, const char *path, size_t limit,
                          const char *kind);

/* "<folder>/<name>" as text of the arena; NULL once a take was refused. */
char *npg_arena_path(npg_arena *arena, const char *folder, const char *name);

/* XXH3 of the first `limit` bytes of a file (UINT64_MAX: all).  NPG_DISK when it can't be read, NPG_BAD_INPUT
 * when it is shorter than a limit. */
npg_status npg_hash_file(uint64_t *hash, const char *path, uint64_t limit);

/* Whether something lies at the path, or in the folder under that name; false, too, where that can't be found
 * out. */
bool npg_is_there(const char *path);
bool npg_is_folder(const char *path);
bool npg_is_in_folder(const char *folder, const char *name);

/* Whether both paths lead to the same file or folder, which is there. */
bool npg_is_same_file(const char *a, const char *b);

/* ---- whole folders (folder.c) ---- */

/* Call visit(user, name) for each name in a folder that is neither "." nor "..", in no order, until one
 * fails.  `failure` is what a folder that can't be listed means; with NPG_DISK one that is not there is empty. */
npg_status npg_folder_each(const char *folder, npg_status failure,
                           npg_status (*visit)(void *user, const char *name), void *user);

/* Remove a file, or a folder with all that is in it; links are removed, not followed.  What is not there is
 * no failure; what can't be removed does not keep the rest, and NPG_DISK names the first. */
npg_status npg_folder_remove(const char *path);

#endif
