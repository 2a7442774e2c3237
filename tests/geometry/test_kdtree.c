/* k-d tree: every search against looking at all points. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/memory.h"

#define MOST 5000

static float points[3 * MOST], queries[3 * 200], dist_sq[MOST * 40];
static uint32_t index_of[MOST * 40];

/* On a sphere, a tenth of them twice, some far away, some on one line. */
static void make_points(size_t count, float scale)
{
    for (size_t i = 0; i < count; i++) {
        float *p = points + 3 * i, u = (float)((i * 7919) % 1000) / 1000,
              v = (float)((i * 104729) % 1000) / 1000;
        p[0] = scale * cosf(6.28f * u) * sqrtf(v);
        p[1] = scale * sinf(6.28f * u) * sqrtf(v);
        p[2] = i % 5 ? scale * v : 0;
        if (i % 10 == 3) memcpy(p, p - 3, 3 * sizeof *p);
        if (i % 97 == 0) p[i % 3] += 20 * scale * (u - 0.5f);
    }
}

static float dist(const float *p, const float *q)
{
    float x = p[0] - q[0], y = p[1] - q[1], z = p[2] - q[2];
    return (x * x + y * y) + z * z;
}

/* The list of one query is what sorting all points by distance and index would give. */
static void expect_list(const float *q, const uint32_t *index, const float *sq, size_t count, size_t k,
                        const uint8_t *keep)
{
    size_t there = 0;
    for (size_t i = 0; i < count; i++) there += !keep || keep[i];
    for (size_t j = 0; j < k; j++) {
        size_t before = 0;
        if (j >= there) {
            assert_int_equal(index[j], UINT32_MAX);
            assert_true(isinf(sq[j]));
            continue;
        }
        assert_true(index[j] < count && (!keep || keep[index[j]]));
        assert_true(dist(q, points + 3 * (size_t)index[j]) == sq[j]);
        for (size_t i = 0; i < count; i++) {
            float d = dist(q, points + 3 * i);
            before += (!keep || keep[i]) && (d < sq[j] || (d == sq[j] && i < index[j]));
        }
        assert_int_equal(before, j);
    }
}

static void nearest_are_those_of_looking_at_all(void **state)
{
    (void)state;
    static const size_t counts[] = {1, 2, 15, 16, 17, 33, 300, MOST}, ks[] = {1, 2, 13, 40};
    static const float scales[] = {1, 1e-20f, 1e9f};
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++)
        for (size_t k = 0; k < 4; k++) {
            npg_kdtree *tree;
            size_t count = counts[c];
            float scale = scales[(c + k) % 3];
            make_points(count, scale);
            for (size_t i = 0; i < 3 * 200; i++) queries[i] = scale * 0.01f * (float)((i * 37) % 300) - scale;
            assert_int_equal(npg_kdtree_open(&tree, points, count), NPG_OK);
            assert_int_equal(npg_kdtree_nearest(tree, index_of, dist_sq, queries, 200, ks[k], 2), NPG_OK);
            for (size_t i = 0; i < 200; i += 7)
                expect_list(queries + 3 * i, index_of + ks[k] * i, dist_sq + ks[k] * i, count, ks[k], NULL);
            assert_int_equal(npg_kdtree_nearest(tree, index_of, dist_sq, points, count, ks[k], 2), NPG_OK);
            for (size_t i = 0; i < count; i += 1 + count / 60)
                expect_list(points + 3 * i, index_of + ks[k] * i, dist_sq + ks[k] * i, count, ks[k], NULL);
            npg_kdtree_close(&tree);
        }
}

typedef struct seen {
    const uint8_t *keep;
    size_t count, k;
    uint8_t is_visited[MOST];
} seen;

static void visit(void *user, uint32_t point, const uint32_t *index, const float *sq)
{
    seen *s = user;
    s->is_visited[point]++;
    if (point % 83 == 0) expect_list(points + 3 * (size_t)point, index, sq, s->count, s->k, s->keep);
}

