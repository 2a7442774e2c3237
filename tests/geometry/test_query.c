/* Query: closest points and rays against every face tried in turn. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"

#define SIDE  24
#define VERTS ((SIDE + 1) * (SIDE + 1))
#define FACES (2 * SIDE * SIDE)
#define ASKED 2000

static float vert_pos[3 * VERTS], points[3 * ASKED];
static uint32_t faces[3 * FACES];

static float random_unit(uint32_t *state) /* -1 .. 1 */
{
    *state = *state * 1664525u + 1013904223u;
    return (float)(*state >> 8) / 8388608.0f - 1;
}

static void make_sheet(float height)
{
    for (int y = 0, i = 0; y <= SIDE; y++)
        for (int x = 0; x <= SIDE; x++, i++) {
            float u = (float)x / SIDE * 2 - 1, v = (float)y / SIDE * 2 - 1;
            float p[3] = {u, v, height * sinf(5 * u) * cosf(4 * v)};
            memcpy(vert_pos + 3 * i, p, sizeof p);
        }
    for (uint32_t y = 0, f = 0; y < SIDE; y++)
        for (uint32_t x = 0; x < SIDE; x++) {
            uint32_t a = y * (SIDE + 1) + x, b = a + 1, c = a + SIDE + 1, d = c + 1;
            uint32_t two[6] = {a, b, d, a, d, c};
            memcpy(faces + 6 * f++, two, sizeof two);
        }
    uint32_t seed = 7;
    for (int i = 0; i < 3 * ASKED; i++) points[i] = 1.5f * random_unit(&seed);
}

/* An independent way to the closest point: a fine search over the weights, refined. */
static double dist_sq_by_search(uint32_t face, const float *p)
{
    double best = INFINITY, middle_b = 0.5, middle_c = 0.5, width = 0.5;
    for (int round = 0; round < 24; round++) {
        double at_b = middle_b, at_c = middle_c;
        for (int i = -4; i <= 4; i++)
            for (int j = -4; j <= 4; j++) {
                double b = fmax(0, fmin(1, middle_b + width * i / 4)),
                       c = fmax(0, fmin(1, middle_c + width * j / 4));
                if (b + c > 1) {
                    double over = (b + c - 1) / 2;
                    b = fmax(0, fmin(1, b - over));
                    c = 1 - b;
                }
                double sum = 0;
                for (int a = 0; a < 3; a++) {
                    double x = (1 - b - c) * (double)vert_pos[3 * faces[3 * face] + (uint32_t)a] +
                               b * (double)vert_pos[3 * faces[3 * face + 1] + (uint32_t)a] +
                               c * (double)vert_pos[3 * faces[3 * face + 2] + (uint32_t)a] - (double)p[a];
                    sum += x * x;
                }
                if (sum < best) {
                    best = sum;
                    at_b = b;
                    at_c = c;
                }
            }
        middle_b = at_b;
        middle_c = at_c;
        width *= 0.6;
    }
    return best;
}

static npg_surface_hit by_hand(const float *p)
{
    npg_surface_hit best = {UINT32_MAX, {0, 0, 0}, INFINITY}, hit;
    for (uint32_t f = 0; f < FACES; f++) {
        npg_face_closest(&hit, vert_pos, faces, f, p);
        if (hit.dist_sq < best.dist_sq) best = hit;
    }
    return best;
}

static void one_face_is_exact(void **state)
{
    (void)state;
    make_sheet(0.4f);
    for (int i = 0; i < 200; i++) {
        npg_surface_hit hit;
        uint32_t face = (uint32_t)(i * 37) % FACES;
        npg_face_closest(&hit, vert_pos, faces, face, points + 3 * i);
        double expected = dist_sq_by_search(face, points + 3 * i);
        assert_true(fabs((double)hit.dist_sq - expected) < 1e-5 * (expected + 1e-3));
        assert_true(fabsf(hit.weights[0] + hit.weights[1] + hit.weights[2] - 1) < 1e-5f);
    }
}

static void degenerate_faces_count_as_edges(void **state)
{
    (void)state;
    float line[9] = {0, 0, 0, 1, 0, 0, 2, 0, 0}, spot[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1}, p[3] = {1.5f, 2, 0};
    uint32_t face[3] = {0, 1, 2};
    npg_surface_hit hit;
    npg_face_closest(&hit, line, face, 0, p);
    assert_float_equal(hit.dist_sq, 4, 1e-6);
    npg_face_closest(&hit, spot, face, 0, p);
    assert_float_equal(hit.dist_sq, 0.25f + 1 + 1, 1e-6);
}

static void check_against_all(npg_surface *surface)
{
    static npg_surface_hit hits[ASKED], near[ASKED];
    static uint32_t start[ASKED];
    assert_int_equal(npg_surface_closest(surface, hits, points, ASKED), NPG_OK);
    for (int i = 0; i < ASKED; i++) {
        npg_surface_hit expected = by_hand(points + 3 * i);
        assert_int_equal(hits[i].face, expected.face);
        assert_memory_equal(&hits[i], &expected, sizeof expected);
        start[i] = i % 3 ? expected.face : (uint32_t)i; /* good hints, bad ones, out of range */
    }
    for (int threads = 1; threads <= 3; threads++) {
        memset(near, 0, sizeof near);
        assert_int_equal(npg_surface_closest_near(surface, near, points, ASKED, start, threads), NPG_OK);
        assert_memory_equal(near, hits, sizeof hits);
    }
}

