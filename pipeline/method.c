/* Methods: a JSON object whose keys are options, or a configuration of the paper's published code.
 *
 * That code solves (I + lambda L) u = z by conjugate gradients and names the choice and its neighbourhood;
 * the solve is exact here, so these keys have no counterpart.  Features have a fixed width of 30 + 2. */
#include "pipeline/options.h"

#include <jansson.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/json_file.h"
#include "pipeline/memory.h"

typedef struct word {
    const char *published, *option, *own; /* option NULL: what is done anyway */
} word;

/* ---- the published code's configuration ---- */

/* The published word, the option here, and its word. */
/* clang-format off */
static const word rotations[] = {
    {"quaternions", NULL, NULL},
    {0}};
static const word time_codes[] = {
    {"fourier_features2", NULL, NULL},
    {0}};
static const word confidences[] = {
    {"pdg",         "confidence", "cumulative"},
    {"constant",    "confidence", "constant"},
    {0}};
/* "none" leaves every frame its full weight, whatever the confidence is */
static const word catch_ups[] = {
    {"pdg",         NULL,         NULL},
    {"none",        "confidence", "constant"},
    {0}};
static const word descriptors[] = {{"surface", NULL, NULL}, {0}};
/* clang-format on */

typedef struct rule {
    const char *section, *key; /* section NULL: on top */
    const word *words;         /* for keys that hold a word */
    const char *options[2];    /* for keys that hold a number */
    double divide_by, is;      /* 0: the number as it stands; without an option: what it is anyway */
} rule;

/* clang-format off */
static const rule rules[] = {
    /* section       key                   words        options                 divide_by, is */
    {NULL,           "descriptor",         descriptors, {0},                    0, 0},
    {NULL,           "time_encoding",      time_codes,  {0},                    0, 0},
    {NULL,           "rotation_method",    rotations,   {0},                    0, 0},
    {"optimization", "epochs",             NULL,        {"epochs"},             0, 0},
    {"optimization", "edgeloss",           NULL,        {"isometry"},           0, 0},
    {"optimization", "time_smoothing",     confidences, {0},                    0, 0},
    {"optimization", "catchup_scaling",    catch_ups,   {0},                    0, 0},
    {"grid",         "base_res",           NULL,        {"grid-base"},          0, 0},
    {"grid",         "increase_per_level", NULL,        {"grid-step"},          0, 0},
    {"grid",         "n_level",            NULL,        {"grid-levels"},        0, 0},
    {"grid",         "lr_adapt",           NULL,        {"grid-rate-growth"},   0, 0},
    {"grid",         "local_lambda_adapt", NULL,        {"lambda-growth"},      0, 0},
    {"grid",         "smoothness",         NULL,        {"lambda"},             0, 0},
    {"grid",         "lr",                 NULL,        {"grid-rate"},          0, 0},
    {"mlp",          "hidden",             NULL,        {"width-1", "width-2"}, 0, 0},
    {"mlp",          "layers",             NULL,        {0},                    0, 3}, /* with the head */
    {"mlp",          "point_dim",          NULL,        {"position-channels"},  0, 0},
    {"mlp",          "normal_dim",         NULL,        {"normal-channels"},    0, 0},
    {"mlp",          "time_dim",           NULL,        {"time-frequencies"},   2, 0},
};
/* clang-format on */
enum { RULES = sizeof rules / sizeof *rules };

typedef struct unmatched {
    char text[512];
    size_t count;
} unmatched;

static void name_unmatched(unmatched *u, const char *section, const char *key, const json_t *value)
{
    size_t used = strlen(u->text);
    char *shown = json_is_string(value) || json_is_number(value)
                      ? json_dumps(value, JSON_ENCODE_ANY | JSON_REAL_PRECISION(6))
                      : NULL;
    snprintf(u->text + used, sizeof u->text - used, "%s%s%s%s%s%s", u->count ? ", " : "",
             section ? section : "", section ? "." : "", key, shown ? " = " : "", shown ? shown : "");
    free(shown);
    u->count++;
}

