/* Options: the tables of a chain, checks of values, presets, the configuration file. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <locale.h>

#include "pipeline/memory.h"
#include "pipeline/options.h"
#include "pipeline/stage.h"
#include "tests/support/group_folder.h"

/* ---- a chain with tables of its own; the second stage has none ---- */

typedef struct first_state {
    bool flag;
    int64_t whole;
    double real;
    int choice;
    const char *text;
} first_state;

#define AT(member) offsetof(first_state, member)

/* clang-format off */
static const npg_option first_table[] = {
    /* type        name           place       default  least  most  shown as or words */
    NPG_ROW_FLAG  ("test-flag",   AT(flag),   "no",
        "A flag"),
    NPG_ROW_INT   ("test-whole",  AT(whole),  "5",     -10,   1e15, NULL,
        "A number"),
    NPG_ROW_REAL  ("test-real",   AT(real),   "0.25",  0,     1,    NULL,
        "A number"),
    NPG_ROW_CHOICE("test-choice", AT(choice), "two",   "one|two|three",
        "A word"),
    NPG_ROW_TEXT  ("test-text",   AT(text),   "",      NULL,
        "A text"),
    {0}};
/* clang-format on */
/* clang-format off */
static const npg_option last_table[] = {
    /* type     name         place  default  least  most  shown as */
    NPG_ROW_INT("test-last", 0,     "1",     0,     9,    NULL,
        "Behind a stage without options"),
    {0}};
/* clang-format on */

static const npg_stage first = {.name = "first", .options = first_table};
static const npg_stage second = {.name = "second"};
static const npg_stage last = {.name = "last", .options = last_table};
static const npg_stage *const chain[] = {&first, &second, &last, NULL};

static npg_options *open_options(void)
{
    npg_options *options;
    assert_int_equal(npg_options_open_chain(&options, chain), NPG_OK);
    return options;
}

static void defaults_fill_a_state(void **state)
{
    (void)state;
    npg_options *options = open_options();
    first_state s = {.flag = true};
    npg_options_fill(options, first_table, &s);
    assert_false(s.flag);
    assert_int_equal(s.whole, 5);
    assert_true(s.real == 0.25);
    assert_int_equal(s.choice, 1);
    assert_string_equal(s.text, "");
    npg_options_close(&options);
    assert_null(options);
    npg_options_close(&options);
    npg_options_close(NULL);
}

static void values_fill_a_state(void **state)
{
    (void)state;
    npg_options *options = open_options();
    first_state s;
    int64_t last_value;
    assert_int_equal(npg_options_set(options, "test-flag", "yes"), NPG_OK);
    assert_int_equal(npg_options_set(options, "test-whole", "-7"), NPG_OK);
    assert_int_equal(npg_options_set(options, "test-real", "1e-3"), NPG_OK);
    assert_int_equal(npg_options_set(options, "test-choice", "three"), NPG_OK);
    assert_int_equal(npg_options_set(options, "test-text", "a b"), NPG_OK);
    assert_int_equal(npg_options_set(options, "test-last", "3"), NPG_OK);
    npg_options *copy;
    assert_int_equal(npg_options_copy(&copy, options), NPG_OK);
    npg_options_close(&options);
    npg_options_fill(copy, first_table, &s);
    npg_options_fill(copy, last_table, &last_value);
    assert_true(s.flag);
    assert_int_equal(s.whole, -7);
    assert_true(s.real == 1e-3);
    assert_int_equal(s.choice, 2);
    assert_string_equal(s.text, "a b");
    assert_int_equal(last_value, 3);
    assert_true(npg_options_is_set(copy, "test-last"));
    assert_false(npg_options_is_set(copy, "chunk"));
    assert_string_equal(npg_options_get(copy, "test-choice"), "three");
    assert_null(npg_options_get(copy, "no-such"));
    npg_options_close(&copy);
}

