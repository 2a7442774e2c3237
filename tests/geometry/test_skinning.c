/* Skinning: points near a moved surface are where they belong when it is at rest. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "geometry/geometry.h"
#include "tests/support/ball_mesh.h"
#include "tests/support/shapes.h"

enum { POINTS = 3000 };

typedef struct cloud {
    float points[3 * POINTS], normals[3 * POINTS];
} cloud;

static void assert_near(const float *got, const float *wanted, float by)
{
    for (int a = 0; a < 3; a++)
        if (!(fabsf(got[a] - wanted[a]) < by))
            fail_msg("%g, not %g, on axis %d", (double)got[a], (double)wanted[a], a);
}

static float length_of(const float *v)
{
    return sqrtf(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static float dot(const float *a, const float *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static npg_skin *carrying(npg_mesh *mesh, const float *moved)
{
    npg_skin *carry;
    assert_int_equal(npg_skin_open(&carry, mesh), NPG_OK);
    npg_skin_pose(carry, moved);
    return carry;
}

static float *alloc_like(const npg_mesh *mesh)
{
    float *out;
    assert_int_equal(npg_alloc_array(&out, NPG_FOR_RUN, mesh->vert_count, 3 * sizeof(float)), NPG_OK);
    return out;
}

/* ---- a rigid motion ---- */

static const double turn[9] = {0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6}; /* a rotation */
static const double way[3] = {0.3, -0.2, 0.7};

static void move_rigidly(float *out, const float *in, size_t count, double share_of_way)
{
    for (size_t i = 0; i < count; i++)
        for (size_t a = 0; a < 3; a++) {
            double sum = share_of_way * way[a];
            for (size_t b = 0; b < 3; b++) sum += turn[3 * a + b] * (double)in[3 * i + b];
            out[3 * i + a] = (float)sum;
        }
}

/* Vertices pushed along their normals, in or out, and aside; normals of any direction. */
static void scatter(cloud *c, const npg_mesh *mesh)
{
    shape_random random = {3};
    static float unused[3 * POINTS];
    shape_sphere(unused, c->normals, POINTS, 1, &random);
    for (size_t i = 0; i < POINTS; i++) {
        size_t v = i * 7919 % mesh->vert_count;
        float out = (float)(0.06 * shape_uniform(&random) - 0.03);
        for (size_t a = 0; a < 3; a++)
            c->points[3 * i + a] = mesh->vert_pos[3 * v + a] + out * mesh->vert_normals[3 * v + a] +
                                   (float)(0.02 * shape_uniform(&random));
    }
}

static void a_rigid_motion_is_undone(void **state)
{
    static cloud rest, now;
    static npg_skinned carried[POINTS];
    npg_mesh *ball = ball_mesh(30, 40);
    float *moved = alloc_like(ball);
    (void)state;
    move_rigidly(moved, ball->vert_pos, ball->vert_count, 1);
    scatter(&rest, ball);
    move_rigidly(now.points, rest.points, POINTS, 1);
    move_rigidly(now.normals, rest.normals, POINTS, 0);
    npg_skin *carry = carrying(ball, moved);
    assert_int_equal(npg_skin_to_rest(carry, carried, now.points, now.normals, POINTS), NPG_OK);
    for (size_t i = 0; i < POINTS; i++) {
        const npg_skinned *p = &carried[i];
        const float *x = rest.points + 3 * i;
        const float away[3] = {x[0] - p->foot[0], x[1] - p->foot[1], x[2] - p->foot[2]};
        assert_near(p->point, x, 1e-4f);
        assert_near(p->normal, rest.normals + 3 * i, 1e-4f);
        assert_true(fabsf(p->dist - length_of(away)) < 1e-4f);
        assert_true(fabsf(p->offset - dot(away, p->facing)) < 1e-4f);
        assert_true(fabsf(p->agreement - dot(rest.normals + 3 * i, p->facing)) < 1e-3f);
    }
    npg_skin_close(&carry);
    assert_null(carry);
    npg_release(&moved);
    npg_mesh_unref(&ball);
}

static void points_without_normals_get_the_surface_s(void **state)
{
    static cloud rest;
    static npg_skinned carried[POINTS];
    npg_mesh *ball = ball_mesh(30, 40);
    (void)state;
    scatter(&rest, ball);
    npg_skin *carry = carrying(ball, ball->vert_pos);
    assert_int_equal(npg_skin_to_rest(carry, carried, rest.points, NULL, POINTS), NPG_OK);
    for (size_t i = 0; i < POINTS; i++) {
        assert_true(fabsf(length_of(carried[i].facing) - 1) < 1e-5f);
        assert_memory_equal(carried[i].normal, carried[i].facing, sizeof carried[i].facing);
        assert_true(carried[i].agreement == 1);
    }
    npg_skin_close(&carry);
    npg_mesh_unref(&ball);
}

/* ---- a bar that bends ---- */

#define RADIUS 0.1

