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
#define VERSION        20 /* that readers need */
#define VERSION_64     45

/* ---- records ---- */

static size_t put_number(const npg_zip *zip, unsigned char *out, uint64_t value)
{
    return npg_put_little(out, value >= zip->large ? 0xffffffff : value, 4);
}

/* What the header before a member and its entry in the directory have in common: version to sizes. */
static size_t put_common(const npg_zip *zip, unsigned char *out, const npg_zip_member *member, bool is_large)
{
    size_t n = npg_put_little(out, is_large ? VERSION_64 : VERSION, 2);
    n += npg_put_little(out + n, 0x0800, 2); /* names are UTF-8 */
    n += npg_put_little(out + n, 0, 2);      /* stored */
    n += npg_put_little(out + n, FIXED_TIME, 4);
    n += npg_put_little(out + n, member->crc, 4);
    n += put_number(zip, out + n, member->size);
    return n + put_number(zip, out + n, member->size);
}

static size_t put_header(const npg_zip *zip, unsigned char *out, const npg_zip_member *member)
{
    size_t length = strlen(member->name), n = npg_put_little(out, LOCAL_HEADER, 4);
    bool is_large = member->size >= zip->large;
    n += put_common(zip, out + n, member, is_large);
    n += npg_put_little(out + n, length, 2);
    n += npg_put_little(out + n, is_large ? 20 : 0, 2);
    memcpy(out + n, member->name, length);
    n += length;
    if (!is_large) return n;
    n += npg_put_little(out + n, 1, 2);
    n += npg_put_little(out + n, 16, 2);
    n += npg_put_little(out + n, member->size, 8);
    return n + npg_put_little(out + n, member->size, 8);
}

static size_t put_entry(const npg_zip *zip, unsigned char *out, const npg_zip_member *member)
{
    bool has_size = member->size >= zip->large, has_place = member->header_at >= zip->large;
    size_t length = strlen(member->name), extra = (has_size ? 16u : 0) + (has_place ? 8u : 0);
    size_t n = npg_put_little(out, ENTRY, 4);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += put_common(zip, out + n, member, extra != 0);
    n += npg_put_little(out + n, length, 2);
    n += npg_put_little(out + n, extra ? extra + 4 : 0, 2);
    n += npg_put_little(out + n, 0, 8); /* comment's length, disk, attributes */
    n += npg_put_little(out + n, 0, 2);
    n += put_number(zip, out + n, member->header_at);
    memcpy(out + n, member->name, length);
    n += length;
    if (!extra) return n;
    n += npg_put_little(out + n, 1, 2);
    n += npg_put_little(out + n, extra, 2);
    for (int i = 0; i < 2 && has_size; i++) n += npg_put_little(out + n, member->size, 8);
    if (has_place) n += npg_put_little(out + n, member->header_at, 8);
    return n;
}

static void write_end(const npg_zip *zip, uint64_t directory_at, uint64_t directory_size)
{
    unsigned char out[128];
    uint64_t end_at = npg_file_size(zip->file);
    size_t n = 0;
    if (directory_at >= zip->large) {
        n += npg_put_little(out + n, END_64, 4);
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
    }
    n += npg_put_little(out + n, END, 4);
    n += npg_put_little(out + n, 0, 4);
    n += npg_put_little(out + n, zip->count, 2);
    n += npg_put_little(out + n, zip->count, 2);
    n += npg_put_little(out + n, directory_size, 4);
    n += put_number(zip, out + n, directory_at);
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

npg_status npg_zip_open(npg_zip *zip, npg_file *file, npg_zip_member *members, size_t count, uint64_t large)
{
    unsigned char header[128];
    *zip = (npg_zip){.file = file, .members = members, .count = count, .large = large};
    NPG_REQUIRE(count && count < 0xffff);
    for (size_t i = 0; i < count; i++) {
        npg_zip_member *member = &members[i];
        member->filled = member->crc = 0;
        member->header_at = npg_file_size(zip->file);
        npg_file_write(zip->file, header, put_header(zip, header, member));
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
        size_t size = put_header(zip, record, &zip->members[i]);
        NPG_TRY(npg_file_patch(zip->file, zip->members[i].header_at, record, size));
    }
    uint64_t at = npg_file_size(zip->file);
    for (size_t i = 0; i < zip->count; i++)
        npg_file_write(zip->file, record, put_entry(zip, record, &zip->members[i]));
    write_end(zip, at, npg_file_size(zip->file) - at);
    return NPG_OK;
}