static void what_is_left_out_is_not_found(void **state)
{
    (void)state;
    static seen s;
    static uint8_t keep[MOST], only[MOST];
    npg_kdtree *tree;
    make_points(MOST, 1);
    s = (seen){.keep = keep, .count = MOST, .k = 13};
    for (size_t i = 0; i < MOST; i++) keep[i] = i % 11 != 0;
    for (size_t i = 0; i < MOST; i++) only[i] = i % 2 == 0;
    assert_int_equal(npg_kdtree_open(&tree, points, MOST), NPG_OK);
    npg_kdtree_leave_out(tree, keep);
    assert_int_equal(npg_kdtree_each(tree, s.k, only, visit, &s, 1), NPG_OK);
    for (size_t i = 0; i < MOST; i++) assert_int_equal(s.is_visited[i], keep[i] && only[i]);
    npg_kdtree_close(&tree);
}

static void within_a_radius_is_what_looking_at_all_says(void **state)
{
    (void)state;
    npg_kdtree *tree;
    uint8_t yes[200];
    float radius_sq[200];
    make_points(MOST, 1);
    for (size_t i = 0; i < 3 * 200; i++) queries[i] = 0.01f * (float)((i * 37) % 300) - 1;
    for (size_t i = 0; i < 200; i++) radius_sq[i] = 1e-4f * (float)(i * i % 700);
    assert_int_equal(npg_kdtree_open(&tree, points, MOST), NPG_OK);
    npg_kdtree_any_within(tree, yes, queries, radius_sq, 200);
    for (size_t q = 0; q < 200; q++) {
        uint32_t within = 0;
        for (size_t i = 0; i < MOST; i++) within += dist(queries + 3 * q, points + 3 * i) <= radius_sq[q];
        assert_int_equal(yes[q], within > 0);
    }
    npg_kdtree_close(&tree);
}

/* All points once, and together: a group of 64 of N even ones on a square of side 1 is far smaller than that. */
static void groups_lie_together(void **state)
{
    (void)state;
    const size_t counts[] = {1, 16, 17, 63, 64, 65, 129, 1024, 1025, MOST};
    static uint32_t order[MOST], first[2 * MOST / NPG_KDTREE_GROUP + 2];
    for (size_t c = 0; c < sizeof counts / sizeof *counts; c++) {
        size_t count = counts[c];
        uint8_t is_listed[MOST] = {0};
        npg_kdtree *tree;
        for (size_t i = 0; i < count; i++) {
            points[3 * i] = (float)(i * 7919 % count) / (float)count;
            points[3 * i + 1] = (float)fmod(0.618034 * (double)(i * 7919 % count), 1);
            points[3 * i + 2] = 0;
        }
        assert_int_equal(npg_kdtree_open(&tree, points, count), NPG_OK);
        size_t groups = npg_kdtree_groups(tree, order, first);
        assert_int_equal(first[0], 0);
        assert_int_equal(first[groups], count);
        for (size_t i = 0; i < count; i++) assert_false(is_listed[order[i]]++);
        for (size_t g = 0; g < groups; g++) {
            size_t of = first[g + 1] - first[g];
            assert_true(of <= NPG_KDTREE_GROUP && (groups == 1 || of >= NPG_KDTREE_GROUP / 2));
            float widest = 0;
            for (size_t i = first[g]; i < first[g + 1]; i++)
                widest =
                    fmaxf(widest, dist(points + 3 * (size_t)order[first[g]], points + 3 * (size_t)order[i]));
            assert_true(widest <= 10 * (float)NPG_KDTREE_GROUP / (float)count);
        }
        npg_kdtree_close(&tree);
    }
}

static void memory_runs_out_without_harm(void **state)
{
    (void)state;
    npg_status status = NPG_MEMORY;
    make_points(300, 1);
    for (uint64_t n = 1; status; n++) {
        npg_kdtree *tree;
        npg_memory_fail_at(n, false);
        status = npg_kdtree_open(&tree, points, 300);
        npg_memory_fail_at(0, false);
        assert_true(!status == !!tree);
        npg_kdtree_close(&tree);
    }
    assert_int_equal(npg_memory_used(), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(nearest_are_those_of_looking_at_all),
                                       cmocka_unit_test(what_is_left_out_is_not_found),
                                       cmocka_unit_test(within_a_radius_is_what_looking_at_all_says),
                                       cmocka_unit_test(groups_lie_together),
                                       cmocka_unit_test(memory_runs_out_without_harm)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
