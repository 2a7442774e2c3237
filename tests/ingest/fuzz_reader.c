/* Fuzz target of the readers, for libFuzzer.  NPG_FUZZ_NAME ("a.ply") says which reader. */
#include "ingest/ingest_internal.h"
#include "tests/support/fuzz_target.h"

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
    npg_status status =
        lseek(fd, 0, SEEK_SET) ? NPG_FAILED : npg_stream_open(&stream, fd, "stream", NULL, NULL);
    for (npg_frame frame = {0}; !status; npg_frame_clear(&frame))
        status = npg_stream_next(stream, &frame, &origin);
    expect(status == NPG_END || status == NPG_BAD_INPUT, "stream");
    npg_stream_close(&stream);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    int fd;
    const char *path = fuzz_file(&fd, NPG_FUZZ_NAME, data, size);
    fuzz_bound(size);
    read_as_cloud(path);
    read_as_mesh(path);
    read_as_stream(fd);
    fuzz_end();
    return 0;
}
