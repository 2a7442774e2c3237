/* Verify: each file that is gone or has other bytes is named, those of segments among them. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "pipeline/json_file.h"
#include "tests/support/group_folder.h"

/* done.json of a folder with two files in it. */
static void write_done(const char *output, const char *first, const char *second)
{
    const char *const names[] = {first, second};
    json_t *files = json_array(), *done = json_pack("{so}", "files", files);
    for (int i = 0; i < 2; i++) {
        json_t *entry = json_pack("{ss}", "path", names[i]);
        assert_int_equal(npg_file_facts(entry, output, names[i]), NPG_OK);
        json_array_append_new(files, entry);
    }
    assert_int_equal(npg_json_write(output, "done.json", done), NPG_OK);
    json_decref(done);
}

/* OUT with a file and a segment, in which are two files. */
static const char *write_results(void)
{
    static char out[512], segment[sizeof out];
    snprintf(out, sizeof out, "%s", in_folder(&folder, "out"));
    snprintf(segment, sizeof segment, "%s", in_folder(&folder, "out/segment_0000"));
    npg_make_folder(segment);
    write_text_file(in_folder(&folder, "out/list.json"), "{}");
    write_text_file(in_folder(&folder, "out/segment_0000/a.ply"), "aaaa");
    write_text_file(in_folder(&folder, "out/segment_0000/b.ply"), "bbbb");
    write_done(segment, "a.ply", "b.ply");
    write_done(out, "list.json", "segment_0000/done.json");
    return out;
}

typedef struct told {
    int count;
    char texts[4][256];
} told;

static void tell(void *user, const char *text)
{
    told *t = user;
    snprintf(t->texts[t->count++ % 4], sizeof t->texts[0], "%s", text);
}

static void what_is_as_it_was_is_counted(void **state)
{
    npg_verified found = {.struct_size = sizeof found};
    (void)state;
    assert_int_equal(npg_verify(&found, write_results(), NULL, NULL), NPG_OK);
    assert_int_equal(found.files, 4);
    assert_int_equal(found.damaged, 0);
}

static void each_damaged_file_is_named(void **state)
{
    npg_verified found = {.struct_size = sizeof found};
    told t = {0};
    const char *out = write_results();
    (void)state;
    write_text_file(in_folder(&folder, "out/segment_0000/a.ply"), "aaxa");
    unlink(in_folder(&folder, "out/segment_0000/b.ply"));
    assert_int_equal(npg_verify(&found, out, &t, tell), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "segment_0000/a.ply was changed"));
    assert_non_null(strstr(npg_error_text(), "1 of the other files"));
    assert_int_equal(found.damaged, 2);
    assert_int_equal(t.count, 2);
    assert_non_null(strstr(t.texts[0], "a.ply was changed"));
    assert_non_null(strstr(t.texts[1], "b.ply is missing"));
}

static void a_list_that_leads_out_or_is_not_there_is_refused(void **state)
{
    npg_verified found = {.struct_size = sizeof found};
    const char *out = write_results(), *done = in_folder(&folder, "out/done.json");
    (void)state;
    write_text_file(done, "{\"files\": [{\"path\": \"../x\", \"bytes\": 1, \"xxh3\": \"0\"}]}");
    assert_int_equal(npg_verify(&found, out, NULL, NULL), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "names ../x, which is not in it"));
    write_text_file(done, "{\"files\": []}");
    assert_int_equal(npg_verify(&found, out, NULL, NULL), NPG_BAD_INPUT);
    unlink(done);
    assert_int_equal(npg_verify(&found, out, NULL, NULL), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), "no done.json"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(what_is_as_it_was_is_counted),
                                       cmocka_unit_test(each_damaged_file_is_named),
                                       cmocka_unit_test(a_list_that_leads_out_or_is_not_there_is_refused)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
