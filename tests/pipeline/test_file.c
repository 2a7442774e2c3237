/* File: a name appears only when its content is whole; full disks, limits and folders that refuse. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include "pipeline/file.h"
#include "pipeline/memory.h"
#include "pipeline/stage.h"
#include "tests/support/group_folder.h"

static void a_file_appears_when_it_is_whole(void **state)
{
    (void)state;
    npg_file *file;
    const char *path = in_folder(&folder, "whole.txt");
    assert_int_equal(npg_file_open(&file, path), NPG_OK);
    assert_int_equal(npg_file_write(file, "abc", 3), NPG_OK);
    assert_int_equal(npg_file_print(file, " %d\n", 7), NPG_OK);
    assert_false(exists(path));
    assert_int_equal(npg_file_commit(&file), NPG_OK);
    assert_null(file);
    char *text = text_of_file(path);
    assert_string_equal(text, "abc 7\n");
    free(text);
    assert_false(exists(in_folder(&folder, ".whole.txt.part")));
    assert_int_equal(npg_memory_used(), 0);
}

static void large_and_odd_writes_arrive(void **state)
{
    (void)state;
    npg_file *file;
    const char *path = in_folder(&folder, "large");
    static unsigned char block[700001];
    uint64_t hash = 0, expected = 0;
    size_t size = 0;
    assert_int_equal(npg_file_open(&file, path), NPG_OK);
    for (size_t part = 1; part <= sizeof block; part = part * 5 + 3) {
        for (size_t i = 0; i < part; i++) {
            block[i] = (unsigned char)(size + i * 7);
            expected = expected * 31 + block[i];
        }
        assert_int_equal(npg_file_write(file, block, part), NPG_OK);
        size += part;
    }
    assert_int_equal(npg_file_commit(&file), NPG_OK);
    FILE *back = fopen(path, "rb");
    size_t read = 0;
    for (int c; (c = fgetc(back)) != EOF; read++) hash = hash * 31 + (uint64_t)c;
    fclose(back);
    assert_int_equal(read, size);
    assert_int_equal(hash, expected);
}

static void what_is_given_up_leaves_no_trace(void **state)
{
    (void)state;
    npg_file *file;
    const char *path = in_folder(&folder, "kept.txt");
    assert_int_equal(write_text_file(path, "old"), 0);
    assert_int_equal(npg_file_open(&file, path), NPG_OK);
    npg_file_print(file, "new");
    npg_file_discard(&file);
    assert_null(file);
    npg_file_discard(&file);
    char *text = text_of_file(path);
    assert_string_equal(text, "old");
    free(text);
    assert_false(exists(in_folder(&folder, ".kept.txt.part")));
}

static void folders_that_refuse_are_named(void **state)
{
    (void)state;
    npg_file *file = (npg_file *)1;
    assert_int_equal(npg_file_open(&file, in_folder(&folder, "missing/x")), NPG_DISK);
    assert_null(file);
    assert_non_null(strstr(npg_error_text(), "missing/x"));
    assert_int_equal(npg_file_open(&file, "/proc/x"), NPG_DISK);
    assert_int_equal(write_text_file(in_folder(&folder, "plain"), ""), 0);
    assert_int_equal(npg_make_folder(in_folder(&folder, "plain/below")), NPG_DISK);
    assert_int_equal(npg_make_folder(in_folder(&folder, "plain")), NPG_DISK);
    assert_int_equal(npg_make_folder(in_folder(&folder, "a/b/c/")), NPG_OK);
    assert_int_equal(npg_make_folder(in_folder(&folder, "a/b/c")), NPG_OK);
    assert_true(exists(in_folder(&folder, "a/b/c")));
    assert_int_equal(npg_make_folder(""), NPG_DISK);
}

static void a_name_taken_by_a_folder_fails_at_commit(void **state)
{
    (void)state;
    npg_file *file;
    assert_int_equal(npg_make_folder(in_folder(&folder, "taken/x")), NPG_OK);
    assert_int_equal(npg_file_open(&file, in_folder(&folder, "taken")), NPG_OK);
    npg_file_print(file, "x");
    assert_int_equal(npg_file_commit(&file), NPG_DISK);
    assert_null(file);
    assert_false(exists(in_folder(&folder, ".taken.part")));
    assert_int_equal(npg_memory_used(), 0);
}

/* A limit on the size of files makes write() fail as a full disk does: some bytes, then an error. */
static int write_beyond_limit(const char *path)
{
    const struct rlimit limit = {100000, 100000};
    static char block[300000];
    npg_file *file;
    signal(SIGXFSZ, SIG_IGN);
    if (setrlimit(RLIMIT_FSIZE, &limit) || npg_file_open(&file, path)) return 1;
    if (npg_file_write(file, block, 50000)) return 2;
    if (npg_file_write(file, block, sizeof block) != NPG_DISK) return 3;
    if (npg_file_write(file, block, 1) != NPG_DISK) return 4; /* it is remembered */
    if (npg_file_print(file, "x") != NPG_DISK) return 5;
    npg_error(NPG_FAILED, "something else in between");
    if (npg_file_commit(&file) != NPG_DISK) return 6;
    if (!strstr(npg_error_text(), path) || !strstr(npg_error_text(), strerror(EFBIG))) return 7;
    if (npg_file_open(&file, path)) return 8;
    if (npg_file_write(file, block, 150000)) return 9; /* it fits the buffer: the failure shows at commit */
    if (npg_file_commit(&file) != NPG_DISK) return 10;
    return npg_memory_used() ? 11 : 0;
}

