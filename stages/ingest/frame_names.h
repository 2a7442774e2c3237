/* Frame names: natural order, and the frame number inside a file's name. */
#ifndef NPG_FRAME_NAMES_H
#define NPG_FRAME_NAMES_H

#include <stdbool.h>

#include "pipeline/status.h"

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

#endif
