/* Tuning: the sets, their checks and their file. */
#include "kernels/runtime/tuning.h"

#include <errno.h>
#include <jansson.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "pipeline/json_file.h"

const npg_tuning npg_tuning_wide = {.mlp_rows = 192,
                                    .mlp_vector = 16,
                                    .mlp_tile_vectors = 2,
                                    .mlp_tile_rows = 12,
                                    .mlp_grad_rows = 8,
                                    .mlp_head_rows = 12,
                                    .mlp_local = 1,
                                    .mlp_groups = 2,
                                    .nearest_queries = 64,
                                    .frame_local = 1,
                                    .span = 16,
                                    .local = 1};

/* 16 registers of 8 floats: 6 x 2 sums, 2 vectors of weights, one value. */
const npg_tuning npg_tuning_narrow = {.mlp_rows = 192,
                                      .mlp_vector = 8,
                                      .mlp_tile_vectors = 2,
                                      .mlp_tile_rows = 6,
                                      .mlp_grad_rows = 4,
                                      .mlp_head_rows = 6,
                                      .mlp_local = 1,
                                      .mlp_groups = 2,
                                      .nearest_queries = 64,
                                      .frame_local = 1,
                                      .span = 16,
                                      .local = 1};

/* 128 items side by side in one row of 512 columns, loads of neighbours adjacent;
 * small blocks give many groups. */
const npg_tuning npg_tuning_gpu = {.mlp_rows = 64,
                                   .mlp_vector = 4,
                                   .mlp_tile_vectors = 1,
                                   .mlp_tile_rows = 8,
                                   .mlp_grad_rows = 8,
                                   .mlp_head_rows = 1,
                                   .mlp_local = 128,
                                   .mlp_groups = 2,
                                   .nearest_queries = 1,
                                   .frame_local = 128,
                                   .span = 1,
                                   .local = 64};

/* clang-format off */
#define FIELD(name, least, most, help) {#name, help, offsetof(npg_tuning, name), least, most}

const npg_tuning_field npg_tuning_fields[] = {
    /*    name              least most  help */
    FIELD(mlp_rows,         16,    1024, "vertices in a block of the decoder"),
    FIELD(mlp_vector,       4,     16,   "floats in a vector of the decoder"),
    FIELD(mlp_tile_vectors, 1,     8,    "vectors in a row of a register tile"),
    FIELD(mlp_tile_rows,    1,     64,   "rows of a register tile"),
    FIELD(mlp_grad_rows,    1,     32,   "rows of a register tile of the weights' gradient"),
    FIELD(mlp_head_rows,    1,     64,   "rows of a register tile of the last layer"),
    FIELD(mlp_local,        1,     1024, "work-items that share a block"),
    FIELD(mlp_groups,       1,     64,   "blocks under way for each compute unit"),
    FIELD(nearest_queries,  1,     1024, "searches of a work-item in a row"),
    FIELD(frame_local,      1,     1024, "work-items that share a frame"),
    FIELD(span,             1,     1024, "values of a work-item in a row"),
    FIELD(local,            1,     1024, "work-group of the other kernels"),
    {0}};
/* clang-format on */

int npg_tuning_get(const npg_tuning *tuning, const npg_tuning_field *field)
{
    int value;
    memcpy(&value, (const char *)tuning + field->offset, sizeof value);
    return value;
}

void npg_tuning_put(npg_tuning *tuning, const npg_tuning_field *field, int value)
{
    memcpy((char *)tuning + field->offset, &value, sizeof value);
}

npg_status npg_tuning_check(const npg_tuning *t)
{
    for (const npg_tuning_field *field = npg_tuning_fields; field->name; field++) {
        int value = npg_tuning_get(t, field);
        if (value < field->min || value > field->max)
            return npg_error(NPG_USAGE, "%s is %d, not within %d .. %d", field->name, value, field->min,
                             field->max);
    }
    if (t->mlp_rows % 16 || t->mlp_rows % t->mlp_tile_rows || t->mlp_rows % t->mlp_head_rows)
        return npg_error(NPG_USAGE, "mlp_rows %d is not a multiple of 16, mlp_tile_rows and mlp_head_rows",
                         t->mlp_rows);
    if ((t->mlp_vector != 4 && t->mlp_vector != 8 && t->mlp_vector != 16) ||
        32 % (t->mlp_vector * t->mlp_tile_vectors))
        return npg_error(NPG_USAGE, "%d vectors of %d floats don't divide 32 columns", t->mlp_tile_vectors,
                         t->mlp_vector);
    if (32 % t->mlp_grad_rows)
        return npg_error(NPG_USAGE, "mlp_grad_rows %d does not divide 32", t->mlp_grad_rows);
    return NPG_OK;
}

