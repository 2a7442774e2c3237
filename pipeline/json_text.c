/* JSON: values from data that it can't hold as it is, and the files that the program writes. */
#include "pipeline/json_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"

/* Length of the UTF-8 sequence that begins at text, 0 if it is none (too long, cut off, a surrogate). */
/* Bounds as in RFC 3629: c0, c1 and e0 8x, f0 8x would be too long, ed ax a surrogate, f4 9x beyond
 * 10ffff. */
static size_t sequence_length(const unsigned char *text)
{
    unsigned char c = text[0];
    size_t length = c < 0x80                ? 1
                    : c >= 0xc2 && c < 0xe0 ? 2
                    : c >= 0xe0 && c < 0xf0 ? 3
                    : c >= 0xf0 && c < 0xf5 ? 4
                                            : 0;
    for (size_t i = 1; i < length; i++)
        if ((text[i] & 0xc0) != 0x80) return 0;
    if (c == 0xe0 && text[1] < 0xa0) return 0;
    if (c == 0xed && text[1] >= 0xa0) return 0;
    if (c == 0xf0 && text[1] < 0x90) return 0;
    if (c == 0xf4 && text[1] >= 0x90) return 0;
    return length;
}

json_t *npg_json_text(const char *text)
{
    if (!text) return json_null();
    json_t *value = json_string(text);
    if (value) return value;
    char *copy;
    if (npg_copy_text(&copy, text)) return NULL;
    for (unsigned char *c = (unsigned char *)copy; *c;) {
        size_t length = sequence_length(c);
        if (!length) *c = '?';
        c += length ? length : 1;
    }
    value = json_string(copy);
    npg_release(&copy);
    return value;
}

json_t *npg_json_real(double value)
{
    return isfinite(value) ? json_real(value) : json_null();
}

npg_status npg_json_save(const char *path, const json_t *value)
{
    char *text = json_dumps(value, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    npg_file *file = NULL;
    if (!text) return npg_error(NPG_MEMORY, "no memory for %s", path);
    npg_status status = npg_file_open(&file, path);
    if (!status) {
        npg_file_write(file, text, strlen(text));
        npg_file_write(file, "\n", 1);
        status = npg_file_commit(&file);
    }
    free(text);
    return status;
}

npg_status npg_json_write(const char *folder, const char *name, const json_t *value)
{
    char *path;
    NPG_TRY(npg_join_path(&path, folder, name));
    npg_status status = npg_json_save(path, value);
    npg_release(&path);
    return status;
}
