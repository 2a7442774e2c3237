/* PLY reader: ascii, little- and big-endian, any types and order of properties, unknown elements skipped. */
#include <math.h>
#include <string.h>

#include "ingest/ingest_internal.h"

#define CORNERS_MAX 1024 /* of a polygon; larger ones are damage (set by trial) */

/* ---- the header: what the elements of the file are made of ---- */

enum { ELEMENTS = 16, PROPERTIES = 128, NAME_SIZE = 64 };

typedef struct ply_property {
    char name[NAME_SIZE];
    npg_ply_type type; /* of the value, or of a list's items */
    bool is_list;
    npg_ply_type count_type; /* lists only                                        */
    size_t offset;           /* in the row; meaningful where no list is before it */
} ply_property;

typedef struct ply_element {
    char name[NAME_SIZE];
    uint64_t count;
    bool has_lists;
    size_t row_size; /* bytes of a binary row, lists counted as their bare length */
    size_t property_count;
    ply_property properties[PROPERTIES];
} ply_element;

typedef struct ply_header {
    npg_ply_format format;
    size_t element_count;
    ply_element elements[ELEMENTS];
} ply_header;

/* Far above any header of real files (set by trial), so that damaged ones are refused and cost nothing. */
#define HEADER_LINES_MAX 10000

/* Each type has its name of the first PLY files and one that says its size. */
/* clang-format off */
static const struct {
    const char *name;
    npg_ply_type type;
} type_names[] = {
    {"char",   NPG_PLY_INT8},   {"int8",    NPG_PLY_INT8},
    {"uchar",  NPG_PLY_UINT8},  {"uint8",   NPG_PLY_UINT8},
    {"short",  NPG_PLY_INT16},  {"int16",   NPG_PLY_INT16},
    {"ushort", NPG_PLY_UINT16}, {"uint16",  NPG_PLY_UINT16},
    {"int",    NPG_PLY_INT32},  {"int32",   NPG_PLY_INT32},
    {"uint",   NPG_PLY_UINT32}, {"uint32",  NPG_PLY_UINT32},
    {"float",  NPG_PLY_FLOAT},  {"float32", NPG_PLY_FLOAT},
    {"double", NPG_PLY_DOUBLE}, {"float64", NPG_PLY_DOUBLE}};
/* clang-format on */

/* "ply" and what ends its line decide how all lines end. */
static npg_status read_magic(npg_source *source)
{
    size_t available;
    NPG_TRY(npg_source_fill(source, 5, &available));
    const unsigned char *data = npg_source_data(source);
    if (available == 0) return NPG_END;
    if (available < 4 || memcmp(data, "ply", 3) != 0 || !strchr("\r\n \t", data[3]) || !data[3])
        return npg_source_bad_byte(source, "not a PLY file: it does not begin with \"ply\"");
    bool is_cr = data[3] == '\r' && available > 4 && data[4] != '\n' && data[4] != '\r';
    source->line_end = is_cr ? '\r' : '\n';
    const char *text;
    size_t length;
    return npg_source_line(source, &text, &length);
}

static npg_status parse_format(ply_header *header, const npg_words *line, const npg_source *source)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    if (line->count != 3) return npg_source_bad_line(source, "\"format\" needs a name and a version");
    if (strcmp(line->words[2], "1.0") != 0)
        return npg_source_bad_line(source, "PLY version \"%.40s\" is not 1.0", line->words[2]);
    for (int i = 0; i < 3; i++)
        if (!strcmp(line->words[1], names[i])) {
            header->format = (npg_ply_format)i;
            return NPG_OK;
        }
    return npg_source_bad_line(source, "unknown format \"%.40s\"", line->words[1]);
}

static npg_status copy_name(char *out, const char *name, const npg_source *source)
{
    if (strlen(name) >= NAME_SIZE)
        return npg_source_bad_line(source, "name of %zu bytes: \"%.40s...\"", strlen(name), name);
    strcpy(out, name);
    return NPG_OK;
}

