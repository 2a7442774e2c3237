/* Folder: listing and removing. */
#include "pipeline/file.h"

#include <dirent.h>
#include <errno.h>
#include <ftw.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/memory.h"
#include "pipeline/order.h"

enum { WALK_FDS = 16 }; /* folders that nftw() keeps open at a time */

/* The number between prefix and extension; false for any other name. */
static bool number_in(const char *name, const char *prefix, const char *extension, int64_t *number)
{
    size_t length = strlen(prefix);
    char *end;
    if (strncmp(name, prefix, length) != 0 || name[length] < '0' || name[length] > '9') return false;
    errno = 0;
    *number = strtoll(name + length, &end, 10);
    return !errno && *end == '.' && !strcmp(end + 1, extension);
}

npg_status npg_folder_numbers(int64_t **numbers, size_t *count, const char *folder, const char *prefix,
                              const char *extension)
{
    npg_status status = NPG_OK;
    size_t capacity = 0;
    int64_t number;
    *numbers = NULL;
    *count = 0;
    DIR *listing = opendir(folder);
    if (!listing && errno == ENOENT) return NPG_OK;
    if (!listing) return npg_error_errno(NPG_DISK, "can't list %s", folder);
    for (struct dirent *entry; !status && (entry = readdir(listing));) {
        if (!number_in(entry->d_name, prefix, extension, &number)) continue;
        status = npg_grow(numbers, &capacity, *count + 1, sizeof **numbers, NPG_FOR_FILES);
        if (!status) (*numbers)[(*count)++] = number;
    }
    closedir(listing);
    if (status)
        npg_release(numbers);
    else if (*count)
        qsort(*numbers, *count, sizeof **numbers, npg_order_int64);
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
