/* Zip store: a ZIP file of members that are not compressed and whose sizes are known before. */
#include "export/exporters/exporters_internal.h"

#include <stdbool.h>
#include <zlib.h>

/* Records and numbers of PKWARE's APPNOTE.TXT, version 6.3. */
#define FIXED_TIME     0x00210000 /* 1980-01-01 00:00, the first one there is: the same bytes every day */
#define LOCAL_HEADER   0x04034b50
#define ENTRY          0x02014b50
#define END_64         0x06064b50
#define END_64_LOCATOR 0x07064b50
#define END            0x06054b50
#define VERSION_64     45
#define ELSEWHERE      0xffffffff /* the number stands in a ZIP64 field */

/* ---- records: with ZIP64 fields, whatever the size ---- */

/* What the header before a member and its entry in the directory have in common: version to sizes. */
static size_t put_common(unsigned char *out, const npg_zip_member *member)
{
    size_t n = npg_put_little(out, VERSION_64, 2);
    n += npg_put_little(out + n, 0x0800, 2); /* names are UTF-8 */
    n += npg_put_little(out + n, 0, 2);      /* stored */
    n += npg_put_little(out + n, FIXED_TIME, 4);
    n += npg_put_little(out + n, member->crc, 4);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    return n + npg_put_little(out + n, ELSEWHERE, 4);
}

/* The name, and behind it a ZIP64 field of `size` bytes that begins with the member's sizes. */
static size_t put_name(unsigned char *out, const npg_zip_member *member, size_t size)
{
    size_t n = strlen(member->name);
    memcpy(out, member->name, n);
    n += npg_put_little(out + n, 1, 2);
    n += npg_put_little(out + n, size, 2);
    n += npg_put_little(out + n, member->size, 8);
    return n + npg_put_little(out + n, member->size, 8);
}

static size_t put_header(unsigned char *out, const npg_zip_member *member)
{
    size_t n = npg_put_little(out, LOCAL_HEADER, 4);
    n += put_common(out + n, member);
    n += npg_put_little(out + n, strlen(member->name), 2);
    n += npg_put_little(out + n, 20, 2);
    return n + put_name(out + n, member, 16);
}

static size_t put_entry(unsigned char *out, const npg_zip_member *member)
{
    size_t n = npg_put_little(out, ENTRY, 4);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += put_common(out + n, member);
    n += npg_put_little(out + n, strlen(member->name), 2);
    n += npg_put_little(out + n, 28, 2);
    n += npg_put_little(out + n, 0, 8); /* comment's length, disk, attributes */
    n += npg_put_little(out + n, 0, 2);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    n += put_name(out + n, member, 24);
    return n + npg_put_little(out + n, member->header_at, 8);
}

static void write_end(const npg_zip *zip, uint64_t directory_at, uint64_t directory_size)
{
    unsigned char out[128];
    uint64_t end_at = npg_file_size(zip->file);
    size_t n = npg_put_little(out, END_64, 4);
    n += npg_put_little(out + n, 44, 8);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += npg_put_little(out + n, 0, 8);
    n += npg_put_little(out + n, zip->count, 8);
    n += npg_put_little(out + n, zip->count, 8);
    n += npg_put_little(out + n, directory_size, 8);
    n += npg_put_little(out + n, directory_at, 8);
    n += npg_put_little(out + n, END_64_LOCATOR, 4);
    n += npg_put_little(out + n, 0, 4);
    n += npg_put_little(out + n, end_at, 8);
    n += npg_put_little(out + n, 1, 4);
    n += npg_put_little(out + n, END, 4);
    n += npg_put_little(out + n, 0, 4);
    n += npg_put_little(out + n, zip->count, 2);
    n += npg_put_little(out + n, zip->count, 2);
    n += npg_put_little(out + n, directory_size, 4);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    n += npg_put_little(out + n, 0, 2);
    npg_file_write(zip->file, out, n);
}

/* ---- the file ---- */

static void write_zeros(npg_file *file, uint64_t size)
{
    static const unsigned char zeros[4096];
    for (; size; size -= size < sizeof zeros ? size : sizeof zeros)
        if (npg_file_write(file, zeros, size < sizeof zeros ? size : sizeof zeros)) return;
}

npg_status npg_zip_open(npg_zip *zip, npg_file *file, npg_zip_member *members, size_t count)
{
    unsigned char header[128];
    *zip = (npg_zip){.file = file, .members = members, .count = count};
    NPG_REQUIRE(count && count < 0xffff);
    for (size_t i = 0; i < count; i++) {
        npg_zip_member *member = &members[i];
        member->filled = member->crc = 0;
        member->header_at = npg_file_size(zip->file);
        npg_file_write(zip->file, header, put_header(header, member));
        member->data_at = npg_file_size(zip->file);
        if (i + 1 < count) write_zeros(zip->file, member->size);
    }
    return NPG_OK;
}

npg_status npg_zip_put(npg_zip *zip, size_t at, const void *data, size_t size)
{
    npg_zip_member *member = &zip->members[at];
    NPG_REQUIRE(at < zip->count && size <= member->size - member->filled);
    uint64_t place = member->data_at + member->filled;
    member->crc = (uint32_t)crc32_z(member->crc, data, size);
    member->filled += size;
    return at + 1 == zip->count ? npg_file_write(zip->file, data, size)
                                : npg_file_patch(zip->file, place, data, size);
}

npg_status npg_zip_finish(npg_zip *zip)
{
    unsigned char record[160];
    for (size_t i = 0; i < zip->count; i++) {
        NPG_REQUIRE(zip->members[i].filled == zip->members[i].size);
        size_t size = put_header(record, &zip->members[i]);
        NPG_TRY(npg_file_patch(zip->file, zip->members[i].header_at, record, size));
    }
    uint64_t at = npg_file_size(zip->file);
    for (size_t i = 0; i < zip->count; i++)
        npg_file_write(zip->file, record, put_entry(record, &zip->members[i]));
    write_end(zip, at, npg_file_size(zip->file) - at);
    return NPG_OK;
}