static npg_status parse_element(ply_header *header, const npg_words *line, const npg_source *source)
{
    if (line->count != 3) return npg_source_bad_line(source, "\"element\" needs a name and a count");
    if (header->element_count == ELEMENTS)
        return npg_source_bad_line(source, "more than %d elements", ELEMENTS);
    for (size_t i = 0; i < header->element_count; i++)
        if (!strcmp(header->elements[i].name, line->words[1]))
            return npg_source_bad_line(source, "second element \"%.40s\"", line->words[1]);
    ply_element *element = &header->elements[header->element_count];
    NPG_TRY(copy_name(element->name, line->words[1], source));
    NPG_TRY(npg_source_count(source, &element->count, line->words[2]));
    header->element_count++;
    return NPG_OK;
}

static npg_status parse_type(npg_ply_type *type, const char *name, const npg_source *source)
{
    for (size_t i = 0; i < sizeof type_names / sizeof *type_names; i++)
        if (!strcmp(type_names[i].name, name)) {
            *type = type_names[i].type;
            return NPG_OK;
        }
    return npg_source_bad_line(source, "unknown type \"%.40s\"", name);
}

static npg_status parse_property(ply_header *header, const npg_words *line, const npg_source *source)
{
    if (!header->element_count) return npg_source_bad_line(source, "a property before the first element");
    ply_element *element = &header->elements[header->element_count - 1];
    bool is_list = line->count > 1 && !strcmp(line->words[1], "list");
    if (line->count != (is_list ? 5u : 3u))
        return npg_source_bad_line(source, "\"property\" needs %s",
                                   is_list ? "two types and a name after \"list\"" : "a type and a name");
    if (element->property_count == PROPERTIES)
        return npg_source_bad_line(source, "more than %d properties", PROPERTIES);
    ply_property *property = &element->properties[element->property_count];
    const char *name = line->words[line->count - 1];
    for (size_t i = 0; i < element->property_count; i++)
        if (!strcmp(element->properties[i].name, name))
            return npg_source_bad_line(source, "second property \"%.40s\"", name);
    NPG_TRY(copy_name(property->name, name, source));
    NPG_TRY(parse_type(&property->type, line->words[line->count - 2], source));
    if (is_list) NPG_TRY(parse_type(&property->count_type, line->words[2], source));
    if (is_list && property->count_type >= NPG_PLY_FLOAT)
        return npg_source_bad_line(source, "the length of list \"%s\" is not a whole number", name);
    property->is_list = is_list;
    property->offset = element->row_size;
    element->row_size += npg_ply_type_size(is_list ? property->count_type : property->type);
    element->has_lists |= is_list;
    element->property_count++;
    return NPG_OK;
}

/* A count that the rest of the file can't hold is wrong; found here it costs no memory.  The shortest row of
 * text has a digit and a separator for each value. */
static npg_status check_counts(const ply_header *header, const npg_source *source)
{
    uint64_t left = npg_source_left(source), need = 0;
    for (size_t i = 0; i < header->element_count && left != UINT64_MAX; i++) {
        const ply_element *element = &header->elements[i];
        uint64_t row = header->format == NPG_PLY_ASCII ? 2 * element->property_count : element->row_size;
        if (!row) continue;
        /* The last line of a file may lack its end. */
        if (element->count > (left + 1) / row || (need += element->count * row) > left + 1)
            return npg_source_bad_line(
                source, "the header claims %llu of element \"%s\", but only %llu bytes follow it",
                (unsigned long long)element->count, element->name, (unsigned long long)left);
    }
    return NPG_OK;
}

