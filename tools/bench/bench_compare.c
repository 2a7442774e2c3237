/* Bench compare: two reports side by side. */
#include "tools/bench/bench_compare.h"

#include <stdbool.h>
#include <stdio.h>
#include <string.h>

npg_status npg_bench_load(json_t **report, const char *path)
{
    json_error_t error;
    *report = json_load_file(path, 0, &error);
    if (!*report) return npg_error(NPG_BAD_INPUT, "%s, line %d: %s", path, error.line, error.text);
    if (json_is_object(json_object_get(*report, "kernels"))) return NPG_OK;
    json_decref(*report);
    *report = NULL;
    return npg_error(NPG_BAD_INPUT, "%s is no report of neupig bench: it has no \"kernels\"", path);
}

/* Figures taken with other sizes or on another device say nothing. */
static npg_status check_same(const json_t *before, const json_t *now)
{
    static const char *const keys[] = {"device", "sizes"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++)
        if (!json_equal(json_object_get(before, keys[i]), json_object_get(now, keys[i])))
            return npg_error(NPG_BAD_INPUT, "the two reports differ in \"%s\": figures can't be compared",
                             keys[i]);
    return NPG_OK;
}

static double real_at(const json_t *row, const char *key, const char *part)
{
    return json_number_value(json_object_get(json_object_get(row, key), part));
}

/* How much slower, 1: as before; *sure: beyond noise. */
static double ratio_of(bool *sure, const json_t *before, const json_t *now, double tolerance)
{
    double high = real_at(before, "relative", "high"), low = real_at(now, "relative", "low");
    double was = real_at(before, "relative", "median"), is = real_at(now, "relative", "median");
    *sure = high > 0 && low > high * (1 + tolerance);
    return was > 0 ? is / was : 0;
}

npg_status npg_bench_compare(const json_t *before, const json_t *now, double tolerance)
{
    const char *name;
    json_t *row;
    size_t slower = 0, common = 0;
    NPG_TRY(check_same(before, now));
    json_object_foreach(json_object_get(now, "kernels"), name, row)
    {
        bool sure;
        const json_t *old = json_object_get(json_object_get(before, "kernels"), name);
        if (!old) continue;
        double ratio = ratio_of(&sure, old, row, tolerance);
        common++;
        if (!sure) continue;
        printf("slower: %s takes %.2f times as long (%.4g ms, was %.4g ms)\n", name, ratio,
               1e3 * real_at(row, "busy_s", "median"), 1e3 * real_at(old, "busy_s", "median"));
        slower++;
    }
    if (!common) return npg_error(NPG_BAD_INPUT, "the two reports have no row in common");
    return slower ? NPG_PARTIAL : NPG_OK;
}
