/* Evaluate: figures of deformations whose answers are known, the verdict, and the comparison with a truth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "evaluate/evaluate_internal.h"
#include "export/files.h"
#include "mesh/mesh_internal.h"
#include "tests/support/group_folder.h"
#include "tests/support/test_chain.h"

extern const npg_stage npg_stage_keyframe, npg_stage_evaluate;

/* ---- a sphere of radius 1 by latitude and longitude ---- */

enum { RINGS = 24, SPOKES = 48, VERTS = 2 + (RINGS - 1) * SPOKES, FACES = 2 * SPOKES * (RINGS - 1) };
static const double pi = 3.14159265358979323846;

static uint32_t ring_vertex(int ring, int spoke)
{
    if (ring == 0) return 0;
    if (ring == RINGS) return VERTS - 1;
    return (uint32_t)(1 + (ring - 1) * SPOKES + spoke % SPOKES);
}

static npg_status open_sphere(npg_mesh **out)
{
    NPG_TRY(npg_mesh_open(out, VERTS, FACES));
    npg_mesh *mesh = *out;
    uint32_t *face = mesh->faces;
    for (int r = 0; r <= RINGS; r++)
        for (int s = 0; s < SPOKES; s++) {
            double tilt = pi * r / RINGS, turn = 2 * pi * s / SPOKES;
            float *p = mesh->vert_pos + 3 * (size_t)ring_vertex(r, s);
            p[0] = (float)(sin(tilt) * cos(turn));
            p[1] = (float)(sin(tilt) * sin(turn));
            p[2] = (float)cos(tilt);
        }
    for (int r = 0; r < RINGS; r++)
        for (int s = 0; s < SPOKES; s++) {
            uint32_t a = ring_vertex(r, s), b = ring_vertex(r + 1, s), c = ring_vertex(r + 1, s + 1),
                     d = ring_vertex(r, s + 1);
            if (r < RINGS - 1) memcpy(face, (uint32_t[]){a, b, c}, 12), face += 3;
            if (r > 0) memcpy(face, (uint32_t[]){a, c, d}, 12), face += 3;
        }
    return NPG_OK;
}

/* ---- the shape's figures by themselves ---- */

typedef struct shape_case {
    npg_mesh *mesh;
    npg_shape *shape;
    float *moved; /* V x 3 */
} shape_case;

static int open_shape(void **state)
{
    static shape_case c;
    if (open_sphere(&c.mesh) || npg_shape_open(&c.shape, c.mesh)) return -1;
    c.moved = calloc(3 * VERTS, sizeof *c.moved);
    memcpy(c.moved, c.mesh->vert_pos, sizeof(float) * 3 * VERTS);
    *state = &c;
    return 0;
}

static int close_shape(void **state)
{
    shape_case *c = *state;
    npg_shape_close(&c->shape);
    npg_mesh_unref(&c->mesh);
    free(c->moved);
    return npg_memory_used() != 0;
}

static npg_figures measure(const shape_case *c)
{
    npg_figures figures = {0};
    npg_shape_measure(c->shape, &figures, c->moved);
    return figures;
}

static void a_rigid_motion_changes_nothing(void **state)
{
    shape_case *c = *state;
    for (size_t i = 0; i < VERTS; i++) { /* a turn by 120 degrees about (1, 1, 1), and a shift */
        const float *p = c->mesh->vert_pos + 3 * i;
        for (size_t a = 0; a < 3; a++) c->moved[3 * i + a] = p[(a + 1) % 3] + 0.25f;
    }
    npg_figures figures = measure(c);
    assert_true(figures.flipped_share == 0 && figures.stretched_share == 0);
    assert_true(figures.edge_change < 1e-5);
}

static void growth_is_edge_change_and_stretch(void **state)
{
    shape_case *c = *state;
    const struct {
        float factor;
        double stretched;
    } cases[] = {{1.5f, 0}, {3, 0}, {3.2f, 1}, {0.4f, 0}, {0.3f, 1}};
    for (size_t k = 0; k < 5; k++) {
        for (size_t i = 0; i < 3 * VERTS; i++) c->moved[i] = cases[k].factor * c->mesh->vert_pos[i];
        npg_figures figures = measure(c);
        assert_true(fabs(figures.edge_change - fabs((double)cases[k].factor - 1)) < 1e-5);
        assert_true(figures.stretched_share == cases[k].stretched);
        assert_true(figures.flipped_share == 0);
    }
}

