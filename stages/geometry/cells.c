/* Cells: keys of cubes, their table, and sets of cubes. */
#include "geometry/geometry.h"

#include <math.h>
#include <string.h>

#define COORDS_BITS 20  /* of a key, per axis         */
#define FULL        0.6 /* of a table's places, at most */

/* ---- keys ---- */

/* at: in cells; 0 is in the middle of the range. */
static uint64_t key_of(const double at[3], const float facing[3])
{
    uint64_t key = 0;
    for (int a = 0; a < 3; a++) {
        double i = fmin(fmax(at[a] + (1 << (COORDS_BITS - 1)), 0), (1 << COORDS_BITS) - 1);
        key = key << COORDS_BITS | (uint64_t)i;
    }
    for (int a = 0; a < 3; a++) key = key << 1 | (facing[a] < 0);
    return key;
}

uint64_t npg_cell_key(const float point[3], const float facing[3], double side)
{
    double at[3];
    for (int a = 0; a < 3; a++) at[a] = floor((double)point[a] / side);
    return key_of(at, facing);
}

uint64_t npg_cell_key_of_double(uint64_t key)
{
    const uint64_t mask = (UINT64_C(1) << COORDS_BITS) - 1, middle = UINT64_C(1) << (COORDS_BITS - 1);
    uint64_t out = 0;
    for (int a = 2; a >= 0; a--) {
        uint64_t at = key >> (3 + a * COORDS_BITS) & mask; /* counted from -middle */
        out = out << COORDS_BITS | ((at + middle) >> 1);
    }
    return out << 3 | (key & 7);
}

/* ---- a table ---- */

static int bits_for(size_t most)
{
    int bits = 4;
    while ((double)((size_t)1 << bits) * FULL < (double)most + 1) bits++;
    return bits;
}

npg_status npg_cell_table_open(npg_cell_table *t, size_t most)
{
    *t = (npg_cell_table){.most = most, .bits = bits_for(most), .arena.purpose = NPG_FOR_MESH};
    size_t places = (size_t)1 << t->bits;
    t->keys = npg_arena_take(&t->arena, most + 1, sizeof *t->keys);
    t->place = npg_arena_take(&t->arena, places, sizeof *t->place);
    if (t->place) memset(t->place, 0xff, places * sizeof *t->place);
    return npg_arena_status(&t->arena);
}

void npg_cell_table_close(npg_cell_table *t)
{
    npg_arena_release(&t->arena);
}

/* The key's place, or the empty one where it would be (Fibonacci hashing). */
static uint32_t *place_of(const npg_cell_table *t, uint64_t key)
{
    size_t mask = ((size_t)1 << t->bits) - 1;
    size_t at = (size_t)((key * UINT64_C(0x9e3779b97f4a7c15)) >> (64 - t->bits));
    while (t->place[at] != NPG_CELL_NONE && t->keys[t->place[at]] != key) at = (at + 1) & mask;
    return &t->place[at];
}

uint32_t npg_cell_find(const npg_cell_table *t, uint64_t key)
{
    return *place_of(t, key);
}

uint32_t npg_cell_add(npg_cell_table *t, uint64_t key)
{
    uint32_t *place = place_of(t, key);
    if (*place != NPG_CELL_NONE) return *place;
    t->keys[t->count] = key;
    return *place = (uint32_t)t->count++;
}

size_t npg_cell_table_memory(size_t most)
{
    return (most + 1) * sizeof(uint64_t) + ((size_t)1 << bits_for(most)) * sizeof(uint32_t);
}

/* ---- a set of cubes ---- */

struct npg_cube_set {
    npg_cell_table table;
    double side;
};

static const float any_side[3] = {0, 0, 0};

npg_status npg_cube_set_open(npg_cube_set **out, const float *middles, size_t count, double side)
{
    *out = NULL;
    NPG_REQUIRE(side > 0);
    NPG_TRY(npg_object_open(out, NPG_FOR_MESH, sizeof **out));
    npg_cube_set *s = *out;
    s->side = side;
    npg_status status = npg_cell_table_open(&s->table, count);
    for (size_t i = 0; i < count && !status; i++)
        npg_cell_add(&s->table, npg_cell_key(middles + 3 * i, any_side, side));
    if (status) npg_cube_set_close(out);
    return status;
}

void npg_cube_set_close(npg_cube_set **set)
{
    npg_object_close(set);
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
    for (int corner = 0; corner < 8; corner++) {
        double at[3], weight = 1;
        for (int a = 0; a < 3; a++) {
            int upper = corner >> a & 1;
            at[a] = first[a] + upper;
            weight *= upper ? share[a] : 1 - share[a];
        }
        if (weight > 0 && npg_cell_find(&s->table, key_of(at, any_side)) != NPG_CELL_NONE) sum += weight;
    }
    return sum;
}
