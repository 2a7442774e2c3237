/* The store: what is put is found, to the bit and by its last word; every damage is noticed; nobody needs it all. */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#include "pipeline/store.h"
#include "tests/support/group_folder.h"

static const double numbers[3] = {1.5, -0.0, 3e300};

static npg_status put_state(npg_store *store, int64_t index, const char *text)
{
    npg_store_begin(store, NPG_RECORD_STATE, index, 0);
    npg_status status = npg_store_put(store, "text", text, strlen(text));
    if (!status) status = npg_store_put(store, "nothing", NULL, 0);
    if (!status) status = npg_store_put(store, "numbers", numbers, sizeof numbers);
    return npg_store_end(store, status, index % 2);
}

static npg_store *open_store(const char *path)
{
    npg_store *store;
    assert_int_equal(path ? npg_store_open(&store, path) : npg_store_open_nameless(&store, NULL), NPG_OK);
    return store;
}

static const char *made_store(const char *name, int states)
{
    const char *path = in_folder(&folder, name);
    unlink(path);
    npg_store *store = open_store(path);
    for (int i = 0; i < states; i++) assert_int_equal(put_state(store, i, "seven b"), NPG_OK);
    npg_store_close(&store);
    return path;
}

static void assert_state(npg_store *store, int64_t index, const char *text)
{
    npg_record *record;
    double found[3];
    size_t size;
    assert_int_equal(npg_store_read(store, &record, NPG_RECORD_STATE, index, 0), NPG_OK);
    const char *bytes = npg_record_find(record, "text", &size);
    assert_int_equal(size, strlen(text));
    assert_memory_equal(bytes, text, size);
    assert_non_null(npg_record_find(record, "nothing", &size));
    assert_int_equal(size, 0);
    assert_int_equal(npg_record_get(record, "numbers", found, sizeof found), NPG_OK);
    assert_memory_equal(found, numbers, sizeof found);
    assert_int_equal(npg_record_get(record, "numbers", found, 8), NPG_BAD_INPUT);
    assert_null(npg_record_find(record, "other", &size));
    assert_int_equal(npg_record_get(record, "other", found, 8), NPG_BAD_INPUT);
    npg_record_close(&record);
}

static void assert_absent(npg_store *store, const char *kind, int64_t index, uint64_t of)
{
    npg_record *record;
    assert_false(npg_store_has(store, kind, index, of));
    assert_int_equal(npg_store_read(store, &record, kind, index, of), NPG_BAD_INPUT);
    assert_null(record);
}

static off_t size_of(const char *path)
{
    struct stat info;
    assert_int_equal(stat(path, &info), 0);
    return info.st_size;
}

/* ---- what is put ---- */

static void what_is_put_is_found_in_another_run(void **state)
{
    (void)state;
    npg_store *store = open_store(made_store("whole.npg", 3));
    for (int i = 0; i < 3; i++) assert_state(store, i, "seven b");
    assert_int_equal(npg_store_last(store, NPG_RECORD_STATE), 2);
    assert_int_equal(npg_store_last(store, NPG_RECORD_INSIDE), -1);
    assert_int_equal(npg_store_count(store, NPG_RECORD_STATE, 0), 3);
    assert_int_equal(npg_store_count(store, NPG_RECORD_STATE, 1), 0);
    assert_string_equal(npg_store_damage(store), "");
    assert_absent(store, NPG_RECORD_STATE, 3, 0);
    assert_absent(store, NPG_RECORD_STATE, 2, 1);
    assert_absent(store, NPG_RECORD_GROUP, 2, 0);
    npg_store_close(&store);
}

static void the_last_word_counts(void **state)
{
    (void)state;
    const char *path = made_store("again.npg", 2);
    for (int i = 0; i < 2; i++) {
        npg_store *store = open_store(path);
        if (!i) assert_int_equal(put_state(store, 0, "another"), NPG_OK);
        assert_state(store, 0, "another");
        assert_state(store, 1, "seven b");
        assert_int_equal(npg_store_count(store, NPG_RECORD_STATE, 0), 2);
        npg_store_close(&store);
    }
}

static void a_store_without_a_name_serves_as_well(void **state)
{
    (void)state;
    npg_store *store = open_store(NULL);
    assert_int_equal(put_state(store, 7, "unnamed"), NPG_OK);
    assert_state(store, 7, "unnamed");
    npg_store_close(&store);
}

static void a_record_given_up_leaves_nothing(void **state)
{
    (void)state;
    const char *path = made_store("never.npg", 1);
    off_t before = size_of(path);
    npg_store *store = open_store(path);
    npg_store_begin(store, NPG_RECORD_STATE, 1, 0);
    npg_store_put(store, "a", "b", 1);
    assert_int_equal(npg_store_end(store, NPG_ABORTED, true), NPG_ABORTED);
    assert_absent(store, NPG_RECORD_STATE, 1, 0);
    assert_int_equal(size_of(path), before);
    assert_int_equal(put_state(store, 1, "the next"), NPG_OK);
    assert_state(store, 1, "the next");
    npg_store_close(&store);
}

