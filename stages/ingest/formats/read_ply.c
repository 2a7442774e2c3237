/* PLY reader: ascii, little- and big-endian, any types and order of properties, unknown elements skipped. */
#include <math.h>
#include <string.h>

#include "ingest/ingest_internal.h"

#define BLOCK_BYTES ((size_t)64 << 10) /* decoded at a time; set by trial */
#define CORNERS_MAX 1024               /* of a polygon; larger ones are damage (set by trial) */

/* What a vertex property can mean. */
enum { X, Y, Z, NX, NY, NZ, RED, GREEN, BLUE, ALPHA, U, V, SLOTS };

static const struct {
    const char *name;
    int slot;
} slot_names[] = {{"x", X},
                  {"y", Y},
                  {"z", Z},
                  {"nx", NX},
                  {"ny", NY},
                  {"nz", NZ},
                  {"normal_x", NX},
                  {"normal_y", NY},
                  {"normal_z", NZ},
                  {"red", RED},
                  {"green", GREEN},
                  {"blue", BLUE},
                  {"alpha", ALPHA},
                  {"r", RED},
                  {"g", GREEN},
                  {"b", BLUE},
                  {"a", ALPHA},
                  {"s", U},
                  {"t", V},
                  {"u", U},
                  {"v", V},
                  {"texture_u", U},
                  {"texture_v", V},
                  {"diffuse_red", RED},
                  {"diffuse_green", GREEN},
                  {"diffuse_blue", BLUE}};

typedef struct reader {
    npg_source *source;
    npg_ply_header *header;
    const npg_ply_element *vertex, *face; /* into header; face is NULL when a cloud is read */
    int slot_of[NPG_PLY_PROPERTIES];      /* of each vertex property, -1: of no interest    */
    const npg_ply_property *in_slot[SLOTS];
    npg_point_list points;     /* where vertices go when a cloud is read */
    npg_mesh_builder *builder; /* or when a mesh is read; NULL else      */
} reader;

/* ---- what the header says about the vertices ---- */

static const npg_ply_element *find_element(const npg_ply_header *header, const char *name)
{
    for (size_t i = 0; i < header->element_count; i++)
        if (!strcmp(header->elements[i].name, name)) return &header->elements[i];
    return NULL;
}

static void assign_slots(reader *r)
{
    for (size_t p = 0; p < r->vertex->property_count; p++) {
        const npg_ply_property *property = &r->vertex->properties[p];
        r->slot_of[p] = -1;
        for (size_t i = 0; i < sizeof slot_names / sizeof *slot_names; i++) {
            int slot = slot_names[i].slot;
            if (strcmp(slot_names[i].name, property->name) != 0 || r->in_slot[slot]) continue;
            r->slot_of[p] = slot;
            r->in_slot[slot] = property;
        }
    }
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
    for (int slot = X; slot <= Z; slot++)
        if (!r->in_slot[slot])
            return npg_error(NPG_BAD_INPUT, "%s: header: element vertex has no property %c", name,
                             "xyz"[slot]);
    return NPG_OK;
}

static bool has_slots(const reader *r, int first, int last)
{
    for (int slot = first; slot <= last; slot++)
        if (!r->in_slot[slot]) return false;
    return true;
}

/* ---- one vertex ---- */

static uint8_t colour_byte(const reader *r, int slot, double value)
{
    npg_ply_type type = r->in_slot[slot]->type;
    if (type >= NPG_PLY_FLOAT) value *= 255;  /* 0 .. 1 */
    if (type == NPG_PLY_UINT16) value /= 257; /* 65535 / 255 */
    return value >= 255 ? 255 : value > 0 ? (uint8_t)(value + 0.5) : 0;
}

static void add_vertex(reader *r, const double slots[SLOTS])
{
    npg_mesh_builder *b = r->builder;
    if (!b) {
        npg_points_add(&r->points, slots + X, slots + NX);
        if (!r->points.has_colours) return;
        uint8_t rgba[4];
        for (int c = 0; c < 4; c++)
            rgba[c] = r->in_slot[RED + c] ? colour_byte(r, RED + c, slots[RED + c]) : 255;
        npg_points_colour(&r->points, rgba);
        return;
    }
    size_t at = npg_builder_vertex(b, slots + X);
    if (b->has_normals) npg_unit_normal(b->vert_normals + 3 * at, slots + NX);
    if (b->has_colours)
        for (int c = 0; c < 4; c++)
            b->vert_colours[4 * at + (size_t)c] =
                r->in_slot[RED + c] ? colour_byte(r, RED + c, slots[RED + c]) : 255;
    for (int c = 0; c < 2 && b->has_uvs; c++) b->vert_uvs[2 * at + (size_t)c] = (float)slots[U + c];
}

