/* Extent: cells go with the surface that a frame shows, not with its points. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "keyframe/keyframe_internal.h"
#include "pipeline/random.h"

enum { POINTS = 4000 };

/* Points spread over a rectangle, height x width, aslant; the capture is a cube of 2. */
static void fill_sheet(npg_frame *frame, float *points, size_t count, double width)
{
    npg_random random = {.state = 7};
    *frame = (npg_frame){.pos_local = points, .point_count = count};
    for (size_t i = 0; i < count; i++) {
        double u = npg_random_real(&random), v = npg_random_real(&random);
        points[3 * i] = (float)(u * width - 0.9);
        points[3 * i + 1] = (float)(0.8 * v - 0.4);
        points[3 * i + 2] = (float)(0.3 * u + 0.2 * v);
    }
}

static npg_frame_box box_of(void)
{
    return (npg_frame_box){.scale = 1, .diagonal = 2};
}

static double ratio_of_wide_to_narrow(bool is_papers)
{
    static float wide[3 * POINTS], narrow[3 * POINTS];
    npg_frame wide_frame, narrow_frame;
    npg_frame_box box = box_of();
    npg_extent *extent;
    fill_sheet(&wide_frame, wide, POINTS, 1.6);
    fill_sheet(&narrow_frame, narrow, POINTS, 0.8);
    assert_int_equal(npg_extent_open(&extent, &box, &wide_frame), NPG_OK);
    double ratio = is_papers ? (double)npg_extent_papers(extent, &wide_frame) /
                                   (double)npg_extent_papers(extent, &narrow_frame)
                             : (double)npg_extent_area(extent, &wide_frame) /
                                   (double)npg_extent_area(extent, &narrow_frame);
    npg_extent_close(&extent);
    assert_null(extent);
    return ratio;
}

static void cells_go_with_the_area(void **state)
{
    (void)state;
    double ratio = ratio_of_wide_to_narrow(false), papers = ratio_of_wide_to_narrow(true);
    print_message("twice the width: %.2f times the cells, %.2f of the paper's\n", ratio, papers);
    assert_true(ratio > 1.6 && ratio < 2.2);
    assert_true(papers < 1.2);
}

static void what_is_no_surface_does_not_count(void **state)
{
    static float points[3 * POINTS];
    npg_frame frame, empty = {0};
    npg_frame_box box = box_of();
    npg_extent *extent;
    (void)state;
    fill_sheet(&frame, points, POINTS, 1.6);
    for (size_t a = 0; a < 3; a++) points[a] = NAN;
    assert_int_equal(npg_extent_open(&extent, &box, &frame), NPG_OK);
    size_t all = npg_extent_area(extent, &frame);
    assert_int_equal(npg_extent_area(extent, &frame), all); /* nothing is left of the frame before */
    memcpy(points + 3 * (POINTS / 2), points, sizeof points / 2);
    size_t half = npg_extent_area(extent, &frame);
    assert_true(half > all / 2 && half < all); /* half the points, twice each, over the same sheet */
    assert_true(npg_extent_area(extent, &empty) == 0 && npg_extent_papers(extent, &empty) == 0);
    npg_extent_close(&extent);
}

static void what_is_cut_off_is_a_piece_more(void **state)
{
    static float points[3 * POINTS];
    npg_frame frame;
    npg_frame_box box = box_of();
    npg_extent *extent;
    size_t whole, cut, shred;
    (void)state;
    fill_sheet(&frame, points, POINTS, 1.6);
    assert_int_equal(npg_extent_open(&extent, &box, &frame), NPG_OK);
    assert_int_equal(npg_extent_pieces(&whole, extent, &frame), NPG_OK);
    for (size_t i = 0; i < 3 * POINTS; i += 3) /* a strip without points through the middle */
        if (points[i] > -0.3F && points[i] < 0.1F) points[i] = NAN;
    assert_int_equal(npg_extent_pieces(&cut, extent, &frame), NPG_OK);
    bool is_first = true; /* of what is behind it a point stays */
    for (size_t i = 0; i < 3 * POINTS; i += 3) {
        if (!(points[i] > 0.1F)) continue;
        if (!is_first) points[i] = NAN;
        is_first = false;
    }
    assert_int_equal(npg_extent_pieces(&shred, extent, &frame), NPG_OK);
    assert_int_equal(whole, 1);
    assert_int_equal(cut, 2);
    assert_int_equal(shred, 1);
    npg_extent_close(&extent);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(cells_go_with_the_area),
                                       cmocka_unit_test(what_is_no_surface_does_not_count),
                                       cmocka_unit_test(what_is_cut_off_is_a_piece_more)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
