/* PCD reader: ascii, binary, and binary_compressed (columns packed with LZF). */
#include <lzf.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "ingest/ingest_internal.h"

#define NONE UINT64_MAX /* the header has no such line     */

typedef struct field {
    char name[32], type;
    size_t size, count;
} field;

typedef struct pcd_header {
    size_t field_count;
    field fields[NPG_WORDS_MAX - 1];
    uint64_t width, height, points;
    char data[32];
} pcd_header;

static npg_status parse_names(pcd_header *h, const npg_words *line, const npg_source *source)
{
    if (h->field_count) return npg_source_bad_line(source, "second line FIELDS");
    for (size_t i = 1; i < line->count; i++) {
        field *f = &h->fields[h->field_count++];
        if (strlen(line->words[i]) >= sizeof f->name)
            return npg_source_bad_line(source, "field name \"%.30s...\" is too long", line->words[i]);
        strcpy(f->name, line->words[i]);
        f->count = 1;
    }
    return NPG_OK;
}

/* An entry of the lines SIZE, TYPE and COUNT. */
static npg_status parse_entry(field *f, char kind, const char *text, const npg_source *source)
{
    uint64_t count = 0;
    bool is_one = strlen(text) == 1;
    if (kind == 'S') {
        if (!is_one || !strchr("1248", *text))
            return npg_source_bad_line(source, "field \"%s\" has size %.30s", f->name, text);
        f->size = (size_t)(*text - '0');
    } else if (kind == 'T') {
        if (!is_one || !strchr("IUF", *text))
            return npg_source_bad_line(source, "field \"%s\" has the unknown type %.30s", f->name, text);
        f->type = *text;
    } else {
        NPG_TRY(npg_source_count(source, &count, text));
        if (count < 1 || count > 65536) /* more is damage (set by trial) */
            return npg_source_bad_line(source, "field \"%s\" has count %s", f->name, text);
        f->count = (size_t)count;
    }
    return NPG_OK;
}

static npg_status parse_entries(pcd_header *h, const npg_words *line, const npg_source *source)
{
    if (line->count - 1 != h->field_count || !h->field_count)
        return npg_source_bad_line(source, "%s has %zu entries for %zu fields", line->words[0],
                                   line->count - 1, h->field_count);
    for (size_t i = 0; i < h->field_count; i++)
        NPG_TRY(parse_entry(&h->fields[i], line->words[0][0], line->words[i + 1], source));
    return NPG_OK;
}

static npg_status parse_line(pcd_header *h, const npg_words *line, const npg_source *source)
{
    const char *word = line->words[0];
    const struct {
        const char *word;
        uint64_t *count;
    } sizes[] = {{"WIDTH", &h->width}, {"HEIGHT", &h->height}, {"POINTS", &h->points}};
    if (!strcmp(word, "VERSION") || !strcmp(word, "VIEWPOINT")) return NPG_OK;
    if (!strcmp(word, "FIELDS") || !strcmp(word, "COLUMNS")) return parse_names(h, line, source);
    if (!strcmp(word, "SIZE") || !strcmp(word, "TYPE") || !strcmp(word, "COUNT"))
        return parse_entries(h, line, source);
    for (size_t i = 0; i < 3; i++)
        if (!strcmp(word, sizes[i].word) && line->count == 2)
            return npg_source_count(source, sizes[i].count, line->words[1]);
    if (strcmp(word, "DATA") != 0 || line->count != 2)
        return npg_source_bad_line(source, "not a line of a PCD header: \"%.30s\"", word);
    snprintf(h->data, sizeof h->data, "%s", line->words[1]);
    return NPG_OK;
}

/* The first field of that name; field_count where there is none. */
static size_t find(const pcd_header *h, const char *name)
{
    size_t i = 0;
    while (i < h->field_count && strcmp(h->fields[i].name, name) != 0) i++;
    return i;
}

static npg_status check_axes(const pcd_header *h, const npg_source *source)
{
    for (size_t axis = 0; axis < 3; axis++) {
        size_t i = find(h, (const char *const[]){"x", "y", "z"}[axis]);
        if (i == h->field_count || h->fields[i].count != 1)
            return npg_source_bad_line(source, "the header has no single field %c", "xyz"[axis]);
    }
    return NPG_OK;
}

static npg_status check_header(pcd_header *h, const npg_source *source)
{
    if (!h->field_count || !h->fields[0].size || !h->fields[0].type)
        return npg_source_bad_line(source, "the header lacks FIELDS, SIZE or TYPE");
    if (h->width == NONE || h->height == NONE)
        return npg_source_bad_line(source, "the header lacks WIDTH or HEIGHT");
    if (h->width > UINT32_MAX || h->height > UINT32_MAX)
        return npg_source_bad_line(source, "impossible size %llu x %llu", (unsigned long long)h->width,
                                   (unsigned long long)h->height);
    if (h->points == NONE) h->points = h->width * h->height;
    if (h->width * h->height != h->points)
        return npg_source_bad_line(source, "%llu x %llu is not %llu points", (unsigned long long)h->width,
                                   (unsigned long long)h->height, (unsigned long long)h->points);
    return check_axes(h, source);
}

