/* Folder: listing and removing. */
#include "pipeline/file.h"

#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <string.h>

enum { WALK_FDS = 16 }; /* folders that nftw() keeps open at a time */

npg_status npg_folder_each(const char *folder, npg_status failure,
                           npg_status (*visit)(void *user, const char *name), void *user)
{
    npg_status status = NPG_OK;
    DIR *listing = opendir(folder);
    if (!listing && errno == ENOENT && failure == NPG_DISK) return NPG_OK;
    if (!listing) return npg_error_errno(failure, "can't list %s", folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));)
        if (strcmp(entry->d_name, ".") != 0 && strcmp(entry->d_name, "..") != 0)
            status = visit(user, entry->d_name);
    closedir(listing);
    return status;
}

/* nftw() hands no pointer through: what a removal came to.  NPG_OK, or the first failure. */
static _Thread_local npg_status removed;

static int remove_entry(const char *path, const struct stat *info, int kind, struct FTW *walk)
{
    (void)info, (void)kind, (void)walk;
    if (remove(path) && errno != ENOENT && !removed)
        removed = npg_error_errno(NPG_DISK, "can't remove %s", path);
    return 0;
}

npg_status npg_folder_remove(const char *path)
{
    removed = NPG_OK;
    if (nftw(path, remove_entry, WALK_FDS, FTW_DEPTH | FTW_PHYS) && errno != ENOENT && !removed)
        removed = npg_error_errno(NPG_DISK, "can't remove %s", path);
    return removed;
}
