/* JSON files: those that people write, read with comments and the place of an error, and those we write. */
#ifndef NPG_JSON_FILE_H
#define NPG_JSON_FILE_H

#include <jansson.h>

#include "pipeline/status.h"

/* Parse a file of at most `limit` bytes; comments go from // to the end of the line, a key may stand only
 * once.  *text gets what was parsed, comments blanked out, lines as they were: npg_release().  The caller
 * owns the root (json_decref).  NPG_USAGE names the file, line, column and cause; both are then NULL. */
npg_status npg_json_read(json_t **root, char **text, const char *path, size_t limit);

/* Write a file that appears whole: <folder>/<name>, or the one of this path.  NPG_DISK, NPG_MEMORY. */
npg_status npg_json_write(const char *folder, const char *name, const json_t *value);
npg_status npg_json_save(const char *path, const json_t *value);

#endif
