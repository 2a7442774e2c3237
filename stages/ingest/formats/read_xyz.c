/* XYZ reader: one point per line, columns by blanks, commas or semicolons;
 * normals where columns 4 to 6 are. */
#include <math.h>
#include <string.h>
#include <strings.h>

#include "geometry/geometry.h"
#include "ingest/ingest_internal.h"

#define COLUMNS_MAX    6
#define UNIT_TOLERANCE 0.02 /* of a normal's length from 1; set by trial, as the next                   */
#define UNIT_SHARE     0.9  /* of the rows: below it columns 4 to 6 are something else, colours perhaps */

typedef struct reader {
    npg_source *source;
    npg_builder *points;
    bool wants_normals;             /* .xyzn: columns 4 to 6 are normals whatever their length */
    int columns;                    /* of the first row, at most COLUMNS_MAX; 0 before it */
    uint64_t claimed_count;         /* .pts: its first line; UINT64_MAX without           */
    uint64_t unit_rows, blank_rows; /* rows whose normal has unit length, or none at all  */
} reader;

static bool is_comment(const char *at, const char *end)
{
    return at == end || *at == '#' || *at == '!' || (end - at > 1 && at[0] == '/' && at[1] == '/');
}

static bool starts_number(char c)
{
    return (c >= '0' && c <= '9') || c == '-' || c == '+' || c == '.' || c == 'n' || c == 'N' || c == 'i' ||
           c == 'I';
}

/* Upper bound of the rows, so that the arrays are made once and at the right size. */
static npg_status count_rows(npg_source *source, size_t *rows)
{
    const char *text;
    size_t length;
    npg_status status;
    *rows = 0;
    while (!(status = npg_source_line(source, &text, &length))) {
        const char *at = npg_skip_blanks(text, text + length);
        *rows += length - (size_t)(at - text) >= 5 && starts_number(*at); /* "0 0 0" has 5 bytes */
    }
    if (status != NPG_END) return status;
    return npg_source_rewind(source);
}

/* "x y z" and the like above the first row. */
static bool is_title(const char *at, const char *end)
{
    while (at < end && (*at == '"' || *at == '\'')) at++;
    return at < end && (*at == 'x' || *at == 'X') && (end - at == 1 || strchr(" \t,;\"'_", at[1]));
}

static npg_status parse_row(reader *r, double values[COLUMNS_MAX], int *columns, const char *at,
                            const char *end)
{
    *columns = 0;
    while (at < end && *columns < COLUMNS_MAX) {
        NPG_TRY(npg_source_number(r->source, &values[(*columns)++], &at, end));
        if (at < end && (*at == ',' || *at == ';')) at = npg_skip_blanks(at + 1, end);
    }
    return NPG_OK;
}

static bool is_unit(const double *normal)
{
    return fabs(npg_vec3_length(normal) - 1) < UNIT_TOLERANCE;
}

static bool is_blank(const double *normal)
{
    return isnan(normal[0] + normal[1] + normal[2]) || (normal[0] == 0 && normal[1] == 0 && normal[2] == 0);
}

/* The first row settles what the columns are. */
static npg_status begin_rows(reader *r, const double *values, int columns, size_t rows)
{
    if (columns < 3)
        return npg_source_bad_line(r->source, "%d value%s where a point has at least 3", columns,
                                   columns == 1 ? "" : "s");
    if (r->wants_normals && columns < 6)
        return npg_source_bad_line(r->source, "%d values where a point with a normal has 6", columns);
    r->columns = columns;
    r->points->has_normals =
        columns == 6 && (r->wants_normals || is_unit(values + 3) || is_blank(values + 3));
    return npg_builder_reserve(r->points, rows, 0);
}

static npg_status add_row(reader *r, const double *values, int columns, size_t rows)
{
    if (!r->columns) NPG_TRY(begin_rows(r, values, columns, rows));
    if (columns != r->columns)
        return npg_source_bad_line(r->source, "%d value%s where the first row has %d", columns,
                                   columns == 1 ? "" : "s", r->columns);
    if (r->points->has_normals) {
        r->unit_rows += is_unit(values + 3);
        r->blank_rows += is_blank(values + 3);
    }
    NPG_TRY(npg_builder_reserve(r->points, 1, 0));
    npg_builder_add(r->points, values);
    return NPG_OK;
}

static npg_status parse_line(reader *r, const char *at, const char *end, size_t rows)
{
    double values[NPG_SLOTS] = {0};
    int columns;
    if (is_comment(at, end)) return NPG_OK;
    if (!r->columns && r->claimed_count == UINT64_MAX && is_title(at, end)) return NPG_OK;
    NPG_TRY(parse_row(r, values, &columns, at, end));
    /* .pts files begin with the number of their points. */
    bool is_count = columns == 1 && !r->columns && r->claimed_count == UINT64_MAX && values[0] >= 0 &&
                    values[0] < 1e15 && values[0] == floor(values[0]);
    if (!is_count) return add_row(r, values, columns, rows);
    r->claimed_count = (uint64_t)values[0];
    return NPG_OK;
}

static npg_status read_rows(reader *r, size_t rows)
{
    const char *text;
    size_t length;
    npg_status status;
    while (!(status = npg_source_line(r->source, &text, &length))) {
        const char *end = text + length;
        /* The byte order mark that Windows editors put in front of UTF-8. */
        if (r->source->line == 1 && length >= 3 && !memcmp(text, "\xef\xbb\xbf", 3)) text += 3;
        NPG_TRY(parse_line(r, npg_skip_blanks(text, end), end, rows));
    }
    return status == NPG_END ? NPG_OK : status;
}

static npg_status check_count_and_normals(reader *r)
{
    npg_builder *b = r->points;
    if (r->claimed_count != UINT64_MAX && r->claimed_count != b->vert_count)
        return npg_error(NPG_BAD_INPUT, "%s: line 1: claims %llu points, but %zu follow", r->source->name,
                         (unsigned long long)r->claimed_count, b->vert_count);
    /* Points without a normal, which scanners write as 0 0 0 or nan, don't count. */
    double directed = (double)(b->vert_count - r->blank_rows);
    bool are_normals = r->unit_rows && (double)r->unit_rows >= UNIT_SHARE * directed;
    if (!r->wants_normals && !are_normals) npg_release(&b->normals);
    return NPG_OK;
}

npg_status npg_xyz_read(npg_builder *b, npg_source *source)
{
    const char *dot = strrchr(source->name, '.');
    reader r = {.source = source, .points = b, .claimed_count = UINT64_MAX};
    size_t rows = 0;
    r.wants_normals = dot && !strcasecmp(dot, ".xyzn");
    NPG_TRY(npg_source_find_line_end(source));
    if (source->is_seekable) NPG_TRY(count_rows(source, &rows));
    NPG_TRY(read_rows(&r, rows));
    return check_count_and_normals(&r);
}
