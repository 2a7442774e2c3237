/* Cube set: sorted keys. */
#include "geometry/cube_set.h"

#include <math.h>
#include <stdlib.h>

#include "pipeline/memory.h"
#include "pipeline/order.h"

#define BITS 21 /* of a key, per axis */

struct npg_cube_set {
    double side;
    size_t count;
    uint64_t *keys; /* growing; owned */
};

static uint64_t key_of(const double at[3])
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++) {
        double i = fmin(fmax(at[a] + (1 << (BITS - 1)), 0), (1 << BITS) - 1);
        key = key << BITS | (uint64_t)i;
    }
    return key;
}

npg_status npg_cube_set_open(npg_cube_set **out, const float *middles, size_t count, double side)
{
    npg_cube_set *s;
    *out = NULL;
    NPG_REQUIRE(side > 0);
    NPG_TRY(npg_alloc(&s, NPG_FOR_MESH, sizeof *s));
    s->side = side;
    npg_status status = npg_alloc_array(&s->keys, NPG_FOR_MESH, count, sizeof *s->keys);
    for (; s->count < count && !status; s->count++) {
        double at[3];
        for (int a = 0; a < 3; a++) at[a] = floor((double)middles[3 * s->count + (size_t)a] / side);
        s->keys[s->count] = key_of(at);
    }
    if (!status && count) qsort(s->keys, count, sizeof *s->keys, npg_order_uint64);
    if (status) npg_cube_set_close(&s);
    *out = s;
    return status;
}

void npg_cube_set_close(npg_cube_set **set)
{
    if (!set || !*set) return;
    npg_release(&(*set)->keys);
    npg_release(set);
}

double npg_cube_set_side(const npg_cube_set *set)
{
    return set->side;
}

double npg_cube_set_value(const npg_cube_set *s, const float place[3])
{
    double first[3], share[3], sum = 0;
    for (int a = 0; a < 3; a++) {
        double x = (double)place[a] / s->side - 0.5;
        first[a] = floor(x);
        share[a] = x - first[a];
    }
    for (int corner = 0; corner < 8 && s->count; corner++) {
        double at[3], weight = 1;
        for (int a = 0; a < 3; a++) {
            int upper = corner >> a & 1;
            at[a] = first[a] + upper;
            weight *= upper ? share[a] : 1 - share[a];
        }
        uint64_t key = key_of(at);
        if (weight > 0 && bsearch(&key, s->keys, s->count, sizeof key, npg_order_uint64)) sum += weight;
    }
    return sum;
}
