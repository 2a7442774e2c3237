/* Alarm: fires where a misfit in one place begins and stays, in any order of the frames, and not on what is
 * usual or passes; misfits are found where they are. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate_internal.h"

/* ---- streams of figures ---- */

enum { FRAMES = 60, KEY = 20 };
typedef double level_fn(int64_t index);

static npg_frame frame_of(int64_t index, int misfit, double share)
{
    npg_frame frame = {.index = index, .number = 100 + index};
    for (int k = 0; k < NPG_MISFITS; k++) frame.figures.misfits[k] = (npg_misfit){0, {1, 2, 3}};
    frame.figures.misfits[misfit].share = share;
    return frame;
}

/* The alarm after all frames; step and start make the order. */
static npg_alarm *alarm_after(int misfit, level_fn *level, int64_t start, int64_t step)
{
    npg_alarm *alarm;
    assert_int_equal(npg_alarm_open(&alarm, KEY), NPG_OK);
    for (int64_t i = 0; i < FRAMES; i++) {
        int64_t index = (start + i * step) % FRAMES;
        npg_frame frame = frame_of(index, misfit, level(index));
        assert_int_equal(npg_alarm_add(alarm, &frame), NPG_OK);
    }
    npg_alarm_finish(alarm);
    return alarm;
}

static void expect(int misfit, level_fn *level, int64_t forward, int64_t backward)
{
    const int64_t orders[][2] = {{0, 1}, {KEY, 1}, {FRAMES - 1, FRAMES - 1}, {7, 23}};
    for (size_t o = 0; o < 4; o++) {
        npg_alarm *alarm = alarm_after(misfit, level, orders[o][0], orders[o][1]);
        const int64_t wanted[] = {forward, backward};
        for (int d = 0; d < NPG_DIRECTIONS; d++) {
            const npg_alarm_cause *cause = npg_alarm_raised(alarm, d);
            assert_int_equal(cause ? cause->index : -1, wanted[d]);
            if (!cause) continue;
            assert_int_equal(cause->number, 100 + cause->index);
            assert_int_equal(cause->misfit, misfit);
            assert_true(cause->value > cause->usual + cause->bound);
            assert_true(cause->at[0] == 1 && cause->at[2] == 3);
        }
        npg_alarm_close(&alarm);
    }
    assert_int_equal(npg_memory_used(), 0);
}

/* Even in 0..1, the same for the same index. */
static double chance(int64_t index)
{
    uint32_t x = (uint32_t)(index + 1) * 2654435761u;
    return (double)((x ^ x >> 15) % 1000) / 1000;
}

static double nothing(int64_t index)
{
    (void)index;
    return 0;
}
static double step_up(int64_t index)
{
    return index >= 37 ? 0.2 : 0;
}
static double step_up_behind(int64_t index)
{
    return index <= 9 ? 0.05 : 0;
}
static double on_both_sides(int64_t index)
{
    return index >= 50 || index <= 3 ? 0.1 : 0.01 * chance(index);
}
static double slow_start(int64_t index)
{
    return index < 30 ? 0 : fmin(0.0085 * (double)(index - 29), 0.1);
}
static double noise(int64_t index)
{
    return 0.05 + 0.03 * chance(index);
}
static double two_frames(int64_t index)
{
    return index == 30 || index == 31 || index == 40 || index == 10 ? 0.3 : 0;
}
static double five_frames(int64_t index)
{
    return index >= 40 && index < 45 ? 0.3 : 0;
}
static double drift(int64_t index)
{
    return 0.02 + 0.0015 * (double)llabs(index - KEY) + 0.01 * chance(index);
}
static double creep(int64_t index)
{
    return index < 25 ? 0 : index < 37 ? 0.0095 : 0.012;
}
/* Holes, in all frames but the one that the reference is made from. */
static double bare_all_along(int64_t index)
{
    return index == KEY ? 0 : 0.018 + 0.01 * chance(index);
}
/* Over holes, in a third of the frames, and then in more than the alarm needs. */
static double torn_now_and_then(int64_t index)
{
    int64_t away = llabs(index - KEY);
    return away % 3 == 2 || (away > 16 && away < 24) ? 0.012 : 0;
}
static double step_above_noise(int64_t index)
{
    return noise(index) + (index >= 33 ? 0.4 : 0);
}

