/* Many captures in one process, files in and files out: memory, descriptors and threads stay as they are, and
 * the same seed gives the same bytes every time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <dirent.h>
#include <malloc.h>
#include <math.h>

#include "neupig.h"
#include "tests/support/temp_folder.h"
#include "tests/support/write_ball.h"

/* What is judged is what the heap has given out and not got back, to the byte, and the anonymous memory that
 * is resident once the heap's free pages have gone back to the system.  The plain resident size tells
 * nothing: the OpenCL compiler takes and gives back tens of MiB in small pieces every time, on threads of its
 * own; the system drops and maps pages of the libraries' files as it likes.  One arena for all threads, as
 * only of the first one malloc_trim() gives back the end.  The least of some rounds early on is compared with
 * the least of as many at the end.  A sanitizer's own books grow, and its rounds take long. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { RUNS = 6, WARM_UP = 2, WINDOW = 2, HEAP_GROWTH_KIB = 256, ANONYMOUS_GROWTH_KIB = 1 << 20 };
#else
enum { RUNS = 50, WARM_UP = 10, WINDOW = 10, HEAP_GROWTH_KIB = 128, ANONYMOUS_GROWTH_KIB = 4096 };
#endif
/* A library's pool may take in a thread late; one that stays behind in every run is dozens at the end. */
enum { THREADS_GROWTH = 2 };
enum { FRAMES = 2, POINTS = 400 };

/* ---- what the process holds ---- */

typedef struct holdings {
    long heap_kib, anonymous_kib;
    int descriptors, threads;
} holdings;

static int count_entries(const char *folder)
{
    int count = 0;
    DIR *listing = opendir(folder);
    assert_non_null(listing);
    while (readdir(listing)) count++;
    closedir(listing);
    return count;
}

static holdings look(void)
{
    long resident = 0, of_files = 0;
    malloc_trim(0);
    struct mallinfo2 heap = mallinfo2();
    FILE *file = fopen("/proc/self/statm", "r");
    assert_non_null(file);
    assert_int_equal(fscanf(file, "%*s %ld %ld", &resident, &of_files), 2);
    fclose(file);
    return (holdings){(long)((heap.uordblks + heap.hblkhd) >> 10),
                      (resident - of_files) * (sysconf(_SC_PAGESIZE) / 1024), count_entries("/proc/self/fd"),
                      count_entries("/proc/self/task")};
}

static void take_least(holdings *least, int round)
{
    holdings now = look();
    if (!round || now.heap_kib < least->heap_kib) least->heap_kib = now.heap_kib;
    if (!round || now.anonymous_kib < least->anonymous_kib) least->anonymous_kib = now.anonymous_kib;
    if (!round || now.descriptors < least->descriptors) least->descriptors = now.descriptors;
    if (!round || now.threads < least->threads) least->threads = now.threads;
}

/* ---- one capture ---- */

static void run_capture(const temp_folder *folder, const char *output)
{
    const char *const settings[][2] = {{"input", in_folder(folder, "capture")},
                                       {"output", output},
                                       {"epochs", "2"},
                                       {"faces", "200"},
                                       {"align-nodes", "20"},
                                       {"align-steps", "2"},
                                       {"poisson-depth", "4"},
                                       {"bars.residual", "100"},
                                       {"bars.coverage", "0"},
                                       {"bars.flipped", "100"}};
    npg_options *options = NULL;
    npg_run *run = NULL;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        assert_int_equal(npg_options_set(options, settings[i][0], settings[i][1]), NPG_OK);
    npg_status status = npg_run_open(&run, options, NULL);
    if (!status) status = npg_run_wait(run);
    if (status < 0) print_error("%s\n", npg_error_text());
    assert_true(status == NPG_OK || status == NPG_PARTIAL);
    npg_run_close(&run);
    npg_options_close(&options);
    assert_int_equal(npg_memory_used(), 0);
}

static void assert_same_bytes(const char *first, const char *other, const char *file)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/%s", first, file);
    char *a = text_of_file(path);
    snprintf(path, sizeof path, "%s/%s", other, file);
    char *b = text_of_file(path);
    assert_true(a && b);
    assert_memory_equal(a, b, 1 << 22); /* text_of_file() gives so many, zeros after the file */
    free(a);
    free(b);
}

static void fifty_captures_leave_nothing_behind_and_give_the_same_bytes(void **state)
{
    temp_folder folder;
    holdings early = {0}, late = {0};
    char first[512], output[512], command[1200];
    (void)state;
    assert_int_equal(open_temp_folder(&folder), 0);
    assert_int_equal(mkdir(in_folder(&folder, "capture"), 0777), 0);
    for (int t = 0; t < FRAMES; t++)
        assert_int_equal(write_ball(in_folder(&folder, t ? "capture/frame_1.ply" : "capture/frame_0.ply"),
                                    POINTS, t, 0.03 * t),
                         0);
    snprintf(first, sizeof first, "%s/first", folder.path);
    run_capture(&folder, first);
    for (int i = 1; i < RUNS; i++) {
        snprintf(output, sizeof output, "%s/out", folder.path);
        run_capture(&folder, output);
        assert_same_bytes(first, output, "reference.ply");
        assert_same_bytes(first, output, "meshes/frame_0000.ply");
        assert_same_bytes(first, output, "meshes/frame_0001.ply");
        assert_same_bytes(first, output, "frames.jsonl");
        snprintf(command, sizeof command, "rm -rf '%s'", output);
        assert_int_equal(system(command), 0);
        if (i >= WARM_UP && i < WARM_UP + WINDOW) take_least(&early, i - WARM_UP);
        if (i >= RUNS - WINDOW) take_least(&late, i - (RUNS - WINDOW));
    }
    print_message(
        "heap KiB %ld, at the end %ld; anonymous KiB %ld, %ld; descriptors %d, %d; threads %d, %d\n",
        early.heap_kib, late.heap_kib, early.anonymous_kib, late.anonymous_kib, early.descriptors,
        late.descriptors, early.threads, late.threads);
    assert_int_equal(early.descriptors, late.descriptors);
    assert_true(late.threads <= early.threads + THREADS_GROWTH);
    assert_true(late.heap_kib <= early.heap_kib + HEAP_GROWTH_KIB);
    assert_true(late.anonymous_kib <= early.anonymous_kib + ANONYMOUS_GROWTH_KIB);
    close_temp_folder(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fifty_captures_leave_nothing_behind_and_give_the_same_bytes)};
    mallopt(M_ARENA_MAX, 1); /* a sanitizer's allocator has no arenas and refuses */
    return cmocka_run_group_tests(tests, NULL, NULL);
}
