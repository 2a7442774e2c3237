/* Base64: bytes as text inside a page. */
#ifndef NPG_BASE64_H
#define NPG_BASE64_H

#include <stddef.h>

#include "pipeline/file.h"

/* Failures as with npg_file_write(): remembered by the file. */
void npg_base64_write(npg_file *file, const void *bytes, size_t size);

#endif
