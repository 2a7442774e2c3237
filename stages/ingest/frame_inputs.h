/* Frame inputs: the files that a folder, pattern, glob, list or single path stands for. */
#ifndef NPG_FRAME_INPUTS_H
#define NPG_FRAME_INPUTS_H

#include <stdbool.h>

#include "pipeline/status.h"

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