static void a_lasting_misfit_raises_the_alarm(void **state)
{
    (void)state;
    for (int k = 0; k < NPG_MISFITS; k++) {
        expect(k, step_up, 37, -1);
        expect(k, step_up_behind, -1, 9);
        expect(k, on_both_sides, 50, k == NPG_MISFIT_STRETCHED ? -1 : 3); /* the last four frames backward */
        expect(k, five_frames, k == NPG_MISFIT_STRETCHED ? -1 : 40, -1);
        expect(k, step_above_noise, 33, -1);
    }
}

static void it_dates_from_the_first_suspect_frame(void **state)
{
    (void)state;
    expect(NPG_MISFIT_FAR, slow_start, 30, -1);
}

static void what_is_usual_or_passes_raises_none(void **state)
{
    (void)state;
    for (int k = 0; k < NPG_MISFITS; k++) {
        expect(k, nothing, -1, -1);
        expect(k, noise, -1, -1);
        expect(k, two_frames, -1, -1);
        expect(k, drift, -1, -1);
    }
}

static void holes_raise_none(void **state)
{
    (void)state;
    expect(NPG_MISFIT_UNSUPPORTED, bare_all_along, -1, -1);
    expect(NPG_MISFIT_STRETCHED, torn_now_and_then, -1, -1);
}

static void what_creeps_raises_none(void **state)
{
    (void)state;
    expect(NPG_MISFIT_FAR, creep, -1, -1);
    expect(NPG_MISFIT_UNSUPPORTED, creep, -1, -1);
}

/* Whether an alarm is raised by frames with these figures from index 30 on. */
static bool is_raised_by(double far, double unsupported, double stretched, double fit)
{
    npg_alarm *alarm;
    assert_int_equal(npg_alarm_open(&alarm, 0), NPG_OK);
    for (int64_t i = 0; i < FRAMES; i++) {
        npg_frame frame = frame_of(i, NPG_MISFIT_FAR, i < 30 ? 0 : far);
        frame.figures.misfits[NPG_MISFIT_UNSUPPORTED].share = i < 30 ? 0 : unsupported;
        frame.figures.misfits[NPG_MISFIT_STRETCHED].share = i < 30 ? 0 : stretched;
        frame.figures.point_dist_median = i < 30 ? 0.002 : fit;
        assert_int_equal(npg_alarm_add(alarm, &frame), NPG_OK);
    }
    npg_alarm_finish(alarm);
    bool is_raised = npg_alarm_raised(alarm, NPG_FORWARD) != NULL;
    npg_alarm_close(&alarm);
    return is_raised;
}

static void a_surface_that_lost_the_points_raises_none(void **state)
{
    (void)state;
    assert_true(is_raised_by(0.1, 0.01, 0, 0.002));
    assert_true(is_raised_by(0.1, 0, 0, 0.02));
    assert_false(is_raised_by(0.1, 0.08, 0, 0.002));
    assert_true(is_raised_by(0.01, 0.1, 0, 0.005));
    assert_false(is_raised_by(0.08, 0.1, 0, 0.002));
    assert_false(is_raised_by(0, 0.1, 0, 0.02));
    assert_true(is_raised_by(0, 0, 0.02, 0.002));
    assert_false(is_raised_by(0, 0, 0.02, 0.02));
    assert_false(is_raised_by(0.05, 0.05, 0.02, 0.002));
}

static void frames_without_figures_are_passed_over(void **state)
{
    (void)state;
    npg_alarm *alarm;
    assert_int_equal(npg_alarm_open(&alarm, 0), NPG_OK);
    for (int64_t i = 0; i < 20; i++) {
        npg_frame frame = frame_of(i, NPG_MISFIT_UNSUPPORTED, i % 2 ? (double)NAN : i >= 10 ? 0.5 : 0);
        if (i % 2) frame.figures.misfits[NPG_MISFIT_FAR].share = (double)NAN;
        assert_int_equal(npg_alarm_add(alarm, &frame), NPG_OK);
    }
    const npg_alarm_cause *cause = npg_alarm_raised(alarm, NPG_FORWARD);
    assert_non_null(cause);
    assert_int_equal(cause->index, 10);
    char text[256];
    npg_alarm_text(text, sizeof text, cause);
    assert_non_null(strstr(text, "50 %"));
    npg_alarm_close(&alarm);
}

