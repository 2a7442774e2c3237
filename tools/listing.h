/* Listing: files of a folder in natural order, for the verbs that take folders of meshes or clouds. */
#ifndef NPG_LISTING_H
#define NPG_LISTING_H

#include <stdbool.h>

#include "ingest/ingest.h"

typedef struct npg_listing {
    char **paths; /* count of them, owned */
    size_t count, room;
} npg_listing;

/* Add a file, or the files of a folder whose names end in one of `endings` (".ply .obj"), numbers in names
 * compared as numbers.  NPG_BAD_INPUT when the path does not exist or the folder has no such file. */
npg_status npg_listing_add(npg_listing *listing, const char *path, const char *endings);
void npg_listing_close(npg_listing *listing);

/* Keep the entries at the selected positions; a number in the selection is a position too, counted from 0. */
void npg_listing_keep(npg_listing *listing, const npg_selection *selection);

/* Where `folder` has a sub-folder of one of `names` ("truth gt"), that one's path, else the folder's own;
 * to be given to npg_release(). */
npg_status npg_subfolder(char **out, const char *folder, const char *names);

#endif