static void bad_values_are_refused_and_change_nothing(void **state)
{
    const char *const bad[][2] = {{"test-flag", "maybe"},
                                  {"test-flag", ""},
                                  {"test-whole", "1.5"},
                                  {"test-whole", "x"},
                                  {"test-whole", ""},
                                  {"test-whole", "5 "},
                                  {"test-whole", " 5"},
                                  {"test-whole", "1e3"},
                                  {"test-whole", "-11"},
                                  {"test-whole", "0x10"},
                                  {"test-real", "1.0001"},
                                  {"test-real", "nan"},
                                  {"test-real", "inf"},
                                  {"test-real", "1e999"},
                                  {"test-real", "0,5"},
                                  {"test-choice", "tw"},
                                  {"test-choice", "twoo"},
                                  {"test-choice", ""},
                                  {"test-choice", "one|two"},
                                  {"chunk", "0"},
                                  {"whole", "1"},
                                  {"", "1"}};
    (void)state;
    npg_options *options = open_options();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(npg_options_set(options, bad[i][0], bad[i][1]), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), bad[i][0]));
        assert_false(npg_options_is_set(options, bad[i][0]));
    }
    assert_int_equal(npg_options_set(NULL, "chunk", "1"), NPG_USAGE);
    assert_int_equal(npg_options_set(options, NULL, "1"), NPG_USAGE);
    assert_int_equal(npg_options_set(options, "chunk", NULL), NPG_USAGE);
    npg_options_close(&options);
}

static void a_table_outside_the_chain_gets_defaults(void **state)
{
    (void)state;
    const npg_option foreign[] = {NPG_ROW_INT("foreign", 0, "42", 0, 99, NULL, ""), {0}};
    npg_options *options = open_options();
    int64_t value = 0;
    npg_options_fill(options, foreign, &value);
    assert_int_equal(value, 42);
    npg_options_close(&options);
}

/* Everything the command shows comes from here, so every entry must be whole. */
static void all_options_are_described_and_sound(void **state)
{
    (void)state;
    npg_option_info info = {.struct_size = sizeof info}, other = info;
    npg_options *options;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    size_t count = 0;
    for (; npg_options_describe(count, &info) == NPG_OK; count++) {
        assert_non_null(info.stage);
        assert_true(strlen(info.help) > 5);
        assert_non_null(info.default_text);
        assert_int_equal(info.type == NPG_OPTION_CHOICE, info.choices != NULL);
        assert_int_equal(strspn(info.name, "abcdefghijklmnopqrstuvwxyz0123456789-."), strlen(info.name));
        assert_int_equal(npg_options_set(options, info.name, info.default_text), NPG_OK);
        assert_null(npg_option_gone(info.name));
        for (size_t i = 0; i < count; i++) {
            assert_int_equal(npg_options_describe(i, &other), NPG_OK);
            assert_string_not_equal(info.name, other.name);
        }
    }
    assert_true(count >= 10);
    assert_int_equal(npg_options_describe(count, &info), NPG_END);
    info.struct_size = 1;
    assert_int_equal(npg_options_describe(0, &info), NPG_USAGE);
    npg_options_close(&options);
}

static void presets_hold_values_that_are_accepted(void **state)
{
    (void)state;
    npg_options *options;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    for (const npg_preset *preset = npg_presets; preset->name; preset++) {
        assert_int_equal(npg_options_set(options, preset->option, preset->name), NPG_OK);
        for (const npg_preset_value *value = preset->values; value->name; value++) {
            assert_string_equal(npg_options_get(options, value->name), value->value);
            const char *own = npg_options_get(options, value->name);
            char *copy = strdup(own);
            assert_int_equal(npg_options_set(options, value->name, copy), NPG_OK);
            free(copy);
        }
        npg_options_close(&options);
        assert_int_equal(npg_options_open(&options), NPG_OK);
    }
    assert_int_equal(npg_options_set(options, "method", "no-such-preset"), NPG_USAGE);
    npg_options_close(&options);
}

