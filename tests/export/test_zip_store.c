/* Zip store: what Python reads back, and archives that are not full. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <stdlib.h>

#include "export/exporters/exporters_internal.h"
#include "tests/support/group_folder.h"

static void members_are_read_back(void **state)
{
    (void)state;
    npg_zip_member members[3] = {
        {.name = "a.bin", .size = 5}, {.name = "b.bin", .size = 300}, {.name = "c.bin", .size = 7}};
    npg_zip zip;
    char command[1200];
    const char *path = in_folder(&folder, "three.zip");
    npg_file *file;
    assert_int_equal(npg_file_open(&file, path), NPG_OK);
    assert_int_equal(npg_zip_open(&zip, file, members, 3), NPG_OK);
    for (int i = 0; i < 300; i++) {
        const char *text = "0123456789";
        if (i < 5) assert_int_equal(npg_zip_put(&zip, 0, text + i, 1), NPG_OK);
        if (i < 7) assert_int_equal(npg_zip_put(&zip, 2, text + i, 1), NPG_OK);
        assert_int_equal(npg_zip_put(&zip, 1, text + i % 10, 1), NPG_OK);
    }
    assert_int_equal(npg_zip_finish(&zip), NPG_OK);
    assert_int_equal(npg_file_commit(&file), NPG_OK);
    snprintf(command, sizeof command,
             "python3 -c \"import zipfile as z; f=z.ZipFile('%s'); assert f.testzip() is None; "
             "assert f.read('a.bin')==b'01234' and f.read('b.bin')==b'0123456789'*30 and "
             "f.read('c.bin')==b'0123456'\"",
             path);
    assert_int_equal(system(command), 0);
}

static void an_archive_that_is_not_full_is_no_file(void **state)
{
    npg_zip_member members[1] = {{.name = "a", .size = 5}};
    npg_zip zip;
    (void)state;
    npg_file *file;
    assert_int_equal(npg_file_open(&file, in_folder(&folder, "short.zip")), NPG_OK);
    assert_int_equal(npg_zip_open(&zip, file, members, 1), NPG_OK);
    assert_int_equal(npg_zip_put(&zip, 0, "123456", 6), NPG_USAGE);
    assert_int_equal(npg_zip_put(&zip, 0, "1234", 4), NPG_OK);
    assert_int_equal(npg_zip_finish(&zip), NPG_USAGE);
    npg_file_discard(&file);
    assert_false(exists(in_folder(&folder, "short.zip")));
    assert_false(exists(in_folder(&folder, ".short.zip.part")));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(members_are_read_back),
                                       cmocka_unit_test(an_archive_that_is_not_full_is_no_file)};
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