static void a_store_takes_another_name(void **state)
{
    (void)state;
    char to[512];
    snprintf(to, sizeof to, "%s", in_folder(&folder, "named.npg"));
    const char *from = made_store("new.npg", 1);
    npg_store *store = open_store(from);
    assert_int_equal(npg_store_rename(store, to), NPG_OK);
    assert_false(exists(in_folder(&folder, "new.npg")));
    assert_int_equal(put_state(store, 1, "seven b"), NPG_OK);
    npg_store_close(&store);
    store = open_store(to);
    assert_state(store, 1, "seven b");
    npg_store_close(&store);
}

/* ---- damage ---- */

static size_t read_bytes(unsigned char *bytes, size_t most, const char *path)
{
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    size_t size = fread(bytes, 1, most, file);
    fclose(file);
    return size;
}

static void write_bytes(const unsigned char *bytes, size_t size, const char *path)
{
    FILE *file = fopen(path, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(bytes, 1, size, file), size);
    fclose(file);
}

/* Of three records those before the damaged one are there, and can be added to. */
static void every_damage_is_noticed(void **state)
{
    (void)state;
    unsigned char bytes[4096];
    char damaged[512];
    size_t size = read_bytes(bytes, sizeof bytes, made_store("good.npg", 3)), each = size / 3;
    assert_true(each > 100 && size < sizeof bytes && size % 3 == 0);
    snprintf(damaged, sizeof damaged, "%s", in_folder(&folder, "bad.npg"));
    for (size_t i = 0; i < size; i++) {
        bytes[i] ^= 1 << i % 8;
        write_bytes(bytes, size, damaged);
        bytes[i] ^= 1 << i % 8;
        npg_store *store = open_store(damaged);
        assert_non_null(strstr(npg_store_damage(store), damaged));
        assert_int_equal(npg_store_last(store, NPG_RECORD_STATE), (int64_t)(i / each) - 1);
        if (i / each) assert_state(store, (int64_t)(i / each) - 1, "seven b");
        assert_int_equal(put_state(store, 5, "goes on"), NPG_OK);
        npg_store_close(&store);
        store = open_store(damaged);
        assert_string_equal(npg_store_damage(store), "");
        assert_state(store, 5, "goes on");
        npg_store_close(&store);
    }
}

static void every_cut_leaves_what_is_whole(void **state)
{
    (void)state;
    unsigned char bytes[4096];
    char cut[512];
    size_t size = read_bytes(bytes, sizeof bytes, made_store("good.npg", 3)), each = size / 3;
    snprintf(cut, sizeof cut, "%s", in_folder(&folder, "cut.npg"));
    for (size_t end = 0; end < size; end++) {
        write_bytes(bytes, end, cut);
        npg_store *store = open_store(cut);
        assert_int_equal(*npg_store_damage(store) != 0, end % each != 0);
        assert_int_equal(npg_store_count(store, NPG_RECORD_STATE, 0), end / each);
        assert_int_equal(size_of(cut), end / each * each);
        npg_store_close(&store);
    }
}

/* A run that is killed while it writes: the head comes last. */
static void a_record_that_was_not_finished_is_no_damage(void **state)
{
    (void)state;
    const char *path = made_store("torn.npg", 1);
    npg_store *store = open_store(path);
    npg_store_begin(store, NPG_RECORD_STATE, 1, 0);
    npg_store_put(store, "numbers", numbers, sizeof numbers);
    npg_store *other = open_store(path); /* as the next run finds it */
    assert_string_equal(npg_store_damage(other), "");
    assert_int_equal(npg_store_last(other, NPG_RECORD_STATE), 0);
    npg_store_close(&other);
    npg_store_end(store, NPG_ABORTED, false);
    npg_store_close(&store);
}

static void what_was_damaged_since_is_bad_input(void **state)
{
    (void)state;
    npg_record *record;
    const char *path = made_store("since.npg", 1);
    npg_store *store = open_store(path);
    FILE *file = fopen(path, "r+b");
    assert_int_equal(fseek(file, 70, SEEK_SET), 0);
    fputc('Z', file);
    fclose(file);
    assert_int_equal(npg_store_read(store, &record, NPG_RECORD_STATE, 0, 0), NPG_BAD_INPUT);
    assert_non_null(strstr(npg_error_text(), path));
    npg_store_close(&store);
}

static void what_is_no_file_is_refused(void **state)
{
    (void)state;
    npg_store *store;
    assert_int_equal(npg_store_open(&store, "/nowhere/at/all"), NPG_DISK);
    assert_null(store);
    assert_int_equal(mkfifo(in_folder(&folder, "pipe"), 0600), 0);
    assert_int_equal(npg_store_open(&store, in_folder(&folder, "pipe")), NPG_DISK);
    assert_int_equal(symlink(made_store("real.npg", 1), in_folder(&folder, "link")), 0);
    assert_int_equal(npg_store_open(&store, in_folder(&folder, "link")), NPG_DISK);
}

