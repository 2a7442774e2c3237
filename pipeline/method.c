/* Methods: a JSON object whose keys are options. */
#include "pipeline/options.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"

/* The line of the key `name` of the outermost object, in text that is known to be good JSON. */
static int line_of_key(const char *text, const char *name)
{
    int line = 1, depth = 0;
    size_t length = strlen(name);
    for (const char *c = text; *c; c++) {
        line += *c == '\n';
        depth += (*c == '{' || *c == '[') - (*c == '}' || *c == ']');
        if (*c != '"') continue;
        const char *first = ++c;
        for (; *c && *c != '"'; c++) c += *c == '\\' && c[1];
        if (!*c) break;
        bool is_key = c[1 + strspn(c + 1, " \t\r\n")] == ':';
        if (depth == 1 && is_key && (size_t)(c - first) == length && !strncmp(first, name, length))
            return line;
    }
    return 0;
}

/* text: what root was read from, or NULL; only then a line is known. */
static npg_status apply(npg_options *options, const json_t *root, const char *place, const char *text)
{
    const char *name;
    json_t *value;
    if (!json_is_object(root)) return npg_error(NPG_USAGE, "%s: not a JSON object", place);
    json_object_foreach((json_t *)root, name, value)
    {
        npg_status status = npg_options_set_key(options, name, value);
        if (status && !text) return npg_error_prefix(status, "%s", place);
        if (status) return npg_error_prefix(status, "%s:%d", place, line_of_key(text, name));
    }
    return NPG_OK;
}

npg_status npg_method_apply(npg_options *options, const json_t *root, const char *place)
{
    return apply(options, root, place, NULL);
}

/* ---- where it comes from ---- */

npg_status npg_options_load(npg_options *options, const char *path)
{
    enum { LIMIT = 1 << 20 }; /* bytes; all options together take a few thousand */
    char *text;
    json_t *root;
    NPG_REQUIRE(options && path);
    NPG_TRY(npg_json_read(&root, &text, path, LIMIT));
    npg_status status = apply(options, root, path, text);
    npg_release(&text);
    json_decref(root);
    return status;
}

static npg_status apply_text(npg_options *options, const char *given)
{
    char *text;
    json_t *root = NULL;
    NPG_TRY(npg_copy_text(&text, given));
    npg_status status = npg_json_parse(&root, text, "method");
    if (!status) status = apply(options, root, "method", text);
    npg_release(&text);
    json_decref(root);
    return status;
}

/* A path has a slash or a dot in it; anything else was meant as a name. */
npg_status npg_method_set(npg_options *options, const char *value)
{
    if (value[strspn(value, " \t\r\n")] == '{') return apply_text(options, value);
    if (strpbrk(value, "./")) return npg_options_load(options, value);
    return npg_error(NPG_USAGE,
                     "option method: \"%s\" is no method (neupig help method lists them), no file.json and "
                     "no JSON object",
                     value);
}
