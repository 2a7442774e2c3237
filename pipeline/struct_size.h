/* Structs that cross the public border begin with struct_size and grow only at their end. */
#ifndef NPG_STRUCT_SIZE_H
#define NPG_STRUCT_SIZE_H

#include <string.h>

#include "pipeline/status.h"

/* The size a struct had when `last` was its last member. */
#define NPG_SIZE_UP_TO(type, last) (offsetof(type, last) + sizeof(((type *)0)->last))

/* The size a caller's struct says it has.  NPG_USAGE for less than its first version had, or NULL. */
static inline npg_status npg_struct_size(size_t *size, const void *given, size_t least, const char *what)
{
    if (!given) return npg_error(NPG_USAGE, "%s is NULL", what);
    memcpy(size, given, sizeof *size);
    if (*size < least)
        return npg_error(NPG_USAGE, "%s has struct_size %zu, its first version has %zu", what, *size, least);
    return NPG_OK;
}

/* Copy a caller's struct of any version into `own` (own_size bytes): what his version does not have is zero,
 * what ours does not have is left out.  least: the size of the first version.
 * NPG_USAGE for less than that, or NULL. */
static inline npg_status npg_struct_take(void *own, size_t own_size, const void *given, size_t least,
                                         const char *what)
{
    size_t size = 0;
    NPG_TRY(npg_struct_size(&size, given, least, what));
    memset(own, 0, own_size);
    memcpy(own, given, size < own_size ? size : own_size);
    return NPG_OK;
}

/* Fill a caller's struct of any version from `own`; struct_size then says how much of it was filled. */
static inline npg_status npg_struct_give(void *given, const void *own, size_t own_size, size_t least,
                                         const char *what)
{
    size_t size = 0;
    NPG_TRY(npg_struct_size(&size, given, least, what));
    if (size > own_size) size = own_size;
    memcpy(given, own, size);
    memcpy(given, &size, sizeof size);
    return NPG_OK;
}

#endif
