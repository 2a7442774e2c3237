/* Order: what qsort() and bsearch() ask. */
#ifndef NPG_ORDER_H
#define NPG_ORDER_H

#include <stdint.h>

/* Ascending int64_t. */
static inline int npg_order_int64(const void *left, const void *right)
{
    int64_t a = *(const int64_t *)left, b = *(const int64_t *)right;
    return (a > b) - (a < b);
}

/* Pairs of uint32_t, ascending by the first, then by the second. */
static inline int npg_order_pair(const void *left, const void *right)
{
    const uint32_t *a = left, *b = right;
    if (a[0] != b[0]) return a[0] < b[0] ? -1 : 1;
    return (a[1] > b[1]) - (a[1] < b[1]);
}

/* Ascending float.  Values without an order (NaN) equal all. */
static inline int npg_order_float(const void *left, const void *right)
{
    float a = *(const float *)left, b = *(const float *)right;
    return (a > b) - (a < b);
}

/* Ascending double; NaN as above. */
static inline int npg_order_double(const void *left, const void *right)
{
    double a = *(const double *)left, b = *(const double *)right;
    return (a > b) - (a < b);
}

#endif
