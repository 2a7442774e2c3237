/* Votes: a strip before a sensor that sees one half of it; frames speak for one half, and against the other. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fuse/fuse_internal.h"

/* The sensor at (0, 0, -4) looks along z, its cells are 0.04 wide at z = 0.  It sees a square with |x|, |y| < 1,
 * and nothing around.  The strip is along x, two rows of vertices 0.1 apart, from x = 0 to x = 3. */
enum { SIDE = 160, COLUMNS = 31, VERTS = 2 * COLUMNS };
#define SHARE 0.2

static float cells[SIDE * SIDE];

static npg_mesh *strip(void)
{
    npg_mesh *mesh;
    assert_int_equal(npg_mesh_open(&mesh, VERTS, 2 * (COLUMNS - 1)), NPG_OK);
    for (size_t v = 0; v < VERTS; v++) {
        const float place[3] = {0.1f * (float)(v / 2), 0.1f * (float)(v % 2), 0};
        memcpy(mesh->vert_pos + 3 * v, place, sizeof place);
    }
    for (uint32_t c = 0; c + 1 < COLUMNS; c++) {
        const uint32_t faces[6] = {2 * c, 2 * c + 1, 2 * c + 2, 2 * c + 2, 2 * c + 1, 2 * c + 3};
        memcpy(mesh->faces + 6 * c, faces, sizeof faces);
    }
    return mesh;
}

/* A frame in which the strip is `stretch` times as long, and at z. */
static void vote(npg_votes *votes, const npg_mesh *mesh, float stretch, float z)
{
    static const npg_frame_box box = {.scale = 1};
    npg_depth_view view = {.to_sensor = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 4},
                           .first = {-0.8, -0.8},
                           .step = 0.01,
                           .width = SIDE,
                           .height = SIDE};
    const npg_frame frame = {
        .sensor_count = 1, .views = &view, .view_cells = cells, .view_cell_count = SIDE * SIDE};
    float now[3 * VERTS];
    npg_free_space *space;
    for (int i = 0; i < SIDE * SIDE; i++)
        cells[i] = abs(i % SIDE - SIDE / 2) < 25 && abs(i / SIDE - SIDE / 2) < 25 ? 4 : INFINITY;
    for (size_t v = 0; v < VERTS; v++) {
        const float place[3] = {mesh->vert_pos[3 * v] * stretch, mesh->vert_pos[3 * v + 1], z};
        memcpy(now + 3 * v, place, sizeof place);
    }
    assert_int_equal(npg_free_space_open(&space, &frame, &box), NPG_OK);
    npg_votes_cast(votes, space, now);
    npg_free_space_close(&space);
}

/* Columns of the strip that are contradicted, from its far end on; the near ones are not. */
static int contradicted(const npg_votes *votes)
{
    uint8_t against[VERTS];
    int first = COLUMNS;
    assert_int_equal(npg_votes_count(votes, against, SHARE), NPG_OK);
    while (first && against[2 * (first - 1)] && against[2 * (first - 1) + 1]) first--;
    for (int c = 0; c < first; c++) assert_false(against[2 * c] && against[2 * c + 1]);
    return COLUMNS - first;
}

static void more_than_the_share_of_frames_contradict(void **state)
{
    (void)state;
    npg_votes *votes;
    npg_mesh *mesh = strip();
    assert_int_equal(npg_votes_open(&votes, mesh), NPG_OK);
    assert_int_equal(contradicted(votes), 0); /* nobody has said anything */
    vote(votes, mesh, 1, 0);
    int beside = contradicted(votes); /* clearly, from x = 1.1 on */
    assert_in_range(beside, 18, 20);
    for (int i = 0; i < 3; i++) vote(votes, mesh, 0.3f, 0);
    assert_in_range(contradicted(votes), beside - 2, beside); /* one of four, those near its border fewer */
    for (int i = 0; i < 2; i++) vote(votes, mesh, 0.3f, 0);
    assert_int_equal(contradicted(votes), 0); /* one of six */
    for (int i = 0; i < 3; i++) vote(votes, mesh, 0.3f, 2);
    assert_int_equal(contradicted(votes), 0); /* hidden: they say nothing */
    for (int i = 0; i < 2; i++) vote(votes, mesh, 0.3f, -1);
    assert_int_equal(contradicted(votes),
                     COLUMNS); /* all of it before what was seen, in two of seven or eight */
    npg_votes_close(&votes);
    npg_mesh_unref(&mesh);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(more_than_the_share_of_frames_contradict),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