static npg_status reserve_vertices(reader *r, size_t count)
{
    return r->builder ? npg_builder_reserve(r->builder, count, 0) : npg_points_reserve(&r->points, count);
}

/* All at once where the count has been checked against the file's size, else block by block. */
static npg_status reserve_known(reader *r)
{
    if (npg_source_left(r->source) == UINT64_MAX) return NPG_OK;
    return reserve_vertices(r, (size_t)r->vertex->count);
}

static npg_status ends_early(const reader *r, const npg_ply_element *element, uint64_t row)
{
    return npg_source_bad_byte(r->source, "the file ends in %llu of the %llu rows of element \"%s\"",
                               (unsigned long long)row, (unsigned long long)element->count, element->name);
}

/* ---- binary ---- */

static void decode_rows(reader *r, const unsigned char *rows, size_t count)
{
    npg_ply_format format = r->header->format;
    int used[SLOTS], used_count = 0;
    /* Of a cloud only positions, normals and colours are of interest. */
    for (int slot = 0; slot < SLOTS; slot++)
        if (r->in_slot[slot] && (r->builder || slot <= NZ || (slot >= RED && slot <= ALPHA)))
            used[used_count++] = slot;
    double slots[SLOTS] = {0};
    for (size_t i = 0; i < count; i++, rows += r->vertex->row_size) {
        for (int k = 0; k < used_count; k++) {
            const npg_ply_property *property = r->in_slot[used[k]];
            slots[used[k]] = npg_ply_value(rows + property->offset, property->type, format);
        }
        add_vertex(r, slots);
    }
}

static npg_status read_binary_vertices(reader *r)
{
    size_t row_size = r->vertex->row_size, block = BLOCK_BYTES / row_size + 1;
    NPG_TRY(reserve_known(r));
    for (uint64_t done = 0; done < r->vertex->count;) {
        size_t available, rows = block;
        if (rows > r->vertex->count - done) rows = (size_t)(r->vertex->count - done);
        NPG_TRY(npg_source_fill(r->source, rows * row_size, &available));
        if (available < rows * row_size) return ends_early(r, r->vertex, done + available / row_size);
        NPG_TRY(reserve_vertices(r, rows));
        decode_rows(r, npg_source_data(r->source), rows);
        npg_source_take(r->source, rows * row_size);
        done += rows;
    }
    return NPG_OK;
}

/* The length of a binary list; the source then stands at its items. */
static npg_status read_list_length(reader *r, const npg_ply_element *element, uint64_t row,
                                   const npg_ply_property *property, uint64_t *length)
{
    size_t available, size = npg_ply_type_size(property->count_type);
    NPG_TRY(npg_source_fill(r->source, size, &available));
    if (available < size) return ends_early(r, element, row);
    double value = npg_ply_value(npg_source_data(r->source), property->count_type, r->header->format);
    if (value < 0)
        return npg_source_bad_byte(r->source, "list \"%s\" of row %llu of element \"%s\" has length %.0f",
                                   property->name, (unsigned long long)row, element->name, value);
    npg_source_take(r->source, size);
    *length = (uint64_t)value;
    return NPG_OK;
}

static npg_status skip_exactly(reader *r, const npg_ply_element *element, uint64_t row, uint64_t size)
{
    uint64_t skipped;
    NPG_TRY(npg_source_skip(r->source, size, &skipped));
    return skipped < size
               ? ends_early(r, element, row + (element->has_lists ? 0 : skipped / element->row_size))
               : NPG_OK;
}

static npg_status skip_binary_property(reader *r, const npg_ply_element *element, uint64_t row,
                                       const npg_ply_property *property)
{
    uint64_t length = 1;
    if (property->is_list) NPG_TRY(read_list_length(r, element, row, property, &length));
    return skip_exactly(r, element, row, length * npg_ply_type_size(property->type));
}

