/* Sensors: the text of option sensor and its file. */
#include "outlier/outlier_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/file.h"
#include "pipeline/source.h"

#define FILE_MOST ((uint64_t)256 << 20) /* bytes */

static npg_status add(npg_sensors *s, int64_t frame, const double world[3])
{
    NPG_TRY(npg_grow(&s->places, &s->capacity, s->count + 1, sizeof *s->places, NPG_FOR_FRAMES));
    s->places[s->count].frame = frame;
    s->places[s->count].line = s->count;
    memcpy(s->places[s->count++].world, world, sizeof s->places->world);
    return NPG_OK;
}

/* ---- places in the option ---- */

/* False where the text is no list of places. */
static bool parse_place(double world[3], const char **at)
{
    for (int a = 0; a < 3; a++) {
        char *end;
        world[a] = strtod(*at, &end);
        if (end == *at || !isfinite(world[a]) || (a < 2 && *end != ',')) return false;
        *at = end + (a < 2);
    }
    return !**at || **at == ':';
}

static npg_status parse_places(npg_sensors *s, bool *are_places)
{
    const char *at = s->text;
    *are_places = true;
    do {
        double world[3];
        at += s->count > 0; /* the colon */
        *are_places = parse_place(world, &at) && s->count < NPG_FRAME_SENSORS_MOST;
        if (*are_places) NPG_TRY(add(s, 0, world));
    } while (*are_places && *at);
    return NPG_OK;
}

/* ---- a file of places ---- */

static npg_status parse_line(npg_sensors *s, const npg_source *source, const char *at, const char *end)
{
    double v[5];
    size_t count = 0;
    while (at < end && count < 5) {
        const char *after = npg_number_parse(at, end, &v[count]);
        if (!after || !isfinite(v[count]))
            return npg_source_bad_line(source, "number %zu is none", count + 1);
        at = npg_skip_blanks(after, end);
        count++;
    }
    if (count != 3 && count != 4)
        return npg_source_bad_line(source, "neither \"X Y Z\" nor \"NUMBER X Y Z\"");
    if (!s->count) s->has_numbers = count == 4;
    if (s->has_numbers != (count == 4))
        return npg_source_bad_line(source, "%zu numbers, where the lines before have %d", count,
                                   s->has_numbers ? 4 : 3);
    if (count == 4 && !(fabs(v[0]) < 1e15 && v[0] == floor(v[0])))
        return npg_source_bad_line(source, "%g is no frame's number", v[0]);
    if (s->count == NPG_SENSOR_LINES)
        return npg_source_bad_line(source, "more than %d lines", NPG_SENSOR_LINES);
    return add(s, count == 4 ? (int64_t)v[0] : (int64_t)s->count, v + (count == 4));
}

static npg_status read_lines(npg_sensors *s, npg_source *source)
{
    const char *at, *end;
    size_t length;
    for (;;) {
        npg_status status = npg_source_line(source, &at, &length);
        if (status) return status == NPG_END ? NPG_OK : status;
        end = at + length;
        at = npg_skip_blanks(at, end);
        if (source->byte > FILE_MOST) return npg_source_bad_line(source, "the file is too large");
        if (at < end && *at != '#') NPG_TRY(parse_line(s, source, at, end));
    }
}

static int by_frame(const void *a, const void *b)
{
    const npg_sensor_place *x = a, *y = b;
    if (x->frame != y->frame) return x->frame < y->frame ? -1 : 1;
    return (x->line > y->line) - (x->line < y->line);
}

static npg_status read_file(npg_sensors *s)
{
    npg_source *source;
    NPG_TRY(npg_source_open_file(&source, s->text));
    npg_status status = npg_source_find_line_end(source);
    if (!status) status = read_lines(s, source);
    npg_source_close(&source);
    NPG_TRY(status);
    if (!s->count) return npg_error(NPG_BAD_INPUT, "%s: no place of a sensor in it", s->text);
    qsort(s->places, s->count, sizeof *s->places, by_frame);
    return NPG_OK;
}

npg_status npg_sensors_open(npg_sensors *s, const char *text)
{
    bool are_places;
    *s = (npg_sensors){.text = text};
    npg_status status = parse_places(s, &are_places);
    s->is_file = !status && !are_places;
    if (s->is_file) s->count = 0;
    if (s->is_file && !npg_is_there(text))
        status =
            npg_error(NPG_USAGE,
                      "option sensor: \"%s\" is neither x,y,z (several: x,y,z:x,y,z), nor a file, nor auto "
                      "nor none",
                      text);
    if (!status && s->is_file) status = read_file(s);
    if (status) npg_sensors_close(s);
    return status;
}

void npg_sensors_close(npg_sensors *s)
{
    npg_release(&s->places);
    *s = (npg_sensors){0};
}

/* ---- of a frame ---- */

static size_t first_of(const npg_sensors *s, int64_t frame)
{
    size_t low = 0, high = s->count;
    while (low < high) {
        size_t middle = (low + high) / 2;
        if (s->places[middle].frame < frame)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

npg_status npg_sensors_set(const npg_sensors *s, npg_frame *frame, const npg_origin *origin)
{
    int64_t wanted = !s->is_file ? 0 : s->has_numbers ? frame->number : frame->index;
    size_t first = first_of(s, wanted), count = 0;
    while (first + count < s->count && s->places[first + count].frame == wanted) count++;
    if (!count)
        return npg_error(NPG_BAD_INPUT, "%s has no place of a sensor for frame %lld", s->text,
                         (long long)wanted);
    if (count > NPG_FRAME_SENSORS_MOST)
        return npg_error(NPG_BAD_INPUT, "%s has %zu sensors for frame %lld; more than %d are not read",
                         s->text, count, (long long)wanted, NPG_FRAME_SENSORS_MOST);
    npg_frame_forget_sensors(frame);
    NPG_TRY(npg_alloc_array(&frame->sensor_local, NPG_FOR_FRAMES, count, 3 * sizeof(float)));
    frame->sensor_count = count;
    for (size_t i = 0; i < 3 * count; i++)
        frame->sensor_local[i] = (float)(s->places[first + i / 3].world[i % 3] - origin->world[i % 3]);
    return NPG_OK;
}
