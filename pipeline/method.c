/* Methods: a JSON object whose keys are options. */
#include "pipeline/options.h"

#include <jansson.h>
#include <string.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"

npg_status npg_method_apply(npg_options *options, const json_t *root, const char *place)
{
    const char *name;
    json_t *value;
    if (!json_is_object(root)) return npg_error(NPG_USAGE, "%s: not a JSON object", place);
    json_object_foreach((json_t *)root, name, value)
        NPG_TRY(npg_error_prefix(npg_options_set_key(options, name, value), "%s", place));
    return NPG_OK;
}

/* ---- where it comes from ---- */

npg_status npg_options_load(npg_options *options, const char *path)
{
    enum { LIMIT = 1 << 20 }; /* bytes; all options together take a few thousand */
    json_t *root;
    NPG_REQUIRE(options && path);
    NPG_TRY(npg_json_read(&root, path, LIMIT));
    npg_status status = npg_method_apply(options, root, path);
    json_decref(root);
    return status;
}

static npg_status apply_text(npg_options *options, const char *given)
{
    char *text;
    json_t *root = NULL;
    NPG_TRY(npg_copy_text(&text, given));
    npg_status status = npg_json_parse(&root, text, "method");
    if (!status) status = npg_method_apply(options, root, "method");
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
