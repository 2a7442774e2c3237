/* Frame files: which files are the frames of a capture, in time order, gaps included.
 *
 * An input is one of
 *   a folder        all files of the ending that most of its files have; else its sub-folder points/,
 *                   point_clouds/ or its only one
 *   a pattern       frame_%04d.ply or frame_####.ply, also in a folder's name
 *   a shell glob    "scan_*.ply"
 *   a list file     one path per line, relative to the list or to the working folder; # begins a comment
 *   one file        a capture of one frame
 *   a rig           a rig.json, or a folder of depth images with their calibration (rig/rig.h);
 *                   npg_frame_files_open_any alone takes these
 * Names sort naturally (f2 before f10), a list file keeps its own order.  A frame's number comes from its
 * name; the step of the numbering is the largest that all numbers share, and what it leaves out is a gap. */
#ifndef NPG_FRAME_FILES_H
#define NPG_FRAME_FILES_H

#include "ingest/frame_select.h"
#include "ingest/rig/rig.h"

typedef struct npg_frame_slot {
    char *path; /* owned; NULL: a gap */
    int64_t number;
} npg_frame_slot;

typedef struct npg_frame_files {
    size_t count, gap_count; /* slots, and how many of them are gaps                              */
    npg_frame_slot *slots;   /* owned                                                             */
    size_t left_out;         /* files of a folder with another ending that could have been frames */
    bool is_numbered;        /* numbers come from the names, so gaps could be found               */
    npg_rig *rig;            /* whose frames these are; owned, or NULL for files                  */
} npg_frame_files;

/* finds_gaps false: frames follow each other whatever their numbers are.
 * NPG_BAD_INPUT: nothing there, nothing readable, a list with a path that is not there.  NPG_USAGE: a
 * selection that is malformed or chooses nothing.  NPG_MEMORY. */
npg_status npg_frame_files_open(npg_frame_files **list, const char *input, const char *selection,
                                bool finds_gaps);
/* The same for an input that may be a rig: paths are then those of each frame's first depth image. */
npg_status npg_frame_files_open_any(npg_frame_files **list, const char *input, const char *selection,
                                    bool finds_gaps, const npg_rig_settings *settings);

/* Read frame `slot`, which has a path: npg_read_cloud(), or npg_rig_read(). */
npg_status npg_frame_files_read(const npg_frame_files *list, size_t slot, npg_frame *frame,
                                npg_origin *origin);

/* npg_rig_compare() over the slots that have a path, of a list that has a rig. */
npg_status npg_frame_files_compare(const npg_frame_files *list, npg_rig_view *views);

/* Call visit for each file that the frame `slot` is made of; ends with the first status but NPG_OK. */
npg_status npg_frame_files_each(const npg_frame_files *list, size_t slot,
                                npg_status (*visit)(void *user, const char *path), void *user);

/* Refuse a list with a file that is not in the input's folder (of a pattern, list or file: the one it lies
 * in) after all links are followed.  NPG_BAD_INPUT names it; nothing has been opened then. */
npg_status npg_frame_files_confine(const npg_frame_files *list, const char *input);
void npg_frame_files_close(npg_frame_files **list);

/* The numbers of the gaps as text, "3, 7-9", ended by "..." where it does not fit. */
void npg_frame_files_gaps(char *text, size_t size, const npg_frame_files *list);

#endif
