/* NPY reader: arrays N x 3 or N x 6 of 4- or 8-byte floats, either byte order, C or Fortran order. */
#include <stdlib.h>
#include <string.h>

#include "ingest/ingest_internal.h"

#define HEADER_MAX 65536 /* what version 1 can say; later versions only lift that for field lists */

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
    char begin, order, kind, size, end;
    if (!text || sscanf(text, "%c%c%c%c%c", &begin, &order, &kind, &size, &end) != 5 ||
        !strchr("'\"", begin) || !strchr("<>=", order) || kind != 'f' || !strchr("48", size) || end != begin)
        return refuse_header(source, "type (descr) is neither f4 nor f8");
    a->order = order == '>' ? NPG_PLY_BIG : NPG_PLY_LITTLE;
    a->type = size == '8' ? NPG_PLY_DOUBLE : NPG_PLY_FLOAT;
    return NPG_OK;
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

static npg_status ends_early(const array *a, const npg_source *source, uint64_t row)
{
    return npg_source_bad_byte(source, "the file ends in row %llu of %llu", (unsigned long long)row,
                               (unsigned long long)a->rows);
}

/* Columns come one after the other, so all bytes are needed before the first point is whole. */
static npg_status read_fortran_order(npg_builder *b, const npg_columns *columns, const array *a,
                                     npg_source *source, size_t size)
{
    size_t available;
    NPG_TRY(npg_source_fill(source, size, &available));
    if (available < size) return ends_early(a, source, 0);
    NPG_TRY(npg_builder_reserve(b, (size_t)a->rows, 0));
    npg_rows_add(b, columns, npg_source_data(source), (size_t)a->rows);
    npg_source_take(source, size);
    return NPG_OK;
}

npg_status npg_npy_read(npg_builder *b, npg_source *source)
{
    array a = {0};
    uint64_t done;
    NPG_TRY(read_header(&a, source));
    npg_columns columns = {.format = a.order};
    size_t item = npg_ply_type_size(a.type), row_size = item * a.columns, rows = (size_t)a.rows;
    for (size_t c = 0; c < a.columns; c++)
        columns.of[c] = (npg_column){.is_there = true,
                                     .type = a.type,
                                     .offset = a.is_fortran ? c * item * rows : c * item,
                                     .step = a.is_fortran ? item : row_size};
    b->has_normals = a.columns == 6;
    if (a.is_fortran) return read_fortran_order(b, &columns, &a, source, rows * row_size);
    npg_status status = npg_rows_read(b, source, &columns, a.rows, row_size, &done);
    return status == NPG_END ? ends_early(&a, source, done) : status;
}
