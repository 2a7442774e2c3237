/* Writers: what is written is read back the same, in both formats, with all that a mesh can carry. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <math.h>

#include "export/files.h"
#include "ingest/ingest.h"
#include "tests/support/group_folder.h"

enum { V = 6, F = 4 };

static const uint32_t faces[3 * F] = {0, 1, 2, 2, 1, 3, 3, 4, 5, 0, 5, 4};
static double world[3 * V];
static float normals[3 * V], uvs[2 * V];
static uint8_t colours[4 * V];

/* A mesh of a size at a place; `parts` says which optional arrays it has. */
static npg_mesh_view make_view(double offset, double size, int parts)
{
    for (size_t i = 0; i < V; i++) {
        for (size_t a = 0; a < 3; a++) {
            world[3 * i + a] = offset * (double)(a + 1) + size * sin(1.7 * (double)i + 2.3 * (double)a);
            normals[3 * i + a] = i % 3 == a ? -1 : 0;
        }
        for (size_t c = 0; c < 4; c++) colours[4 * i + c] = c == 3 ? 255 : (uint8_t)(40 * i + 7 * c);
        uvs[2 * i] = (float)i / V;
        uvs[2 * i + 1] = 1 - uvs[2 * i];
    }
    return (npg_mesh_view){
        V,    F, world, parts & 1 ? normals : NULL, faces, parts & 2 ? colours : NULL, parts & 4 ? uvs : NULL,
        false};
}

static void compare(const npg_mesh *mesh, const npg_origin *origin, const npg_mesh_view *view, double extent)
{
    assert_int_equal(mesh->vert_count, V);
    assert_int_equal(mesh->face_count, F);
    assert_memory_equal(mesh->faces, faces, sizeof faces);
    for (size_t k = 0; k < 3 * V; k++)
        assert_true(fabs((double)mesh->vert_pos[k] + origin->world[k % 3] - world[k]) <= 1.2e-6 * extent);
    assert_true(!mesh->vert_normals == !view->vert_normals);
    assert_true(!mesh->vert_colours == !view->vert_colours);
    assert_true(!mesh->vert_uvs == !view->vert_uvs);
    if (mesh->vert_normals) assert_memory_equal(mesh->vert_normals, normals, sizeof normals);
    if (mesh->vert_colours) assert_memory_equal(mesh->vert_colours, colours, sizeof colours);
    for (size_t k = 0; k < 2 * V && mesh->vert_uvs; k++)
        assert_true(fabs((double)(mesh->vert_uvs[k] - uvs[k])) < 1e-6);
}

static void written_meshes_come_back(void **state)
{
    (void)state;
    static const char *const names[] = {"m.ply", "m.obj", "M.PLY", "m.Obj"};
    const double offsets[] = {0, 1e6, -3e8}, sizes[] = {1, 1e-3, 1e5};
    for (size_t n = 0; n < 4; n++)
        for (int parts = 0; parts < 8; parts++)
            for (size_t k = 0; k < 9; k++) {
                double size = sizes[k / 3];
                npg_mesh_view view = make_view(offsets[k % 3], size, parts);
                npg_mesh *mesh;
                npg_origin origin = {0};
                const char *path = in_folder(&folder, names[n]);
                if (fabs(offsets[k % 3]) * 1e-16 > 1e-8 * size) continue; /* beyond double itself */
                if (npg_write_mesh(path, &view)) fail_msg("%s", npg_error_text());
                if (npg_read_mesh(&mesh, path, &origin)) fail_msg("%s", npg_error_text());
                compare(mesh, &origin, &view, size);
                npg_mesh_unref(&mesh);
            }
}

static void positions_are_float_only_where_that_is_enough(void **state)
{
    (void)state;
    const double offsets[] = {0, 1e6};
    for (size_t k = 0; k < 2; k++) {
        npg_mesh_view view = make_view(offsets[k], 1, 0);
        const char *path = in_folder(&folder, "float.ply");
        assert_int_equal(npg_write_ply(path, &view), NPG_OK);
        char *text = text_of_file(path);
        assert_non_null(strstr(text, k ? "property double x" : "property float x"));
        free(text);
    }
}

static void a_cloud_has_no_faces(void **state)
{
    (void)state;
    static const char *const names[] = {"c.ply", "c.obj"};
    for (size_t n = 0; n < 2; n++) {
        npg_mesh_view view = make_view(0, 1, 1);
        npg_frame frame = {0};
        npg_origin origin = {0};
        view.face_count = 0;
        assert_int_equal(npg_write_mesh(in_folder(&folder, names[n]), &view), NPG_OK);
        assert_int_equal(npg_read_cloud(&frame, in_folder(&folder, names[n]), &origin), NPG_OK);
        assert_int_equal(frame.point_count, V);
        assert_memory_equal(frame.normals, normals, sizeof normals);
        npg_frame_clear(&frame);
    }
}

static void the_same_mesh_gives_the_same_bytes(void **state)
{
    (void)state;
    static const char *const names[][2] = {{"1.ply", "2.ply"}, {"1.obj", "2.obj"}};
    for (size_t n = 0; n < 2; n++) {
        char command[1200];
        for (size_t k = 0; k < 2; k++) {
            npg_mesh_view view = make_view(5, 1, 7);
            assert_int_equal(npg_write_mesh(in_folder(&folder, names[n][k]), &view), NPG_OK);
        }
        snprintf(command, sizeof command, "cmp '%s' '%s'", in_folder(&folder, names[n][0]),
                 in_folder(&folder, names[n][1]));
        assert_int_equal(system(command), 0);
    }
}

static void failures_leave_nothing(void **state)
{
    (void)state;
    npg_mesh_view view = make_view(0, 1, 7);
    assert_int_equal(npg_write_mesh(in_folder(&folder, "m.stl"), &view), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "m.stl"));
    assert_int_equal(npg_write_mesh(in_folder(&folder, "no/such/folder/m.ply"), &view), NPG_DISK);
    assert_non_null(strstr(npg_error_text(), "no/such/folder/m.ply"));
    for (uint64_t n = 1; n <= 3; n++) {
        npg_memory_fail_at(n, true);
        assert_int_equal(npg_write_mesh(in_folder(&folder, "never.ply"), &view), NPG_MEMORY);
        npg_memory_fail_at(0, false);
        assert_false(exists(in_folder(&folder, "never.ply")));
        assert_false(exists(in_folder(&folder, ".never.ply.part")));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(written_meshes_come_back),
                                       cmocka_unit_test(positions_are_float_only_where_that_is_enough),
                                       cmocka_unit_test(a_cloud_has_no_faces),
                                       cmocka_unit_test(the_same_mesh_gives_the_same_bytes),
                                       cmocka_unit_test(failures_leave_nothing)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
