/* File: output that appears under its final name only when it is whole. */
#include "pipeline/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include "pipeline/memory.h"

#define BUFFER_SIZE (256 << 10) /* bytes gathered before a write: few system calls for many small pieces */

struct npg_file {
    npg_arena arena; /* of paths and buffer */
    int fd;
    npg_status status; /* of the first failure, with its text in `cause` */
    char cause[512];
    char *path, *hidden_path, *folder;
    unsigned char *buffer; /* BUFFER_SIZE */
    size_t used;
    uint64_t flushed; /* bytes that left the buffer */
};

static size_t path_size(const char *folder, const char *name)
{
    return strlen(folder) + strlen(name) + 2;
}

static bool print_path(char *path, size_t size, const char *folder, const char *name)
{
    size_t length = strlen(folder);
    const char *slash = length && folder[length - 1] == '/' ? "" : "/";
    int printed = snprintf(path, size, "%s%s%s", folder, slash, name);
    return printed >= 0 && (size_t)printed < size;
}

npg_status npg_path_of(char path[NPG_PATH_SIZE], const char *folder, const char *name)
{
    if (print_path(path, NPG_PATH_SIZE, folder, name)) return NPG_OK;
    return npg_error(NPG_DISK, "%s: the name is too long", folder);
}

npg_status npg_file_remove(const char *folder, const char *name)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, folder, name));
    if (!unlink(path) || errno == ENOENT) return NPG_OK;
    return npg_error_errno(NPG_DISK, "can't remove %s", path);
}

npg_status npg_file_lock(int *fd, const char *folder, const char *name, bool waits)
{
    char path[NPG_PATH_SIZE];
    *fd = -1;
    NPG_TRY(npg_make_folder(folder));
    NPG_TRY(npg_path_of(path, folder, name));
    *fd = open(path, O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0666);
    if (*fd < 0) return npg_error_errno(NPG_DISK, "can't open %s", path);
    while (flock(*fd, waits ? LOCK_EX : LOCK_EX | LOCK_NB)) {
        if (errno == EINTR) continue;
        if (waits) return npg_error_errno(NPG_DISK, "can't lock %s", path);
        return npg_error(NPG_USAGE, "another run is at work on %s", folder);
    }
    return NPG_OK;
}

npg_status npg_join_path(char **out, const char *folder, const char *name)
{
    NPG_TRY(npg_alloc(out, NPG_FOR_FILES, path_size(folder, name)));
    print_path(*out, path_size(folder, name), folder, name);
    return NPG_OK;
}

char *npg_arena_path(npg_arena *arena, const char *folder, const char *name)
{
    char *path = npg_arena_take(arena, path_size(folder, name), 1);
    if (path) print_path(path, path_size(folder, name), folder, name);
    return path;
}

bool npg_write_at(int fd, const void *data, size_t size, int64_t at)
{
    for (size_t done = 0; done < size;) {
        ssize_t count = pwrite(fd, (const char *)data + done, size - done, (off_t)at + (off_t)done);
        if (count < 0 && errno == EINTR) continue;
        if (count == 0) errno = ENOSPC;
        if (count <= 0) return false;
        done += (size_t)count;
    }
    return true;
}

bool npg_read_at(int fd, void *data, size_t *size, int64_t at)
{
    size_t done = 0;
    while (done < *size) {
        ssize_t count = pread(fd, (char *)data + done, *size - done, (off_t)at + (off_t)done);
        if (count < 0 && errno == EINTR) continue;
        if (count < 0) return false;
        if (!count) break;
        done += (size_t)count;
    }
    *size = done;
    return true;
}

bool npg_is_there(const char *path)
{
    return access(path, F_OK) == 0;
}

bool npg_is_folder(const char *path)
{
    struct stat info;
    return !stat(path, &info) && S_ISDIR(info.st_mode);
}

bool npg_is_in_folder(const char *folder, const char *name)
{
    char path[NPG_PATH_SIZE];
    return !npg_path_of(path, folder, name) && npg_is_there(path);
}