static npg_status skip_binary_element(reader *r, const npg_ply_element *element)
{
    if (!element->property_count) return NPG_OK;
    if (!element->has_lists) return skip_exactly(r, element, 0, element->count * element->row_size);
    for (uint64_t row = 0; row < element->count; row++)
        for (size_t p = 0; p < element->property_count; p++)
            NPG_TRY(skip_binary_property(r, element, row, &element->properties[p]));
    return NPG_OK;
}

/* ---- ascii ---- */

static npg_status next_row(reader *r, const npg_ply_element *element, uint64_t row, const char **at,
                           const char **end)
{
    npg_status status = npg_source_row(r->source, at, end);
    return status == NPG_END ? ends_early(r, element, row) : status;
}

static npg_status parse_row(reader *r, double slots[SLOTS], const char *at, const char *end)
{
    const npg_ply_element *vertex = r->vertex;
    for (size_t p = 0; p < vertex->property_count; p++) {
        double value;
        if (at == end)
            return npg_source_bad_line(r->source, "%zu values where element \"vertex\" has %zu", p,
                                       vertex->property_count);
        NPG_TRY(npg_source_number(r->source, &value, &at, end));
        if (r->slot_of[p] >= 0) slots[r->slot_of[p]] = value;
    }
    if (at < end)
        return npg_source_bad_line(r->source, "more than the %zu values that element \"vertex\" has",
                                   vertex->property_count);
    return NPG_OK;
}

static npg_status read_ascii_vertices(reader *r)
{
    double slots[SLOTS] = {0};
    const char *at, *end;
    NPG_TRY(reserve_known(r));
    for (uint64_t row = 0; row < r->vertex->count; row++) {
        NPG_TRY(next_row(r, r->vertex, row, &at, &end));
        NPG_TRY(parse_row(r, slots, at, end));
        NPG_TRY(reserve_vertices(r, 1));
        add_vertex(r, slots);
    }
    return NPG_OK;
}

static npg_status skip_ascii_element(reader *r, const npg_ply_element *element)
{
    const char *at, *end;
    for (uint64_t row = 0; row < element->count && element->property_count; row++)
        NPG_TRY(next_row(r, element, row, &at, &end));
    return NPG_OK;
}

/* ---- faces ---- */

static bool is_corner_list(const npg_ply_property *property)
{
    return property->is_list &&
           (!strcmp(property->name, "vertex_indices") || !strcmp(property->name, "vertex_index"));
}

static npg_status check_corner_count(const reader *r, uint64_t row, uint64_t length)
{
    if (length >= 3 && length <= CORNERS_MAX) return NPG_OK;
    return npg_source_bad_byte(r->source, "face %llu has %llu corners", (unsigned long long)row,
                               (unsigned long long)length);
}

static npg_status check_corner(const reader *r, uint64_t row, double value)
{
    double limit = r->vertex->count < UINT32_MAX ? (double)r->vertex->count : (double)UINT32_MAX;
    if (value >= 0 && value < limit && value == floor(value)) return NPG_OK;
    return npg_source_bad_byte(r->source, "face %llu uses vertex %.0f, but there are only %llu",
                               (unsigned long long)row, value, (unsigned long long)r->vertex->count);
}

static npg_status read_binary_corners(reader *r, uint64_t row, const npg_ply_property *property)
{
    uint64_t length;
    uint32_t corners[CORNERS_MAX];
    size_t size = npg_ply_type_size(property->type), available;
    NPG_TRY(read_list_length(r, r->face, row, property, &length));
    NPG_TRY(check_corner_count(r, row, length));
    NPG_TRY(npg_source_fill(r->source, length * size, &available));
    if (available < length * size) return ends_early(r, r->face, row);
    for (size_t i = 0; i < length; i++) {
        double value =
            npg_ply_value(npg_source_data(r->source) + i * size, property->type, r->header->format);
        NPG_TRY(check_corner(r, row, value));
        corners[i] = (uint32_t)value;
    }
    npg_source_take(r->source, length * size);
    return npg_builder_polygon(r->builder, corners, length);
}

static npg_status read_binary_faces(reader *r)
{
    for (uint64_t row = 0; row < r->face->count; row++)
        for (size_t p = 0; p < r->face->property_count; p++) {
            const npg_ply_property *property = &r->face->properties[p];
            if (is_corner_list(property))
                NPG_TRY(read_binary_corners(r, row, property));
            else
                NPG_TRY(skip_binary_property(r, r->face, row, property));
        }
    return NPG_OK;
}