static void a_full_disk_leaves_no_partial_file(void **state)
{
    (void)state;
    const char *path = in_folder(&folder, "full.bin");
    int status = -1;
    pid_t child = fork();
    if (child == 0) _exit(write_beyond_limit(path));
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 0);
    assert_false(exists(path));
    assert_false(exists(in_folder(&folder, ".full.bin.part")));
}

static void a_killed_writer_leaves_no_final_name(void **state)
{
    (void)state;
    const char *path = in_folder(&folder, "killed.bin");
    int status;
    pid_t child = fork();
    if (child == 0) {
        npg_file *file;
        static char block[600000];
        if (!npg_file_open(&file, path)) npg_file_write(file, block, sizeof block);
        raise(SIGKILL);
    }
    assert_int_equal(waitpid(child, &status, 0), child);
    assert_true(WIFSIGNALED(status));
    assert_false(exists(path));
    npg_file *file; /* the next attempt goes over what was left */
    assert_int_equal(npg_file_open(&file, path), NPG_OK);
    npg_file_print(file, "short");
    assert_int_equal(npg_file_commit(&file), NPG_OK);
    char *text = text_of_file(path);
    assert_string_equal(text, "short");
    free(text);
    assert_false(exists(in_folder(&folder, ".killed.bin.part")));
}

static void a_link_in_the_way_is_not_followed(void **state)
{
    (void)state;
    npg_file *file;
    assert_int_equal(write_text_file(in_folder(&folder, "victim"), "precious"), 0);
    assert_int_equal(symlink("victim", in_folder(&folder, ".link.part")), 0);
    assert_int_equal(npg_file_open(&file, in_folder(&folder, "link")), NPG_DISK);
    char *text = text_of_file(in_folder(&folder, "victim"));
    assert_string_equal(text, "precious");
    free(text);
}

static void paths_join(void **state)
{
    (void)state;
    char *path;
    const char *const cases[][3] = {
        {"a", "b", "a/b"}, {"a/", "b", "a/b"}, {"/", "b", "/b"}, {"a/b", "c/d", "a/b/c/d"}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        assert_int_equal(npg_join_path(&path, cases[i][0], cases[i][1]), NPG_OK);
        assert_string_equal(path, cases[i][2]);
        npg_release(&path);
    }
}

/* What is no UTF-8 becomes "?", byte by byte; the rest stays. */
static void any_bytes_become_a_json_text(void **state)
{
    static const char *const pairs[][2] = {
        {"plain", "plain"},
        {"a\nb", "a\nb"},
        {"\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80", "\xc3\xa4 \xe2\x82\xac \xf0\x9f\x98\x80"},
        {"\xff\xfe", "??"},
        {"\xc3", "?"},                                                     /* cut off */
        {"\xe2\x82x", "??x"},                                              /* cut off within */
        {"\xc0\x80", "??"},                                                /* too long for its value */
        {"\xe0\x9f\xbf", "???"},                                           /* too long for its value */
        {"\xf0\x8f\xbf\xbf", "????"},                                      /* too long for its value */
        {"\xed\xa0\x80", "???"},                                           /* half of a pair of UTF-16 */
        {"\xf4\x90\x80\x80", "????"},                                      /* beyond the last character */
        {"\xf5\x80\x80\x80", "????"},                                      /* no first byte of anything */
        {"\x80 \xf0\x90\x80\x80\xf4\x8f\xbf\xbf \xed\x9f\xbf\xe0\xa0\x80", /* first and last that are some */
         "? \xf0\x90\x80\x80\xf4\x8f\xbf\xbf \xed\x9f\xbf\xe0\xa0\x80"}};
    (void)state;
    for (size_t i = 0; i < sizeof pairs / sizeof *pairs; i++) {
        json_t *text = npg_json_text(pairs[i][0]);
        assert_non_null(text);
        assert_string_equal(json_string_value(text), pairs[i][1]);
        json_decref(text);
    }
    assert_true(json_is_null(npg_json_text(NULL)));
    npg_memory_fail_at(1, false);
    assert_null(npg_json_text("\xff"));
    npg_memory_fail_at(0, false);
}

