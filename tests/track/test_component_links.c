/* Component links: pieces hang on the nearest one, from their nearest nodes; what is one piece has none. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"
#include "pipeline/order.h"
#include "track/track_internal.h"

enum { NODES = 9 };

/* On a line: 0 to 3, then a gap, 4 to 6, a gap, 7, and 8 beyond it; 0 to 3 and 4 to 6 are pieces. */
static const float node_pos[3 * NODES] = {0, 0, 0, 1, 0, 0, 2, 0, 0, 3, 0,  0, 5, 0,
                                          0, 6, 0, 0, 7, 0, 0, 9, 0, 0, 12, 0, 0};
static const uint32_t edges[][2] = {{0, 1}, {1, 2}, {2, 3}, {4, 5}, {5, 6}};

static void pieces_hang_on_the_nearest(void **state)
{
    uint32_t(*links)[2];
    size_t count;
    (void)state;
    assert_int_equal(npg_component_links_find(&links, &count, node_pos, NODES, edges, 5), NPG_OK);
    static const uint32_t wanted[][2] = {{3, 4}, {3, 5}, {3, 6}, {6, 7}, {7, 8}};
    assert_int_equal(count, sizeof wanted / sizeof *wanted);
    assert_memory_equal(links, wanted, sizeof wanted);
    npg_release(&links);
}

static void one_piece_has_none(void **state)
{
    uint32_t(*links)[2];
    size_t count;
    (void)state;
    assert_int_equal(npg_component_links_find(&links, &count, node_pos, 4, edges, 3), NPG_OK);
    assert_int_equal(count, 0);
    assert_int_equal(npg_component_links_find(&links, &count, node_pos, 1, edges, 0), NPG_OK);
    assert_int_equal(count, 0);
    npg_release(&links);
}

/* Many scattered nodes without an edge: a tree joins them, in order, none twice. */
static void all_are_joined(void **state)
{
    enum { MANY = 300 };
    float pos[3 * MANY];
    uint32_t(*links)[2], set[MANY];
    size_t count;
    (void)state;
    for (uint32_t i = 0; i < 3 * MANY; i++) pos[i] = (float)((i * 7919U + 13U) % 1009U);
    assert_int_equal(npg_component_links_find(&links, &count, pos, MANY, NULL, 0), NPG_OK);
    assert_int_equal(count, MANY - 1);
    for (uint32_t k = 0; k < MANY; k++) set[k] = k;
    for (size_t i = 0; i < count; i++) {
        assert_true(links[i][0] < links[i][1]);
        assert_true(!i || npg_order_pair(links[i - 1], links[i]) < 0);
        npg_set_join(set, links[i][0], links[i][1]);
    }
    for (uint32_t k = 0; k < MANY; k++) assert_int_equal(npg_set_root(set, k), 0);
    npg_release(&links);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(pieces_hang_on_the_nearest),
                                       cmocka_unit_test(one_piece_has_none),
                                       cmocka_unit_test(all_are_joined)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