static npg_status parse_value(reader *r, const char **at, const char *end, double *value)
{
    if (*at == end) return npg_source_bad_line(r->source, "the row of a face ends early");
    return npg_source_number(r->source, value, at, end);
}

static npg_status parse_face_property(reader *r, uint64_t row, const npg_ply_property *property,
                                      const char **at, const char *end)
{
    double value, length = 1;
    uint32_t corners[CORNERS_MAX];
    bool is_corners = is_corner_list(property);
    if (property->is_list) NPG_TRY(parse_value(r, at, end, &length));
    /* NaN, negative, or no length that a line of text could have. */
    if (!(length >= 0 && length <= 1e9)) return npg_source_bad_line(r->source, "a list of length %g", length);
    if (is_corners) NPG_TRY(check_corner_count(r, row, (uint64_t)length));
    for (size_t i = 0; i < (size_t)length; i++) {
        NPG_TRY(parse_value(r, at, end, &value));
        if (is_corners) NPG_TRY(check_corner(r, row, value));
        if (is_corners) corners[i] = (uint32_t)value;
    }
    return is_corners ? npg_builder_polygon(r->builder, corners, (size_t)length) : NPG_OK;
}

static npg_status read_ascii_faces(reader *r)
{
    const char *at, *end;
    for (uint64_t row = 0; row < r->face->count; row++) {
        NPG_TRY(next_row(r, r->face, row, &at, &end));
        for (size_t p = 0; p < r->face->property_count; p++)
            NPG_TRY(parse_face_property(r, row, &r->face->properties[p], &at, end));
        if (at < end) return npg_source_bad_line(r->source, "more values than element \"face\" has");
    }
    return NPG_OK;
}

/* ---- the whole ---- */

static npg_status read_element(reader *r, const npg_ply_element *element)
{
    bool is_ascii = r->header->format == NPG_PLY_ASCII;
    if (element == r->vertex) return is_ascii ? read_ascii_vertices(r) : read_binary_vertices(r);
    if (element == r->face) return is_ascii ? read_ascii_faces(r) : read_binary_faces(r);
    return is_ascii ? skip_ascii_element(r, element) : skip_binary_element(r, element);
}

static npg_status read_body(reader *r)
{
    for (size_t i = 0; i < r->header->element_count; i++) NPG_TRY(read_element(r, &r->header->elements[i]));
    return NPG_OK;
}

static npg_status find_corner_list(reader *r)
{
    const char *name = r->source->name;
    r->face = find_element(r->header, "face");
    if (!r->face && r->builder->may_be_points) return NPG_OK;
    if (!r->face) return npg_error(NPG_BAD_INPUT, "%s: no faces, so it is not a mesh", name);
    for (size_t p = 0; p < r->face->property_count; p++)
        if (is_corner_list(&r->face->properties[p])) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: header: element face has no list vertex_indices", name);
}

npg_status npg_ply_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin)
{
    reader r = {.source = source, .points = {.frame = frame, .origin = origin}};
    NPG_TRY(npg_alloc(&r.header, NPG_FOR_FILES, sizeof *r.header));
    npg_status status = npg_ply_header_read(r.header, source);
    if (!status) status = find_vertex_element(&r);
    r.points.has_normals = has_slots(&r, NX, NZ);
    r.points.has_colours = has_slots(&r, RED, BLUE);
    if (!status) status = read_body(&r);
    npg_release(&r.header);
    return status;
}

npg_status npg_ply_read_mesh(npg_mesh **mesh, npg_source *source, npg_origin *origin, bool may_be_points)
{
    npg_mesh_builder builder = {.origin = origin, .may_be_points = may_be_points};
    reader r = {.source = source, .builder = &builder};
    NPG_TRY(npg_alloc(&r.header, NPG_FOR_FILES, sizeof *r.header));
    npg_status status = npg_ply_header_read(r.header, source);
    if (!status) status = find_vertex_element(&r);
    if (!status) status = find_corner_list(&r);
    builder.has_normals = has_slots(&r, NX, NZ);
    builder.has_colours = has_slots(&r, RED, BLUE);
    builder.has_uvs = has_slots(&r, U, V);
    if (!status) status = read_body(&r);
    if (!status) status = npg_builder_finish(mesh, &builder, source->name);
    npg_builder_clear(&builder);
    npg_release(&r.header);
    return status;
}
