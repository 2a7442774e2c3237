/* OBJ writer that keeps the lines of another OBJ: only positions and normals are new. */
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

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
    npg_obj_add_numbers(line, sizeof line, c->decimals, c->mesh->vert_world + 3 * i, 3);
    npg_file_print(c->file, at < end ? "%s " : "%s", line);
    npg_file_write(c->file, at, (size_t)(end - at));
    npg_file_write(c->file, "\n", 1);
    if (!c->mesh->vert_normals) return;
    for (size_t a = 0; a < 3; a++) row[a] = (double)c->mesh->vert_normals[3 * i + a];
    strcpy(line, "vn");
    npg_obj_add_numbers(line, sizeof line, 7, row, 3);
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
    copying c = {.mesh = mesh, .decimals = npg_obj_decimals_for(mesh)};
    NPG_TRY(npg_source_open_file(&c.source, like));
    npg_status status = npg_file_open(&c.file, path);
    if (!status) status = copy_lines(&c);
    status = npg_file_end(&c.file, status);
    npg_source_close(&c.source);
    return status;
}
