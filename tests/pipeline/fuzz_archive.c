/* Fuzz target of the states on disk, for libFuzzer: the bytes as they are,
 * and with their checksum made right, so that damage reaches what is behind the checksum.
 * Then every part of a state that is taken from it. */
#include <string.h>
#include <xxhash.h>

#include "job/state_mesh.h"
#include "pipeline/archive.h"
#include "tests/support/fuzz_target.h"

enum { TAIL = NPG_BLOCK_NAME + 16 }; /* of the last block: name, size, checksum */

static void take_parts(const npg_archive *archive)
{
    static const char *const names[] = {"reference", "reference.faces", "held", "frame.0", "list", "end", ""};
    size_t size;
    uint64_t word;
    unsigned char sum = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const unsigned char *bytes = npg_archive_find(archive, names[i], &size);
        for (size_t k = 0; bytes && k < size; k++) sum = (unsigned char)(sum + bytes[k]);
        npg_status status = npg_archive_get(archive, names[i], &word, sizeof word);
        expect(status == NPG_OK || status == NPG_BAD_INPUT, "block");
    }
    npg_mesh *mesh = NULL;
    npg_status status = npg_state_get_mesh(&mesh, archive);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "reference");
    for (size_t i = 0; mesh && i < 3 * mesh->face_count; i++)
        expect(mesh->faces[i] < mesh->vert_count, "a face out of range");
    npg_mesh_unref(&mesh);
}

static void open_one(const uint8_t *data, size_t size)
{
    int fd;
    npg_archive *archive;
    const char *path = fuzz_file(&fd, "state.npg", data, size);
    npg_status status = npg_archive_open(&archive, path);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "archive");
    if (status) return;
    take_parts(archive);
    npg_archive_close(&archive);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_bound(size);
    open_one(data, size);
    size_t whole = size / 8 * 8;
    if (whole > TAIL) {
        uint8_t *copy = malloc(whole);
        uint64_t sum_size = 8, sum = XXH3_64bits(data, whole - TAIL);
        if (!copy) abort();
        memcpy(copy, data, whole);
        memset(copy + whole - TAIL, 0, TAIL);
        memcpy(copy + whole - TAIL, "end", 3);
        memcpy(copy + whole - 16, &sum_size, sizeof sum_size);
        memcpy(copy + whole - 8, &sum, sizeof sum);
        open_one(copy, whole);
        free(copy);
    }
    fuzz_end();
    return 0;
}
