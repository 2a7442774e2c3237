/* OpenCV's FileStorage as far as a camera needs it: matrices by name, from XML or YAML. */
#include <ctype.h>
#include <math.h>
#include <string.h>

#include "ingest/rig/rig_internal.h"
#include "pipeline/file.h"

#define CAMERA_FILE_MAX ((size_t)1 << 20) /* bytes; a camera's file has about a thousand */

npg_status npg_opencv_open(npg_arena *arena, char **text, const char *path)
{
    size_t size;
    NPG_TRY(npg_file_whole(arena, text, &size, path, CAMERA_FILE_MAX, "camera"));
    if (strlen(*text) == size) return NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s: byte %zu is 0: no text file", path, strlen(*text));
}

static size_t line_of(const char *text, const char *at)
{
    size_t line = 1;
    for (; text < at; text++) line += *text == '\n';
    return line;
}

/* The numbers of an XML element <name ...> ... <data> here </data>; NULL where there is no such element. */
static const char *find_in_xml(const char *text, const char *name, const char **end)
{
    size_t length = strlen(name);
    for (const char *at = text; (at = strchr(at, '<')); at++) {
        if (strncmp(at + 1, name, length) != 0 || !strchr(" \t\r\n>", at[1 + length]) || !at[1 + length])
            continue;
        const char *data = strstr(at, "<data>");
        *end = data ? strstr(data, "</data>") : NULL;
        /* The data of the next element is not this one's. */
        for (const char *close = at; *end && (close = strstr(close, "</")) && close < data; close++)
            if (!strncmp(close + 2, name, length) && close[2 + length] == '>') return NULL;
        return *end ? data + strlen("<data>") : NULL;
    }
    return NULL;
}

/* The numbers of "name: !!opencv-matrix" ... "data: [ here ]". */
static const char *find_in_yaml(const char *text, const char *name, const char **end)
{
    size_t length = strlen(name);
    for (const char *line = text; line; line = strchr(line, '\n')) {
        line += *line == '\n';
        const char *at = line + strspn(line, " \t");
        if (strncmp(at, name, length) != 0 || at[length] != ':') continue;
        const char *data = strstr(at + length, "data:"), *open = data ? strchr(data, '[') : NULL;
        *end = open ? strchr(open, ']') : NULL;
        return *end ? open + 1 : NULL;
    }
    return NULL;
}

npg_status npg_opencv_matrix(const char *text, const char *path, const char *name, double *values,
                             size_t most, size_t *found)
{
    const char *end;
    *found = 0;
    const char *at = text[strspn(text, " \t\r\n\xef\xbb\xbf")] == '<' ? find_in_xml(text, name, &end)
                                                                      : find_in_yaml(text, name, &end);
    if (!at) return NPG_OK;
    for (;;) {
        while (at < end && (isspace((unsigned char)*at) || *at == ',')) at++;
        if (at == end) return NPG_OK;
        const char *stop = at;
        while (stop < end && !isspace((unsigned char)*stop) && *stop != ',') stop++;
        double value;
        if (*found == most)
            return npg_error(NPG_BAD_INPUT, "%s: line %zu: \"%s\" has more than %zu numbers", path,
                             line_of(text, at), name, most);
        if (npg_number_parse(at, stop, &value) != stop || !isfinite(value))
            return npg_error(NPG_BAD_INPUT, "%s: line %zu: \"%.*s\" is no number", path, line_of(text, at),
                             stop - at > 30 ? 30 : (int)(stop - at), at);
        values[(*found)++] = value;
        at = stop;
    }
}