/* ---- one frame ---- */

enum { SIDE = 20, VERTS = (SIDE + 1) * (SIDE + 1), EXTRA = 40 };

/* A sheet of 1 x 1 in cells of 1 / SIDE, a point on every vertex; without a border each side
 * goes on at the other. */
typedef struct sheet {
    npg_mesh *mesh;
    float points[3 * (VERTS + EXTRA)], vert_dist_sq[VERTS], vert_unit[3 * VERTS];
    npg_surface_hit hits[VERTS + EXTRA];
    double areas[VERTS];
    npg_misfit_frame frame;
} sheet;

static void open_sheet(sheet *s, bool has_border)
{
    enum { ROW = SIDE + 1 };
    *s = (sheet){0};
    assert_int_equal(npg_mesh_open(&s->mesh, VERTS, has_border ? 2 * SIDE * SIDE : 2 * VERTS), NPG_OK);
    uint32_t *face = s->mesh->faces;
    for (uint32_t v = 0; v < VERTS; v++) {
        float *p = s->mesh->vert_pos + 3 * v;
        uint32_t x = v % ROW, y = v / ROW, right = (x + 1) % ROW, above = (y + 1) % ROW * ROW;
        p[0] = (float)x / SIDE;
        p[1] = (float)y / SIDE;
        memcpy(s->points + 3 * v, p, 12);
        memcpy(s->vert_unit + 3 * v, p, 12);
        s->areas[v] = 1.0 / VERTS;
        s->hits[v].weights[0] = 1;
        if (has_border && (x == SIDE || y == SIDE)) continue;
        const uint32_t faces[] = {v, y * ROW + right, above + right, v, above + right, above + x};
        memcpy(face, faces, sizeof faces);
        face += 6;
    }
    s->frame = (npg_misfit_frame){.points = s->points,
                                  .hits = s->hits,
                                  .point_count = VERTS,
                                  .vert_unit = s->vert_unit,
                                  .vert_dist_sq = s->vert_dist_sq,
                                  .vert_areas = s->areas,
                                  .area = 1};
}

static void find(npg_misfit misfits[NPG_MISFITS], sheet *s)
{
    npg_misfit_finder *finder;
    assert_int_equal(npg_misfit_open(&finder, s->mesh, 0), NPG_OK);
    assert_int_equal(npg_misfit_find(finder, misfits, &s->frame), NPG_OK);
    npg_misfit_close(&finder);
}

static void close_sheet(sheet *s)
{
    npg_mesh_unref(&s->mesh);
    assert_int_equal(npg_memory_used(), 0);
}

/* Points over the sheet's middle, `apart` from each other in a row, closest to an inner face. */
static void add_points(sheet *s, double height, double apart)
{
    for (size_t i = 0; i < EXTRA; i++) {
        float *p = s->points + 3 * (VERTS + i);
        p[0] = (float)(0.5 + apart * (double)(i % 8));
        p[1] = (float)(0.5 + apart * (double)(i / 8));
        p[2] = (float)height;
        s->hits[VERTS + i] =
            (npg_surface_hit){SIDE * SIDE + SIDE, {0.4f, 0.3f, 0.3f}, (float)(height * height)};
    }
    s->frame.point_count = VERTS + EXTRA;
}

static void points_in_a_cluster_far_off_are_found_and_scattered_ones_not(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    (void)state;
    open_sheet(&s, true);
    find(m, &s);
    for (int k = 0; k < NPG_MISFITS; k++) assert_true(m[k].share == 0 && isnan(m[k].at[0]));
    add_points(&s, 0.5, 0.04);
    find(m, &s);
    assert_true(fabs(m[NPG_MISFIT_FAR].share - (double)EXTRA / (VERTS + EXTRA)) < 1e-9);
    assert_true(fabs(m[NPG_MISFIT_FAR].at[2] - 0.5) < 1e-6 && fabs(m[NPG_MISFIT_FAR].at[0] - 0.64) < 1e-6);
    add_points(&s, 0.5, 0.4);
    find(m, &s);
    assert_true(m[NPG_MISFIT_FAR].share == 0);
    add_points(&s, 0.02, 0.04);
    find(m, &s);
    assert_true(m[NPG_MISFIT_FAR].share == 0);
    close_sheet(&s);
}

