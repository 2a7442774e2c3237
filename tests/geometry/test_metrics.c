/* Metrics and random numbers: samples are uniform, figures are those worked out by hand,
 * memory failures clean. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "geometry/geometry.h"
#include "pipeline/random.h"

/* Two triangles that make the rectangle 0..width x 0..1 at height z. */
static npg_mesh *rectangle(float width, float z)
{
    const float corners[12] = {0, 0, z, width, 0, z, width, 1, z, 0, 1, z};
    const uint32_t faces[6] = {0, 1, 2, 0, 2, 3};
    npg_mesh *mesh = NULL;
    assert_int_equal(npg_mesh_open(&mesh, 4, 2), NPG_OK);
    memcpy(mesh->vert_pos, corners, sizeof corners);
    memcpy(mesh->faces, faces, sizeof faces);
    return mesh;
}

static const npg_metrics_settings unit_settings = {
    .sample_count = 20000, .tau = 0.005, .diagonal = 1, .seed = 1};

static void numbers_are_those_of_the_published_generator(void **state)
{
    (void)state;
    /* SplitMix64 from state 0 */
    npg_random random = {0};
    assert_true(npg_random_bits(&random) == 0xe220a8397b1dcdafu);
    assert_true(npg_random_bits(&random) == 0x6e789e6aa1b965f4u);
    assert_true(npg_random_bits(&random) == 0x06c45d188009454fu);
}

static void numbers_have_their_distributions(void **state)
{
    enum { COUNT = 100000, CELLS = 10 };
    npg_random random = npg_random_stream(5, 0, 0);
    size_t cells[CELLS] = {0};
    double sum = 0, square_sum = 0;
    (void)state;
    for (int i = 0; i < COUNT; i++) {
        double real = npg_random_real(&random), gauss = npg_random_gauss(&random);
        assert_true(real >= 0 && real < 1);
        cells[npg_random_below(&random, CELLS)]++;
        sum += gauss;
        square_sum += gauss * gauss;
    }
    for (int c = 0; c < CELLS; c++) assert_in_range(cells[c], 9500, 10500);
    assert_true(fabs(sum / COUNT) < 0.02 && fabs(square_sum / COUNT - 1) < 0.03);
}

static void streams_differ(void **state)
{
    (void)state;
    npg_random a = npg_random_stream(1, 2, 3), same = npg_random_stream(1, 2, 3),
               keys[3] = {npg_random_stream(2, 2, 3), npg_random_stream(1, 3, 3), npg_random_stream(1, 2, 4)};
    uint64_t first = npg_random_bits(&a);
    assert_true(first == npg_random_bits(&same));
    for (int i = 0; i < 3; i++) assert_true(first != npg_random_bits(&keys[i]));
}

static void samples_are_uniform_by_area(void **state)
{
    enum { COUNT = 40000 };
    npg_mesh *mesh = rectangle(4, 0);
    float *pos = malloc(COUNT * 3 * sizeof *pos), *normals = malloc(COUNT * 3 * sizeof *normals);
    size_t cells[8] = {0};
    (void)state;
    mesh->vert_pos[3] = mesh->vert_pos[6] = 4;
    assert_int_equal(npg_mesh_sample(pos, normals, mesh, COUNT, 3, 0, 0), NPG_OK);
    for (size_t i = 0; i < COUNT; i++) {
        assert_true(pos[3 * i] >= 0 && pos[3 * i] <= 4 && pos[3 * i + 1] >= 0 && pos[3 * i + 1] <= 1);
        assert_true(normals[3 * i + 2] == 1);
        cells[(size_t)fminf(pos[3 * i], 3.999f) * 2 + (pos[3 * i + 1] > 0.5f)]++;
    }
    for (int c = 0; c < 8; c++) assert_in_range(cells[c], 4700, 5300);
    free(pos);
    free(normals);
    npg_mesh_unref(&mesh);
}

static void parallel_squares(void **state)
{
    npg_mesh *a = rectangle(1, 0), *b = rectangle(1, 0.1f);
    npg_eval_figures m;
    (void)state;
    assert_int_equal(npg_metrics_compare(&m, a, b, &unit_settings, 0), NPG_OK);
    /* d^2 = 0.01 and what the nearest of 20000 samples is off to the side: 1 / (pi 20000) */
    assert_true(fabs(m.cd - 1000 - 1.6) < 0.5);
    assert_true(m.f == 0 && fabs(m.nc - 1) < 1e-6);
    npg_metrics_settings wide = unit_settings;
    wide.tau = 0.2;
    assert_int_equal(npg_metrics_compare(&m, a, b, &wide, 0), NPG_OK);
    assert_true(m.f == 1);
    wide.diagonal = 2;
    assert_int_equal(npg_metrics_compare(&m, a, b, &wide, 0), NPG_OK);
    assert_true(fabs(m.cd - 250.4) < 0.2);
    npg_mesh_unref(&a);
    npg_mesh_unref(&b);
}

/* Half of a 2 x 1 rectangle is missing: all of the prediction is right, half of the truth is found. */
static void precision_is_not_recall(void **state)
{
    npg_mesh *half = rectangle(1, 0), *whole = rectangle(2, 0);
    npg_eval_figures m;
    npg_metrics_settings settings = unit_settings;
    (void)state;
    settings.tau = 0.03;
    assert_int_equal(npg_metrics_compare(&m, half, whole, &settings, 0), NPG_OK);
    assert_true(m.precision > 0.999);
    assert_true(fabs(m.recall - 0.515) < 0.01);
    assert_true(fabs(m.f - 2 * m.precision * m.recall / (m.precision + m.recall)) < 1e-12);
    assert_true(m.cd_from_truth > 1000 * m.cd_to_truth);
    npg_mesh_unref(&half);
    npg_mesh_unref(&whole);
}