static void numbers_do_not_depend_on_the_locale(void **state)
{
    (void)state;
    npg_options *options = open_options();
    first_state s;
    const char *const names[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8"};
    for (size_t i = 0; i < 3; i++)
        if (setlocale(LC_NUMERIC, names[i])) break;
    assert_int_equal(npg_options_set(options, "test-real", "0.5"), NPG_OK);
    npg_options_fill(options, first_table, &s);
    assert_true(s.real == 0.5);
    setlocale(LC_NUMERIC, "C");
    npg_options_close(&options);
}

/* ---- the configuration file ---- */

static npg_status load(npg_options *options, const char *text)
{
    const char *path = in_folder(&folder, "config.json");
    assert_int_equal(write_text_file(path, text), 0);
    return npg_options_load(options, path);
}

static void a_file_sets_options(void **state)
{
    (void)state;
    npg_options *options = open_options();
    first_state s;
    assert_int_equal(load(options, "{ // a comment\n"
                                   "  \"test-flag\": true, \"test-whole\": -3,\n"
                                   "  \"test-real\": 0.125, // \"test-real\": 7,\n"
                                   "  \"test-text\": \"http://x // \\\" {\", \"test-choice\": \"one\"\n"
                                   "} // the end"),
                     NPG_OK);
    npg_options_fill(options, first_table, &s);
    assert_true(s.flag);
    assert_int_equal(s.whole, -3);
    assert_true(s.real == 0.125);
    assert_int_equal(s.choice, 0);
    assert_string_equal(s.text, "http://x // \" {");
    npg_options_close(&options);
}

static void a_bad_file_is_named(void **state)
{
    const struct {
        const char *text, *place, *word;
    } cases[] = {
        {"{\n\n\"test-whole\": 1.5}", "config.json: ", "test-whole"},
        {"{\"test-text\": \"test-whole\",\n \"test-whole\" : \"x\"}", "config.json: ", "test-whole"},
        {"{\"chunk\": 2,\n\n\n\"no-such\": 1}", "config.json: ", "no-such"},
        {"{\"chunk\": {\"a\": 1}}", "config.json: ", "chunk"},
        {"{\"chunk\": null}", "config.json: ", "chunk"},
        {"{\"chunk\": 1,\n\"chunk\": 2}", "config.json:2", "chunk"},
        {"{\"chunk\": 1,\n", "config.json:", ""},
        {"[1]", "config.json", "object"},
        {"", "config.json", ""},
        {"{\"test-text\": \"\xff\"}", "config.json:1", ""},
    };
    (void)state;
    npg_options *options = open_options();
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(load(options, cases[i].text), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), cases[i].place));
        assert_non_null(strstr(npg_error_text(), cases[i].word));
    }
    assert_int_equal(npg_options_load(options, in_folder(&folder, "missing.json")), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "missing.json"));
    assert_int_equal(npg_options_load(options, folder.path), NPG_USAGE);
    npg_options_close(&options);
}

static void a_huge_file_is_refused(void **state)
{
    (void)state;
    npg_options *options = open_options();
    char *text = malloc((2 << 20) + 1);
    memset(text, ' ', 2 << 20);
    text[2 << 20] = 0;
    assert_int_equal(load(options, text), NPG_USAGE);
    assert_non_null(strstr(npg_error_text(), "1 MiB"));
    free(text);
    npg_options_close(&options);
}

static void no_memory_is_said(void **state)
{
    (void)state;
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status && n < 50; n++) {
        npg_options *options = NULL, *copy = NULL;
        npg_memory_fail_at(n, false);
        status = npg_options_open_chain(&options, chain);
        if (!status) status = load(options, "{\"test-text\": \"abc\", \"chunk\": 3}");
        if (!status) status = npg_options_copy(&copy, options);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        npg_options_close(&options);
        npg_options_close(&copy);
        assert_int_equal(npg_memory_used(), before);
    }
    assert_int_equal(status, NPG_OK);
}

/* ---- the method ---- */

static npg_options *open_all(void)
{
    npg_options *options;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    return options;
}

static void a_method_is_a_name_a_text_or_a_file(void **state)
{
    (void)state;
    const char *path = in_folder(&folder, "method.json");
    assert_int_equal(write_text_file(path, "{ // mine\n\"preset\": \"grids\", \"epochs\": 7}"), 0);
    npg_options *options = open_all();
    char usual[32];
    snprintf(usual, sizeof usual, "%s", npg_options_get(options, "reference-rounds"));
    assert_int_equal(npg_options_set(options, "effort", "best"), NPG_OK);
    assert_string_not_equal(npg_options_get(options, "reference-rounds"), usual);
    assert_int_equal(npg_options_set(options, "effort", "usual"), NPG_OK);
    assert_string_equal(npg_options_get(options, "reference-rounds"), usual);
    assert_int_equal(npg_options_set(options, "method", "paper"), NPG_OK);
    assert_string_equal(npg_options_get(options, "align"), "no");
    assert_string_equal(npg_options_get(options, "preset"), "paper");
    assert_int_equal(npg_options_set(options, "method", " {\"epochs\": 5, \"faces\": 300}"), NPG_OK);
    assert_string_equal(npg_options_get(options, "method"), "paper");
    assert_string_equal(npg_options_get(options, "epochs"), "5");
    assert_string_equal(npg_options_get(options, "faces"), "300");
    assert_int_equal(npg_options_set(options, "method", path), NPG_OK);
    assert_string_equal(npg_options_get(options, "method"), "grids");
    assert_string_equal(npg_options_get(options, "epochs"), "7");
    npg_options_close(&options);
}