static npg_status set_number(npg_options *options, const rule *r, double value)
{
    char text[64];
    if (r->divide_by > 0) value /= r->divide_by;
    snprintf(text, sizeof text, "%.15g", value);
    for (size_t i = 0; i < 2 && r->options[i]; i++) NPG_TRY(npg_options_set(options, r->options[i], text));
    return NPG_OK;
}

static npg_status apply(npg_options *options, const rule *r, const json_t *value, unmatched *u)
{
    if (r->words && !json_is_string(value)) return npg_error(NPG_USAGE, "not a word");
    if (!r->words && !json_is_number(value)) return npg_error(NPG_USAGE, "not a number");
    if (r->words) {
        const word *w = r->words;
        while (w->published && strcmp(w->published, json_string_value(value)) != 0) w++;
        if (!w->published) name_unmatched(u, r->section, r->key, value);
        return w->option ? npg_options_set(options, w->option, w->own) : NPG_OK;
    }
    if (!r->options[0] && json_number_value(value) != r->is) name_unmatched(u, r->section, r->key, value);
    return set_number(options, r, json_number_value(value));
}

static const json_t *section_of(const json_t *root, const rule *r)
{
    return r->section ? json_object_get(root, r->section) : root;
}

/* Everything in one object that no rule knows. */
static void find_unknown(unmatched *u, const json_t *object, const char *section)
{
    const char *key;
    const json_t *value;
    json_object_foreach((json_t *)object, key, value)
    {
        bool known = !section && json_is_object(value) &&
                     (!strcmp(key, "optimization") || !strcmp(key, "grid") || !strcmp(key, "mlp"));
        for (size_t i = 0; i < RULES && !known; i++) {
            const char *in = rules[i].section;
            known = !strcmp(rules[i].key, key) && (in && section ? !strcmp(in, section) : in == section);
        }
        if (!known) name_unmatched(u, section, key, NULL);
    }
}

static npg_status apply_published(npg_options *options, const json_t *root, const char *place)
{
    unmatched u = {.count = 0};
    char *ignored;
    NPG_TRY(npg_options_set(options, "preset", "paper"));
    for (size_t i = 0; i < RULES; i++) {
        const rule *r = &rules[i];
        const json_t *value = json_object_get(section_of(root, r), r->key);
        npg_status status = value ? apply(options, r, value, &u) : NPG_OK;
        if (status)
            return npg_error_prefix(status, "%s: %s%s%s", place, r->section ? r->section : "",
                                    r->section ? "." : "", r->key);
    }
    find_unknown(&u, root, NULL);
    find_unknown(&u, json_object_get(root, "optimization"), "optimization");
    find_unknown(&u, json_object_get(root, "grid"), "grid");
    find_unknown(&u, json_object_get(root, "mlp"), "mlp");
    NPG_TRY(npg_copy_text(&ignored, u.text));
    npg_options_ignore(options, &ignored);
    return NPG_OK;
}

static bool is_published(const json_t *root)
{
    return json_is_object(json_object_get(root, "optimization")) ||
           json_is_object(json_object_get(root, "grid")) || json_is_object(json_object_get(root, "mlp"));
}

/* ---- our own ---- */

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
static npg_status apply_own(npg_options *options, const json_t *root, const char *place, const char *text)
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
    return is_published(root) ? apply_published(options, root, place) : apply_own(options, root, place, NULL);
}

/* ---- where it comes from ---- */

/* Takes over root and text. */
static npg_status apply_read(npg_options *options, json_t *root, char *text, const char *place)
{
    npg_status status =
        is_published(root) ? apply_published(options, root, place) : apply_own(options, root, place, text);
    npg_release(&text);
    json_decref(root);
    return status;
}

npg_status npg_options_load(npg_options *options, const char *path)
{
    enum { LIMIT = 1 << 20 }; /* bytes; all options together take a few thousand */
    char *text;
    json_t *root;
    NPG_REQUIRE(options && path);
    NPG_TRY(npg_json_read(&root, &text, path, LIMIT));
    return apply_read(options, root, text, path);
}

static npg_status apply_text(npg_options *options, const char *given)
{
    char *text;
    json_t *root;
    NPG_TRY(npg_copy_text(&text, given));
    npg_status status = npg_json_parse(&root, text, "method");
    if (!status) return apply_read(options, root, text, "method");
    npg_release(&text);
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
