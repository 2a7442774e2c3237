/* Fuzz target of the readers, for libFuzzer: whatever the bytes, they are read or refused, leave nothing
 * behind and take no more memory than the bound allows.  NPG_FUZZ_NAME ("a.ply") says which reader. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <unistd.h>

#include "reader.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void expect(int condition, const char *what)
{
    if (condition) return;
    fprintf(stderr, "%s: %s\n", what, npg_error_text());
    abort();
}

/* A file that has the wanted ending and lives in memory: a link to a memfd. */
static const char *open_file(int *fd, const uint8_t *data, size_t size)
{
    static char path[128], target[64];
    *fd = memfd_create("fuzz", MFD_CLOEXEC);
    expect(*fd >= 0 && write(*fd, data, size) == (ssize_t)size, "memfd");
    snprintf(path, sizeof path, "/tmp/npg-fuzz-%d-" NPG_FUZZ_NAME, (int)getpid());
    snprintf(target, sizeof target, "/proc/self/fd/%d", *fd);
    unlink(path);
    expect(symlink(target, path) == 0, "symlink");
    return path;
}

static void read_as_cloud(const char *path)
{
    npg_frame frame = {0};
    npg_origin origin = {0};
    npg_status status = npg_read_cloud(&frame, path, &origin);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "cloud");
    expect(status == NPG_OK || !frame.pos_local, "left-overs");
    npg_frame_clear(&frame);
}

static void read_as_mesh(const char *path)
{
    npg_mesh *mesh = NULL;
    npg_origin origin = {0};
    npg_status status = npg_read_mesh(&mesh, path, &origin);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "mesh");
    for (size_t i = 0; mesh && i < 3 * mesh->face_count; i++)
        expect(mesh->faces[i] < mesh->vert_count, "a face out of range");
    npg_mesh_unref(&mesh);
}

static void read_as_stream(int fd)
{
    npg_stream *stream = NULL;
    npg_origin origin = {0};
    npg_status status = lseek(fd, 0, SEEK_SET) ? NPG_FAILED : npg_stream_open(&stream, fd, "stream");
    for (npg_frame frame = {0}; !status; npg_frame_clear(&frame))
        status = npg_stream_next(stream, &frame, &origin);
    expect(status == NPG_END || status == NPG_BAD_INPUT, "stream");
    npg_stream_close(&stream);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    const char *path = open_file(&fd, data, size);
    npg_memory_set_limit(4 * size + ((size_t)1 << 20));
    read_as_cloud(path);
    npg_memory_set_limit(0);
    read_as_mesh(path);
    read_as_stream(fd);
    expect(npg_memory_used() == 0, "memory is still in use");
    unlink(path);
    close(fd);
    return 0;
}
