/* What the files of the export stage share: the folder of the results and the list of its frames.
 *
 *     OUT/meshes/<prefix>_<number>.ply|obj   one file per frame
 *     OUT/reference.ply                      the reference mesh
 *     OUT/frames.jsonl                       one line per frame, in the order of time
 *     OUT/frames.partial.jsonl               the same while the run goes on, in the order of solving
 *     OUT/exports.jsonl and what it lists    other forms (forms/forms.h)
 *     OUT/report.json                        the run's report
 *     OUT/done.json                          last of all: what was made, with sizes and checksums */
#ifndef NPG_EXPORT_H
#define NPG_EXPORT_H

#include "pipeline/chunk.h"
#include "pipeline/stage.h"

/* ---- the folder ---- */

typedef struct npg_mesh_names { /* how the mesh files of a run are called */
    const char *prefix, *ending;
    int width; /* digits of the number at least */
} npg_mesh_names;

enum { NPG_MESH_NAME_SIZE = 256 };

/* "<prefix>_<number>.<ending>". */
void npg_mesh_name(char name[NPG_MESH_NAME_SIZE], const npg_mesh_names *names, int64_t number);

/* Digits that the largest number needs, 4 at least. */
int npg_number_width(int64_t number_max);

/* Make OUT and see that bytes can be written into it, by writing and removing some.  NPG_DISK. */
npg_status npg_folder_probe(const char *output);

/* NPG_DISK when fewer bytes than these are free where OUT lies, with those of the earlier mesh files in OUT
 * that will be removed. */
npg_status npg_folder_has_room(const char *output, uint64_t bytes);

/* NPG_USAGE when OUT/meshes holds mesh files that this run would not write over: their numbering would mix
 * with the run's.  numbers: the frames' numbers, sorted; with none every mesh file is in the way. */
npg_status npg_folder_check(const char *output, const npg_mesh_names *names, const int64_t *numbers,
                            size_t number_count);

/* Remove what an earlier run left: done.json first, so that what remains can't pass for a whole result, then
 * its other files and the mesh files (<word>_<digits>.ply or .obj).  Files that no run makes stay. */
npg_status npg_folder_clear(const char *output);

/* ---- the frames ---- */

typedef struct npg_frame_log npg_frame_log;

/* Begin OUT/frames.partial.jsonl. */
npg_status npg_frame_log_open(npg_frame_log **list, const char *output);

/* Called with each line's object, and its bytes with their newline. */
typedef npg_status npg_visit_line(void *user, const json_t *frame, const char *line, size_t size);

/* The misfits of a line, exactly as they were; NaN where it has none. */
void npg_misfits_take(npg_figures *figures, const json_t *misfits);

/* The lines in the first `bytes` bytes of a list.  NPG_DISK, NPG_BAD_INPUT where they are no such lines. */
npg_status npg_frame_lines_each(const char *path, int64_t bytes, npg_visit_line *visit, void *user);

/* Take up OUT/frames.partial.jsonl where it has `bytes` bytes; what comes after them goes.  Every mesh that
 * the lines name must be as it was written: NPG_BAD_INPUT.  *mesh_count and *skipped_count: of the lines. */
npg_status npg_frame_log_resume(npg_frame_log **list, const char *output, int64_t bytes, int64_t *mesh_count,
                                int64_t *skipped_count);

/* Make OUT/frames.partial.jsonl of the frames before index `below` from the whole list of a run that is done
 * (or from the partial one, where this was broken off), which goes. */
npg_status npg_frame_log_go_back(const char *output, int64_t below, int64_t *lines, int64_t *bytes);

/* Lines so far and their bytes. */
void npg_frame_log_size(const npg_frame_log *list, int64_t *lines, int64_t *bytes);

/* Append one line for a frame.  file: its mesh relative to OUT, NULL if it has none. */
npg_status npg_frame_log_add(npg_frame_log *list, const npg_frame *frame, const char *output,
                             const char *file);

/* Write OUT/frames.jsonl in the order of the indices; the partial one stays until the run is done.  Frames
 * that the reference does not explain (facts->changed_at) are marked. */
npg_status npg_frame_log_finish(npg_frame_log *list, const npg_facts *facts);

/* The partial file stays when finish has not been called.  NULL is fine. */
void npg_frame_log_close(npg_frame_log **list);

/* {"bytes": n, "xxh3": "16 hex digits"} added to entry for the file OUT/<file>. */
npg_status npg_file_facts(json_t *entry, const char *output, const char *file);

/* NPG_BAD_INPUT when OUT/<file> is not the file that entry ({"bytes", "xxh3"}) tells of. */
npg_status npg_file_check(const json_t *entry, const char *output, const char *file);

/* OUT/done.json: version, status, settings, and every file of the run, with has_forms those that
 * OUT/exports.jsonl lists too; the partial list of frames goes.  head is consumed. */
npg_status npg_done_write(const char *output, json_t *head, bool has_forms);

#endif
