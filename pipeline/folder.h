/* Folder: what is done with whole folders. */
#ifndef NPG_FOLDER_H
#define NPG_FOLDER_H

#include <stddef.h>
#include <stdint.h>

#include "pipeline/status.h"

/* The numbers N of the files "<prefix>N.<extension>" in a folder, ascending; *numbers is to be given to
 * npg_release(), NULL where there are none, nor a folder.  NPG_DISK when it can't be listed. */
npg_status npg_folder_numbers(int64_t **numbers, size_t *count, const char *folder, const char *prefix,
                              const char *extension);

/* Remove a file, or a folder with all that is in it; links are removed, not followed.  What is not there is
 * no failure; what can't be removed does not keep the rest, and NPG_DISK names the first. */
npg_status npg_folder_remove(const char *path);

#endif
