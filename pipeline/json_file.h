/* JSON: files that people write, read with comments and the place of an error; files that the program writes;
 * and values from data that JSON can't hold as it is. */
#ifndef NPG_JSON_FILE_H
#define NPG_JSON_FILE_H

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

#include "pipeline/file.h"

/* Parse a file of at most `limit` bytes; comments go from // to the end of the line, a key may stand only
 * once.  The caller owns the root (json_decref).  NPG_USAGE names the file, line, column and cause; it is then NULL. */
npg_status npg_json_read(json_t **root, const char *path, size_t limit);

/* The same for a text at hand, whose comments are blanked out in place; errors name it as `place`. */
npg_status npg_json_parse(json_t **root, char *text, const char *place);

/* A JSON string; bytes that are not UTF-8 (old file names) become '?', so the text is never
 * lost.  NULL gives null. */
json_t *npg_json_text(const char *text);

/* <folder>/<name>, an object that the program wrote; NULL where there is none.  `damaged`: it can't be read. */
npg_status npg_json_load(json_t **value, const char *folder, const char *name, npg_status damaged);

/* The JSON file of a folder; NULL where there is none, or none that can be read. */
json_t *npg_json_in(const char *folder, const char *name);

/* What lies in objects in each other ("stages.evaluate.topology"): a loan, NULL where it is not there. */
json_t *npg_json_at(const json_t *object, const char *names);

/* A JSON number, or null for one that is not finite. */
json_t *npg_json_real(double value);

/* [x, y, z] of such numbers. */
json_t *npg_json_place(const double at[3]);

/* Write <folder>/<name>, a file that appears whole.  NPG_DISK, NPG_MEMORY. */
npg_status npg_json_write(const char *folder, const char *name, const json_t *value);

/* Its text into a file that is being written; flags as jansson's. */
npg_status npg_json_print(npg_file *file, const json_t *value, size_t flags);

/* ---- JSON lines: one object a line, read so that memory does not grow with the file ---- */

/* Given each line in turn: its object, a loan, and its bytes with their newline.  A failure ends the
 * visit. */
typedef npg_status npg_json_line_visit(void *user, const json_t *object, const char *line, size_t size);

/* The lines in the first `bytes` bytes (-1: all) of a folder's file.  NPG_DISK when it can't be read, NPG_BAD_INPUT
 * where these are no whole lines with an object each. */
npg_status npg_json_lines(const char *folder, const char *name, int64_t bytes, npg_json_line_visit *visit,
                          void *user);

/* ---- what the lists of a run say of a file ---- */

/* {"bytes": n, "xxh3": "16 hex digits"} added to entry for the file OUT/<file>.  NPG_DISK. */
npg_status npg_file_facts(json_t *entry, const char *output, const char *file);

/* NPG_BAD_INPUT when OUT/<file> is not the file that entry ({"bytes", "xxh3"}) describes. */
npg_status npg_file_check(const json_t *entry, const char *output, const char *file);

#endif