static void normals_at_an_angle(void **state)
{
    npg_mesh *flat = rectangle(1, 0), *tilted = rectangle(1, 0);
    npg_eval_figures m;
    (void)state;
    tilted->vert_pos[5] = tilted->vert_pos[8] = 1; /* z = x: 45 degrees */
    assert_int_equal(npg_metrics_compare(&m, flat, tilted, &unit_settings, 0), NPG_OK);
    assert_true(fabs(m.nc - sqrt(0.5)) < 1e-5);
    /* turned over, the agreement is the same */
    tilted->faces[1] = 2;
    tilted->faces[2] = 1;
    tilted->faces[4] = 3;
    tilted->faces[5] = 2;
    assert_int_equal(npg_metrics_compare(&m, flat, tilted, &unit_settings, 0), NPG_OK);
    assert_true(fabs(m.nc - sqrt(0.5)) < 1e-5);
    npg_mesh_unref(&flat);
    npg_mesh_unref(&tilted);
}

static void a_cloud_as_truth_has_no_normals(void **state)
{
    npg_mesh *mesh = rectangle(1, 0), *cloud = NULL;
    npg_eval_figures m;
    npg_metrics_settings settings = unit_settings;
    (void)state;
    settings.tau = 0.05;
    assert_int_equal(npg_mesh_open(&cloud, 4, 0), NPG_OK);
    memcpy(cloud->vert_pos, mesh->vert_pos, 12 * sizeof(float));
    assert_int_equal(npg_metrics_compare(&m, mesh, cloud, &settings, 0), NPG_OK);
    assert_true(isnan(m.nc) && m.recall == 1 && m.cd_from_truth < 50 && m.precision < 0.1);
    npg_mesh_unref(&mesh);
    npg_mesh_unref(&cloud);
}

static void tied_vertices_drift(void **state)
{
    npg_mesh *predicted = rectangle(1, 0.01f), *truth = rectangle(1, 0);
    uint32_t *truth_of = NULL;
    (void)state;
    assert_int_equal(npg_metrics_tie(&truth_of, predicted, truth), NPG_OK);
    for (uint32_t v = 0; v < 4; v++) assert_int_equal(truth_of[v], v);
    predicted->vert_pos[0] += 0.3f;
    predicted->vert_pos[2] = 0.4f;
    assert_true(fabs(npg_metrics_drift(predicted, truth, truth_of, 2) - (0.5 + 0.03) / 4 / 2) < 1e-6);
    npg_release(&truth_of);
    npg_mesh_unref(&predicted);
    npg_mesh_unref(&truth);
}

static void figures_repeat(void **state)
{
    npg_mesh *a = rectangle(1, 0), *b = rectangle(1.1f, 0.02f);
    npg_eval_figures one = {0}, two = {0}, other;
    npg_metrics_settings settings = unit_settings;
    (void)state;
    assert_int_equal(npg_metrics_compare(&one, a, b, &settings, 3), NPG_OK);
    assert_int_equal(npg_metrics_compare(&two, a, b, &settings, 3), NPG_OK);
    assert_memory_equal(&one, &two, sizeof one);
    assert_int_equal(npg_metrics_compare(&other, a, b, &settings, 4), NPG_OK);
    assert_true(other.cd != one.cd);
    npg_mesh_unref(&a);
    npg_mesh_unref(&b);
}

static void without_area_it_is_bad_input(void **state)
{
    npg_mesh *a = rectangle(0, 0), *b = rectangle(1, 0);
    npg_eval_figures m;
    (void)state;
    assert_int_equal(npg_metrics_compare(&m, a, b, &unit_settings, 0), NPG_BAD_INPUT);
    assert_int_equal(npg_metrics_compare(&m, b, a, &unit_settings, 0), NPG_BAD_INPUT);
    npg_mesh_unref(&a);
    npg_mesh_unref(&b);
}

static void every_failed_allocation_ends_cleanly(void **state)
{
    npg_mesh *a = rectangle(1, 0), *b = rectangle(1, 0.1f);
    size_t used = npg_memory_used();
    npg_status status = NPG_MEMORY;
    (void)state;
    for (uint64_t n = 1; status != NPG_OK; n++) {
        npg_eval_figures m;
        uint32_t *truth_of = NULL;
        assert_in_range(n, 1, 100);
        npg_memory_fail_at(n, false);
        status = npg_metrics_compare(&m, a, b, &unit_settings, 0);
        if (!status) status = npg_metrics_tie(&truth_of, a, b);
        npg_memory_fail_at(0, false);
        npg_release(&truth_of);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), used);
    }
    npg_mesh_unref(&a);
    npg_mesh_unref(&b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(numbers_are_those_of_the_published_generator),
        cmocka_unit_test(numbers_have_their_distributions),
        cmocka_unit_test(streams_differ),
        cmocka_unit_test(samples_are_uniform_by_area),
        cmocka_unit_test(parallel_squares),
        cmocka_unit_test(precision_is_not_recall),
        cmocka_unit_test(normals_at_an_angle),
        cmocka_unit_test(a_cloud_as_truth_has_no_normals),
        cmocka_unit_test(tied_vertices_drift),
        cmocka_unit_test(figures_repeat),
        cmocka_unit_test(without_area_it_is_bad_input),
        cmocka_unit_test(every_failed_allocation_ends_cleanly),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
