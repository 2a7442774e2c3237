/* Mesh files: a square with colours, normals and texture, in every form that carries them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "tests/ingest/read_helpers.h"

static void check_square(const npg_mesh *mesh)
{
    const float pos[] = {0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
    const uint32_t faces[] = {0, 1, 2, 0, 2, 3};
    const uint8_t colour[] = {255, 128, 0, 255};
    assert_int_equal(mesh->vert_count, 4);
    assert_int_equal(mesh->face_count, 2);
    assert_memory_equal(mesh->vert_pos, pos, sizeof pos);
    assert_memory_equal(mesh->faces, faces, sizeof faces);
    for (size_t i = 0; i < 4; i++) {
        assert_memory_equal(mesh->vert_colours + 4 * i, colour, 4);
        assert_true(mesh->vert_normals[3 * i] == 0 && mesh->vert_normals[3 * i + 2] == 1);
        assert_true(mesh->vert_uvs[2 * i] == pos[3 * i] && mesh->vert_uvs[2 * i + 1] == pos[3 * i + 1]);
    }
}

static void read_square(const char *name, const void *data, size_t size)
{
    npg_mesh *mesh;
    npg_origin origin = {0};
    if (npg_read_mesh(&mesh, save(name, data, size), &origin)) fail_msg("%s", npg_error_text());
    check_square(mesh);
    npg_mesh_unref(&mesh);
}

static void meshes_with_all_they_carry(void **state)
{
    (void)state;
    const char *obj =
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvn 0 0 2\nv 0 0 0 1 .5 0\nv 1 0 0 1 .5 0\nv 1 1 0 1 .5 0\n"
        "v 0 1 0 1 .5 0\nf 1/1/1 2/2/1 3/3/1 4/4/-1\n";
    read_square("square.obj", obj, strlen(obj));
    const char *head =
        "element vertex 4\nproperty float x\nproperty float y\nproperty float z\nproperty uchar red\n"
        "property uchar green\nproperty uchar blue\nproperty float nx\nproperty float ny\n"
        "property float nz\nproperty float s\nproperty float t\nelement face 1\n"
        "property int flags\nproperty list uchar uint vertex_index\nend_header\n";
    char text[2048];
    snprintf(text, sizeof text,
             "ply\nformat ascii 1.0\n%s0 0 0 255 128 0 0 0 1 0 0\n1 0 0 255 128 0 0 0 1 1 0\n"
             "1 1 0 255 128 0 0 0 1 1 1\n0 1 0 255 128 0 0 0 1 0 1\n-5 4 0 1 2 3\n",
             head);
    read_square("square.ply", text, strlen(text));
    static bytes b;
    b.size = 0;
    put_text(&b, "ply\nformat binary_big_endian 1.0\n");
    put_text(&b, head);
    const float xy[][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    for (size_t i = 0; i < 4; i++) {
        const float before[] = {xy[i][0], xy[i][1], 0}, after[] = {0, 0, 1, xy[i][0], xy[i][1]};
        for (size_t k = 0; k < 3; k++) put_float(&b, before[k], true);
        put_bytes(&b, "\xff\x80\0", 3);
        for (size_t k = 0; k < 5; k++) put_float(&b, after[k], true);
    }
    put_bits(&b, 0, 4, true);
    put_bits(&b, 4, 1, true);
    for (uint64_t k = 0; k < 4; k++) put_bits(&b, k, 4, true);
    read_square("square.ply", b.data, b.size);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(meshes_with_all_they_carry)};
    return cmocka_run_group_tests(tests, open_reader_tests, close_reader_tests);
}
