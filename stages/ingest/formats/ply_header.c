/* PLY header: what the elements of a PLY file are made of. */
#include "ingest/ingest_internal.h"

#include <string.h>

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

size_t npg_ply_type_size(npg_ply_type type)
{
    static const size_t sizes[] = {1, 1, 2, 2, 4, 4, 4, 8};
    return sizes[type];
}

double npg_ply_value(const unsigned char *bytes, npg_ply_type type, npg_ply_format format)
{
    size_t size = npg_ply_type_size(type);
    uint64_t bits = 0;
    if (format == NPG_PLY_LITTLE) {
        for (size_t i = size; i-- > 0;) bits = bits << 8 | bytes[i];
    } else {
        for (size_t i = 0; i < size; i++) bits = bits << 8 | bytes[i];
    }
    uint32_t low = (uint32_t)bits;
    float single;
    double whole;
    switch (type) {
    case NPG_PLY_INT8: return (double)(int8_t)low;
    case NPG_PLY_UINT8: return (double)(uint8_t)low;
    case NPG_PLY_INT16: return (double)(int16_t)low;
    case NPG_PLY_UINT16: return (double)(uint16_t)low;
    case NPG_PLY_INT32: return (double)(int32_t)low;
    case NPG_PLY_UINT32: return (double)low;
    case NPG_PLY_FLOAT: memcpy(&single, &low, sizeof single); return (double)single;
    case NPG_PLY_DOUBLE: memcpy(&whole, &bits, sizeof whole); return whole;
    }
    return 0;
}

/* ---- lines ---- */

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

/* ---- the three kinds of line that matter ---- */

static npg_status parse_format(npg_ply_header *header, const npg_words *line, const npg_source *source)
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
    if (strlen(name) >= NPG_PLY_NAME)
        return npg_source_bad_line(source, "name of %zu bytes: \"%.40s...\"", strlen(name), name);
    strcpy(out, name);
    return NPG_OK;
}

static npg_status parse_element(npg_ply_header *header, const npg_words *line, const npg_source *source)
{
    if (line->count != 3) return npg_source_bad_line(source, "\"element\" needs a name and a count");
    if (header->element_count == NPG_PLY_ELEMENTS)
        return npg_source_bad_line(source, "more than %d elements", NPG_PLY_ELEMENTS);
    for (size_t i = 0; i < header->element_count; i++)
        if (!strcmp(header->elements[i].name, line->words[1]))
            return npg_source_bad_line(source, "second element \"%.40s\"", line->words[1]);
    npg_ply_element *element = &header->elements[header->element_count];
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

static npg_status parse_property(npg_ply_header *header, const npg_words *line, const npg_source *source)
{
    if (!header->element_count) return npg_source_bad_line(source, "a property before the first element");
    npg_ply_element *element = &header->elements[header->element_count - 1];
    bool is_list = line->count > 1 && !strcmp(line->words[1], "list");
    if (line->count != (is_list ? 5u : 3u))
        return npg_source_bad_line(source, "\"property\" needs %s",
                                   is_list ? "two types and a name after \"list\"" : "a type and a name");
    if (element->property_count == NPG_PLY_PROPERTIES)
        return npg_source_bad_line(source, "more than %d properties", NPG_PLY_PROPERTIES);
    npg_ply_property *property = &element->properties[element->property_count];
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

/* ---- the whole ---- */

/* A count that the rest of the file can't hold is wrong; found here it costs no memory.  The shortest row of
 * text has a digit and a separator for each value. */
static npg_status check_counts(const npg_ply_header *header, const npg_source *source)
{
    uint64_t left = npg_source_left(source), need = 0;
    for (size_t i = 0; i < header->element_count && left != UINT64_MAX; i++) {
        const npg_ply_element *element = &header->elements[i];
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

static npg_status read_lines(npg_ply_header *header, npg_source *source)
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

npg_status npg_ply_header_read(npg_ply_header *header, npg_source *source)
{
    memset(header, 0, sizeof *header);
    NPG_TRY(read_magic(source));
    NPG_TRY(read_lines(header, source));
    return check_counts(header, source);
}
