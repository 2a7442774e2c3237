/* Log files: one JSON object per line. */
#ifndef NPG_LOG_FILE_H
#define NPG_LOG_FILE_H

#include <jansson.h>

/* Append a record (consumed; NULL does nothing) with "time" put in front: one write, so that several
 * processes may append to the same file.  A write that fails is reported once on standard error, and *fd (-1:
 * does nothing) becomes -1. */
void npg_log_file_write(int *fd, json_t *record);

#endif
