/* Frame files: which files are the frames, in what order, with which numbers and gaps;
 * what --frames chooses. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "ingest/ingest_internal.h"
#include "pipeline/memory.h"
#include "tests/support/group_folder.h"

/* A fresh sub-folder with files of these names ("a/b.ply" makes the folder a); its path. */
static const char *make_files(const char *name, const char *const *files)
{
    static char path[400];
    char command[1500];
    snprintf(path, sizeof path, "%s", in_folder(&folder, name));
    snprintf(command, sizeof command, "mkdir -p '%s'", path);
    if (system(command)) abort();
    for (; *files; files++) {
        snprintf(command, sizeof command, "mkdir -p \"$(dirname '%s/%s')\" && echo '1 2 3' > '%s/%s'", path,
                 *files, path, *files);
        if (system(command)) abort();
    }
    return path;
}

/* The list as text: "number:name" or "number:-" for a gap, parted by blanks; or the failure. */
static const char *listed(const char *input, const char *selection, bool finds_gaps)
{
    static char text[4096];
    npg_frame_files *list;
    size_t used = 0;
    if (npg_frame_files_open(&list, input, selection, finds_gaps, NULL)) {
        assert_null(list);
        return npg_error_text();
    }
    text[0] = 0;
    for (size_t i = 0; i < list->count; i++) {
        const char *path = list->slots[i].path, *slash = path ? strrchr(path, '/') : NULL;
        used += (size_t)snprintf(text + used, sizeof text - used, "%s%lld:%s", used ? " " : "",
                                 (long long)list->slots[i].number, path ? slash ? slash + 1 : path : "-");
    }
    npg_frame_files_close(&list);
    return text;
}

#define FILES(...) ((const char *const[]){__VA_ARGS__, NULL})
#define CONTAINS(text, part)                                                                                 \
    do {                                                                                                     \
        const char *text_ = (text);                                                                          \
        if (!strstr(text_, part)) fail_msg("\"%s\" is not in: %s", part, text_);                             \
    } while (0)

static void a_folder_in_natural_order(void **state)
{
    (void)state;
    const char *path =
        make_files("natural", FILES("f10.xyz", "f9.xyz", "f11.xyz", ".f1.xyz", "f8.xyz", "notes.md"));
    assert_string_equal(listed(path, "", true), "8:f8.xyz 9:f9.xyz 10:f10.xyz 11:f11.xyz");
    char with_slash[500];
    snprintf(with_slash, sizeof with_slash, "%s/", path);
    assert_string_equal(listed(with_slash, "", true), "8:f8.xyz 9:f9.xyz 10:f10.xyz 11:f11.xyz");
}

static void natural_order_itself(void **state)
{
    (void)state;
    static const char *const sorted[] = {
        "",   "a", "a1", "a2", "a02b", "a3", "a10", "a99999999999999999999999", "a100000000000000000000000",
        "ab", "b"};
    size_t count = sizeof sorted / sizeof *sorted;
    for (size_t i = 0; i < count; i++)
        for (size_t k = 0; k < count; k++) {
            int order = npg_natural_compare(sorted[i], sorted[k]);
            assert_true(i < k ? order < 0 : i > k ? order > 0 : order == 0);
        }
    assert_int_equal(npg_natural_compare("f007", "f7"), 0);
}

static void numbers_come_from_the_run_that_grows(void **state)
{
    (void)state;
    assert_string_equal(listed(make_files("last", FILES("v2_0001.xyz", "v2_0002.xyz")), "", true),
                        "1:v2_0001.xyz 2:v2_0002.xyz");
    assert_string_equal(listed(make_files("first", FILES("01_v2.xyz", "02_v2.xyz", "03_v2.xyz")), "", true),
                        "1:01_v2.xyz 2:02_v2.xyz 3:03_v2.xyz");
    assert_string_equal(listed(make_files("stamp", FILES("5.9.xyz", "5.11.xyz", "6.1.xyz")), "", true),
                        "0:5.9.xyz 1:5.11.xyz 2:6.1.xyz");
    assert_string_equal(listed(make_files("names", FILES("anna.xyz", "bert.xyz")), "", true),
                        "0:anna.xyz 1:bert.xyz");
    CONTAINS(listed(make_files("twice", FILES("f1.xyz", "f01.xyz")), "", true), "have the same number");
}

