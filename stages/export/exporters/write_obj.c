/* OBJ writer: a mesh, one that keeps the lines of another OBJ, a sequence beside a PLY one
 * (OUT/obj/<prefix>_0000.obj); and the writer of any format. */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <strings.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

/* Digits after the point that keep 1e-7 of the extent, and 9 digits at least where the extent is unknown. */
static int decimals_for(const npg_mesh_view *mesh)
{
    double extent = 0;
    for (size_t i = 3; i < 3 * mesh->vert_count; i++)
        extent = fmax(extent, fabs(mesh->vert_world[i] - mesh->vert_world[i % 3]));
    if (!(extent > 0) || !isfinite(extent)) return 9;
    int decimals = (int)ceil(7 - log10(extent));             /* as many as a float can tell apart */
    return decimals < 1 ? 1 : decimals > 30 ? 30 : decimals; /* lines have room for 30 */
}

/* Append " <number>" for each value to a line of `size` bytes, with a decimal point in every locale. */
static void add_numbers(char *line, size_t size, int decimals, const double *values, int count)
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
    int decimals = decimals_for(mesh);
    for (size_t i = 0; i < mesh->vert_count; i++) {
        char line[512] = "v";
        double colour[3];
        add_numbers(line, sizeof line, decimals, mesh->vert_world + 3 * i, 3);
        for (size_t c = 0; c < 3 && mesh->vert_colours; c++)
            colour[c] = (double)mesh->vert_colours[4 * i + c] / 255;
        if (mesh->vert_colours) add_numbers(line, sizeof line, 4, colour, 3);
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
        add_numbers(line, sizeof line, 7, row, width);
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

static npg_status write_obj(const char *path, const npg_mesh_view *mesh)
{
    npg_file *file;
    NPG_TRY(npg_file_open(&file, path));
    write_vertices(file, mesh);
    write_rows(file, "vt", mesh->vert_uvs, mesh->vert_count, 2);
    write_rows(file, "vn", mesh->vert_normals, mesh->vert_count, 3);
    for (size_t f = 0; f < mesh->face_count; f++) write_face(file, mesh, mesh->faces + 3 * f);
    return npg_file_commit(&file);
}

/* ---- the lines of another OBJ, but for positions and normals ---- */

typedef struct copying {
    npg_file *file;
    npg_source *source;
    const npg_mesh_view *mesh;
    int decimals;
    size_t vertex; /* the next one */
} copying;

static const char *word_end(const char *at, const char *end)
{
    while (at < end && *at != ' ' && *at != '\t') at++;
    return at;
}

/* A position: its three numbers are new, what follows them (a weight, a colour) stays.  Its normal comes
 * right after it, so that the i-th normal is that of the i-th vertex wherever faces stand in between. */
static void copy_vertex(copying *c, const char *at, const char *end)
{
    char line[1200] = "v";
    double row[3];
    size_t i = c->vertex++;
    if (i >= c->mesh->vert_count) return;
    for (int k = 0; k < 3; k++) at = npg_skip_blanks(word_end(at, end), end);
    add_numbers(line, sizeof line, c->decimals, c->mesh->vert_world + 3 * i, 3);
    npg_file_print(c->file, at < end ? "%s " : "%s", line);
    npg_file_write(c->file, at, (size_t)(end - at));
    npg_file_write(c->file, "\n", 1);
    if (!c->mesh->vert_normals) return;
    for (size_t a = 0; a < 3; a++) row[a] = (double)c->mesh->vert_normals[3 * i + a];
    strcpy(line, "vn");
    add_numbers(line, sizeof line, 7, row, 3);
    npg_file_print(c->file, "%s\n", line);
}

/* v, v/vt, v//vn or v/vt/vn becomes v/vt/v: normals are numbered as vertices, from either end. */
static void copy_corner(const copying *c, const char *at, const char *end)
{
    const char *slash = memchr(at, '/', (size_t)(end - at));
    const char *index_end = slash ? slash : end, *uv = slash ? slash + 1 : end;
    const char *uv_end = memchr(uv, '/', (size_t)(end - uv));
    if (!uv_end) uv_end = end;
    npg_file_write(c->file, " ", 1);
    npg_file_write(c->file, at, (size_t)(index_end - at));
    if (uv < uv_end || c->mesh->vert_normals) npg_file_write(c->file, "/", 1);
    npg_file_write(c->file, uv, (size_t)(uv_end - uv));
    if (!c->mesh->vert_normals) return;
    npg_file_write(c->file, "/", 1);
    npg_file_write(c->file, at, (size_t)(index_end - at));
}

static bool is_gap(char c)
{
    return c == ' ' || c == '\t' || c == '\r';
}

/* The corners after the first one, from the last on: the face looks the other way and is cut
 * into the same triangles. */
static void copy_backwards(const copying *c, const char *at, const char *end)
{
    while (at < end) {
        while (at < end && is_gap(end[-1])) end--;
        const char *word = end;
        while (word > at && !is_gap(word[-1])) word--;
        if (word < end) copy_corner(c, word, end);
        end = word;
    }
}

static void copy_face(const copying *c, const char *at, const char *end)
{
    npg_file_write(c->file, "f", 1);
    for (bool is_first = true; at < end; is_first = false) {
        const char *after = word_end(at, end);
        if (!is_first && c->mesh->turns_faces) {
            copy_backwards(c, at, end);
            break;
        }
        copy_corner(c, at, after);
        at = npg_skip_blanks(after, end);
    }
    npg_file_write(c->file, "\n", 1);
}

static void copy_line(copying *c, const char *line, const char *end)
{
    const char *word = npg_skip_blanks(line, end), *after = word_end(word, end);
    const char *values = npg_skip_blanks(after, end);
    size_t length = (size_t)(after - word);
    bool is_v = length && word[0] == 'v', is_f = length && word[0] == 'f';
    if (is_v && length == 1) {
        copy_vertex(c, values, end);
    } else if (is_f && (length == 1 || (length == 2 && word[1] == 'o'))) {
        copy_face(c, values, end);
    } else if (!(is_v && length == 2 && word[1] == 'n')) {
        npg_file_write(c->file, line, (size_t)(end - line));
        npg_file_write(c->file, "\n", 1);
    }
}

static npg_status copy_lines(copying *c)
{
    const char *line;
    size_t length;
    npg_status status;
    NPG_TRY(npg_source_find_line_end(c->source));
    while (!(status = npg_source_line(c->source, &line, &length))) copy_line(c, line, line + length);
    if (status != NPG_END) return status;
    if (c->vertex == c->mesh->vert_count) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s has %zu vertices where there were %zu", c->source->name, c->vertex,
                     c->mesh->vert_count);
}

