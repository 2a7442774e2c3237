/* NPY reader: arrays N x 3 or N x 6 of 4- or 8-byte floats, either byte order, C or Fortran order. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/ingest_internal.h"

#define HEADER_MAX  65536 /* what version 1 can say; later versions only lift that for field lists */
#define BLOCK_BYTES ((size_t)64 << 10) /* decoded at a time; set by trial */

typedef struct array {
    npg_ply_type type; /* NPG_PLY_FLOAT or NPG_PLY_DOUBLE */
    npg_ply_format order;
    bool is_fortran;
    uint64_t rows;
    size_t columns;
} array;

static npg_status refuse_header(const npg_source *source, const char *cause)
{
    return npg_error(NPG_BAD_INPUT, "%s: NPY header: %s", source->name, cause);
}

/* The text after 'key': in the header's dictionary, NULL when it is not there. */
static const char *value_of(const char *header, const char *key)
{
    const char *at = strstr(header, key);
    if (!at) return NULL;
    at += strlen(key);
    at += strspn(at, "'\" ");
    if (*at != ':') return NULL;
    return at + 1 + strspn(at + 1, " ");
}

static npg_status parse_type(array *a, const char *text, const npg_source *source)
{
    if (!text || (*text != '\'' && *text != '"')) return refuse_header(source, "no plain type (descr)");
    char name[4] = {0};
    snprintf(name, sizeof name, "%.3s", text + 1);
    bool is_whole = strlen(name) == 3; /* else the header ends within it, and there is no text[4] */
    if (!is_whole || !strchr("<>=", name[0]) || (text[4] != '\'' && text[4] != '"'))
        return refuse_header(source, "type (descr) is neither f4 nor f8");
    a->order = name[0] == '>' ? NPG_PLY_BIG : NPG_PLY_LITTLE;
    a->type = name[2] == '8' ? NPG_PLY_DOUBLE : NPG_PLY_FLOAT;
    if (name[1] == 'f' && (name[2] == '4' || name[2] == '8')) return NPG_OK;
    return refuse_header(source, "type (descr) is neither f4 nor f8");
}

static npg_status parse_order(array *a, const char *text, const npg_source *source)
{
    if (!text) return refuse_header(source, "no fortran_order");
    a->is_fortran = !strncmp(text, "True", 4);
    return a->is_fortran || !strncmp(text, "False", 5)
               ? NPG_OK
               : refuse_header(source, "fortran_order is not True or False");
}

static npg_status parse_shape(array *a, const char *text, const npg_source *source)
{
    uint64_t sizes[2];
    if (!text || *text++ != '(') return refuse_header(source, "no shape");
    for (int i = 0; i < 2; i++) {
        text += strspn(text, " ");
        size_t digits = strspn(text, "0123456789");
        if (*text == '-') return refuse_header(source, "negative size in the shape");
        if (!digits || digits > 15) return refuse_header(source, "the shape is not (N, 3) or (N, 6)");
        sizes[i] = strtoull(text, NULL, 10);
        text += digits + (text[digits] == 'L'); /* Python 2 wrote whole numbers as 5000L */
        text += strspn(text, " ");
        if (i == 0 && *text++ != ',') return refuse_header(source, "the shape is not (N, 3) or (N, 6)");
    }
    text += *text == ',';
    text += strspn(text, " ");
    if (*text != ')' || (sizes[1] != 3 && sizes[1] != 6))
        return refuse_header(source, "the shape is not (N, 3) or (N, 6)");
    a->rows = sizes[0];
    a->columns = (size_t)sizes[1];
    return NPG_OK;
}