bool npg_is_same_file(const char *a, const char *b)
{
    struct stat of_a, of_b;
    return !stat(a, &of_a) && !stat(b, &of_b) && of_a.st_dev == of_b.st_dev && of_a.st_ino == of_b.st_ino;
}

static npg_status fill_file(npg_file *file, const char *path)
{
    const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
    size_t size = strlen(path) + 8;
    file->fd = -1;
    file->path = npg_arena_text(&file->arena, path);
    file->hidden_path = npg_arena_take(&file->arena, size, 1);
    file->folder = npg_arena_text(&file->arena, slash ? path : ".");
    file->buffer = npg_arena_take(&file->arena, BUFFER_SIZE, 1);
    NPG_TRY(npg_arena_status(&file->arena));
    /* where the file is written until it is whole */
    snprintf(file->hidden_path, size, "%.*s.%s.part", (int)(name - path), path, name);
    if (slash) file->folder[slash == path ? 1 : slash - path] = 0;
    file->fd = open(file->hidden_path, O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0666);
    return file->fd < 0 ? npg_error_errno(NPG_DISK, "can't write %s", path) : NPG_OK;
}

npg_status npg_file_open(npg_file **out, const char *path)
{
    NPG_TRY(npg_object_open(out, NPG_FOR_FILES, sizeof **out));
    npg_status status = fill_file(*out, path);
    if (status) npg_object_close(out);
    return status;
}

npg_status npg_file_open_in(npg_file **out, const char *folder, const char *name)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, folder, name));
    return npg_file_open(out, path);
}

static npg_status keep_failure(npg_file *file, const char *verb)
{
    file->status = npg_error_errno(NPG_DISK, "can't %s %s", verb, file->path);
    if (file->status != NPG_MEMORY) file->status = NPG_DISK;
    snprintf(file->cause, sizeof file->cause, "%s", npg_error_text());
    return file->status;
}

static npg_status write_through(npg_file *file, const unsigned char *data, size_t size)
{
    int64_t at = (int64_t)file->flushed;
    file->flushed += size;
    return npg_write_at(file->fd, data, size, at) ? NPG_OK : keep_failure(file, "write");
}

static npg_status flush_buffer(npg_file *file)
{
    size_t used = file->used;
    file->used = 0;
    return write_through(file, file->buffer, used);
}

npg_status npg_file_write(npg_file *file, const void *data, size_t size)
{
    if (file->status) return file->status;
    if (size > BUFFER_SIZE - file->used) NPG_TRY(flush_buffer(file));
    if (size > BUFFER_SIZE) return write_through(file, data, size);
    memcpy(file->buffer + file->used, data, size);
    file->used += size;
    return NPG_OK;
}

uint64_t npg_file_size(const npg_file *file)
{
    return file->flushed + file->used;
}

npg_status npg_file_patch(npg_file *file, uint64_t offset, const void *data, size_t size)
{
    NPG_REQUIRE(offset <= npg_file_size(file) && size <= npg_file_size(file) - offset);
    if (!file->status && offset + size > file->flushed) NPG_TRY(flush_buffer(file));
    if (!file->status && !npg_write_at(file->fd, data, size, (int64_t)offset))
        return keep_failure(file, "write");
    return file->status;
}

npg_status npg_file_reread(npg_file *file, void *data, size_t size, uint64_t offset)
{
    size_t got = size;
    NPG_REQUIRE(offset <= npg_file_size(file) && size <= npg_file_size(file) - offset);
    if (!file->status && offset + size > file->flushed) NPG_TRY(flush_buffer(file));
    if (!file->status && (!npg_read_at(file->fd, data, &got, (int64_t)offset) || got < size))
        return keep_failure(file, "read");
    return file->status;
}

