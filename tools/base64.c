/* Base64: bytes as text inside a page. */
#include "tools/base64.h"

enum { BYTES_AT_ONCE = 3072 }; /* a multiple of 3 */

static void write_some(npg_file *file, const unsigned char *bytes, size_t size)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    char text[BYTES_AT_ONCE / 3 * 4];
    size_t length = 0;
    for (size_t i = 0; i < size; i += 3) {
        uint32_t left = (uint32_t)(size - i), three = (uint32_t)bytes[i] << 16;
        if (left > 1) three |= (uint32_t)bytes[i + 1] << 8;
        if (left > 2) three |= bytes[i + 2];
        text[length++] = digits[three >> 18];
        text[length++] = digits[three >> 12 & 63];
        text[length++] = left > 1 ? digits[three >> 6 & 63] : '=';
        text[length++] = left > 2 ? digits[three & 63] : '=';
    }
    npg_file_write(file, text, length);
}

void npg_base64_write(npg_file *file, const void *bytes, size_t size)
{
    for (size_t at = 0; at < size; at += BYTES_AT_ONCE) {
        size_t left = size - at;
        write_some(file, (const unsigned char *)bytes + at, left < BYTES_AT_ONCE ? left : BYTES_AT_ONCE);
    }
}