void npg_tuning_constants(char *out, size_t size, const npg_tuning *t, const char *program)
{
    out[0] = 0;
    if (!strcmp(program, "mlp"))
        snprintf(out, size, "-DROWS=%d -DVW=%d -DNV=%d -DMR=%d -DGR=%d -DHR=%d -DLOCAL=%d -DSPAN=%d",
                 t->mlp_rows, t->mlp_vector, t->mlp_tile_vectors, t->mlp_tile_rows, t->mlp_grad_rows,
                 t->mlp_head_rows, t->mlp_local, t->span);
    if (!strcmp(program, "nearest"))
        snprintf(out, size, "-DQUERIES=%d -DLOCAL=%d", t->nearest_queries, t->frame_local);
    if (!strcmp(program, "chamfer") || !strcmp(program, "pull"))
        snprintf(out, size, "-DLOCAL=%d", t->frame_local);
    if (!strcmp(program, "peak"))
        snprintf(out, size, "-DVW=%d -DCHAINS=%d -DLOCAL=%d", t->mlp_vector,
                 t->mlp_tile_rows * t->mlp_tile_vectors, t->mlp_local);
    if (!strcmp(program, "adam")) snprintf(out, size, "-DSPAN=%d", t->span);
}

/* ---- the file ---- */

#define KIND "neupig tuning"

npg_status npg_tuning_save(const npg_tuning *tuning, const char *path, const char *device)
{
    json_t *values = json_object(), *root = json_pack("{s:s, s:s}", "kind", KIND, "device", device);
    for (const npg_tuning_field *field = npg_tuning_fields; field->name; field++)
        json_object_set_new(values, field->name, json_integer(npg_tuning_get(tuning, field)));
    json_object_set_new(root, "values", values);
    npg_status status = npg_json_save(path, root);
    json_decref(root);
    return status;
}

static npg_status read_values(npg_tuning *out, const json_t *root, const char *device)
{
    npg_tuning read = {0};
    const char *kind = json_string_value(json_object_get(root, "kind"));
    const char *whose = json_string_value(json_object_get(root, "device"));
    const json_t *values = json_object_get(root, "values");
    if (!kind || strcmp(kind, KIND) != 0) return npg_error(NPG_BAD_INPUT, "is no file of neupig tune");
    if (!whose || strcmp(whose, device) != 0)
        return npg_error(NPG_BAD_INPUT, "was made for %s, not for %s", whose ? whose : "no device", device);
    for (const npg_tuning_field *field = npg_tuning_fields; field->name; field++) {
        const json_t *value = json_object_get(values, field->name);
        if (!json_is_integer(value)) return npg_error(NPG_BAD_INPUT, "has no number %s", field->name);
        json_int_t number = json_integer_value(value);
        if (number < field->min || number > field->max)
            return npg_error(NPG_BAD_INPUT, "%s is %lld, not within %d .. %d", field->name, (long long)number,
                             field->min, field->max);
        npg_tuning_put(&read, field, (int)number);
    }
    if (npg_tuning_check(&read)) {
        char why[256];
        snprintf(why, sizeof why, "%.255s", npg_error_text());
        return npg_error(NPG_BAD_INPUT, "%s", why);
    }
    *out = read;
    return NPG_OK;
}

npg_status npg_tuning_load(npg_tuning *tuning, const char *path, const char *device)
{
    json_error_t error;
    if (access(path, F_OK)) return errno == ENOENT ? NPG_END : npg_error_errno(NPG_DISK, "%s", path);
    json_t *root = json_load_file(path, JSON_REJECT_DUPLICATES, &error);
    if (!root) return npg_error(NPG_BAD_INPUT, "%s, line %d: %s", path, error.line, error.text);
    npg_status status = npg_error_prefix(read_values(tuning, root, device), "%s", path);
    json_decref(root);
    return status;
}
