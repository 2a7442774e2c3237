/* A kernel that computes wrong on purpose is named by the self-test: one change in every source, compiled and
 * run as any other, in a kernel cache of this program's own. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#define npg_kernel_sources true_sources
#include "kernels_embedded.c"
#undef npg_kernel_sources

#include "kernels/kernels.h"
#include "tests/support/temp_folder.h"

enum { TEXT_MAX = 32 << 10 };

/* The library takes these in the place of its own; set_up() fills them. */
static char texts[9][TEXT_MAX];
extern const npg_kernel_source npg_kernel_sources[];
const npg_kernel_source npg_kernel_sources[] = {{"adam", texts[0]},      {"chamfer", texts[1]},
                                                {"isometry", texts[2]},  {"latent", texts[3]},
                                                {"mlp", texts[4]},       {"nearest", texts[5]},
                                                {"sobolev", texts[6]},   {"time", texts[7]},
                                                {"transform", texts[8]}, {0}};

static const struct change {
    const char *source, *was, *is, *op; /* the op that the self-test must name */
} changes[] = {
    {"latent", "fma(w, vload16(2 * index[k], nodes), a)", "fma(w, vload16(2 * index[k], nodes), -a)",
     "latent"},
    {"sobolev", "a = fma(c, vload16(2 * row, in), a)", "a = fma(c, vload16(2 * row, in), 0.99f * a)",
     "sobolev"},
    {"mlp", "sum[j] += a;", "sum[j] -= a;", "mlp"},
    {"mlp", "STORE(e + LOAD(j, dp1 + at + NPG_PANEL * i), j", "STORE(e, j", "mlp"},
    {"mlp", "head_back(d2, sum + AT_B2", "head_back(d2, sum + AT_HEAD", "mlp"},
    {"time", "float sum = b[n]", "float sum = 0.9f * b[n]", "mlp"},
    {"adam", "(1.0f - b1) * g[i]", "(1.0f - b2) * g[i]", "adam"},
    {"transform", "2.0f * (q.s * uv", "1.9f * (q.s * uv", "transform"},
    {"transform", "d.s0 = (ds - q.s * along)", "d.s0 = (ds + q.s * along)", "transform"},
    {"nearest", "if (low < best.dist_sq)", "if (2.0f * low < best.dist_sq)", "nearest"},
    {"chamfer", "sum_v + sum_p", "sum_v - sum_p", "chamfer"},
    {"isometry", "sum += fabs(change)", "sum += change", "isometry"},
};

static char *text_of(const char *name)
{
    for (size_t i = 0; npg_kernel_sources[i].name; i++)
        if (!strcmp(npg_kernel_sources[i].name, name)) return texts[i];
    return NULL;
}

static void mend_all(void)
{
    for (const npg_kernel_source *source = true_sources; source->name; source++) {
        char *text = text_of(source->name);
        if (text) snprintf(text, TEXT_MAX, "%s", source->text);
        if (text) assert_true(strlen(source->text) < TEXT_MAX);
    }
}

static void spoil(const struct change *change)
{
    char *text = text_of(change->source), *place = strstr(text, change->was);
    char rest[TEXT_MAX];
    assert_non_null(place);
    snprintf(rest, sizeof rest, "%s", place + strlen(change->was));
    snprintf(place, (size_t)(text + TEXT_MAX - place), "%s%s", change->is, rest);
}

/* A device keeps what it compiled: each text gets one of its own. */
static npg_status self_test(void)
{
    npg_device *device;
    if (npg_device_open(&device, "auto", NULL)) fail_msg("%s", npg_error_text());
    npg_status status = npg_kernels_self_test(device);
    npg_device_close(&device);
    return status;
}

static void a_wrong_kernel_is_named(void **state)
{
    char words[64];
    (void)state;
    for (size_t i = 0; i < sizeof changes / sizeof *changes; i++) {
        mend_all();
        spoil(&changes[i]);
        npg_status status = self_test();
        if (status != NPG_DEVICE)
            fail_msg("%s with \"%s\" passes as %d", changes[i].source, changes[i].is, status);
        snprintf(words, sizeof words, "computes op %s wrong", changes[i].op);
        if (!strstr(npg_error_text(), words))
            fail_msg("%s: \"%s\" is not in: %s", changes[i].source, words, npg_error_text());
    }
    mend_all();
    if (self_test()) fail_msg("%s", npg_error_text());
}

static void a_kernel_that_does_not_compile_is_named(void **state)
{
    const struct change change = {"isometry", "sum += fabs(change)", "sum += fabs(chance)", NULL};
    (void)state;
    mend_all();
    spoil(&change);
    assert_int_equal(self_test(), NPG_DEVICE);
    if (!strstr(npg_error_text(), "kernels/isometry.cl")) fail_msg("%s", npg_error_text());
}

/* What a wrong text was built to stays in the cache under that text: the right one does not find it. */
static void a_binary_in_the_cache_belongs_to_its_text(void **state)
{
    npg_device *device;
    npg_program *program;
    (void)state;
    mend_all();
    spoil(&changes[sizeof changes / sizeof *changes - 1]);
    if (npg_device_open(&device, "auto", NULL)) fail_msg("%s", npg_error_text());
    assert_int_equal(npg_program_open(&program, device, "isometry", ""), NPG_OK);
    mend_all();
    npg_device_close(&device);
    if (npg_device_open(&device, "auto", NULL)) fail_msg("%s", npg_error_text());
    if (npg_kernels_self_test(device)) fail_msg("%s", npg_error_text());
    npg_device_close(&device);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_wrong_kernel_is_named),
                                       cmocka_unit_test(a_kernel_that_does_not_compile_is_named),
                                       cmocka_unit_test(a_binary_in_the_cache_belongs_to_its_text)};
    temp_folder cache;
    if (open_temp_folder(&cache)) return 1;
    setenv("XDG_CACHE_HOME", cache.path, 1);
    unsetenv("POCL_CACHE_DIR");
    int failures = cmocka_run_group_tests(tests, NULL, NULL);
    close_temp_folder(&cache);
    return failures;
}
