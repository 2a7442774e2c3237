/* Fuzz target of the states on disk, for libFuzzer: the bytes as a store, and as the content of a record whose
 * checksum is right, so that damage reaches what is behind the checksum.
 * Then every part of a state that is taken from it. */
#include <string.h>
#include <xxhash.h>

#include "job/job_internal.h"
#include "pipeline/store.h"
#include "tests/support/fuzz_target.h"

static void take_parts(const npg_record *record)
{
    static const char *const names[] = {"reference", "reference.faces", "held", "frame.0", "list", "end", ""};
    size_t size;
    uint64_t word;
    unsigned char sum = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        const unsigned char *bytes = npg_record_find(record, names[i], &size);
        for (size_t k = 0; bytes && k < size; k++) sum = (unsigned char)(sum + bytes[k]);
        npg_status status = npg_record_get(record, names[i], &word, sizeof word);
        expect(status == NPG_OK || status == NPG_BAD_INPUT, "block");
    }
    npg_mesh *mesh = NULL;
    npg_status status = npg_state_get_mesh(&mesh, record);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "reference");
    for (size_t i = 0; mesh && i < 3 * mesh->face_count; i++)
        expect(mesh->faces[i] < mesh->vert_count, "a face out of range");
    npg_mesh_unref(&mesh);
}

static void open_one(const uint8_t *data, size_t size)
{
    int fd;
    npg_store *store;
    npg_record *record;
    const char *path = fuzz_file(&fd, "store.npg", data, size);
    npg_status status = npg_store_open(&store, path);
    expect(status == NPG_OK || status == NPG_DISK, "store");
    if (status) return;
    int64_t last = npg_store_last(store, NPG_RECORD_STATE);
    status = npg_store_read(store, &record, NPG_RECORD_STATE, last, 0);
    expect(status == NPG_OK || status == NPG_BAD_INPUT, "state");
    if (!status) take_parts(record);
    npg_record_close(&record);
    npg_store_close(&store);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    fuzz_bound(size);
    open_one(data, size);
    struct {
        char magic[8], kind[8];
        int64_t index;
        uint64_t of, size, hash;
    } head = {"NPGREC0", NPG_RECORD_STATE, 0, 0, size, 0};
    head.magic[7] = '1';
    uint8_t *whole = malloc(sizeof head + size);
    if (!whole) abort();
    head.hash = XXH3_64bits(head.kind, 32) ^ XXH3_64bits(data, size);
    memcpy(whole, &head, sizeof head);
    if (size) memcpy(whole + sizeof head, data, size);
    open_one(whole, sizeof head + size);
    free(whole);
    fuzz_end();
    return 0;
}