static npg_status read_header(pcd_header *h, npg_source *source)
{
    npg_words line;
    h->width = h->height = h->points = NONE;
    for (int i = 0; !h->data[0]; i++) {
        if (i == 1000) return npg_source_bad_line(source, "no line DATA in the first 1000 lines");
        NPG_TRY(npg_source_words(source, &line));
        if (!line.count) return npg_source_bad_line(source, "an empty line in the header");
        if (line.words[0][0] != '#') NPG_TRY(parse_line(h, &line, source));
    }
    return check_header(h, source);
}

/* ---- columns: where the values of a point lie ---- */

typedef struct pcd_body {
    npg_columns columns;
    size_t value[NPG_SLOTS]; /* its number in an ascii row; that of the colour at NPG_RED */
    npg_ply_type colour;
    size_t row_values, row_size;
    bool is_packed;
} pcd_body;

/* Of the field's first value. */
static npg_status set_type(npg_ply_type *type, const field *f, const npg_source *source)
{
    static const npg_ply_type whole[2][3] = {{NPG_PLY_INT8, NPG_PLY_INT16, NPG_PLY_INT32},
                                             {NPG_PLY_UINT8, NPG_PLY_UINT16, NPG_PLY_UINT32}};
    bool is_float = f->type == 'F';
    if (is_float ? f->size < 4 : f->size > 4)
        return npg_source_bad_line(source, "field \"%s\" is a %s of %zu bytes", f->name,
                                   is_float ? "float" : "whole number", f->size);
    *type = is_float ? f->size == 8 ? NPG_PLY_DOUBLE : NPG_PLY_FLOAT : whole[f->type == 'U'][f->size / 2];
    return NPG_OK;
}

/* "rgb" or "rgba": 0xAARRGGBB in four bytes, whatever type the header gives them. */
static size_t find_colour(const pcd_header *h)
{
    size_t i = find(h, "rgb");
    if (i == h->field_count) i = find(h, "rgba");
    return i < h->field_count && h->fields[i].size == 4 && h->fields[i].count == 1 ? i : h->field_count;
}

static npg_status set_columns(npg_builder *b, pcd_body *body, const pcd_header *h, const npg_source *source)
{
    npg_column *of = body->columns.of;
    for (size_t i = 0; i < h->field_count; i++) {
        const size_t bytes = h->fields[i].size * h->fields[i].count;
        /* packed: columns come one after the other */
        npg_column column = {.is_there = true,
                             .offset = body->is_packed ? body->row_size * (size_t)h->points : body->row_size,
                             .step = bytes};
        const int slot = npg_slot_of(h->fields[i].name);
        if (slot >= NPG_X && slot <= NPG_NZ && !of[slot].is_there) {
            NPG_TRY(set_type(&column.type, &h->fields[i], source));
            of[slot] = column;
            body->value[slot] = body->row_values;
        }
        if (i == find_colour(h)) {
            NPG_TRY(set_type(&body->colour, &h->fields[i], source));
            body->value[NPG_RED] = body->row_values;
            for (size_t c = 0; c < 3; c++) { /* the lowest byte is blue */
                of[NPG_RED + c] = column;
                of[NPG_RED + c].type = NPG_PLY_UINT8;
                of[NPG_RED + c].offset += 2 - c;
            }
        }
        body->row_size += bytes;
        body->row_values += h->fields[i].count;
    }
    for (size_t slot = 0; slot < NPG_SLOTS && !body->is_packed; slot++) of[slot].step = body->row_size;
    b->has_normals = of[NPG_NX].is_there && of[NPG_NY].is_there && of[NPG_NZ].is_there;
    b->has_colours = of[NPG_RED].is_there;
    return NPG_OK;
}

/* ---- the body ---- */

static npg_status refuse_claim(const pcd_header *h, const npg_source *source, uint64_t need)
{
    return npg_source_bad_byte(source, "the header claims %llu points (%llu bytes), but %llu bytes follow",
                               (unsigned long long)h->points, (unsigned long long)need,
                               (unsigned long long)npg_source_left(source));
}

static npg_status read_row(npg_builder *b, const pcd_body *body, const npg_source *source, const char *at,
                           const char *end)
{
    double values[NPG_SLOTS] = {[NPG_ALPHA] = 255}, value, colour = 0;
    size_t count = 0;
    for (; at < end; count++) {
        NPG_TRY(npg_source_number(source, &value, &at, end));
        for (size_t slot = NPG_X; slot <= NPG_NZ; slot++) {
            const npg_column *c = &body->columns.of[slot];
            if (!c->is_there || body->value[slot] != count) continue;
            values[slot] = c->type == NPG_PLY_FLOAT ? (double)(float)value : value;
        }
        if (b->has_colours && body->value[NPG_RED] == count) colour = value;
    }
    if (count != body->row_values)
        return npg_source_bad_line(source, "%zu values where a point has %zu", count, body->row_values);
    /* A colour is the bits of its number. */
    uint32_t argb = 0;
    if (body->colour == NPG_PLY_FLOAT)
        argb = npg_float_bits((float)colour);
    else if (fabs(colour) <= UINT32_MAX)
        argb = (uint32_t)(int64_t)colour;
    for (int c = 0; c < 3; c++) values[NPG_RED + c] = argb >> (16 - 8 * c) & 0xff;
    NPG_TRY(npg_builder_reserve(b, 1, 0));
    npg_builder_add(b, values);
    return NPG_OK;
}