static void what_lies_beyond_a_border_is_not_far(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    (void)state;
    open_sheet(&s, true);
    add_points(&s, 0.18, 0.04);
    for (size_t i = 0; i < EXTRA; i++) s.hits[VERTS + i].face = 0;
    for (size_t i = 0; i < EXTRA; i++) memcpy(s.hits[VERTS + i].weights, (float[]){0.5f, 0.5f, 0}, 12);
    find(m, &s);
    assert_true(m[NPG_MISFIT_FAR].share == 0);
    add_points(&s, 0.5, 0.04);
    for (size_t i = 0; i < EXTRA; i++) s.hits[VERTS + i].face = 0;
    find(m, &s);
    assert_true(m[NPG_MISFIT_FAR].share > 0);
    close_sheet(&s);
}

/* The right half has gone off its points; then it is stretched as well. */
static void unsupported_and_stretched_surface_is_found(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    double unsupported = 0;
    (void)state;
    open_sheet(&s, false);
    for (size_t v = 0; v < VERTS; v++) {
        bool is_right = v % (SIDE + 1) > SIDE / 2;
        s.vert_dist_sq[v] = is_right ? 0.09f : 0;
        unsupported += is_right ? s.areas[v] : 0;
    }
    find(m, &s);
    assert_true(fabs(m[NPG_MISFIT_UNSUPPORTED].share - unsupported) < 1e-9 &&
                m[NPG_MISFIT_STRETCHED].share == 0);
    for (size_t v = 0; v < VERTS; v++)
        if (v % (SIDE + 1) > SIDE / 2) s.vert_unit[3 * v] = 0.5f + 3 * (s.vert_unit[3 * v] - 0.5f);
    find(m, &s);
    assert_true(fabs(m[NPG_MISFIT_STRETCHED].share - unsupported) < 1e-9);
    assert_true(m[NPG_MISFIT_STRETCHED].at[0] > 1);
    close_sheet(&s);
}

/* The same, but the sensors have only the left half in sight, and then nothing. */
static void what_no_sensor_has_in_sight_is_not_missing(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    uint8_t is_in_sight[VERTS] = {0};
    (void)state;
    open_sheet(&s, false);
    for (size_t v = 0; v < VERTS; v++) {
        is_in_sight[v] = v % (SIDE + 1) <= SIDE / 2;
        if (is_in_sight[v]) continue;
        s.vert_dist_sq[v] = 0.09f;
        s.vert_unit[3 * v] = 0.5f + 3 * (s.vert_unit[3 * v] - 0.5f);
    }
    find(m, &s);
    assert_true(m[NPG_MISFIT_UNSUPPORTED].share > 0.4 && m[NPG_MISFIT_STRETCHED].share > 0.4);
    s.frame.is_in_sight = is_in_sight;
    find(m, &s);
    for (int k = 0; k < NPG_MISFITS; k++) assert_true(m[k].share == 0);
    memset(is_in_sight, 0, sizeof is_in_sight);
    find(m, &s);
    for (int k = 0; k < NPG_MISFITS; k++) assert_true(m[k].share == 0);
    close_sheet(&s);
}

/* The right half was closed where the reference had no points: it may go anywhere. */
static void what_no_point_of_the_reference_supports_is_not_missing(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    (void)state;
    open_sheet(&s, false);
    assert_int_equal(npg_alloc_array(&s.mesh->vert_unseen, NPG_FOR_MESH, VERTS, 1), NPG_OK);
    for (size_t v = 0; v < VERTS; v++) {
        s.mesh->vert_unseen[v] = v % (SIDE + 1) > SIDE / 2;
        if (!s.mesh->vert_unseen[v]) continue;
        s.vert_dist_sq[v] = 0.09f;
        s.vert_unit[3 * v] = 0.5f + 3 * (s.vert_unit[3 * v] - 0.5f);
    }
    find(m, &s);
    for (int k = 0; k < NPG_MISFITS; k++) assert_true(m[k].share == 0);
    memset(s.mesh->vert_unseen, 0, VERTS);
    find(m, &s);
    assert_true(m[NPG_MISFIT_UNSUPPORTED].share > 0.4 && m[NPG_MISFIT_STRETCHED].share > 0.4);
    close_sheet(&s);
}

