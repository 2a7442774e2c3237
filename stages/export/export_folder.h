/* Export folder: the folder of the results and its last file.
 *
 *     OUT/meshes/<prefix>_<number>.ply|obj   one file per frame
 *     OUT/reference.ply                      the reference mesh
 *     OUT/frames.jsonl                       one line per frame, in the order of time
 *     OUT/frames.partial.jsonl               the frame log while the run is at work (job/frame_log.h)
 *     OUT/exports.jsonl and what it lists     other forms (forms.h)
 *     OUT/report.json                        the run's report
 *     OUT/done.json                          last of all: what was made, with sizes and checksums */
#ifndef NPG_EXPORT_FOLDER_H
#define NPG_EXPORT_FOLDER_H

#include "pipeline/stage.h"

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

/* Remove what an earlier run left: done.json first, so that what remains can't pass for a whole result, then
 * its other files and the mesh files (<word>_<digits>.ply or .obj).  Files that no run makes stay. */
npg_status npg_folder_clear(const char *output);

/* NPG_DISK when fewer bytes than these are free where OUT lies, with those of the earlier mesh files in OUT
 * that will be removed. */
npg_status npg_folder_has_room(const char *output, uint64_t bytes);

/* NPG_USAGE when OUT/meshes holds mesh files that this run would not write over: their numbering would mix
 * with the run's.  numbers: the frames' numbers, sorted; with none every mesh file is in the way. */
npg_status npg_folder_check(const char *output, const npg_mesh_names *names, const int64_t *numbers,
                            size_t number_count);

/* ---- the last file ---- */

/* OUT/done.json: version, status, settings, and every file of the run, with has_forms those that
 * OUT/exports.jsonl lists too; the frame log goes.  head is consumed. */
npg_status npg_done_write(const char *output, json_t *head, bool has_forms);

#endif