static void gaps_are_found(void **state)
{
    (void)state;
    const char *path = make_files("gaps", FILES("f1.xyz", "f2.xyz", "f4.xyz", "f7.xyz"));
    assert_string_equal(listed(path, "", true), "1:f1.xyz 2:f2.xyz 3:- 4:f4.xyz 5:- 6:- 7:f7.xyz");
    assert_string_equal(listed(path, "", false), "1:f1.xyz 2:f2.xyz 4:f4.xyz 7:f7.xyz");
    assert_string_equal(
        listed(make_files("tens", FILES("f0.xyz", "f10.xyz", "f20.xyz", "f40.xyz")), "", true),
        "0:f0.xyz 10:f10.xyz 20:f20.xyz 30:- 40:f40.xyz");
    CONTAINS(listed(make_files("wide", FILES("f1.xyz", "f2.xyz", "f90000000000.xyz")), "", true),
             "not a numbering");
}

static void gaps_as_text(void **state)
{
    (void)state;
    npg_frame_files *list;
    char text[64], small[16];
    const char *path =
        make_files("gap_text", FILES("f1.xyz", "f3.xyz", "f6.xyz", "f10.xyz", "f12.xyz", "f14.xyz"));
    assert_int_equal(npg_frame_files_open(&list, path, "", true, NULL), NPG_OK);
    assert_int_equal(list->gap_count, 8);
    npg_frame_files_gaps(text, sizeof text, list);
    assert_string_equal(text, "2, 4, 5, 7-9, 11, 13");
    npg_frame_files_gaps(small, sizeof small, list);
    assert_string_equal(small, "2, 4, 5, ...");
    npg_frame_files_close(&list);
}