static void a_vertex_pushed_over_its_neighbours_flips_faces(void **state)
{
    shape_case *c = *state;
    size_t v = ring_vertex(RINGS / 2, 5), opposite = ring_vertex(RINGS / 2, 7);
    memcpy(c->moved + 3 * v, c->mesh->vert_pos + 3 * opposite, 12); /* beyond the next spoke */
    npg_figures figures = measure(c);
    double flipped = figures.flipped_share * FACES;
    assert_true(flipped > 0.5 && flipped < 6.5); /* at most the faces that the vertex has */
    assert_true(figures.edge_change > 0 && figures.edge_change < 0.01);
}

static double flipped_by(shape_case *c, int ring)
{
    memcpy(c->moved, c->mesh->vert_pos, sizeof(float) * 3 * VERTS);
    memcpy(c->moved + 3 * (size_t)ring_vertex(ring, 5), c->mesh->vert_pos + 3 * (size_t)ring_vertex(ring, 7),
           12);
    return measure(c).flipped_share;
}

static void what_is_turned_over_counts_by_its_area(void **state)
{
    shape_case *c = *state; /* the second ring's faces are slivers */
    double slivers = flipped_by(c, 2), usual = flipped_by(c, RINGS / 2);
    assert_true(slivers > 0 && slivers < usual / 2);
}

static void a_fold_of_many_faces_is_not_many_flips(void **state)
{
    shape_case *c = *state; /* the upper half dented into the lower: flips at most along the crease */
    for (size_t i = 0; i < VERTS; i++) c->moved[3 * i + 2] = -fabsf(c->mesh->vert_pos[3 * i + 2]);
    npg_figures figures = measure(c);
    assert_true(figures.flipped_share <= 2.0 * SPOKES / FACES);
    assert_true(figures.edge_change < 1e-6);
}

static void a_flattened_face_is_stretched_not_flipped(void **state)
{
    shape_case *c = *state;
    for (size_t i = 0; i < 3 * VERTS; i++) c->moved[i] = 0;
    npg_figures figures = measure(c);
    assert_true(figures.flipped_share == 0 && figures.stretched_share == 1);
    assert_true(fabs(figures.edge_change - 1) < 1e-12);
}

/* ---- the stage ---- */

enum { FRAMES = 3, POINTS = 2000 };

typedef struct scene {
    double gap[FRAMES];   /* points lie this far outside the unit sphere            */
    double share[FRAMES]; /* of the sphere from the north pole down that has points */
    double lost[FRAMES];  /* of the points, those farthest south: `lost_dist` outside the sphere */
    double lost_dist;
    double vert_scale[FRAMES];
    bool skipped[FRAMES], broken[FRAMES];
    bool is_made;  /* the reference, from the points of all frames: it says what they did not see */
    bool key_only; /* ... from those of frame 0 alone */
    /* seen */
    npg_figures figures[FRAMES];
    double diagonal;
    size_t bad_count, skipped_count;
    double worst_median;
} scene;

static scene plain_scene(void)
{
    scene s = {.lost_dist = 0.07}; /* 2 % of the diagonal */
    for (int i = 0; i < FRAMES; i++) s.share[i] = s.vert_scale[i] = 1;
    return s;
}

/* A spiral of points that covers the sphere evenly, from the pole down to `share` of its area. */
static void put_spiral(float *points, const scene *s, int64_t index)
{
    for (int i = 0; i < POINTS; i++) {
        double z = 1 - 2 * s->share[index] * (i + 0.5) / POINTS, turn = i * pi * (3 - sqrt(5.0));
        double lost = i >= (1 - s->lost[index]) * POINTS ? s->lost_dist : 0;
        double radius = 1 + s->gap[index] + lost, flat = sqrt(1 - z * z);
        points[3 * i] = (float)(radius * flat * cos(turn));
        points[3 * i + 1] = (float)(radius * flat * sin(turn));
        points[3 * i + 2] = (float)(radius * z);
    }
}

static npg_status make(npg_frame *frame, npg_facts *facts, int64_t index, void *user)
{
    const scene *s = user;
    if (!facts->origin.known) facts->origin.known = true;
    frame->is_skipped = s->skipped[index];
    if (frame->is_skipped) return NPG_OK;
    NPG_TRY(npg_alloc_array(&frame->pos_local, NPG_FOR_FRAMES, POINTS, 12));
    frame->point_count = POINTS;
    put_spiral(frame->pos_local, s, index);
    return NPG_OK;
}

