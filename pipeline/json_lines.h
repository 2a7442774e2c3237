/* JSON lines: a file of one JSON object a line, as the frame log and the lists of a run are. */
#ifndef NPG_JSON_LINES_H
#define NPG_JSON_LINES_H

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/status.h"

/* Given each line in turn: its object, a loan, and its bytes with their newline.  A failure ends the
 * visit. */
typedef npg_status npg_json_line_visit(void *user, const json_t *object, const char *line, size_t size);

/* The lines in the first `bytes` bytes of a file.  NPG_DISK when it can't be read, NPG_BAD_INPUT where
 * these are no whole lines with an object each. */
npg_status npg_json_lines_each(const char *path, int64_t bytes, npg_json_line_visit *visit, void *user);

#endif
