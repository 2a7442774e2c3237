/* PLY writer: binary little-endian. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "export/files.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

#define KEPT_SHARE 1e-6 /* of the extent: what positions may lose as float */

/* float rounds by at most 2^-24 of the largest coordinate. */
static bool float_is_enough(const npg_mesh_view *mesh)
{
    double lo[3] = {DBL_MAX, DBL_MAX, DBL_MAX}, hi[3] = {-DBL_MAX, -DBL_MAX, -DBL_MAX};
    double extent = 0, largest = 0;
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) {
        lo[i % 3] = fmin(lo[i % 3], mesh->vert_world[i]);
        hi[i % 3] = fmax(hi[i % 3], mesh->vert_world[i]);
    }
    for (int a = 0; a < 3; a++) {
        extent = fmax(extent, hi[a] - lo[a]);
        largest = fmax(largest, fmax(fabs(lo[a]), fabs(hi[a])));
    }
    return !mesh->vert_count || (largest < 1e37 && largest / 16777216 <= KEPT_SHARE * extent);
}

static void write_header(npg_file *file, const npg_mesh_view *mesh, const char *type)
{
    npg_file_print(file, "ply\nformat binary_little_endian 1.0\nelement vertex %zu\n", mesh->vert_count);
    for (const char *axis = "xyz"; *axis; axis++) npg_file_print(file, "property %s %c\n", type, *axis);
    if (mesh->vert_normals) npg_file_print(file, "property float nx\nproperty float ny\nproperty float nz\n");
    if (mesh->vert_uvs) npg_file_print(file, "property float s\nproperty float t\n");
    if (mesh->vert_colours)
        npg_file_print(file, "property uchar red\nproperty uchar green\n"
                             "property uchar blue\nproperty uchar alpha\n");
    if (mesh->face_count)
        npg_file_print(file, "element face %zu\nproperty list uchar int vertex_indices\n", mesh->face_count);
    npg_file_print(file, "end_header\n");
}

static void write_vertex(npg_file *file, const npg_mesh_view *mesh, size_t i, bool as_float)
{
    unsigned char row[64];
    size_t size = 0;
    for (size_t a = 0; a < 3; a++) {
        double x = mesh->vert_world[3 * i + a];
        size += as_float ? npg_put_little(row + size, npg_float_bits((float)x), 4)
                         : npg_put_little(row + size, npg_double_bits(x), 8);
    }
    for (size_t a = 0; a < 3 && mesh->vert_normals; a++)
        size += npg_put_little(row + size, npg_float_bits(mesh->vert_normals[3 * i + a]), 4);
    for (size_t a = 0; a < 2 && mesh->vert_uvs; a++)
        size += npg_put_little(row + size, npg_float_bits(mesh->vert_uvs[2 * i + a]), 4);
    if (mesh->vert_colours) {
        memcpy(row + size, mesh->vert_colours + 4 * i, 4);
        size += 4;
    }
    npg_file_write(file, row, size);
}

static void write_face(npg_file *file, const uint32_t *face)
{
    unsigned char row[13] = {3};
    for (size_t k = 0; k < 3; k++) npg_put_little(row + 1 + 4 * k, face[k], 4);
    npg_file_write(file, row, sizeof row);
}

npg_status npg_write_ply(const char *path, const npg_mesh_view *mesh)
{
    npg_file *file;
    bool as_float = float_is_enough(mesh);
    NPG_REQUIRE(mesh->vert_count <= INT32_MAX);
    NPG_TRY(npg_file_open(&file, path));
    write_header(file, mesh, as_float ? "float" : "double");
    for (size_t i = 0; i < mesh->vert_count; i++) write_vertex(file, mesh, i, as_float);
    for (size_t f = 0; f < mesh->face_count; f++) write_face(file, mesh->faces + 3 * f);
    return npg_file_commit(&file);
}