static void a_bad_method_is_named(void **state)
{
    const char *const bad[][2] = {{"papr", "\"papr\""},
                                  {"", "method"},
                                  {"missing.json", "missing.json"},
                                  {"{\"epochs\": 5", "method:1"},
                                  {"{\n\"epochs\": -1}", "method: option epochs"},
                                  {"{\"preset\": \"other.json\"}", "other.json"},
                                  {"{\"method\": {\"epochs\": 1}}", "method"},
                                  {"{\"quality\": \"best\"}", "--effort best"},
                                  {"best", "--effort best"},
                                  {"{\"grid\": {\"n_level\": 99}}", "method_json.py"},
                                  {"[1]", "method"}};
    (void)state;
    npg_options *options = open_all();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(npg_options_set(options, "method", bad[i][0]), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), bad[i][1]));
    }
    npg_options_close(&options);
}

static void a_list_sets_its_parts(void **state)
{
    const char *const bad[][2] = {{"bars", "5"},
                                  {"bars", "residual=x"},
                                  {"bars", "residual"},
                                  {"bars", "resid=5"},
                                  {"bars", "residual=101"},
                                  {"bars", ""},
                                  {"depth-range", "1:2:3"},
                                  {"depth-range", "a"},
                                  {"follow-end", "1,2,3"}};
    (void)state;
    npg_options *options = open_all();
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(npg_options_set(options, bad[i][0], bad[i][1]), NPG_USAGE);
        assert_non_null(strstr(npg_error_text(), bad[i][0]));
    }
    npg_options_close(&options);
    options = open_all();
    assert_int_equal(npg_options_set(options, "bars", "residual=2,coverage=0"), NPG_OK);
    assert_int_equal(npg_options_set(options, "bars", "flipped=3"), NPG_OK);
    assert_string_equal(npg_options_get(options, "bars.residual"), "2");
    assert_string_equal(npg_options_get(options, "bars.coverage"), "0");
    assert_string_equal(npg_options_get(options, "bars.flipped"), "3");
    assert_int_equal(npg_options_set(options, "depth-range", ":3.5"), NPG_OK);
    assert_false(npg_options_is_set(options, "depth-range.near"));
    assert_string_equal(npg_options_get(options, "depth-range.far"), "3.5");
    assert_int_equal(npg_options_set(options, "depth-range", "1:2"), NPG_OK);
    assert_string_equal(npg_options_get(options, "depth-range.near"), "1");
    assert_int_equal(npg_options_set(options, "follow-end", "5"), NPG_OK);
    assert_string_equal(npg_options_get(options, "follow-end.idle"), "5");
    assert_string_equal(npg_options_get(options, "follow-end.name"), "capture.end");
    assert_int_equal(npg_options_set(options, "follow-end", "stop"), NPG_OK);
    assert_int_equal(npg_options_set(options, "follow-end", "name=,idle=0"), NPG_OK);
    assert_string_equal(npg_options_get(options, "follow-end.name"), "");
    assert_int_equal(npg_options_set(options, "method", "{\"bars\": \"residual=4\", \"bars.cover\": 2}"),
                     NPG_OK);
    assert_string_equal(npg_options_get(options, "bars.residual"), "4");
    assert_string_equal(npg_options_get(options, "bars.cover"), "2");
    npg_options_close(&options);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(defaults_fill_a_state),
        cmocka_unit_test(values_fill_a_state),
        cmocka_unit_test(bad_values_are_refused_and_change_nothing),
        cmocka_unit_test(a_table_outside_the_chain_gets_defaults),
        cmocka_unit_test(all_options_are_described_and_sound),
        cmocka_unit_test(presets_hold_values_that_are_accepted),
        cmocka_unit_test(numbers_do_not_depend_on_the_locale),
        cmocka_unit_test(a_file_sets_options),
        cmocka_unit_test(a_bad_file_is_named),
        cmocka_unit_test(a_huge_file_is_refused),
        cmocka_unit_test(no_memory_is_said),
        cmocka_unit_test(a_method_is_a_name_a_text_or_a_file),
        cmocka_unit_test(a_bad_method_is_named),
        cmocka_unit_test(a_list_sets_its_parts),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