/* What a reference made from points says: vertices more than 0.15 from all of them are unseen. */
static npg_status mark_unseen(npg_facts *facts, const scene *s)
{
    static float points[3 * FRAMES * POINTS];
    size_t count = s->key_only ? POINTS : FRAMES * POINTS;
    for (int t = 0; t < FRAMES; t++) put_spiral(points + 3 * t * POINTS, s, t);
    npg_box_local_to_unit(&facts->box, points, points, count);
    return npg_mesh_mark_unseen(facts->reference, points, count, 0.15 * facts->box.scale);
}

static npg_status give_mesh(npg_facts *facts, npg_frame *frame, const scene *s)
{
    npg_mesh *sphere;
    if (!facts->reference) {
        NPG_TRY(open_sphere(&facts->reference));
        npg_box_local_to_unit(&facts->box, facts->reference->vert_pos, facts->reference->vert_pos, VERTS);
        if (s->is_made) NPG_TRY(mark_unseen(facts, s));
    }
    NPG_TRY(open_sphere(&sphere));
    for (size_t i = 0; i < 3 * VERTS; i++) sphere->vert_pos[i] *= (float)s->vert_scale[frame->index];
    npg_status status = npg_alloc_array(&frame->vert_unit, NPG_FOR_FRAMES, VERTS, 12);
    if (!status) npg_box_local_to_unit(&facts->box, frame->vert_unit, sphere->vert_pos, VERTS);
    if (!status && s->broken[frame->index]) frame->vert_unit[100] = NAN;
    npg_mesh_unref(&sphere);
    frame->vert_count = VERTS;
    frame->fields |= NPG_FIELD_VERTICES;
    return status;
}

static npg_status mesh_process(npg_worker *worker, npg_chunk **chunk)
{
    for (size_t i = 0; i < npg_chunk_count(*chunk); i++) {
        npg_frame *frame = npg_chunk_frame(*chunk, i);
        if (!frame->is_skipped) NPG_TRY(give_mesh(test_facts(worker), frame, script.user));
    }
    return NPG_OK;
}

static npg_status see(npg_worker *worker, npg_frame *frame, void *user)
{
    scene *s = user;
    s->figures[frame->index] = frame->figures;
    s->diagonal = npg_worker_facts(worker)->box.diagonal;
    return frame->fields & NPG_FIELD_FIGURES ? NPG_OK : npg_error(NPG_FAILED, "no figures");
}

static npg_status read_report(npg_worker *worker)
{
    scene *s = script.user;
    json_t *stages = json_object_get(npg_worker_run_report(worker), "stages");
    json_t *own = json_object_get(stages, "evaluate");
    json_t *median = json_object_get(json_object_get(own, "figures"), "point_dist_median");
    s->bad_count = json_array_size(json_object_get(own, "bad"));
    s->skipped_count = (size_t)json_integer_value(json_object_get(own, "skipped"));
    s->worst_median = json_real_value(json_object_get(median, "worst"));
    return NPG_OK;
}

static const npg_stage mesher = {.name = "mesher",
                                 .help = "",
                                 .passes = NPG_PASS_SOLVE,
                                 .gives = NPG_FIELD_VERTICES | NPG_FIELD_REFERENCE | NPG_FIELD_CLEAN,
                                 .process = mesh_process};
static const npg_stage reader = {.name = "reader", .help = "", .conclude = read_report};
static const npg_stage *const chain[] = {
    &test_source, &npg_stage_keyframe, &mesher, &npg_stage_evaluate, &test_sink, &reader, NULL};

static char last_text[1024];

static npg_status run_scene(scene *s, const char *const (*more)[2])
{
    const char *settings[16][2] = {{"input", "any"}, {"output", "any"}, {"keyframe", "0"}};
    for (int i = 0; more && more[i][0]; i++) memcpy(settings[3 + i], more[i], sizeof *more);
    script = (test_script){FRAMES, make, see, s};
    return run_chain(chain, (const char *const(*)[2])settings, last_text);
}

static bool is_near(double value, double expected, double tolerance)
{
    return fabs(value - expected) <= tolerance;
}