/* ---- what nobody needs ---- */

static bool is_newest(const npg_record_id *id, const void *user)
{
    const int64_t *newest = user;
    return !strcmp(id->kind, NPG_RECORD_STATE) && id->index > *newest - 2;
}

/* However many states were written, the file is never larger than about four of them. */
static void a_store_does_not_grow_with_what_is_forgotten(void **state)
{
    (void)state;
    const char *path = made_store("bounded.npg", 1);
    off_t each = size_of(path);
    npg_store *store = open_store(path);
    for (int64_t i = 1; i < 60; i++) {
        npg_store_begin(store, NPG_RECORD_POSE, i, 9);
        assert_int_equal(npg_store_end(store, npg_store_put(store, "pose", &i, sizeof i), false), NPG_OK);
        assert_int_equal(put_state(store, i, "seven b"), NPG_OK);
        assert_int_equal(npg_store_forget(store, is_newest, &i), NPG_OK);
        assert_true(size_of(path) <= 4 * each);
        assert_state(store, i, "seven b");
        assert_state(store, i - 1, "seven b");
        assert_absent(store, NPG_RECORD_STATE, i - 2, 0);
        assert_absent(store, NPG_RECORD_POSE, i, 9);
    }
    npg_store_close(&store);
    store = open_store(path);
    assert_string_equal(npg_store_damage(store), "");
    assert_state(store, 59, "seven b");
    assert_state(store, 58, "seven b");
    npg_store_close(&store);
}

/* ---- threads and memory ---- */

static void *write_many(void *argument)
{
    npg_store *store = argument;
    for (int64_t i = 0; i < 200; i++) {
        npg_store_begin(store, NPG_RECORD_GROUP, i, 3);
        npg_status status = npg_store_put(store, "index", &i, sizeof i);
        if (npg_store_end(store, status, false)) return argument;
    }
    return NULL;
}

static void two_threads_do_not_mix_their_records(void **state)
{
    (void)state;
    pthread_t thread;
    void *failed;
    npg_store *store = open_store(in_folder(&folder, "two.npg"));
    assert_int_equal(pthread_create(&thread, NULL, write_many, store), 0);
    for (int64_t i = 0; i < 200; i++) assert_int_equal(put_state(store, i, "seven b"), NPG_OK);
    assert_int_equal(pthread_join(thread, &failed), 0);
    assert_null(failed);
    for (int64_t i = 0, found; i < 200; i++) {
        npg_record *record;
        assert_state(store, i, "seven b");
        assert_int_equal(npg_store_read(store, &record, NPG_RECORD_GROUP, i, 3), NPG_OK);
        assert_int_equal(npg_record_get(record, "index", &found, sizeof found), NPG_OK);
        assert_int_equal(found, i);
        npg_record_close(&record);
    }
    npg_store_close(&store);
}

static npg_status write_and_read(const char *path)
{
    npg_store *store;
    npg_record *record = NULL;
    NPG_TRY(npg_store_open(&store, path));
    npg_status status = put_state(store, 0, "text");
    const int64_t none = -9;
    if (!status) status = npg_store_read(store, &record, NPG_RECORD_STATE, 0, 0);
    if (!status) status = npg_store_forget(store, is_newest, &none);
    npg_record_close(&record);
    npg_store_close(&store);
    return status;
}

static void without_memory_nothing_remains(void **state)
{
    (void)state;
    const char *path = in_folder(&folder, "memory.npg");
    size_t before = npg_memory_used();
    npg_status status = NPG_MEMORY;
    for (uint64_t n = 1; status == NPG_MEMORY; n++) {
        unlink(path);
        npg_memory_fail_at(n, true);
        status = write_and_read(path);
        npg_memory_fail_at(0, false);
        assert_int_equal(npg_memory_used(), before);
        assert_true(n < 100);
    }
    assert_int_equal(status, NPG_OK);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_is_put_is_found_in_another_run),
        cmocka_unit_test(the_last_word_counts),
        cmocka_unit_test(a_store_without_a_name_serves_as_well),
        cmocka_unit_test(a_record_given_up_leaves_nothing),
        cmocka_unit_test(a_store_takes_another_name),
        cmocka_unit_test(every_damage_is_noticed),
        cmocka_unit_test(every_cut_leaves_what_is_whole),
        cmocka_unit_test(a_record_that_was_not_finished_is_no_damage),
        cmocka_unit_test(what_was_damaged_since_is_bad_input),
        cmocka_unit_test(what_is_no_file_is_refused),
        cmocka_unit_test(a_store_does_not_grow_with_what_is_forgotten),
        cmocka_unit_test(two_threads_do_not_mix_their_records),
        cmocka_unit_test(without_memory_nothing_remains),
    };
    return cmocka_run_group_tests(tests, open_folder, close_folder);
}