npg_status npg_write_obj_like(const char *path, const char *like, const npg_mesh_view *mesh)
{
    copying c = {.mesh = mesh, .decimals = decimals_for(mesh)};
    NPG_TRY(npg_source_open_file(&c.source, like));
    npg_status status = npg_file_open(&c.file, path);
    if (!status) status = copy_lines(&c);
    status = npg_file_end(&c.file, status);
    npg_source_close(&c.source);
    return status;
}

/* ---- a pose, and the sequence ---- */

npg_status npg_write_pose(const char *path, const npg_export_facts *facts, const float *pos,
                          const float *normals, const uint8_t *colours)
{
    double *world;
    NPG_TRY(npg_alloc_array(&world, NPG_FOR_FILES, facts->vert_count, 3 * sizeof *world));
    for (size_t i = 0; i < 3 * facts->vert_count; i++) world[i] = (double)pos[i];
    npg_mesh_view view = {.vert_count = facts->vert_count,
                          .face_count = facts->face_count,
                          .vert_world = world,
                          .vert_normals = normals,
                          .faces = facts->faces,
                          .vert_colours = colours ? colours : facts->colours,
                          .vert_uvs = facts->uvs,
                          .turns_faces = facts->turns_faces};
    bool is_like = facts->like && !strcmp(strrchr(path, '.'), ".obj");
    npg_status status = is_like ? npg_write_obj_like(path, facts->like, &view) : npg_write_mesh(path, &view);
    npg_release(&world);
    return status;
}

static uint64_t bytes(const npg_export_facts *facts)
{
    uint64_t per_vert = facts->has_normals ? 100 : 70; /* with its two faces, about */
    return (uint64_t)facts->pose_count * facts->vert_count * per_vert;
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    return npg_write_pose(pose->path, ((npg_writer *)state)->facts, pose->pos, pose->normals, pose->colours);
}

const npg_exporter npg_exporter_obj = {.name = "obj",
                                       .folder = "obj",
                                       .ending = "obj",
                                       .state_size = sizeof(npg_writer),
                                       .bytes = bytes,
                                       .pose = write_pose};

const npg_exporter npg_exporter_ply = {.name = "ply",
                                       .folder = "ply",
                                       .ending = "ply",
                                       .state_size = sizeof(npg_writer),
                                       .bytes = bytes,
                                       .pose = write_pose};

/* ---- any format ---- */

/* By the ending. */
npg_status npg_write_mesh(const char *path, const npg_mesh_view *mesh)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    if (dot && !strcasecmp(dot, ".ply")) return npg_write_ply(path, mesh);
    if (dot && !strcasecmp(dot, ".obj")) return write_obj(path, mesh);
    return npg_error(NPG_USAGE, "%s: a mesh is written as .ply or .obj", path);
}
