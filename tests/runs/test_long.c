/* A long capture, files in and files out: what the process holds in a late window is what it held in an early
 * one.  Lists of files and frames grow with the capture, by about a KiB a frame, before the first window. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>
#include <malloc.h>
#include <math.h>

#include "neupig.h"
#include "tests/support/temp_folder.h"
#include "tests/support/write_ball.h"

/* Windows of 6 frames that go on by 4.  The least of some windows is compared with the least of as many later
 * ones; the last windows are left out, since by then the stages before hold no frames any more.  A leak of
 * one frame's arrays in each window would be 500 KiB.  How many chunks are on their way between stages is the
 * system's choice, hence the least of many windows. */
enum { FRAMES = 160, POINTS = 600, EARLY = 6, LATE = 24, AMONG = 11 };
/* The sanitizers' own books grow, and their heap can't be asked. */
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
enum { HEAP_GROWTH_KIB = 1 << 20, ANONYMOUS_GROWTH_KIB = 1 << 20 };
#else
enum { HEAP_GROWTH_KIB = 256, ANONYMOUS_GROWTH_KIB = 4096 };
#endif
enum { COUNTED_GROWTH_KIB = 64 };

/* ---- what the process holds ---- */

typedef struct holdings {
    long counted_kib, heap_kib, anonymous_kib;
    int seen;
} holdings;

typedef struct watch {
    holdings early, late;
    int64_t window; /* the last that was looked at */
} watch;

static long least_of(long least, long now, int seen)
{
    return seen && least < now ? least : now;
}

/* Not the plain resident size: of libraries' files the system drops and maps pages as it likes. */
static void take_least(holdings *least)
{
    long resident = 0, of_files = 0;
    malloc_trim(0);
    struct mallinfo2 heap = mallinfo2();
    FILE *file = fopen("/proc/self/statm", "r");
    if (!file || fscanf(file, "%*s %ld %ld", &resident, &of_files) != 2) abort();
    fclose(file);
    long anonymous = (resident - of_files) * (sysconf(_SC_PAGESIZE) / 1024);
    least->counted_kib = least_of(least->counted_kib, (long)(npg_memory_used() >> 10), least->seen);
    least->heap_kib = least_of(least->heap_kib, (long)((heap.uordblks + heap.hblkhd) >> 10), least->seen);
    least->anonymous_kib = least_of(least->anonymous_kib, anonymous, least->seen);
    least->seen++;
}

/* Once in each window. */
static void look(void *user, const npg_progress *progress)
{
    watch *w = user;
    if (strcmp(progress->stage, "optimize") != 0 || progress->window == w->window) return;
    w->window = progress->window;
    if (w->window >= EARLY && w->window < EARLY + AMONG) take_least(&w->early);
    if (w->window >= LATE && w->window < LATE + AMONG) take_least(&w->late);
}

static npg_status run_capture(const char *input, const char *output, watch *w)
{
    const char *const settings[][2] = {
        {"input", input},      {"output", output}, {"window", "6"},       {"overlap", "2"},
        {"ring", "1"},         {"chunk", "1"},     {"cache", "0"},        {"keyframe-choice", "paper"},
        {"epochs", "2"},       {"faces", "400"},   {"align-nodes", "20"}, {"align-steps", "2"},
        {"poisson-depth", "4"}};
    const npg_hooks hooks = {.struct_size = sizeof hooks, .user = w, .progress = look};
    npg_options *options = NULL;
    npg_run *run = NULL;
    assert_int_equal(npg_options_open(&options), NPG_OK);
    for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
        assert_int_equal(npg_options_set(options, settings[i][0], settings[i][1]), NPG_OK);
    npg_status status = npg_run_open(&run, options, &hooks);
    if (!status) status = npg_run_wait(run);
    if (status < 0) print_error("%s\n", npg_error_text());
    npg_run_close(&run);
    npg_options_close(&options);
    return status;
}

static void a_late_window_holds_what_an_early_one_held(void **state)
{
    temp_folder folder;
    char input[512], name[64];
    watch w = {.window = -1};
    (void)state;
    assert_int_equal(open_temp_folder(&folder), 0);
    snprintf(input, sizeof input, "%s", in_folder(&folder, "capture"));
    assert_int_equal(mkdir(input, 0777), 0);
    for (int t = 0; t < FRAMES; t++) {
        snprintf(name, sizeof name, "capture/frame_%03d.ply", t);
        assert_int_equal(write_ball(in_folder(&folder, name), POINTS, t, 0.2 * sin(0.3 * t)), 0);
    }
    npg_status status = run_capture(input, in_folder(&folder, "out"), &w);
    assert_true(status == NPG_OK || status == NPG_PARTIAL);
    print_message("KiB early and late: counted %ld, %ld; heap %ld, %ld; anonymous %ld, %ld\n",
                  w.early.counted_kib, w.late.counted_kib, w.early.heap_kib, w.late.heap_kib,
                  w.early.anonymous_kib, w.late.anonymous_kib);
    assert_int_equal(w.early.seen, AMONG);
    assert_int_equal(w.late.seen, AMONG);
    assert_true(w.late.counted_kib <= w.early.counted_kib + COUNTED_GROWTH_KIB);
    assert_true(w.late.heap_kib <= w.early.heap_kib + HEAP_GROWTH_KIB);
    assert_true(w.late.anonymous_kib <= w.early.anonymous_kib + ANONYMOUS_GROWTH_KIB);
    close_temp_folder(&folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_late_window_holds_what_an_early_one_held)};
    mallopt(M_MMAP_THRESHOLD, 1 << 20); /* as the command has it; a sanitizer's allocator refuses */
    mallopt(M_ARENA_MAX, 1);
    return cmocka_run_group_tests(tests, NULL, NULL);
}
