/* PCD reader: checks the header and, in ascii files, every row; PCL then reads what has been found sound. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ingest/formats/formats.h"
#include "ingest/formats/number.h"
#include "ingest/formats/pcd.h"
#include "ingest/formats/point_list.h"

/* Above any header of real files (set by trial): damaged ones are refused and cost nothing. */
enum { FIELDS_MAX = 128, LINE_MAX_BYTES = 8191, WORDS_MAX = FIELDS_MAX + 1 };

typedef struct pcd_header {
    size_t field_count;
    char names[FIELDS_MAX][32];
    size_t sizes[FIELDS_MAX], counts[FIELDS_MAX];
    char types[FIELDS_MAX];
    bool has_sizes, has_types, has_counts;
    uint64_t width, height, points;
    bool has_width, has_height, has_points;
    char data[32];
} pcd_header;

typedef struct header_line {
    char text[LINE_MAX_BYTES + 1];
    char *words[WORDS_MAX];
    size_t word_count;
} header_line;

static npg_status next_line(header_line *line, npg_source *source)
{
    const char *text;
    size_t length;
    char *rest = NULL;
    npg_status status = npg_source_line(source, &text, &length);
    if (status == NPG_END) return npg_source_bad_line(source, "the file ends inside the header");
    if (status) return status;
    if (length > LINE_MAX_BYTES || memchr(text, 0, length))
        return npg_source_bad_line(source, "not a line of a PCD header");
    memcpy(line->text, text, length);
    line->text[length] = 0;
    line->word_count = 0;
    for (char *word = strtok_r(line->text, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        if (line->word_count == WORDS_MAX)
            return npg_source_bad_line(source, "more than %d fields", FIELDS_MAX);
        line->words[line->word_count++] = word;
    }
    /* PCL 1.13 reads past its list of words in a line that has none but blanks. */
    if (!line->word_count) return npg_source_bad_line(source, "an empty line in the header");
    return NPG_OK;
}

static npg_status parse_count(uint64_t *value, const char *text, const npg_source *source)
{
    size_t digits = strspn(text, "0123456789");
    if (!digits || text[digits] || digits > 15)
        return npg_source_bad_line(source, "\"%.30s\" is not a count", text);
    *value = strtoull(text, NULL, 10);
    return NPG_OK;
}

static npg_status parse_names(pcd_header *h, const header_line *line, const npg_source *source)
{
    if (h->field_count) return npg_source_bad_line(source, "second line FIELDS");
    for (size_t i = 1; i < line->word_count; i++) {
        if (strlen(line->words[i]) >= sizeof h->names[0])
            return npg_source_bad_line(source, "field name \"%.30s...\" is too long", line->words[i]);
        strcpy(h->names[h->field_count++], line->words[i]);
    }
    return NPG_OK;
}

static npg_status expect_fields(const pcd_header *h, const header_line *line, const npg_source *source)
{
    if (line->word_count - 1 == h->field_count && h->field_count) return NPG_OK;
    return npg_source_bad_line(source, "%s has %zu entries for %zu fields", line->words[0],
                               line->word_count - 1, h->field_count);
}

static npg_status parse_sizes(pcd_header *h, const header_line *line, const npg_source *source)
{
    NPG_TRY(expect_fields(h, line, source));
    for (size_t i = 0; i < h->field_count; i++) {
        const char *text = line->words[i + 1];
        if (strlen(text) != 1 || !strchr("1248", *text))
            return npg_source_bad_line(source, "field \"%s\" has size %.30s", h->names[i], text);
        h->sizes[i] = (size_t)(*text - '0');
    }
    h->has_sizes = true;
    return NPG_OK;
}

static npg_status parse_types(pcd_header *h, const header_line *line, const npg_source *source)
{
    NPG_TRY(expect_fields(h, line, source));
    for (size_t i = 0; i < h->field_count; i++) {
        const char *text = line->words[i + 1];
        if (strlen(text) != 1 || !strchr("IUF", *text))
            return npg_source_bad_line(source, "field \"%s\" has the unknown type %.30s", h->names[i], text);
        h->types[i] = *text;
    }
    h->has_types = true;
    return NPG_OK;
}

static npg_status parse_field_counts(pcd_header *h, const header_line *line, const npg_source *source)
{
    NPG_TRY(expect_fields(h, line, source));
    for (size_t i = 0; i < h->field_count; i++) {
        uint64_t count = 0;
        NPG_TRY(parse_count(&count, line->words[i + 1], source));
        if (count < 1 || count > 65536) /* more is damage (set by trial) */
            return npg_source_bad_line(source, "field \"%s\" has count %llu", h->names[i],
                                       (unsigned long long)count);
        h->counts[i] = (size_t)count;
    }
    h->has_counts = true;
    return NPG_OK;
}

static npg_status parse_size(uint64_t *value, bool *has, const header_line *line, const npg_source *source)
{
    if (line->word_count != 2) return npg_source_bad_line(source, "%s needs one number", line->words[0]);
    *has = true;
    return parse_count(value, line->words[1], source);
}

static npg_status parse_line(pcd_header *h, const header_line *line, const npg_source *source)
{
    const char *word = line->words[0];
    if (!strcmp(word, "VERSION") || !strcmp(word, "VIEWPOINT")) return NPG_OK;
    if (!strcmp(word, "FIELDS") || !strcmp(word, "COLUMNS")) return parse_names(h, line, source);
    if (!strcmp(word, "SIZE")) return parse_sizes(h, line, source);
    if (!strcmp(word, "TYPE")) return parse_types(h, line, source);
    if (!strcmp(word, "COUNT")) return parse_field_counts(h, line, source);
    if (!strcmp(word, "WIDTH")) return parse_size(&h->width, &h->has_width, line, source);
    if (!strcmp(word, "HEIGHT")) return parse_size(&h->height, &h->has_height, line, source);
    if (!strcmp(word, "POINTS")) return parse_size(&h->points, &h->has_points, line, source);
    if (strcmp(word, "DATA") != 0) return npg_source_bad_line(source, "unknown word \"%.30s\"", word);
    if (line->word_count != 2) return npg_source_bad_line(source, "DATA needs one word");
    snprintf(h->data, sizeof h->data, "%s", line->words[1]);
    return NPG_OK;
}

static npg_status check_axes(const pcd_header *h, const npg_source *source)
{
    for (const char *axis = "xyz"; *axis; axis++) {
        size_t i = 0;
        while (i < h->field_count && (h->names[i][0] != *axis || h->names[i][1])) i++;
        if (i == h->field_count || h->counts[i] != 1)
            return npg_source_bad_line(source, "the header has no single field %c", *axis);
    }
    return NPG_OK;
}

static bool is_used(const char *name)
{
    static const char *const names[] = {"x", "y", "z", "normal_x", "normal_y", "normal_z"};
    size_t i = 0;
    while (i < 6 && strcmp(name, names[i]) != 0) i++;
    return i < 6;
}

/* PCL 1.13 knows no whole numbers of 8 bytes: it steps over such a field, but not in compressed files. */
static npg_status check_types(const pcd_header *h, const npg_source *source)
{
    bool is_packed = !strcmp(h->data, "binary_compressed");
    for (size_t i = 0; i < h->field_count; i++) {
        bool is_float = h->types[i] == 'F';
        if (is_float ? h->sizes[i] < 4 : h->sizes[i] > 4 && (is_packed || is_used(h->names[i])))
            return npg_source_bad_line(source, "field \"%s\" is a %s of %zu bytes", h->names[i],
                                       is_float ? "float" : "whole number", h->sizes[i]);
    }
    return NPG_OK;
}

static npg_status check_header(pcd_header *h, const npg_source *source)
{
    if (!h->field_count || !h->has_sizes || !h->has_types)
        return npg_source_bad_line(source, "the header lacks FIELDS, SIZE or TYPE");
    for (size_t i = 0; i < h->field_count && !h->has_counts; i++) h->counts[i] = 1;
    if (!h->has_width || !h->has_height)
        return npg_source_bad_line(source, "the header lacks WIDTH or HEIGHT");
    if (h->width > UINT32_MAX || h->height > UINT32_MAX)
        return npg_source_bad_line(source, "impossible size %llu x %llu", (unsigned long long)h->width,
                                   (unsigned long long)h->height);
    if (!h->has_points) h->points = h->width * h->height;
    if (h->width * h->height != h->points)
        return npg_source_bad_line(source, "%llu x %llu is not %llu points", (unsigned long long)h->width,
                                   (unsigned long long)h->height, (unsigned long long)h->points);
    NPG_TRY(check_axes(h, source));
    return check_types(h, source);
}

static npg_status read_header(pcd_header *h, npg_source *source)
{
    header_line *line;
    NPG_TRY(npg_alloc(&line, NPG_FOR_FILES, sizeof *line));
    npg_status status = NPG_OK;
    for (int i = 0; !status && !h->data[0]; i++) {
        if (i == 1000) status = npg_source_bad_line(source, "no line DATA in the first 1000 lines");
        if (!status) status = next_line(line, source);
        if (!status && line->words[0][0] != '#') status = parse_line(h, line, source);
    }
    if (!status) status = check_header(h, source);
    npg_release(&line);
    return status;
}

/* ---- the body, before PCL sees it ---- */

static npg_status refuse_claim(const pcd_header *h, const npg_source *source, uint64_t need)
{
    return npg_source_bad_byte(source, "the header claims %llu points (%llu bytes), but %llu bytes follow",
                               (unsigned long long)h->points, (unsigned long long)need,
                               (unsigned long long)npg_source_left(source));
}

static npg_status check_rows(const pcd_header *h, npg_source *source, size_t values_per_row)
{
    const char *at;
    size_t length;
    npg_status status;
    uint64_t rows = 0;
    while (!(status = npg_source_line(source, &at, &length))) {
        const char *end = at + length;
        size_t values = 0;
        double value;
        at = npg_skip_blanks(at, end);
        if (at == end) continue;
        while (at < end) {
            const char *after = npg_number_parse(at, end, &value);
            int shown = end - at > 30 ? 30 : (int)(end - at);
            if (!after) return npg_source_bad_line(source, "\"%.*s\" is not a number", shown, at);
            at = npg_skip_blanks(after, end);
            values++;
        }
        if (values != values_per_row)
            return npg_source_bad_line(source, "%zu values where a point has %zu", values, values_per_row);
        rows++;
    }
    if (status != NPG_END) return status;
    if (rows != h->points)
        return npg_source_bad_line(source, "the header claims %llu points, but %llu rows follow",
                                   (unsigned long long)h->points, (unsigned long long)rows);
    return NPG_OK;
}

static npg_status check_compressed(const pcd_header *h, npg_source *source, uint64_t need)
{
    size_t available;
    uint32_t sizes[2];
    NPG_TRY(npg_source_fill(source, sizeof sizes, &available));
    if (available < sizeof sizes) return npg_source_bad_byte(source, "the file ends before the data");
    memcpy(sizes, npg_source_data(source), sizeof sizes);
    npg_source_take(source, sizeof sizes);
    if (sizes[1] != need) return refuse_claim(h, source, need);
    /* LZF: no three bytes stand for more than 264. */
    if (sizes[0] > npg_source_left(source) || need / 264 > sizes[0])
        return npg_source_bad_byte(source, "%u compressed bytes can't be in the %llu that follow", sizes[0],
                                   (unsigned long long)npg_source_left(source));
    return NPG_OK;
}

static npg_status check_body(const pcd_header *h, npg_source *source)
{
    uint64_t row = 0;
    size_t values = 0;
    for (size_t i = 0; i < h->field_count; i++) {
        row += h->sizes[i] * h->counts[i];
        values += h->counts[i];
    }
    /* So that points times bytes of a row can't overflow. */
    if (h->points > (uint64_t)1 << 36) return refuse_claim(h, source, UINT64_MAX);
    if (!strcmp(h->data, "ascii")) return check_rows(h, source, values);
    uint64_t need = h->points * row;
    if (!strcmp(h->data, "binary"))
        return need == npg_source_left(source) ? NPG_OK : refuse_claim(h, source, need);
    if (!strcmp(h->data, "binary_compressed")) return check_compressed(h, source, need);
    return npg_source_bad_line(source, "unknown DATA \"%s\"", h->data);
}

/* ---- the whole ---- */

static npg_status begin_points(void *user, size_t point_count, bool has_normals, bool has_colours)
{
    npg_point_list *points = user;
    points->has_normals = has_normals;
    points->has_colours = has_colours;
    return npg_points_reserve(points, point_count);
}

static void add_point(void *user, const double world[3], const double normal[3], const uint8_t rgba[4])
{
    npg_point_list *points = user;
    npg_points_add(points, world, normal);
    if (points->has_colours) npg_points_colour(points, rgba);
}

npg_status npg_pcd_read_cloud(npg_frame *frame, npg_source *source, npg_origin *origin)
{
    pcd_header *header;
    npg_point_list points = {.frame = frame, .origin = origin};
    if (!source->is_seekable)
        return npg_error(NPG_BAD_INPUT, "%s: PCD can't be read from a pipe", source->name);
    NPG_TRY(npg_alloc(&header, NPG_FOR_FILES, sizeof *header));
    npg_status status = read_header(header, source);
    if (!status) status = check_body(header, source);
    size_t count = (size_t)header->points;
    npg_release(&header);
    if (status || !count) return status;
    npg_pcd_sink sink = {&points, begin_points, add_point};
    return npg_pcd_load(source->name, count, &sink);
}