static void what_sampling_or_a_border_explains_is_not_unsupported(void **state)
{
    sheet s;
    npg_misfit m[NPG_MISFITS];
    (void)state;
    for (int has_border = 0; has_border < 2; has_border++) {
        open_sheet(&s, has_border);
        for (size_t v = 0; v < 19; v++) s.vert_dist_sq[v] = 1;
        find(m, &s);
        assert_true(m[NPG_MISFIT_UNSUPPORTED].share == 0);
        for (size_t v = 0; v < 21; v++) s.vert_dist_sq[v] = 1;
        find(m, &s);
        assert_true(has_border ? m[NPG_MISFIT_UNSUPPORTED].share == 0
                               : m[NPG_MISFIT_UNSUPPORTED].share > 0.04);
        close_sheet(&s);
    }
}

/* Two sheets in one place: the second has no points of its own, then a fair share. */
static void a_part_without_points_of_its_own_is_vacated(void **state)
{
    enum { ROW = SIDE + 1, HALF = SIDE / 2 * ROW };
    sheet s;
    npg_misfit m[NPG_MISFITS];
    (void)state;
    open_sheet(&s, false);
    for (size_t f = 0; f < s.mesh->face_count; f++) { /* cut between the rows of the two halves */
        uint32_t *face = s.mesh->faces + 3 * f;
        bool is_upper = face[0] >= HALF;
        for (int k = 0; k < 3; k++)
            if ((face[k] >= HALF) != is_upper) face[k] = is_upper ? HALF + face[k] % ROW : face[k] % ROW;
    }
    uint32_t lower = UINT32_MAX, upper = UINT32_MAX;
    for (uint32_t f = 0; f < s.mesh->face_count; f++) *(s.mesh->faces[3 * f] >= HALF ? &upper : &lower) = f;
    for (size_t i = 0; i < VERTS; i++) s.hits[i].face = i % 2 ? lower : upper;
    find(m, &s);
    assert_true(m[NPG_MISFIT_VACATED].share == 0);
    for (size_t i = 0; i < VERTS; i++) s.hits[i].face = i % 5 ? lower : upper;
    find(m, &s);
    assert_true(fabs(m[NPG_MISFIT_VACATED].share - 0.3) < 0.05 && m[NPG_MISFIT_VACATED].at[1] > 0.5);
    assert_true(m[NPG_MISFIT_UNSUPPORTED].share == 0 && m[NPG_MISFIT_STRETCHED].share == 0);
    for (size_t v = VERTS - 3 * HALF / 4; v < VERTS; v++)
        s.vert_dist_sq[v] = 0.09f; /* a hole: most of it is bare */
    find(m, &s);
    assert_true(m[NPG_MISFIT_VACATED].share == 0 && m[NPG_MISFIT_UNSUPPORTED].share > 0);
    memset(s.vert_dist_sq, 0, sizeof s.vert_dist_sq);
    for (size_t i = 0; i < VERTS; i++) s.hits[i].face = i % 3 ? lower : upper; /* 67 %: still its own */
    find(m, &s);
    assert_true(m[NPG_MISFIT_VACATED].share == 0);
    close_sheet(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lasting_misfit_raises_the_alarm),
        cmocka_unit_test(it_dates_from_the_first_suspect_frame),
        cmocka_unit_test(what_is_usual_or_passes_raises_none),
        cmocka_unit_test(holes_raise_none),
        cmocka_unit_test(what_creeps_raises_none),
        cmocka_unit_test(a_surface_that_lost_the_points_raises_none),
        cmocka_unit_test(frames_without_figures_are_passed_over),
        cmocka_unit_test(points_in_a_cluster_far_off_are_found_and_scattered_ones_not),
        cmocka_unit_test(what_lies_beyond_a_border_is_not_far),
        cmocka_unit_test(unsupported_and_stretched_surface_is_found),
        cmocka_unit_test(what_no_sensor_has_in_sight_is_not_missing),
        cmocka_unit_test(what_no_point_of_the_reference_supports_is_not_missing),
        cmocka_unit_test(what_sampling_or_a_border_explains_is_not_unsupported),
        cmocka_unit_test(a_part_without_points_of_its_own_is_vacated)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
