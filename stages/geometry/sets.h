/* Sets: which things belong together, as a forest of parents (union-find).
 *
 * parent[i] = i makes i a set of its own.  The lowest member of a set is its root, so that the result does
 * not depend on the order of the joins. */
#ifndef NPG_SETS_H
#define NPG_SETS_H

#include <stdint.h>

/* The lowest member of i's set; the way there is shortened. */
static inline uint32_t npg_set_root(uint32_t *parent, uint32_t i)
{
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
}

static inline void npg_set_join(uint32_t *parent, uint32_t a, uint32_t b)
{
    a = npg_set_root(parent, a);
    b = npg_set_root(parent, b);
    parent[a > b ? a : b] = a > b ? b : a;
}

#endif