static npg_status read_header_text(char **text, npg_source *source)
{
    size_t available, length;
    NPG_TRY(npg_source_fill(source, 12, &available));
    const unsigned char *data = npg_source_data(source);
    if (!available) return NPG_END;
    if (available < 10 || memcmp(data, "\x93NUMPY", 6) != 0)
        return npg_source_bad_byte(source, "not an NPY file: it does not begin with \\x93NUMPY");
    unsigned version = data[6], skip = version == 1 ? 10 : 12;
    if (version < 1 || version > 3)
        return npg_source_bad_byte(source, "NPY version %u is not 1, 2 or 3", version);
    if (available < skip) return npg_source_bad_byte(source, "the file ends inside the header");
    length = data[8] | (size_t)data[9] << 8;
    if (version > 1) length |= (size_t)data[10] << 16 | (size_t)data[11] << 24;
    if (length > HEADER_MAX) return npg_source_bad_byte(source, "NPY header of %zu bytes", length);
    NPG_TRY(npg_source_fill(source, skip + length, &available));
    if (available < skip + length) return npg_source_bad_byte(source, "the file ends inside the header");
    NPG_TRY(npg_alloc(text, NPG_FOR_FILES, length + 1));
    memcpy(*text, npg_source_data(source) + skip, length);
    npg_source_take(source, skip + length);
    return NPG_OK;
}

static npg_status read_header(array *a, npg_source *source)
{
    char *text = NULL;
    NPG_TRY(read_header_text(&text, source));
    npg_status status = parse_type(a, value_of(text, "descr"), source);
    if (!status) status = parse_order(a, value_of(text, "fortran_order"), source);
    if (!status) status = parse_shape(a, value_of(text, "shape"), source);
    npg_release(&text);
    if (status) return status;
    uint64_t size = a->rows * a->columns * npg_ply_type_size(a->type), left = npg_source_left(source);
    if (left != UINT64_MAX && size > left)
        return npg_source_bad_byte(source, "the header claims %llu x %zu values, but only %llu bytes follow",
                                   (unsigned long long)a->rows, a->columns, (unsigned long long)left);
    return NPG_OK;
}

/* Rows whose values lie row_step and column_step bytes apart. */
static void add_rows(npg_point_list *points, const array *a, const unsigned char *data, size_t rows,
                     size_t row_step, size_t column_step)
{
    double values[6] = {0};
    for (size_t i = 0; i < rows; i++, data += row_step) {
        for (size_t c = 0; c < a->columns; c++)
            values[c] = npg_ply_value(data + c * column_step, a->type, a->order);
        npg_points_add(points, values, values + 3);
    }
}

static npg_status ends_early(const array *a, const npg_source *source, uint64_t row)
{
    return npg_source_bad_byte(source, "the file ends in row %llu of %llu", (unsigned long long)row,
                               (unsigned long long)a->rows);
}

static npg_status read_c_order(npg_point_list *points, const array *a, npg_source *source)
{
    size_t item = npg_ply_type_size(a->type), row_size = item * a->columns, block = BLOCK_BYTES / row_size;
    if (npg_source_left(source) != UINT64_MAX) NPG_TRY(npg_points_reserve(points, (size_t)a->rows));
    for (uint64_t done = 0; done < a->rows;) {
        size_t available, rows = a->rows - done < block ? (size_t)(a->rows - done) : block;
        NPG_TRY(npg_source_fill(source, rows * row_size, &available));
        if (available < rows * row_size) return ends_early(a, source, done + available / row_size);
        NPG_TRY(npg_points_reserve(points, rows));
        add_rows(points, a, npg_source_data(source), rows, row_size, item);
        npg_source_take(source, rows * row_size);
        done += rows;
    }
    return NPG_OK;
}

/* Columns come one after the other, so all bytes are needed before the first point is whole. */
static npg_status read_fortran_order(npg_point_list *points, const array *a, npg_source *source)
{
    unsigned char *data = NULL;
    size_t item = npg_ply_type_size(a->type), size = (size_t)a->rows * a->columns * item, got;
    NPG_TRY(npg_source_read(source, &data, size, &got));
    npg_status status = got < size ? ends_early(a, source, 0) : npg_points_reserve(points, (size_t)a->rows);
    if (!status) add_rows(points, a, data, (size_t)a->rows, item, item * (size_t)a->rows);
    npg_release(&data);
    return status;
}

npg_status npg_npy_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin)
{
    array a = {0};
    NPG_TRY(read_header(&a, source));
    npg_point_list points = {.frame = frame, .origin = origin, .has_normals = a.columns == 6};
    return a.is_fortran ? read_fortran_order(&points, &a, source) : read_c_order(&points, &a, source);
}
