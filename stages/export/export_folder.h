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

#include "export/export.h"
#include "pipeline/stage.h"

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
