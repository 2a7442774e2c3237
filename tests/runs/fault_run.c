/* Runs a capture again and again, each time with another allocation that fails.
 *
 *     fault_run FIRST STEP LAST INPUT OUT [OPTION VALUE]...
 *
 * The FIRST-th request to the allocator fails, then the FIRST+STEP-th, ... until a run is through before its
 * turn comes, or LAST is passed.  Every run must end with exit code 6 and leave nothing that looks done;
 * files under final names must be those of a whole run (the one without a failure that comes first); nothing
 * may stay in use.  Ends with 0 when all do. */
#include <ftw.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "neupig.h"

static _Atomic unsigned long requests, fails_at;
static _Atomic int has_failed;

static void *take(void *user, size_t align, size_t size)
{
    (void)user;
    if (atomic_fetch_add(&requests, 1) + 1 == atomic_load(&fails_at)) {
        atomic_store(&has_failed, 1);
        return NULL;
    }
    return aligned_alloc(align, (size + align - 1) / align * align);
}

static void give(void *user, void *memory)
{
    (void)user;
    free(memory);
}

static int remove_entry(const char *path, const struct stat *info, int type, struct FTW *walk)
{
    (void)info, (void)type, (void)walk;
    return remove(path);
}

static void remove_folder(const char *path)
{
    nftw(path, remove_entry, 16, FTW_DEPTH | FTW_PHYS);
}

static npg_status run(const char *input, const char *output, char **pairs, int pair_count)
{
    npg_options *options = NULL;
    npg_run *chain = NULL;
    npg_status status = npg_options_open(&options);
    if (!status) status = npg_options_set(options, "input", input);
    if (!status) status = npg_options_set(options, "output", output);
    for (int i = 0; i + 1 < pair_count && !status; i += 2)
        status = npg_options_set(options, pairs[i], pairs[i + 1]);
    if (!status) status = npg_run_open(&chain, options, NULL);
    if (!status) status = npg_run_wait(chain);
    npg_run_close(&chain);
    npg_options_close(&options);
    return status;
}

/* Whether what is under a final name in OUT is byte for byte that of the whole run;
 * with all of it, or not. */
static int results_are_whole(const char *output, const char *whole, int is_all)
{
    setenv("OUT", output, 1);
    setenv("WHOLE", whole, 1);
    if (is_all)
        return system("diff -r \"$OUT/meshes\" \"$WHOLE/meshes\" && "
                      "cmp \"$OUT/frames.jsonl\" \"$WHOLE/frames.jsonl\"") == 0;
    return system(
               "cd \"$OUT\" 2>/dev/null || exit 0; for file in reference.ply frames.jsonl meshes/*.ply; do "
               "[ ! -e \"$file\" ] || cmp \"$file\" \"$WHOLE/$file\" || exit 1; done") == 0;
}

static int is_done(const char *output)
{
    char path[4096];
    struct stat info;
    snprintf(path, sizeof path, "%s/done.json", output);
    return !stat(path, &info);
}

/* 1: it ended with 6; 2: it did without that memory (a cache), and all results are there; 0: neither. */
static int check(unsigned long n, npg_status status, const char *output, const char *whole)
{
    int code = npg_status_exit_code(status);
    const char *fault = NULL;
    if (code != 6 && code != 0) fault = "the exit code is not 6";
    if (is_done(output) != (code == 0)) fault = "done.json does not fit the exit code";
    if (!results_are_whole(output, whole, code == 0)) fault = "a file under its final name is not whole";
    if (npg_memory_used()) fault = "memory is still in use";
    if (fault)
        fprintf(stderr, "request %lu failed, ended with %d (%s): %s\n", n, code, npg_error_text(), fault);
    return fault ? 0 : code ? 1 : 2;
}

int main(int argc, char **argv)
{
    if (argc < 6) return 2;
    unsigned long n = strtoul(argv[1], NULL, 10), step = strtoul(argv[2], NULL, 10),
                  last = strtoul(argv[3], NULL, 10), ended[3] = {0};
    char whole[4000];
    npg_allocator failing = {sizeof failing, NULL, take, give};
    snprintf(whole, sizeof whole, "%s.whole", argv[5]);
    if (!n || !step || npg_memory_set_allocator(&failing)) return 2;
    if (whole[0] != '/') return fprintf(stderr, "OUT must be an absolute path\n"), 2;
    remove_folder(whole);
    npg_status status = run(argv[4], whole, argv + 6, argc - 6);
    if (status) return fprintf(stderr, "without a failure: %s\n", npg_error_text()), 1;
    printf("a run makes %lu requests\n", atomic_load(&requests));
    for (; n <= last; n += step) {
        remove_folder(argv[5]);
        atomic_store(&requests, 0);
        atomic_store(&has_failed, 0);
        atomic_store(&fails_at, n);
        status = run(argv[4], argv[5], argv + 6, argc - 6);
        atomic_store(&fails_at, 0);
        if (!atomic_load(&has_failed)) break;
        ended[check(n, status, argv[5], whole)]++;
    }
    printf("%lu failures: %lu ended with 6, %lu runs did without that memory, %lu went wrong\n",
           ended[0] + ended[1] + ended[2], ended[1], ended[2], ended[0]);
    remove_folder(whole);
    remove_folder(argv[5]);
    return ended[0] || !ended[1];
}
