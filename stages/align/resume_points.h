/* Resume points: what stage align needs behind the last frame that a window waits for, until the state of that
 * window is written.  By then the stage is at work on later frames.  Any thread. */
#ifndef NPG_RESUME_POINTS_H
#define NPG_RESUME_POINTS_H

#include <pthread.h>

#include "pipeline/store.h"

/* Zeros are an empty list, once its lock is open. */
typedef struct npg_resume_points {
    pthread_mutex_t lock;
    struct npg_resume_point {
        int64_t read; /* frames of the plan that came before */
        unsigned char *bytes;
        size_t size;
    } * points; /* owned, with their bytes */
    size_t count, capacity;
} npg_resume_points;

void npg_resume_points_open(npg_resume_points *list);
void npg_resume_points_close(npg_resume_points *list);

/* Takes the bytes, also where it fails. */
npg_status npg_resume_points_add(npg_resume_points *list, int64_t read, unsigned char *bytes, size_t size);

/* The point behind `read` frames as a block of a state; those before it go.  NPG_FAILED: there is none. */
npg_status npg_resume_points_save(npg_resume_points *list, int64_t read, npg_store *out, const char *block);

#endif