static npg_status read_lines(ply_header *header, npg_source *source)
{
    npg_words line;
    bool has_format = false;
    for (int i = 0; i < HEADER_LINES_MAX; i++) {
        NPG_TRY(npg_source_words(source, &line));
        const char *word = line.count ? line.words[0] : "comment";
        if (!strcmp(word, "comment") || !strcmp(word, "obj_info")) continue;
        if (!strcmp(word, "end_header")) {
            if (!has_format) return npg_source_bad_line(source, "the header names no format");
            return NPG_OK;
        }
        if (!strcmp(word, "format")) {
            NPG_TRY(parse_format(header, &line, source));
            has_format = true;
        } else if (!strcmp(word, "element")) {
            NPG_TRY(parse_element(header, &line, source));
        } else if (!strcmp(word, "property")) {
            NPG_TRY(parse_property(header, &line, source));
        } else {
            return npg_source_bad_line(source, "unknown word \"%.40s\" in the header", word);
        }
    }
    return npg_source_bad_line(source, "the header has more than %d lines", HEADER_LINES_MAX);
}

/* Read and check the header; the source then stands at the body.  Counts are compared with the bytes that
 * follow where these are known.  NPG_END when the source is at its end before the first byte. */
static npg_status read_header(ply_header *header, npg_source *source)
{
    memset(header, 0, sizeof *header);
    NPG_TRY(read_magic(source));
    NPG_TRY(read_lines(header, source));
    return check_counts(header, source);
}

/* ---- the body ---- */

typedef struct reader {
    npg_source *source;
    ply_header *header;
    const ply_element *vertex, *face; /* into header; face: NULL where none has corners */
    int slot_of[PROPERTIES];          /* of each vertex property, -1: of no interest    */
    npg_columns columns;
    npg_builder *builder;
} reader;

/* ---- what the header says about the vertices ---- */

static const ply_element *find_element(const ply_header *header, const char *name)
{
    for (size_t i = 0; i < header->element_count; i++)
        if (!strcmp(header->elements[i].name, name)) return &header->elements[i];
    return NULL;
}

static void assign_slots(reader *r)
{
    r->columns.format = r->header->format;
    for (size_t p = 0; p < r->vertex->property_count; p++) {
        const ply_property *property = &r->vertex->properties[p];
        int slot = npg_slot_of(property->name);
        bool is_new = slot >= 0 && !r->columns.of[slot].is_there;
        r->slot_of[p] = is_new ? slot : -1;
        if (is_new)
            r->columns.of[slot] = (npg_column){true, property->type, property->offset, r->vertex->row_size};
    }
}

static bool has_slots(const reader *r, int first, int last)
{
    for (int slot = first; slot <= last; slot++)
        if (!r->columns.of[slot].is_there) return false;
    return true;
}

static npg_status find_vertex_element(reader *r)
{
    const char *name = r->source->name;
    r->vertex = find_element(r->header, "vertex");
    if (!r->vertex) return npg_error(NPG_BAD_INPUT, "%s: header: no element \"vertex\"", name);
    for (size_t p = 0; p < r->vertex->property_count; p++)
        if (r->vertex->properties[p].is_list)
            return npg_error(NPG_BAD_INPUT, "%s: header: list property \"%s\" in element vertex", name,
                             r->vertex->properties[p].name);
    assign_slots(r);
    for (int axis = 0; axis < 3; axis++)
        if (!r->columns.of[NPG_X + axis].is_there)
            return npg_error(NPG_BAD_INPUT, "%s: header: element vertex has no property %c", name,
                             "xyz"[axis]);
    r->builder->has_normals = has_slots(r, NPG_NX, NPG_NZ);
    r->builder->has_colours = has_slots(r, NPG_RED, NPG_BLUE);
    r->builder->has_uvs = r->builder->wants_faces && has_slots(r, NPG_U, NPG_V);
    return NPG_OK;
}

static bool is_corner_list(const ply_property *property)
{
    return property->is_list &&
           (!strcmp(property->name, "vertex_indices") || !strcmp(property->name, "vertex_index"));
}

