/* Visible: of a ball with a small one before it, what faces a sensor and is not behind the small one; two
 * sensors see more than one; one that is nowhere sees nothing; without any all is taken to be seen. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/support/ball_mesh.h"
#include "track/track.h"

#define RADIUS 0.5f /* of the ball */

enum { RINGS = 20, SPOKES = 30, VERTS = RINGS * SPOKES + 2 };

typedef struct scene {
    npg_mesh *ball;
    float verts[2 * 3 * VERTS], normals[2 * 3 * VERTS]; /* the ball's, then those of a small one above it */
    uint32_t *faces, order[2 * VERTS];
    npg_surface *surface;
    npg_arena arena; /* of visible */
    npg_visible visible;
    uint8_t is_seen[2 * VERTS];
} scene;

static void open_scene(scene *s)
{
    s->ball = ball_mesh(RINGS, SPOKES);
    size_t f = s->ball->face_count;
    assert_int_equal(s->ball->vert_count, VERTS);
    s->faces = malloc(6 * f * sizeof *s->faces);
    for (size_t i = 0; i < 2 * VERTS; i++) s->order[i] = (uint32_t)i;
    for (size_t i = 0; i < 3 * VERTS; i++) {
        float at = s->ball->vert_pos[i];
        s->verts[i] = at;
        s->verts[3 * VERTS + i] = 0.2f * at + (i % 3 == 2 ? 2 * RADIUS : 0.0f);
    }
    for (size_t i = 0; i < 3 * VERTS; i++)
        s->normals[i] = s->normals[3 * VERTS + i] = s->ball->vert_normals[i];
    for (size_t i = 0; i < 3 * f; i++) {
        s->faces[i] = s->ball->faces[i];
        s->faces[3 * f + i] = s->ball->faces[i] + VERTS;
    }
    assert_int_equal(npg_surface_open(&s->surface, s->verts, 2 * VERTS, s->faces, 2 * f), NPG_OK);
    s->arena.purpose = NPG_FOR_RUN;
    npg_visible_open(&s->visible, &s->arena, 2 * VERTS);
    assert_int_equal(npg_arena_status(&s->arena), NPG_OK);
}

static void close_scene(scene *s)
{
    npg_arena_release(&s->arena);
    npg_surface_close(&s->surface);
    npg_mesh_unref(&s->ball);
    free(s->faces);
}

static void look(scene *s, const float *sensors, size_t count)
{
    assert_int_equal(npg_visible_find(&s->visible, s->is_seen, s->surface, sensors, count, s->verts, s->order,
                                      s->normals, 2 * VERTS, 0.01),
                     NPG_OK);
}

/* Seen of the large ball: above and below its middle, in its upper cap behind the small one, beside it. */
typedef struct seen {
    int above, below, behind, all_above, all_below, all_behind;
} seen;

static seen count_seen(const scene *s)
{
    seen n = {0};
    for (size_t v = 0; v < VERTS; v++) {
        const float *at = s->verts + 3 * v;
        float beside = sqrtf(at[0] * at[0] + at[1] * at[1]);
        if (at[2] > 0 && beside < 0.15f * RADIUS) {
            n.all_behind++;
            n.behind += s->is_seen[v];
        } else if (at[2] > 0.4f * RADIUS && beside > 0.35f * RADIUS) {
            n.all_above++;
            n.above += s->is_seen[v];
        } else if (at[2] < 0) {
            n.all_below++;
            n.below += s->is_seen[v];
        }
    }
    return n;
}

static void what_faces_a_sensor_and_is_not_hidden_is_seen(void **state)
{
    static const float sensors[6] = {0, 0, 40, 0, 0, -40};
    static scene s;
    (void)state;
    open_scene(&s);
    look(&s, sensors, 1);
    seen one = count_seen(&s);
    assert_true(one.all_above > 50 && one.all_below > 50 && one.all_behind > 0);
    assert_int_equal(one.above, one.all_above);
    assert_int_equal(one.below, 0);
    assert_int_equal(one.behind, 0);
    look(&s, sensors, 2);
    seen two = count_seen(&s);
    assert_int_equal(two.above, two.all_above);
    assert_true(two.below > two.all_below * 3 / 4);
    assert_int_equal(two.behind, 0);
    close_scene(&s);
}

static void a_sensor_that_is_nowhere_sees_nothing_and_without_any_all_is_seen(void **state)
{
    const float nowhere[3] = {NAN, NAN, NAN};
    static scene s;
    (void)state;
    open_scene(&s);
    look(&s, nowhere, 1);
    for (size_t i = 0; i < 2 * VERTS; i++) assert_int_equal(s.is_seen[i], 0);
    look(&s, NULL, 0);
    for (size_t i = 0; i < 2 * VERTS; i++) assert_int_equal(s.is_seen[i], 1);
    close_scene(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_faces_a_sensor_and_is_not_hidden_is_seen),
        cmocka_unit_test(a_sensor_that_is_nowhere_sees_nothing_and_without_any_all_is_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
