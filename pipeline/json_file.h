/* JSON: files that people write, read with comments and the place of an error; files that the program writes;
 * and values from data that JSON can't hold as it is. */
#ifndef NPG_JSON_FILE_H
#define NPG_JSON_FILE_H

#include <jansson.h>

#include "pipeline/status.h"

/* Parse a file of at most `limit` bytes; comments go from // to the end of the line, a key may stand only
 * once.  *text gets what was parsed, comments blanked out, lines as they were: npg_release().  The caller
 * owns the root (json_decref).  NPG_USAGE names the file, line, column and cause; both are then NULL. */
npg_status npg_json_read(json_t **root, char **text, const char *path, size_t limit);

/* The same for a text at hand, whose comments are blanked out in place; errors name it as `place`. */
npg_status npg_json_parse(json_t **root, char *text, const char *place);

/* A JSON string; bytes that are not UTF-8 (old file names) become '?', so the text is never
 * lost.  NULL gives null. */
json_t *npg_json_text(const char *text);

/* A JSON number, or null for one that is not finite. */
json_t *npg_json_real(double value);

/* Write a file that appears whole: <folder>/<name>, or the one of this path.  NPG_DISK, NPG_MEMORY. */
npg_status npg_json_write(const char *folder, const char *name, const json_t *value);
npg_status npg_json_save(const char *path, const json_t *value);

#endif