static npg_status count_letter(void *user, const char *name)
{
    int *counts = user;
    if (name[0] == 'x') return npg_error(NPG_FAILED, "%s", name);
    counts[name[0] - 'a']++;
    return NPG_OK;
}

static void each_name_of_a_folder_is_visited_until_one_fails(void **state)
{
    int counts[26] = {0};
    char visited[600];
    (void)state;
    snprintf(visited, sizeof visited, "%s/visited", folder.path);
    assert_int_equal(npg_make_folder(in_folder(&folder, "visited/c")), NPG_OK);
    assert_int_equal(write_text_file(in_folder(&folder, "visited/a"), ""), 0);
    assert_int_equal(write_text_file(in_folder(&folder, "visited/b"), ""), 0);
    assert_int_equal(npg_folder_each(visited, NPG_DISK, count_letter, counts), NPG_OK);
    assert_true(counts[0] == 1 && counts[1] == 1 && counts[2] == 1);
    assert_int_equal(write_text_file(in_folder(&folder, "visited/x"), ""), 0);
    assert_int_equal(npg_folder_each(visited, NPG_DISK, count_letter, counts), NPG_FAILED);
    assert_int_equal(npg_folder_each(in_folder(&folder, "none"), NPG_DISK, count_letter, counts), NPG_OK);
    assert_int_equal(npg_folder_each(in_folder(&folder, "none"), NPG_BAD_INPUT, count_letter, counts),
                     NPG_BAD_INPUT);
    assert_int_equal(npg_folder_each(in_folder(&folder, "visited/a"), NPG_DISK, count_letter, counts),
                     NPG_DISK);
    assert_non_null(strstr(npg_error_text(), "visited/a"));
}

static void a_folder_goes_but_not_what_its_links_lead_to(void **state)
{
    (void)state;
    assert_int_equal(npg_make_folder(in_folder(&folder, "kept")), NPG_OK);
    assert_int_equal(npg_make_folder(in_folder(&folder, "gone/deep/deeper")), NPG_OK);
    assert_int_equal(write_text_file(in_folder(&folder, "kept/file"), "x"), 0);
    assert_int_equal(write_text_file(in_folder(&folder, "gone/deep/file"), "x"), 0);
    assert_int_equal(symlink(in_folder(&folder, "kept"), in_folder(&folder, "gone/link")), 0);
    assert_int_equal(npg_folder_remove(in_folder(&folder, "gone")), NPG_OK);
    assert_false(exists(in_folder(&folder, "gone")));
    assert_true(exists(in_folder(&folder, "kept/file")));
    assert_int_equal(npg_folder_remove(in_folder(&folder, "kept/file")), NPG_OK);
    assert_false(exists(in_folder(&folder, "kept/file")));
    assert_int_equal(npg_folder_remove(in_folder(&folder, "gone")), NPG_OK); /* there is nothing to do */
    assert_int_equal(npg_folder_remove("/proc/self"), NPG_DISK);             /* nobody can */
    assert_non_null(strstr(npg_error_text(), "can't remove /proc/self"));
}

static void no_memory_is_said(void **state)
{
    (void)state;
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status && n < 20; n++) {
        npg_file *file = NULL;
        npg_memory_fail_at(n, false);
        status = npg_file_open(&file, in_folder(&folder, "memory"));
        if (!status) status = npg_file_print(file, "x");
        if (!status) status = npg_file_commit(&file);
        npg_memory_fail_at(0, false);
        assert_true(status == NPG_OK || status == NPG_MEMORY);
        npg_file_discard(&file);
        assert_int_equal(npg_memory_used(), 0);
    }
    assert_int_equal(status, NPG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_file_appears_when_it_is_whole),
        cmocka_unit_test(large_and_odd_writes_arrive),
        cmocka_unit_test(what_is_given_up_leaves_no_trace),
        cmocka_unit_test(folders_that_refuse_are_named),
        cmocka_unit_test(a_name_taken_by_a_folder_fails_at_commit),
        cmocka_unit_test(a_full_disk_leaves_no_partial_file),
        cmocka_unit_test(a_killed_writer_leaves_no_final_name),
        cmocka_unit_test(a_link_in_the_way_is_not_followed),
        cmocka_unit_test(paths_join),
        cmocka_unit_test(any_bytes_become_a_json_text),
        cmocka_unit_test(each_name_of_a_folder_is_visited_until_one_fails),
        cmocka_unit_test(a_folder_goes_but_not_what_its_links_lead_to),
        cmocka_unit_test(no_memory_is_said),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