static npg_status find_corner_list(reader *r)
{
    const char *name = r->source->name;
    bool needs_faces = r->builder->wants_faces && !r->builder->may_be_points;
    r->face = find_element(r->header, "face");
    if (!r->face)
        return needs_faces ? npg_error(NPG_BAD_INPUT, "%s: no faces, so it is not a mesh", name) : NPG_OK;
    for (size_t p = 0; p < r->face->property_count; p++)
        if (is_corner_list(&r->face->properties[p])) return NPG_OK;
    r->face = NULL;
    if (!r->builder->wants_faces) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: header: element face has no list vertex_indices", name);
}

/* ---- rows ---- */

/* Where a row is read: in text from `at` to `end`. */
typedef struct cursor {
    const ply_element *element;
    uint64_t row;
    const char *at, *end; /* NULL: the file is binary */
} cursor;

static npg_status ends_early(const reader *r, const ply_element *element, uint64_t row)
{
    return npg_source_bad_byte(r->source, "the file ends in %llu of the %llu rows of element \"%s\"",
                               (unsigned long long)row, (unsigned long long)element->count, element->name);
}

static npg_status next_value(reader *r, cursor *c, npg_ply_type type, double *value)
{
    size_t available, size = npg_ply_type_size(type);
    if (c->at && c->at == c->end)
        return npg_source_bad_line(r->source, "the row of element \"%s\" ends early", c->element->name);
    if (c->at) return npg_source_number(r->source, value, &c->at, c->end);
    NPG_TRY(npg_source_fill(r->source, size, &available));
    if (available < size) return ends_early(r, c->element, c->row);
    *value = npg_ply_value(npg_source_data(r->source), type, r->header->format);
    npg_source_take(r->source, size);
    return NPG_OK;
}

static npg_status skip_bytes(reader *r, const cursor *c, uint64_t size)
{
    uint64_t skipped;
    NPG_TRY(npg_source_skip(r->source, size, &skipped));
    if (skipped == size) return NPG_OK;
    return ends_early(r, c->element, c->row + (c->element->has_lists ? 0 : skipped / c->element->row_size));
}

static npg_status read_length(reader *r, cursor *c, const ply_property *property, uint64_t *length)
{
    double value = 1;
    if (property->is_list) NPG_TRY(next_value(r, c, property->count_type, &value));
    *length = (uint64_t)value;
    /* NaN, negative, or no length that a line of text could have. */
    if (c->at && !(value >= 0 && value <= 1e9))
        return npg_source_bad_line(r->source, "a list of length %g", value);
    if (c->at || value >= 0) return NPG_OK;
    return npg_source_bad_byte(r->source, "list \"%s\" of row %llu of element \"%s\" has length %.0f",
                               property->name, (unsigned long long)c->row, c->element->name, value);
}

static npg_status read_corner(reader *r, cursor *c, npg_ply_type type, uint32_t *corner)
{
    double value, limit = r->vertex->count < UINT32_MAX ? (double)r->vertex->count : (double)UINT32_MAX;
    NPG_TRY(next_value(r, c, type, &value));
    if (!(value >= 0 && value < limit && value == floor(value)))
        return npg_source_bad_byte(r->source, "face %llu uses vertex %.0f, but there are only %llu",
                                   (unsigned long long)c->row, value, (unsigned long long)r->vertex->count);
    *corner = (uint32_t)value;
    return NPG_OK;
}

/* A cloud has no faces, but of a damaged file it is not its points either. */
static npg_status read_corners(reader *r, cursor *c, npg_ply_type type, uint64_t length)
{
    uint32_t corners[CORNERS_MAX];
    for (uint64_t i = 0; i < length && !r->builder->wants_faces; i++)
        NPG_TRY(read_corner(r, c, type, corners));
    if (!r->builder->wants_faces) return NPG_OK;
    if (length < 3 || length > CORNERS_MAX)
        return npg_source_bad_byte(r->source, "face %llu has %llu corners", (unsigned long long)c->row,
                                   (unsigned long long)length);
    for (size_t i = 0; i < length; i++) NPG_TRY(read_corner(r, c, type, &corners[i]));
    return npg_builder_polygon(r->builder, corners, length);
}