npg_status npg_file_append(npg_file *file, npg_file **part)
{
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    unsigned char *bytes = npg_arena_take(&scratch, BUFFER_SIZE, 1);
    npg_status status = npg_arena_status(&scratch);
    for (uint64_t at = 0, size; at < npg_file_size(*part) && !status; at += size) {
        size = npg_file_size(*part) - at < BUFFER_SIZE ? npg_file_size(*part) - at : BUFFER_SIZE;
        status = npg_file_reread(*part, bytes, size, at);
        if (status) npg_error_set(status, (*part)->cause);
        if (!status) status = npg_file_write(file, bytes, size);
    }
    npg_arena_release(&scratch);
    npg_file_discard(part);
    return status;
}

npg_status npg_file_print(npg_file *file, const char *format, ...)
{
    char text[4096];
    va_list arguments;
    va_start(arguments, format);
    int length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    if (length < 0 || (size_t)length >= sizeof text)
        return npg_error(NPG_FAILED, "%s: a line is too long", file->path);
    return npg_file_write(file, text, (size_t)length);
}

/* The rename is on disk only once its folder is. */
static npg_status sync_folder(npg_file *file)
{
    int fd = open(file->folder, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd < 0) return keep_failure(file, "sync the folder of");
    int failed = fsync(fd) && errno != EINVAL; /* EINVAL: some file systems have nothing to sync there */
    if (failed) keep_failure(file, "sync the folder of");
    close(fd);
    return failed ? file->status : NPG_OK;
}

npg_status npg_file_commit(npg_file **slot)
{
    npg_file *file = *slot;
    if (!file->status) flush_buffer(file);
    if (!file->status && fsync(file->fd) && errno != EINVAL) keep_failure(file, "sync");
    int closed = close(file->fd);
    file->fd = -1;
    if (!file->status && closed) keep_failure(file, "close");
    if (!file->status && rename(file->hidden_path, file->path)) keep_failure(file, "rename to");
    /* Where the folder can't be synced the file stands under its name already: the failure is reported all
     * the same. */
    npg_status status = file->status ? npg_error_set(file->status, file->cause) : sync_folder(file);
    if (file->status) unlink(file->hidden_path);
    npg_object_close(slot);
    return status;
}

npg_status npg_file_end(npg_file **file, npg_status status)
{
    if (!status) return npg_file_commit(file);
    npg_file_discard(file);
    return status;
}

void npg_file_discard(npg_file **slot)
{
    npg_file *file = *slot;
    if (!file) return;
    if (file->fd >= 0) close(file->fd);
    unlink(file->hidden_path);
    npg_object_close(slot);
}

/* ---- reading ---- */

/* O_NONBLOCK: opening a pipe without a writer would wait for one; O_NOCTTY: a terminal must not become
 * ours. */
npg_status npg_file_open_plain(int *out, const char *path, npg_status failure)
{
    struct stat info;
    *out = -1;
    int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
    if (fd >= 0 && !fstat(fd, &info) && S_ISREG(info.st_mode)) {
        *out = fd;
        return NPG_OK;
    }
    int cause = fd >= 0 && S_ISDIR(info.st_mode) ? EISDIR : errno;
    bool is_other = fd >= 0 && !S_ISDIR(info.st_mode);
    if (fd >= 0) close(fd);
    return npg_error(cause == ENOMEM && !is_other ? NPG_MEMORY : failure, "%s: can't be read: %s", path,
                     is_other ? "a pipe or a device, not a file" : strerror(cause));
}

npg_status npg_file_whole(npg_arena *arena, void *bytes, size_t *size, const char *path, size_t limit,
                          const char *kind)
{
    struct stat info;
    int fd;
    NPG_TRY(npg_file_open_plain(&fd, path, NPG_BAD_INPUT));
    npg_status status = fstat(fd, &info) ? npg_error_errno(NPG_BAD_INPUT, "can't read %s", path) : NPG_OK;
    *size = status ? 0 : (size_t)info.st_size;
    if (*size > limit)
        status =
            npg_error(NPG_BAD_INPUT, "%s: no %s file, or one of more than %zu MiB", path, kind, limit >> 20);
    void *taken = status ? NULL : npg_arena_take(arena, *size + 1, 1);
    if (!status) status = npg_arena_status(arena);
    if (!status && !npg_read_at(fd, taken, size, 0))
        status = npg_error_errno(NPG_BAD_INPUT, "can't read %s", path);
    close(fd);
    *(void **)bytes = taken;
    return status;
}