static void closest_equals_all_faces_tried(void **state)
{
    (void)state;
    npg_surface *surface;
    make_sheet(0.4f);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_OK);
    check_against_all(surface);
    for (int i = 0; i < 3; i++) { /* moved far and refitted */
        make_sheet(0.1f + 0.5f * (float)i);
        for (int k = 0; k < VERTS; k++) vert_pos[3 * k] = 0.7f * vert_pos[3 * k] + 0.2f * (float)i;
        assert_int_equal(npg_surface_move(surface, vert_pos), NPG_OK);
        check_against_all(surface);
    }
    npg_surface_close(&surface);
    assert_null(surface);
}

/* Vertices of a flat grid as queries: up to six faces lie at distance 0, the lowest must win. */
static void ties_go_to_the_lowest_face(void **state)
{
    (void)state;
    npg_surface *surface;
    static npg_surface_hit hits[VERTS];
    make_sheet(0);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_OK);
    assert_int_equal(npg_surface_closest(surface, hits, vert_pos, VERTS), NPG_OK);
    for (uint32_t i = 0; i < VERTS; i++) {
        uint32_t lowest = 0;
        while (faces[3 * lowest] != i && faces[3 * lowest + 1] != i && faces[3 * lowest + 2] != i) lowest++;
        assert_int_equal(hits[i].face, lowest);
        assert_true(hits[i].dist_sq == 0);
    }
    npg_surface_close(&surface);
}

static void rays_meet_the_sheet(void **state)
{
    (void)state;
    npg_surface *surface;
    npg_ray rays[3] = {{{0.31f, 0.2f, 5}, {0, 0, -2}, 0, INFINITY},
                       {{0.31f, 0.2f, -5}, {0, 0, 1}, 0, INFINITY},
                       {{3, 3, 5}, {0, 0, -1}, 0, INFINITY}};
    npg_ray_hit hits[3];
    make_sheet(0);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_OK);
    assert_int_equal(npg_surface_rays(surface, hits, rays, 3, 0), NPG_OK);
    assert_float_equal(hits[0].t, 2.5f, 1e-5);
    assert_float_equal(hits[1].t, 5, 1e-5);
    assert_false(hits[0].is_back);
    assert_true(hits[1].is_back);
    assert_int_equal(hits[2].face, UINT32_MAX);
    for (int i = 0; i < 2; i++) {
        float x = 0;
        for (int k = 0; k < 3; k++)
            x += hits[i].weights[k] * vert_pos[3 * faces[3 * hits[i].face + (uint32_t)k]];
        assert_float_equal(x, 0.31f, 1e-5);
    }
    npg_surface_close(&surface);
}

static void misuse_is_refused(void **state)
{
    (void)state;
    npg_surface *surface;
    npg_surface_hit hit;
    make_sheet(0.3f);
    faces[7] = VERTS;
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "face 2"));
    make_sheet(0.3f);
    vert_pos[16] = NAN;
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "vertex 5"));
    make_sheet(0.3f);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, 0), NPG_USAGE);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_OK);
    float bad[3] = {0, NAN, 0};
    assert_int_equal(npg_surface_closest(surface, &hit, bad, 1), NPG_OK);
    assert_int_equal(hit.face, UINT32_MAX);
    assert_true(isinf(hit.dist_sq));
    npg_surface_close(&surface);
    npg_surface_close(&surface);
}

static void memory_is_counted_and_refusals_are_clean(void **state)
{
    (void)state;
    npg_surface *surface;
    make_sheet(0.3f);
    size_t before = npg_memory_used();
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_OK);
    assert_true(npg_memory_used() > sizeof vert_pos + sizeof faces + 10000);
    npg_surface_close(&surface);
    assert_int_equal(npg_memory_used(), before);
    int refused = 0;
    for (uint64_t n = 1;; n++) {
        npg_memory_fail_at(n, true);
        npg_status status = npg_surface_open(&surface, vert_pos, VERTS, faces, FACES);
        npg_memory_fail_at(0, false);
        npg_surface_close(&surface);
        assert_int_equal(npg_memory_used(), before);
        if (!status) break;
        assert_int_equal(status, NPG_MEMORY);
        refused++;
    }
    assert_true(refused >= 3);
    npg_memory_set_limit(before + sizeof vert_pos + sizeof faces + 2048);
    assert_int_equal(npg_surface_open(&surface, vert_pos, VERTS, faces, FACES), NPG_MEMORY);
    npg_memory_set_limit(0);
    assert_int_equal(npg_memory_used(), before);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(one_face_is_exact),
                                       cmocka_unit_test(degenerate_faces_count_as_edges),
                                       cmocka_unit_test(closest_equals_all_faces_tried),
                                       cmocka_unit_test(ties_go_to_the_lowest_face),
                                       cmocka_unit_test(rays_meet_the_sheet),
                                       cmocka_unit_test(misuse_is_refused),
                                       cmocka_unit_test(memory_is_counted_and_refusals_are_clean)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