static void selections(void **state)
{
    (void)state;
    const char *path = make_files("select", FILES("f1.xyz", "f2.xyz", "f4.xyz", "f5.xyz", "f6.xyz"));
    static const struct {
        const char *selection, *frames;
    } cases[] = {
        {"0:2", "1:f1.xyz 2:f2.xyz"},
        {":", "1:f1.xyz 2:f2.xyz 3:- 4:f4.xyz 5:f5.xyz 6:f6.xyz"},
        {"1:4", "2:f2.xyz 3:- 4:f4.xyz"},
        {"::2", "1:f1.xyz 3:- 5:f5.xyz"},
        {"1::2", "2:f2.xyz 4:f4.xyz 6:f6.xyz"},
        {"-2:", "5:f5.xyz 6:f6.xyz"},
        {":-4", "1:f1.xyz 2:f2.xyz"},
        {"4:99", "5:f5.xyz 6:f6.xyz"},
        {" 0 : 2 : 1 ", "1:f1.xyz 2:f2.xyz"},
        {"1-2,5", "1:f1.xyz 2:f2.xyz 5:f5.xyz"},
        {"5, 1-2 ,2", "1:f1.xyz 2:f2.xyz 5:f5.xyz"},
        {"6", "6:f6.xyz"},
        {"2-4", "2:f2.xyz 3:- 4:f4.xyz"},
        {"0-1,6-8", "0:- 1:f1.xyz 6:f6.xyz 7:- 8:-"},
        {"3", "option frames: chooses none"},
        {"9:12", "option frames: chooses none"},
        {"2:2", "option frames: chooses none"},
        {"::0", "the step must be at least 1"},
        {"::-1", "the step must be at least 1"},
        {"1:2:3:4", "not of the form a:b:step"},
        {"a:b", "not a number"},
        {"five", "not a frame number"},
        {"5-3", "a range that runs backward"},
        {"1-", "a range without an end"},
        {"1;2", "parted by commas"},
        {"1,,2", "not a frame number"},
        {"-3", "a negative frame number"},
        {"1-99999999999", "far from what is there"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        CONTAINS(listed(path, cases[i].selection, true), cases[i].frames);
    assert_int_equal(strlen(listed(path, "1-2,5", true)), strlen("1:f1.xyz 2:f2.xyz 5:f5.xyz"));
}

static void sub_folders(void **state)
{
    (void)state;
    assert_string_equal(
        listed(make_files("deep", FILES("points/0000.xyz", "gt/0000.xyz", "gt/0001.xyz")), "", true),
        "0:0000.xyz");
    assert_string_equal(listed(make_files("one", FILES("frames/a.xyz", "frames/b.xyz")), "", true),
                        "0:a.xyz 1:b.xyz");
    assert_string_equal(listed(make_files("clouds", FILES("point_clouds/7.xyz", "gt/8.xyz")), "", true),
                        "7:7.xyz");
    CONTAINS(listed(make_files("two", FILES("left/a.xyz", "right/a.xyz")), "", true),
             "no file here has a format");
    CONTAINS(listed(make_files("bare", FILES("read.md")), "", true), "no file here has a format");
    assert_string_equal(listed(make_files("flat", FILES("1.xyz", "points/2.xyz")), "", true), "1:1.xyz");
}

static void endings_do_not_mix(void **state)
{
    (void)state;
    npg_frame_files *list;
    const char *path = make_files("mixed", FILES("1.xyz", "2.xyz", "readme.txt", "3.XYZ"));
    assert_int_equal(npg_frame_files_open(&list, path, "", true, NULL), NPG_OK);
    assert_int_equal(list->count, 3);
    assert_int_equal(list->left_out, 1);
    npg_frame_files_close(&list);
    CONTAINS(listed(make_files("tie", FILES("1.xyz", "1.ply")), "", true), "say which with a pattern");
}

static void patterns_and_globs(void **state)
{
    (void)state;
    char input[600];
    const char *path =
        make_files("pat", FILES("f_0008.xyz", "f_0009.xyz", "f_0011.xyz", "f_12.xyz", "f_0013b.xyz",
                                "g_0010.xyz", "f_12345.xyz", "[x]3.xyz", "[x]4.xyz"));
    static const char *const cases[][2] = {
        {"f_%04d.xyz", "8:f_0008.xyz 9:f_0009.xyz 10:- 11:f_0011.xyz"},
        {"f_####.xyz", "8:f_0008.xyz 9:f_0009.xyz 10:- 11:f_0011.xyz"},
        {"f_%d.xyz", "12:f_12.xyz"},
        {"f_00*.xyz", "f_0008.xyz"},
        {"?_001[01].xyz", "10:f_0011.xyz"},
        {"[x]%d.xyz", "3:[x]3.xyz 4:[x]4.xyz"},
        {"f_0008.xyz", "8:f_0008.xyz"},
        {"h_%04d.xyz", "no file fits this pattern"},
        {"*.ply", "no file fits this pattern"},
        {"f_%04d_%04d.xyz", "one place for the number"},
        {"not-there", "there is no such file or folder"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        snprintf(input, sizeof input, "%s/%s", path, cases[i][0]);
        const char *text = listed(input, i == 0 || i == 1 ? "0:4" : "", true);
        if (i == 4)
            text = listed(input, "", false), assert_string_equal(text, "0:f_0011.xyz 1:g_0010.xyz");
        else
            CONTAINS(text, cases[i][1]);
    }
    path = make_files("per", FILES("f1/cloud.xyz", "f2/cloud.xyz"));
    snprintf(input, sizeof input, "%s/f%%d/cloud.xyz", path);
    assert_string_equal(listed(input, "", true), "1:cloud.xyz 2:cloud.xyz");
}

static void list_files(void **state)
{
    (void)state;
    const char *path = make_files("lists", FILES("b.xyz", "a.xyz", "10.xyz", "sub/20.xyz", "cloud.txt"));
    char list_path[500], absolute[1200];
    snprintf(list_path, sizeof list_path, "%s/frames.txt", path);
    write_text_file(list_path, "# order matters\nb.xyz\r\n\n  a.xyz  \n");
    assert_string_equal(listed(list_path, "", true), "0:b.xyz 1:a.xyz");
    snprintf(absolute, sizeof absolute, "%s/10.xyz\nsub/20.xyz\n", path);
    write_text_file(list_path, absolute);
    assert_string_equal(listed(list_path, "", true), "10:10.xyz 20:20.xyz");
    write_text_file(list_path, "b.xyz\ngone.xyz\n");
    CONTAINS(listed(list_path, "", true), "frames.txt: line 2: there is no file gone.xyz");
    snprintf(list_path, sizeof list_path, "%s/cloud.txt", path);
    assert_string_equal(listed(list_path, "", true), "0:cloud.txt");
    snprintf(list_path, sizeof list_path, "%s/frames.lst", path);
    write_text_file(list_path, "gone.xyz\n");
    CONTAINS(listed(list_path, "", true), "frames.lst: line 1: there is no file gone.xyz");
    write_text_file(list_path, "# nothing\n");
    CONTAINS(listed(list_path, "", true), "the list names no file");
}

static void odd_inputs(void **state)
{
    (void)state;
    const char *fifo = in_folder(&folder, "fifo.ply");
    char command[600];
    snprintf(command, sizeof command, "mkfifo '%s'", fifo);
    assert_int_equal(system(command), 0);
    CONTAINS(listed(fifo, "", true), "for a pipe use -");
    CONTAINS(listed(in_folder(&folder, "nowhere/at/all"), "", true), "there is no such file or folder");
}

static npg_status confined(const char *input)
{
    npg_frame_files *list;
    assert_int_equal(npg_frame_files_open(&list, input, "", false, NULL), NPG_OK);
    npg_status status = npg_frame_files_confine(list, input);
    npg_frame_files_close(&list);
    return status;
}

/* Of a pattern the folders before the first that is a pattern itself. */
static void links_out_of_the_input_are_refused(void **state)
{
    char path[450], input[500], target[500];
    (void)state;
    snprintf(path, sizeof path, "%s",
             make_files("confined", FILES("takes/a/f_1.xyz", "takes/b/f_1.xyz", "outside.xyz")));
    for (int linked = 0; linked < 2; linked++) {
        const npg_status wanted = linked ? NPG_BAD_INPUT : NPG_OK;
        snprintf(input, sizeof input, "%s/takes/*/f_1.xyz", path);
        assert_int_equal(confined(input), wanted);
        snprintf(input, sizeof input, "%s/takes/b/f_%%d.xyz", path);
        assert_int_equal(confined(input), wanted);
        snprintf(input, sizeof input, "%s/takes/b/f_1.xyz", path);
        assert_int_equal(confined(input), wanted);
        snprintf(input, sizeof input, "%s/takes/b/", path);
        assert_int_equal(confined(input), wanted);
        snprintf(input, sizeof input, "%s/takes/a", path);
        assert_int_equal(confined(input), NPG_OK);
        snprintf(input, sizeof input, "%s/takes/b/f_1.xyz", path);
        snprintf(target, sizeof target, "%s/outside.xyz", path);
        assert_true(linked || (unlink(input) == 0 && symlink(target, input) == 0));
    }
    CONTAINS(npg_error_text(), "--no-confine");
}

static void no_memory_at_any_point(void **state)
{
    (void)state;
    static const char *const tails[] = {"", "/f%d.xyz", "/f*.xyz", "/all.lst"};
    char path[400], input[600];
    snprintf(path, sizeof path, "%s", make_files("memory", FILES("f1.xyz", "f2.xyz", "f4.xyz", "x.txt")));
    snprintf(input, sizeof input, "%s/all.lst", path);
    write_text_file(input, "f1.xyz\nf4.xyz\n");
    for (size_t i = 0; i < 4; i++) {
        npg_status status = NPG_MEMORY;
        uint64_t n = 0;
        snprintf(input, sizeof input, "%s%s", path, tails[i]);
        for (; status; n++) {
            npg_frame_files *list;
            npg_memory_fail_at(n + 1, false);
            status = npg_frame_files_open(&list, input, "0:3", true, NULL);
            npg_memory_fail_at(0, false);
            if (status) assert_int_equal(status, NPG_MEMORY);
            npg_frame_files_close(&list);
            assert_int_equal(npg_memory_used(), 0);
        }
        assert_true(n > 3);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_folder_in_natural_order),
                                       cmocka_unit_test(natural_order_itself),
                                       cmocka_unit_test(numbers_come_from_the_run_that_grows),
                                       cmocka_unit_test(gaps_are_found),
                                       cmocka_unit_test(gaps_as_text),
                                       cmocka_unit_test(selections),
                                       cmocka_unit_test(sub_folders),
                                       cmocka_unit_test(endings_do_not_mix),
                                       cmocka_unit_test(patterns_and_globs),
                                       cmocka_unit_test(list_files),
                                       cmocka_unit_test(odd_inputs),
                                       cmocka_unit_test(links_out_of_the_input_are_refused),
                                       cmocka_unit_test(no_memory_at_any_point)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