bool npg_path_stays(const char *name)
{
    if (!*name || *name == '/') return false;
    for (const char *part = name; part; part = strchr(part, '/')) {
        part += *part == '/';
        if (!strncmp(part, "..", 2) && (!part[2] || part[2] == '/')) return false;
    }
    return true;
}

static bool is_inside(const char *path, const char *folder)
{
    char *real_path = realpath(path, NULL), *real_folder = realpath(folder, NULL);
    size_t size = real_folder ? strlen(real_folder) : 0;
    bool is_root = size == 1;
    bool inside = real_path && real_folder && !strncmp(real_path, real_folder, size) &&
                  (is_root || real_path[size] == '/');
    free(real_path);
    free(real_folder);
    return inside;
}

npg_status npg_path_confine(const char *path, const char *folder)
{
    if (is_inside(path, folder)) return NPG_OK;
    return npg_error(NPG_BAD_INPUT,
                     "%s: leads out of %s, and option confine is set "
                     "(as always in a batch, unless it says otherwise); --no-confine follows it",
                     path, folder);
}

/* ---- folders ---- */

npg_status npg_folder_is_own(const char *folder)
{
    struct stat info;
    if (lstat(folder, &info) || !S_ISLNK(info.st_mode)) return NPG_OK;
    return npg_error(NPG_USAGE, "%s is a link, and option confine is set", folder);
}

npg_status npg_make_folder(const char *path)
{
    char *copy;
    struct stat info;
    if (!*path) return npg_error(NPG_DISK, "a folder without a name can't be made");
    NPG_TRY(npg_copy_text(&copy, path));
    npg_status status = NPG_OK;
    for (char *slash = copy + 1; !status; slash++) {
        char c = *slash;
        if (c && c != '/') continue;
        *slash = 0;
        if (mkdir(copy, 0777) && errno != EEXIST)
            status = npg_error_errno(NPG_DISK, "can't make the folder %s", copy);
        *slash = c;
        if (!c) break;
    }
    npg_release(&copy);
    if (status) return status < 0 && status != NPG_MEMORY ? NPG_DISK : status;
    if (stat(path, &info) || !S_ISDIR(info.st_mode)) return npg_error(NPG_DISK, "%s is not a folder", path);
    return NPG_OK;
}

/* ---- checksums ---- */

static npg_status hash_bytes(XXH3_state_t *state, int fd, const char *path, uint64_t limit)
{
    unsigned char block[16 << 10];
    XXH3_64bits_reset(state);
    for (uint64_t left = limit; left;) {
        ssize_t got = read(fd, block, left < sizeof block ? (size_t)left : sizeof block);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) return npg_error_errno(NPG_DISK, "can't read %s", path);
        if (got == 0 && limit == UINT64_MAX) break;
        if (got == 0)
            return npg_error(NPG_BAD_INPUT, "%s is %llu bytes shorter than it was", path,
                             (unsigned long long)left);
        XXH3_64bits_update(state, block, (size_t)got);
        left -= (uint64_t)got;
    }
    return NPG_OK;
}

npg_status npg_hash_file(uint64_t *hash, const char *path, uint64_t limit)
{
    XXH3_state_t *state = XXH3_createState();
    if (!state) return npg_error(NPG_MEMORY, "no memory for a checksum");
    int fd;
    npg_status status = npg_file_open_plain(&fd, path, NPG_DISK);
    if (!status) status = hash_bytes(state, fd, path, limit);
    if (fd >= 0) close(fd);
    *hash = status ? 0 : XXH3_64bits_digest(state);
    XXH3_freeState(state);
    return status;
}
