#ifndef NPG_INGEST_FRAME_FILES_H
#define NPG_INGEST_FRAME_FILES_H

#include <stdbool.h>

#include "ingest/rig/rig.h"
#include "pipeline/options.h"
#include "pipeline/status.h"

/* Frame selection: the text of --frames.
 *
 *   "a:b:step"  positions in time as Python slices them: from a up to but without b, negative ones from the
 *               end, every part may be left out; step >= 1
 *   "1-5,8"     the numbers in the files' names, both ends included
 *   ""          everything */

typedef struct npg_selection {
    bool is_slice, has_first, has_end;
    int64_t first, end, step; /* slice                                          */
    size_t range_count;       /* numbers; 0 and no slice: everything            */
    int64_t (*ranges)[2];     /* both ends included, ascending and apart; owned */
} npg_selection;

/* NPG_USAGE says what is wrong with the text.  Clear it after success. */
npg_status npg_selection_parse(npg_selection *selection, const char *text);
void npg_selection_clear(npg_selection *selection);

/* Whether the frame at a position of `count` with a number is chosen; count < 0: not known, and then a slice
 * must not count from the end (npg_selection_needs_count). */
bool npg_selection_takes(const npg_selection *selection, int64_t position, int64_t number, int64_t count);
bool npg_selection_needs_count(const npg_selection *selection);

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

/* Frame names: natural order, and the frame number inside a file's name. */

/* Compares as people count: runs of digits by their value ("f2" before "f10").  Names that differ only in
 * leading zeros are equal. */
int npg_natural_compare(const char *a, const char *b);

/* The number of every path: the last run of digits (the ending aside) that grows from each
 * path to the next.  *is_numbered is false where there is none; the numbers are then 0, 1, 2 ...
 * One path alone is numbered by the last run of its file name.  is_sorted: NPG_BAD_INPUT when two neighbours
 * differ only in leading zeros. */
npg_status npg_number_paths(int64_t *numbers, bool *is_numbered, char *const *paths, size_t count,
                            bool is_sorted);

/* The value of the run of digits that stands `from_end` runs before the last one of a name, its ending aside;
 * -1 where there is none or it is too long for a number. */
int64_t npg_name_number(const char *name, size_t from_end);

/* The largest number that divides both, for the step of a numbering; the other one when one is 0. */
int64_t npg_common_divisor(int64_t a, int64_t b);

/* Input list: the frames that the options of a run name, those of files or of a rig (ingest.c). */

/* The files that the options of a run (input, frames, missing, confine, those of rigs) name as its frames; of
 * a rig the description is read, else nothing.  As npg_frame_files_open_any() and, with confine,
 * npg_frame_files_confine(). */
npg_status npg_capture_list(npg_frame_files **list, const npg_options *options);

/* The same with another selection than option frames says, and with the gaps of that selection. */
npg_status npg_capture_select(npg_frame_files **list, const npg_options *options, const char *selection);

/* Frame inputs: the files that a folder, pattern, glob, list or single path stands for. */

typedef struct npg_paths {
    char **paths;     /* each owned */
    int64_t *numbers; /* owned; NULL unless the input itself says the numbers (a pattern) */
    size_t count, capacity, number_capacity;
    size_t left_out; /* see npg_frame_files                     */
    bool is_listed;  /* in the order of a list file, not sorted */
} npg_paths;

/* In time order, at least one.  See npg_frame_files_open. */
npg_status npg_paths_find(npg_paths *out, const char *input);
void npg_paths_clear(npg_paths *paths);

#endif
