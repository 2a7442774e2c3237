/* The word that a mistyped one was meant to be. */
#ifndef NPG_NEAREST_H
#define NPG_NEAREST_H

#include <stddef.h>

typedef struct npg_nearest {
    const char *wanted, *word; /* word: the nearest so far, NULL: none is near; loans */
    size_t edits;              /* that are too many                                  */
} npg_nearest;

npg_nearest npg_nearest_to(const char *wanted);

/* One more word that could have been meant. */
void npg_nearest_offer(npg_nearest *nearest, const char *word);

#endif
