/* Follow: the frames of a folder that grows, in natural order, each as soon as its file is complete.
 *
 * A file is taken when its reader succeeds and it was the same in two scans a quarter of a second apart.  Where the numbers in the names
 * leave one out, up to NPG_FOLLOW_LATE later files wait for it; then it counts as missing.  A file that its
 * reader refuses, that a later one follows and that has not changed for settle_s is broken.  The source ends
 * when the end file is in the folder and every file has been taken, or when nothing changed for idle_s while
 * the run waited.  Time is the monotonic clock's: setting the system's clock changes nothing.
 *
 * Memory: the names of the files that are there and were not taken yet.  One thread. */
#ifndef NPG_FOLLOW_H
#define NPG_FOLLOW_H

#include "pipeline/chunk.h"
#include "pipeline/frame_box.h"

enum { NPG_FOLLOW_LATE = 8 }; /* set by trial */

typedef struct npg_follow_settings {
    const char *where;    /* a folder, or <folder>/<pattern of names>                  */
    bool confine;         /* a file that leads out of the folder is refused            */
    const char *end_name; /* a file of this name ends the source; "": none does        */
    double idle_s;        /* seconds without any change that end it; 0: none           */
    double settle_s;      /* seconds without a change after which a bad file stays bad */
    bool finds_gaps;      /* wait for numbers that are left out                        */
    bool (*stopping)(void *user);
    void *user;
} npg_follow_settings;

typedef struct npg_follow npg_follow;

/* NPG_BAD_INPUT: no such folder. */
npg_status npg_follow_open(npg_follow **follow, const npg_follow_settings *settings);
void npg_follow_close(npg_follow **follow);

/* Where an earlier run was: the next frame is one behind these in natural order. */
typedef struct npg_follow_place {
    const char *last; /* name of the file that was taken last                     */
    size_t digits;    /* npg_follow_digits() of the run                           */
    int64_t number;   /* of the last file, and by what the numbers grew until it  */
    int64_t step;
    size_t taken_count; /* files taken                                              */
} npg_follow_place;

/* Before the first frame.  NPG_MEMORY. */
npg_status npg_follow_resume(npg_follow *follow, const npg_follow_place *place);

/* Path of a file of the folder, to npg_release().  With confine, NPG_BAD_INPUT for one that leads out. */
npg_status npg_follow_path(const npg_follow *follow, char **path, const char *name);

/* Files that are there now and were not taken. */
npg_status npg_follow_count_new(npg_follow *follow, size_t *count);

/* Which run of digits in the names is the number, counted from the end. */
size_t npg_follow_digits(const npg_follow *follow);

/* The next frame into the empty *frame, with its number, waiting for it.  NPG_PARTIAL: its file is broken:
 * the frame has number and path but no points, and npg_error_text() says why.  NPG_END, NPG_STOPPED;
 * NPG_BAD_INPUT when the numbers in the names don't grow. */
npg_status npg_follow_next(npg_follow *follow, npg_frame *frame, npg_origin *origin);

/* By what the numbers grow from frame to frame, 0 while one frame came; it can only get smaller. */
int64_t npg_follow_step(const npg_follow *follow);

/* Files that were found after a later one had been taken, and are left out. */
size_t npg_follow_late_count(const npg_follow *follow);

#endif