static void distances_are_those_that_were_made(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.gap[1] = 0.01;
    s.gap[2] = 0.05;
    const char *const lenient[][2] = {{"bars.residual", "5"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
    /* the mesh lies inside the sphere by up to 1 - cos(half of a cell's diagonal) = 0.0075 */
    double inside = 0.0075 / s.diagonal;
    for (int t = 0; t < FRAMES; t++) {
        const npg_figures *f = &s.figures[t];
        double gap = s.gap[t] / s.diagonal;
        assert_true(f->point_dist_median >= gap - 1e-6 && f->point_dist_median <= gap + inside);
        assert_true(f->point_dist_mean >= gap - 1e-6 && f->point_dist_mean <= gap + inside);
        assert_true(f->point_dist_p95 >= f->point_dist_median && f->point_dist_p95 <= gap + inside);
        assert_true(f->vertex_dist_mean >= gap - 1e-6);
        assert_true(f->coverage == 1);
        assert_true(f->flipped_share == 0 && f->stretched_share == 0 && f->edge_change < 1e-5);
        assert_true(f->good);
    }
    assert_true(s.figures[2].chamfer > 1e5 * pow(0.05 / s.diagonal, 2));
    assert_true(s.worst_median == s.figures[2].point_dist_median);
    assert_int_equal(s.bad_count, 0);
}

/* The plain way: the distance of every vertex to every point. */
static void vertex_distances_agree_with_the_plain_way(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.gap[1] = 0.02;
    const char *const lenient[][2] = {{"bars.residual", "5"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
    npg_mesh *sphere;
    npg_facts facts = {0};
    npg_frame frame = {.index = 1};
    assert_int_equal(open_sphere(&sphere), NPG_OK);
    assert_int_equal(make(&frame, &facts, 1, &s), NPG_OK);
    double sum = 0;
    for (size_t v = 0; v < VERTS; v++) {
        double nearest = 1e9;
        for (size_t i = 0; i < POINTS; i++) {
            double dist_sq = 0;
            for (size_t a = 0; a < 3; a++) {
                double d = (double)sphere->vert_pos[3 * v + a] - (double)frame.pos_local[3 * i + a];
                dist_sq += d * d;
            }
            nearest = fmin(nearest, dist_sq);
        }
        sum += sqrt(nearest);
    }
    assert_true(is_near(s.figures[1].vertex_dist_mean, sum / VERTS / s.diagonal, 1e-6));
    npg_frame_clear(&frame);
    npg_mesh_unref(&sphere);
}

/* A limb's share of the points is off the surface, where the median knows nothing of it. */
static void nearly_all_points_must_be_near(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.lost[1] = 0.03;
    s.lost[2] = 0.07;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    assert_true(s.figures[1].point_dist_p95 < 0.002 && s.figures[1].good);
    assert_true(s.figures[2].point_dist_median < 0.002 && is_near(s.figures[2].point_dist_p95, 0.02, 0.002));
    assert_false(s.figures[2].good);
    assert_int_equal(s.bad_count, 1);
    const char *const lenient[][2] = {{"bars.residual", "1.2"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
}

/* A hand: too few points for the bar on 95 % of them, and all of them in one place. */
static void a_place_that_is_missed_is_a_fault(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.lost_dist = 0.5;
    s.lost[1] = 0.008;
    s.lost[2] = 0.015;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    assert_true(s.figures[1].good && s.figures[2].point_dist_p95 < 0.002);
    assert_true(is_near(s.figures[2].misfits[NPG_MISFIT_FAR].share, 0.015, 1e-3));
    assert_int_equal(s.figures[2].fault, NPG_FAULT_LOST);
    assert_int_equal(s.bad_count, 1);
    const char *const lenient[][2] = {{"bars.lost", "4"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
}

static void coverage_is_the_share_with_points(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.share[1] = 0.5;
    s.share[2] = 0.25;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    assert_true(s.figures[0].coverage == 1);
    assert_true(is_near(s.figures[1].coverage, 0.5, 0.1));
    assert_true(is_near(s.figures[2].coverage, 0.25, 0.1));
    assert_true(s.figures[1].coverage >= 0.5 && s.figures[1].good);
    assert_false(s.figures[2].good);
}

/* A cap of 60 degrees around the south pole, less the rim that points just beyond it still support: the wider
 * of the mask's 0.15 and the cover radius, two mean spacings of the frame's points. */
static void surface_without_support_is_measured_and_placed(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.is_made = true;
    for (int t = 0; t < FRAMES; t++) s.share[t] = 0.75;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    double rim = 2 * sqrt(4 * pi / POINTS), tilt = pi / 3 - rim, share = (1 - cos(tilt)) / 2;
    for (int t = 0; t < FRAMES; t++) {
        const npg_figures *f = &s.figures[t];
        assert_true(is_near(f->unsupported_share, share, 0.03));
        assert_true(is_near(f->unsupported_at[0], 0, 0.01) && is_near(f->unsupported_at[1], 0, 0.01));
        assert_true(is_near(f->unsupported_at[2], -(1 + cos(tilt)) / 2, 0.03));
        assert_false(f->good);
    }
    assert_int_equal(s.bad_count, FRAMES);
    const char *const lenient[][2] = {{"bars.unsupported", "25"}, {NULL, NULL}};
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
}

static void what_another_frame_saw_has_support(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.is_made = true;
    s.share[1] = 0.75;
    assert_int_equal(run_scene(&s, NULL), NPG_OK);
    for (int t = 0; t < FRAMES; t++) {
        assert_true(s.figures[t].unsupported_share == 0);
        assert_true(isnan(s.figures[t].unsupported_at[0]));
    }
    assert_true(s.figures[1].coverage < 0.85);
    s.is_made = false; /* no mask: nothing is known */
    assert_int_equal(run_scene(&s, NULL), NPG_OK);
    for (int t = 0; t < FRAMES; t++) assert_true(isnan(s.figures[t].unsupported_share));
}

/* The reference of one frame that saw less than another: what that one sees is supported there. */
static void a_frames_own_points_support(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.is_made = true;
    s.key_only = true;
    s.share[0] = s.share[2] = 0.75;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    assert_true(s.figures[0].unsupported_share > 0.1 && s.figures[2].unsupported_share > 0.1);
    assert_true(s.figures[1].unsupported_share == 0 && s.figures[1].good);
}

/* The figures of one frame that is measured by itself; the mesh is let go. */
static const npg_figures *figures_of(npg_frame *frame, npg_mesh *mesh, const npg_measure_settings *settings)
{
    const npg_frame_box box = {.scale = 1, .diagonal = 1};
    npg_measure *measure;
    assert_int_equal(npg_mesh_make_normals(mesh), NPG_OK);
    assert_int_equal(npg_measure_open(&measure, mesh, 0, settings), NPG_OK);
    assert_int_equal(npg_measure_frame(measure, frame, &box), NPG_OK);
    npg_measure_close(&measure);
    npg_mesh_unref(&mesh);
    return &frame->figures;
}

/* A reference that its own frame contradicts, though it is moved to where all is right: a sphere that lies beside what the
 * sensor of the keyframe sees. */
static double nowhere_of(float shift, bool is_key, bool lies_as_key)
{
    enum { SIDE = 100 };
    static float cells[SIDE * SIDE], points[3 * VERTS];
    const npg_measure_settings settings = {.cover_dist = 1, .lies_as_key = lies_as_key};
    npg_depth_view view = {.to_sensor = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 9},
                           .first = {-0.5, -0.5},
                           .step = 0.01,
                           .width = SIDE,
                           .height = SIDE};
    float sensor[3] = {0, 0, -9};
    npg_mesh *mesh;
    assert_int_equal(open_sphere(&mesh), NPG_OK);
    memcpy(points, mesh->vert_pos, sizeof points);
    for (size_t v = 0; v < VERTS; v++) mesh->vert_pos[3 * v] += shift;
    for (int i = 0; i < SIDE * SIDE; i++) { /* the sphere's outline, at least */
        int x = i % SIDE - SIDE / 2, y = i / SIDE - SIDE / 2;
        cells[i] = x * x + y * y < 13 * 13 ? 8 : INFINITY;
    }
    npg_frame frame = {.is_key = is_key,
                       .pos_local = points,
                       .point_count = VERTS,
                       .vert_unit = points,
                       .vert_count = VERTS,
                       .sensor_local = sensor,
                       .sensor_count = 1,
                       .views = &view,
                       .view_cells = cells,
                       .view_cell_count = SIDE * SIDE};
    return figures_of(&frame, mesh, &settings)->nowhere_share;
}

static void the_keyframe_contradicts_what_lies_elsewhere(void **state)
{
    (void)state;
    assert_true(nowhere_of(0, true, true) == 0);
    assert_true(nowhere_of(1, true, true) > 0.2);
    assert_true(nowhere_of(1, false, true) == 0); /* of another frame the pose counts alone */
    assert_true(nowhere_of(1, true, false) == 0); /* and of a mesh that was given, too */
}

/* Of a sphere of which a sensor has seen the half that it can see. */
static double vertex_dist_of_half(size_t sensor_count)
{
    static float points[3 * VERTS];
    const npg_measure_settings settings = {.cover_dist = 1};
    float sensor[3] = {0, 0, -9};
    size_t count = 0;
    npg_mesh *mesh;
    assert_int_equal(open_sphere(&mesh), NPG_OK);
    for (size_t v = 0; v < VERTS; v++)
        if (mesh->vert_pos[3 * v + 2] < 0.1f) memcpy(points + 3 * count++, mesh->vert_pos + 3 * v, 12);
    npg_frame frame = {.pos_local = points,
                       .point_count = count,
                       .vert_unit = mesh->vert_pos,
                       .vert_count = VERTS,
                       .sensor_local = sensor,
                       .sensor_count = sensor_count};
    return figures_of(&frame, mesh, &settings)->vertex_dist_mean;
}

static void what_no_sensor_can_see_does_not_stand_off(void **state)
{
    (void)state;
    assert_true(vertex_dist_of_half(0) > 0.3);
    assert_true(vertex_dist_of_half(1) < 0.01);
}

static void bad_frames_make_a_partial_run(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.gap[1] = 0.05; /* 1.4 % of the diagonal */
    s.skipped[2] = true;
    assert_int_equal(run_scene(&s, NULL), NPG_PARTIAL);
    assert_true(s.figures[0].good);
    assert_false(s.figures[1].good);
    assert_false(s.figures[2].good);
    assert_true(isnan(s.figures[2].point_dist_median));
    assert_int_equal(s.bad_count, 1);
    assert_int_equal(s.skipped_count, 1);
    const char *const lenient[][2] = {{"bars.residual", "2"}, {NULL, NULL}};
    s.skipped[2] = false;
    assert_int_equal(run_scene(&s, lenient), NPG_OK);
    s.vert_scale[1] = 4; /* grown faces: beyond every bar */
    assert_int_equal(run_scene(&s, lenient), NPG_PARTIAL);
    assert_true(s.figures[1].stretched_share == 1);
}

static void fewer_points_give_nearly_the_same(void **state)
{
    (void)state;
    scene all = plain_scene(), some = plain_scene();
    const char *const settings[][2] = {{"evaluate-points", "300"}, {NULL, NULL}};
    assert_int_equal(run_scene(&all, NULL), NPG_OK);
    assert_int_equal(run_scene(&some, settings), NPG_OK);
    assert_true(is_near(some.figures[0].point_dist_median, all.figures[0].point_dist_median, 5e-4));
    assert_true(some.figures[0].point_dist_median != all.figures[0].point_dist_median);
    assert_true(some.figures[0].coverage > 0.95);
}

static void a_vertex_that_is_not_finite_is_a_failure(void **state)
{
    (void)state;
    scene s = plain_scene();
    s.broken[1] = true;
    assert_int_equal(run_scene(&s, NULL), NPG_DIVERGED);
    assert_non_null(strstr(last_text, "frame 1: vertex 33"));
}

static void no_memory_is_said(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status && n < 600; n += n < 40 ? 1 : 5) {
        scene s = plain_scene();
        npg_memory_fail_at(n, true);
        status = run_scene(&s, NULL);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_rigid_motion_changes_nothing, open_shape, close_shape),
        cmocka_unit_test_setup_teardown(growth_is_edge_change_and_stretch, open_shape, close_shape),
        cmocka_unit_test_setup_teardown(a_vertex_pushed_over_its_neighbours_flips_faces, open_shape,
                                        close_shape),
        cmocka_unit_test_setup_teardown(a_fold_of_many_faces_is_not_many_flips, open_shape, close_shape),
        cmocka_unit_test_setup_teardown(what_is_turned_over_counts_by_its_area, open_shape, close_shape),
        cmocka_unit_test_setup_teardown(a_flattened_face_is_stretched_not_flipped, open_shape, close_shape),
        cmocka_unit_test(distances_are_those_that_were_made),
        cmocka_unit_test(vertex_distances_agree_with_the_plain_way),
        cmocka_unit_test(nearly_all_points_must_be_near),
        cmocka_unit_test(a_place_that_is_missed_is_a_fault),
        cmocka_unit_test(coverage_is_the_share_with_points),
        cmocka_unit_test(surface_without_support_is_measured_and_placed),
        cmocka_unit_test(what_another_frame_saw_has_support),
        cmocka_unit_test(a_frames_own_points_support),
        cmocka_unit_test(the_keyframe_contradicts_what_lies_elsewhere),
        cmocka_unit_test(what_no_sensor_can_see_does_not_stand_off),
        cmocka_unit_test(bad_frames_make_a_partial_run),
        cmocka_unit_test(fewer_points_give_nearly_the_same),
        cmocka_unit_test(a_vertex_that_is_not_finite_is_a_failure),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