/* Along z from -0.5 to 0.5, with caps. */
static npg_mesh *bar_mesh(uint32_t rings, uint32_t spokes)
{
    npg_mesh *mesh = ball_mesh(rings, spokes);
    for (size_t v = 0; v < mesh->vert_count; v++) {
        bool is_end = v >= mesh->vert_count - 2;
        double around = 2 * M_PI * (double)(v % spokes) / (double)spokes, radius = is_end ? 0 : RADIUS;
        double down = is_end ? (double)(v + 1 == mesh->vert_count) : (double)(v / spokes) / (rings - 1);
        shape_put(mesh->vert_pos + 3 * v, radius * cos(around), radius * sin(around), 0.5 - down);
    }
    npg_mesh_vertex_normals(mesh->vert_normals, mesh->vert_pos, mesh->vert_count, mesh->faces,
                            mesh->face_count);
    return mesh;
}

/* The axis becomes an arc of one radian. */
static void bend(float *out, const float *in, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        double angle = (double)in[3 * i + 2], arm = 1 - (double)in[3 * i];
        shape_put(out + 3 * i, 1 - arm * cos(angle), (double)in[3 * i + 1], arm * sin(angle));
    }
}

/* The same place in a face of both surfaces. */
static void on_both(float *rest, float *now, const npg_mesh *mesh, const float *bent, shape_random *random)
{
    const uint32_t *face = mesh->faces + 3 * (size_t)((double)mesh->face_count * shape_uniform(random));
    float u = (float)shape_uniform(random), w = (float)shape_uniform(random) * (1 - u);
    const float share[3] = {u, w, 1 - u - w};
    for (size_t a = 0; a < 3; a++) {
        rest[a] = now[a] = 0;
        for (size_t c = 0; c < 3; c++) {
            rest[a] += share[c] * mesh->vert_pos[3 * face[c] + a];
            now[a] += share[c] * bent[3 * face[c] + a];
        }
    }
}

static void points_on_a_bent_bar_come_back_to_the_bar(void **state)
{
    static cloud rest, now;
    static npg_skinned carried[POINTS];
    shape_random random = {9};
    npg_mesh *bar = bar_mesh(60, 40);
    float *bent = alloc_like(bar);
    (void)state;
    bend(bent, bar->vert_pos, bar->vert_count);
    for (size_t i = 0; i < POINTS; i++) on_both(rest.points + 3 * i, now.points + 3 * i, bar, bent, &random);
    npg_skin *carry = carrying(bar, bent);
    assert_int_equal(npg_skin_to_rest(carry, carried, now.points, NULL, POINTS), NPG_OK);
    for (size_t i = 0; i < POINTS; i++) {
        assert_near(carried[i].point, rest.points + 3 * i, 1e-4f);
        assert_near(carried[i].foot, rest.points + 3 * i, 1e-4f);
        assert_true(carried[i].dist < 1e-5f);
    }
    npg_skin_close(&carry);
    npg_release(&bent);
    npg_mesh_unref(&bar);
}

/* Straight out of the bent bar's side is straight out of the straight one's. */
static void points_off_a_bent_bar_keep_their_offset(void **state)
{
    static cloud rest, straight, now;
    static npg_skinned carried[POINTS];
    shape_random random = {11};
    npg_mesh *bar = bar_mesh(60, 40);
    float *bent = alloc_like(bar);
    (void)state;
    bend(bent, bar->vert_pos, bar->vert_count);
    for (size_t i = 0; i < POINTS; i++) {
        double around = 2 * M_PI * shape_uniform(&random),
               out = RADIUS + 0.04 * shape_uniform(&random) - 0.02;
        double along = 0.8 * shape_uniform(&random) - 0.4;
        shape_put(rest.normals + 3 * i, cos(around), sin(around), 0);
        shape_put(rest.points + 3 * i, out * cos(around), out * sin(around), along);
        shape_put(straight.points + 3 * i, (out + 1) * cos(around), (out + 1) * sin(around), along);
    }
    bend(now.points, rest.points, POINTS);
    bend(straight.normals, straight.points, POINTS);
    for (size_t i = 0; i < 3 * POINTS; i++) now.normals[i] = straight.normals[i] - now.points[i];
    npg_skin *carry = carrying(bar, bent);
    assert_int_equal(npg_skin_to_rest(carry, carried, now.points, now.normals, POINTS), NPG_OK);
    for (size_t i = 0; i < POINTS; i++) {
        float out = sqrtf(dot(rest.points + 3 * i, rest.points + 3 * i) -
                          rest.points[3 * i + 2] * rest.points[3 * i + 2]);
        assert_near(carried[i].point, rest.points + 3 * i, 2e-3f);
        assert_near(carried[i].normal, rest.normals + 3 * i, 0.05f);
        assert_true(fabsf(carried[i].offset - (out - (float)RADIUS)) < 1e-3f);
        assert_true(carried[i].agreement > 0.98f);
    }
    npg_skin_close(&carry);
    npg_release(&bent);
    npg_mesh_unref(&bar);
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_rigid_motion_is_undone),
        cmocka_unit_test(points_without_normals_get_the_surface_s),
        cmocka_unit_test(points_on_a_bent_bar_come_back_to_the_bar),
        cmocka_unit_test(points_off_a_bent_bar_keep_their_offset),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
