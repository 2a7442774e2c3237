/* Helpers of the tests of readers: files from bytes, an allocator that knows its peak, and what a reader must
 * keep to whatever it is given. */
#ifndef NPG_TEST_READ_HELPERS_H
#define NPG_TEST_READ_HELPERS_H

#include "ingest/ingest_internal.h"
#include "tests/support/temp_folder.h"

static temp_folder folder;

/* ---- bytes under construction ---- */

typedef struct bytes {
    unsigned char data[1 << 16];
    size_t size;
} bytes;

static inline void put_bytes(bytes *b, const void *data, size_t size)
{
    if (b->size + size > sizeof b->data) abort();
    memcpy(b->data + b->size, data, size);
    b->size += size;
}

static inline void put_text(bytes *b, const char *text)
{
    put_bytes(b, text, strlen(text));
}

/* The low `size` bytes of bits, in either order. */
static inline void put_bits(bytes *b, uint64_t bits, size_t size, bool is_big)
{
    for (size_t i = 0; i < size; i++) {
        unsigned char byte = (unsigned char)(bits >> 8 * (is_big ? size - 1 - i : i));
        put_bytes(b, &byte, 1);
    }
}

static inline void put_float(bytes *b, float value, bool is_big)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_bits(b, bits, sizeof bits, is_big);
}

static inline void put_double(bytes *b, double value, bool is_big)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_bits(b, bits, sizeof bits, is_big);
}

static inline const char *save(const char *name, const void *data, size_t size)
{
    const char *path = in_folder(&folder, name);
    unlink(path); /* some file systems write a file out at once when it is cut and filled again */
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(data, 1, size, file) != size || fclose(file)) abort();
    return path;
}

/* ---- an allocator that counts ---- */

static size_t held_bytes, peak_bytes;

static inline void *counting_alloc(void *user, size_t align, size_t size)
{
    (void)user;
    size_t *block = aligned_alloc(align, (size + 2 * align - 1) / align * align + align);
    if (!block) return NULL;
    *block = size;
    held_bytes += size;
    if (held_bytes > peak_bytes) peak_bytes = held_bytes;
    return (char *)block + align;
}

static inline void counting_release(void *user, void *memory)
{
    (void)user;
    size_t *block = (size_t *)((char *)memory - 64);
    held_bytes -= *block;
    free(block);
}

static inline int open_reader_tests(void **state)
{
    (void)state;
    npg_allocator counting = {sizeof counting, NULL, counting_alloc, counting_release};
    return npg_memory_set_allocator(&counting) || open_temp_folder(&folder);
}

static inline int close_reader_tests(void **state)
{
    (void)state;
    close_temp_folder(&folder);
    return npg_memory_used() ? -1 : 0;
}

/* Read, and hold the reader to its bound of memory and to leaving nothing behind. */
static inline npg_status read_within_bounds(npg_frame *frame, const char *path, npg_origin *origin)
{
    struct stat info = {0};
    stat(path, &info);
    size_t before = peak_bytes = held_bytes;
    *frame = (npg_frame){0};
    npg_status status = npg_read_cloud(frame, path, origin);
    assert_true(peak_bytes - before <= 4 * (size_t)info.st_size + (1 << 20));
    if (status) {
        assert_int_equal(held_bytes, before);
        assert_null(frame->pos_local);
        assert_int_equal(frame->point_count, 0);
    } else {
        assert_string_equal(frame->path, path);
        assert_int_equal(frame->cleaning.read, frame->point_count);
        assert_true(frame->fields & NPG_FIELD_POINTS);
    }
    return status;
}

#endif
