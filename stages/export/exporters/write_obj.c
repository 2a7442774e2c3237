/* OBJ writer, and the writer of any format. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

/* Digits after the point that keep 1e-7 of the extent, and 9 digits at least where the extent is unknown. */
int npg_obj_decimals_for(const npg_mesh_view *mesh)
{
    double extent = 0;
    for (size_t i = 3; i < 3 * mesh->vert_count; i++)
        extent = fmax(extent, fabs(mesh->vert_world[i] - mesh->vert_world[i % 3]));
    if (!(extent > 0) || !isfinite(extent)) return 9;
    int decimals = (int)ceil(7 - log10(extent));             /* as many as a float can tell apart */
    return decimals < 1 ? 1 : decimals > 30 ? 30 : decimals; /* lines have room for 30 */
}

void npg_obj_add_numbers(char *line, size_t size, int decimals, const double *values, int count)
{
    size_t used = strlen(line);
    for (int i = 0; i < count && used < size; i++) {
        char format[16], number[360];
        snprintf(format, sizeof format, "%%.%d%c", decimals, fabs(values[i]) < 1e15 ? 'f' : 'e');
        npg_number_print(number, sizeof number, format, values[i]);
        used += (size_t)snprintf(line + used, size - used, " %s", number);
    }
}

static void write_vertices(npg_file *file, const npg_mesh_view *mesh)
{
    int decimals = npg_obj_decimals_for(mesh);
    for (size_t i = 0; i < mesh->vert_count; i++) {
        char line[512] = "v";
        double colour[3];
        npg_obj_add_numbers(line, sizeof line, decimals, mesh->vert_world + 3 * i, 3);
        for (size_t c = 0; c < 3 && mesh->vert_colours; c++)
            colour[c] = (double)mesh->vert_colours[4 * i + c] / 255;
        if (mesh->vert_colours) npg_obj_add_numbers(line, sizeof line, 4, colour, 3);
        npg_file_print(file, "%s\n", line);
    }
}

static void write_rows(npg_file *file, const char *word, const float *rows, size_t count, int width)
{
    for (size_t i = 0; i < count && rows; i++) {
        double row[3];
        char line[512];
        snprintf(line, sizeof line, "%s", word);
        for (int a = 0; a < width; a++) row[a] = (double)rows[i * (size_t)width + (size_t)a];
        npg_obj_add_numbers(line, sizeof line, 7, row, width);
        npg_file_print(file, "%s\n", line);
    }
}

static void write_face(npg_file *file, const npg_mesh_view *mesh, const uint32_t *face)
{
    const char *format = mesh->vert_uvs && mesh->vert_normals ? " %u/%u/%u"
                         : mesh->vert_uvs                     ? " %u/%u"
                         : mesh->vert_normals                 ? " %u//%u"
                                                              : " %u";
    char text[128] = "f";
    size_t used = 1;
    for (int k = 0; k < 3; k++) {
        unsigned i = face[k] + 1;
        used += (size_t)snprintf(text + used, sizeof text - used, format, i, i, i);
    }
    npg_file_print(file, "%s\n", text);
}

npg_status npg_write_obj(const char *path, const npg_mesh_view *mesh)
{
    npg_file *file;
    NPG_TRY(npg_file_open(&file, path));
    write_vertices(file, mesh);
    write_rows(file, "vt", mesh->vert_uvs, mesh->vert_count, 2);
    write_rows(file, "vn", mesh->vert_normals, mesh->vert_count, 3);
    for (size_t f = 0; f < mesh->face_count; f++) write_face(file, mesh, mesh->faces + 3 * f);
    return npg_file_commit(&file);
}

/* By the ending. */
npg_status npg_write_mesh(const char *path, const npg_mesh_view *mesh)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    if (dot && !strcasecmp(dot, ".ply")) return npg_write_ply(path, mesh);
    if (dot && !strcasecmp(dot, ".obj")) return npg_write_obj(path, mesh);
    return npg_error(NPG_USAGE, "%s: a mesh is written as .ply or .obj", path);
}