static npg_status read_property(reader *r, cursor *c, const ply_property *property)
{
    uint64_t length;
    double unused;
    NPG_TRY(read_length(r, c, property, &length));
    if (c->element == r->face && is_corner_list(property)) return read_corners(r, c, property->type, length);
    if (!c->at) return skip_bytes(r, c, length * npg_ply_type_size(property->type));
    for (uint64_t i = 0; i < length; i++) NPG_TRY(next_value(r, c, property->type, &unused));
    return NPG_OK;
}

/* Of text. */
static npg_status read_vertex(reader *r, cursor *c)
{
    double value, values[NPG_SLOTS] = {[NPG_ALPHA] = 255};
    for (size_t p = 0; p < r->vertex->property_count; p++) {
        const npg_ply_type type = r->vertex->properties[p].type;
        int slot = r->slot_of[p];
        NPG_TRY(next_value(r, c, type, &value));
        bool is_colour = slot >= NPG_RED && slot <= NPG_ALPHA;
        if (slot >= 0) values[slot] = is_colour ? npg_colour_value(value, type) : value;
    }
    NPG_TRY(npg_builder_reserve(r->builder, 1, 0));
    npg_builder_add(r->builder, values);
    return NPG_OK;
}

static npg_status read_binary_vertices(reader *r)
{
    uint64_t row;
    npg_status status =
        npg_rows_read(r->builder, r->source, &r->columns, r->vertex->count, r->vertex->row_size, &row);
    return status == NPG_END ? ends_early(r, r->vertex, row) : status;
}

static npg_status read_rows(reader *r, const ply_element *element)
{
    bool is_ascii = r->header->format == NPG_PLY_ASCII, is_face = element == r->face,
         is_vertex = element == r->vertex;
    cursor c = {.element = element};
    if (!element->property_count && !is_face) return NPG_OK;
    if (!is_ascii && is_vertex) return read_binary_vertices(r);
    if (!is_ascii && !element->has_lists) return skip_bytes(r, &c, element->count * element->row_size);
    if (is_vertex && npg_source_left(r->source) != UINT64_MAX)
        NPG_TRY(npg_builder_reserve(r->builder, (size_t)element->count, 0));
    for (; c.row < element->count; c.row++) {
        npg_status status = is_ascii ? npg_source_row(r->source, &c.at, &c.end) : NPG_OK;
        if (status) return status == NPG_END ? ends_early(r, element, c.row) : status;
        if (is_vertex) NPG_TRY(read_vertex(r, &c));
        for (size_t p = 0; p < element->property_count && (is_face || !is_ascii); p++)
            NPG_TRY(read_property(r, &c, &element->properties[p]));
        if ((is_face || is_vertex) && c.at < c.end)
            return npg_source_bad_line(r->source, "more values than element \"%s\" has", element->name);
    }
    return NPG_OK;
}

/* ---- the whole ---- */

static npg_status read_all(reader *r)
{
    NPG_TRY(read_header(r->header, r->source));
    NPG_TRY(find_vertex_element(r));
    NPG_TRY(find_corner_list(r));
    for (size_t i = 0; i < r->header->element_count; i++) NPG_TRY(read_rows(r, &r->header->elements[i]));
    return NPG_OK;
}

npg_status npg_ply_read(npg_builder *builder, npg_source *source)
{
    reader r = {.source = source, .builder = builder};
    NPG_TRY(npg_alloc(&r.header, NPG_FOR_FILES, sizeof *r.header));
    npg_status status = read_all(&r);
    npg_release(&r.header);
    return status;
}