static npg_status read_ascii(npg_builder *b, const pcd_body *body, const pcd_header *h, npg_source *source)
{
    const char *at, *end;
    npg_status status;
    uint64_t rows = 0,
             most = npg_source_left(source) / (2 * body->row_values) + 1; /* a digit and a blank each */
    NPG_TRY(npg_builder_reserve(b, (size_t)(h->points < most ? h->points : most), 0));
    while (!(status = npg_source_row(source, &at, &end)))
        if (rows++ < h->points) NPG_TRY(read_row(b, body, source, at, end));
    if (status != NPG_END) return status;
    if (rows == h->points) return NPG_OK;
    return npg_source_bad_line(source, "the header claims %llu points, but %llu rows follow",
                               (unsigned long long)h->points, (unsigned long long)rows);
}

static npg_status read_binary(npg_builder *b, const pcd_body *body, const pcd_header *h, npg_source *source)
{
    uint64_t done;
    if (h->points * body->row_size != npg_source_left(source))
        return refuse_claim(h, source, h->points * body->row_size);
    npg_status status = npg_rows_read(b, source, &body->columns, h->points, body->row_size, &done);
    return status == NPG_END ? npg_source_bad_byte(source, "the file ends in the data") : status;
}

static npg_status unpack(npg_builder *b, const pcd_body *body, npg_arena *scratch, const pcd_header *h,
                         npg_source *source, uint32_t packed_size)
{
    size_t need = (size_t)h->points * body->row_size, available;
    unsigned char *data = npg_arena_take(scratch, need, 1);
    NPG_TRY(npg_arena_status(scratch));
    NPG_TRY(npg_source_fill(source, packed_size, &available));
    if (available < packed_size ||
        (need && lzf_decompress(npg_source_data(source), packed_size, data, (unsigned)need) != need))
        return npg_source_bad_byte(source, "the compressed data is damaged");
    NPG_TRY(npg_builder_reserve(b, (size_t)h->points, 0));
    npg_rows_add(b, &body->columns, data, (size_t)h->points);
    return NPG_OK;
}

static npg_status read_packed(npg_builder *b, const pcd_body *body, npg_arena *scratch, const pcd_header *h,
                              npg_source *source)
{
    size_t available;
    uint64_t need = h->points * body->row_size;
    NPG_TRY(npg_source_fill(source, 8, &available));
    if (available < 8) return npg_source_bad_byte(source, "the file ends before the data");
    uint32_t packed = (uint32_t)npg_ply_value(npg_source_data(source), NPG_PLY_UINT32, NPG_PLY_LITTLE);
    uint32_t plain = (uint32_t)npg_ply_value(npg_source_data(source) + 4, NPG_PLY_UINT32, NPG_PLY_LITTLE);
    npg_source_take(source, 8);
    if (plain != need) return refuse_claim(h, source, need);
    /* LZF: no three bytes stand for more than 264. */
    if (packed > npg_source_left(source) || need / 264 > packed)
        return npg_source_bad_byte(source, "%u compressed bytes can't be in the %llu that follow", packed,
                                   (unsigned long long)npg_source_left(source));
    return unpack(b, body, scratch, h, source, packed);
}

static npg_status read_all(npg_builder *b, npg_arena *scratch, npg_source *source)
{
    pcd_header *h = npg_arena_take(scratch, 1, sizeof *h);
    NPG_TRY(npg_arena_status(scratch));
    NPG_TRY(read_header(h, source));
    /* So that points times bytes of a row can't overflow. */
    if (h->points > (uint64_t)1 << 36) return refuse_claim(h, source, UINT64_MAX);
    pcd_body body = {.columns.format = NPG_PLY_LITTLE, .is_packed = !strcmp(h->data, "binary_compressed")};
    NPG_TRY(set_columns(b, &body, h, source));
    if (body.is_packed) return read_packed(b, &body, scratch, h, source);
    if (!strcmp(h->data, "ascii")) return read_ascii(b, &body, h, source);
    if (!strcmp(h->data, "binary")) return read_binary(b, &body, h, source);
    return npg_source_bad_line(source, "unknown DATA \"%s\"", h->data);
}

npg_status npg_pcd_read(npg_builder *b, npg_source *source)
{
    npg_arena scratch = {.purpose = NPG_FOR_FILES};
    if (!source->is_seekable)
        return npg_error(NPG_BAD_INPUT, "%s: PCD can't be read from a pipe", source->name);
    npg_status status = read_all(b, &scratch, source);
    npg_arena_release(&scratch);
    return status;
}
