/* Watch: how far a run is, from the outside. */
#include "tools/view/run_watch.h"

#include <dirent.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "pipeline/file.h"

#define UNLOCKED_S          2  /* so that a run which begins is not taken for one that ended */
#define UNLOCKED_SEGMENTS_S 30 /* between two runs of segments nobody holds a lock */

static bool stat_in(struct stat *info, const char *folder, const char *name)
{
    char *path;
    if (npg_join_path(&path, folder, name)) return false;
    bool is_there = stat(path, info) == 0;
    npg_release(&path);
    return is_there;
}

/* FNV-1a: any change of these numbers must show, nothing depends on the value. */
static uint64_t mix(uint64_t traces, uint64_t value)
{
    for (int i = 0; i < 8; i++) traces = (traces ^ (value >> 8 * i & 255)) * 0x100000001b3;
    return traces;
}

static uint64_t trace_of(uint64_t traces, const char *folder, const char *name)
{
    struct stat info;
    if (!stat_in(&info, folder, name)) return mix(traces, 0);
    traces = mix(mix(traces, info.st_ino), (uint64_t)info.st_size);
    return mix(mix(traces, (uint64_t)info.st_mtim.tv_sec), (uint64_t)info.st_mtim.tv_nsec);
}

static uint64_t traces_of(uint64_t traces, const char *folder)
{
    static const char *const names[] = {
        "frames.partial.jsonl", "frames.jsonl",  "reference.ply",        "report.json", "done.json",
        "job/job.json",         "segments.json", "segments.partial.json"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) traces = trace_of(traces, folder, names[i]);
    return traces;
}

/* ---- the lock ---- */

/* Whether any process has a lock on this file.  Asked of the system's list: to try the lock oneself could
 * keep a run from it.  Where there is no list it counts as held. */
static bool is_locked(ino_t inode)
{
    FILE *list = fopen("/proc/locks", "re");
    char line[256];
    bool found = !list;
    while (list && !found && fgets(line, sizeof line, list)) {
        unsigned long long there;
        found = sscanf(line, "%*d: %*s %*s %*s %*d %*x:%*x:%llu", &there) == 1 &&
                there == (unsigned long long)inode;
    }
    if (list) fclose(list);
    return found;
}

typedef struct locks {
    bool any, held; /* there is a file of a lock; one is held */
    uint64_t traces;
} locks;

static void look_at(locks *l, const char *folder)
{
    struct stat info;
    l->traces = traces_of(l->traces, folder);
    if (!stat_in(&info, folder, "job/lock")) return;
    l->any = true;
    l->held = l->held || is_locked(info.st_ino);
}

/* The folder itself, and those of segments. */
static locks look_at_all(const char *path)
{
    locks l = {.traces = 0xcbf29ce484222325};
    look_at(&l, path);
    DIR *folder = opendir(path);
    for (struct dirent *entry; folder && (entry = readdir(folder));) {
        char *inner;
        if (strncmp(entry->d_name, "segment_", 8) != 0 || npg_join_path(&inner, path, entry->d_name))
            continue;
        look_at(&l, inner);
        npg_release(&inner);
    }
    if (folder) closedir(folder);
    return l;
}

/* ---- phases ---- */

static npg_run_phase phase_of(npg_run_watch *watch, const char *path, const locks *l)
{
    bool has_segments = npg_is_in_folder(path, "segments.partial.json");
    double now_s = npg_clock_s();
    if (npg_is_in_folder(path, "done.json") && !has_segments) return NPG_RUN_DONE;
    if (l->held || !l->any)
        watch->unlocked_s = 0;
    else if (watch->unlocked_s <= 0)
        watch->unlocked_s = now_s;
    else if (now_s - watch->unlocked_s > (has_segments ? UNLOCKED_SEGMENTS_S : UNLOCKED_S))
        return NPG_RUN_STOPPED;
    if (has_segments) return NPG_RUN_SOLVING;
    if (npg_is_in_folder(path, "frames.jsonl")) return NPG_RUN_WRITING;
    return npg_is_in_folder(path, "frames.partial.jsonl") ? NPG_RUN_SOLVING : NPG_RUN_PREPARING;
}

bool npg_run_watch_look(npg_run_watch *watch, const char *path)
{
    locks l = look_at_all(path);
    watch->phase = phase_of(watch, path, &l);
    bool has_changed = l.traces != watch->traces;
    watch->traces = l.traces;
    return has_changed;
}

void npg_run_watch_again(npg_run_watch *watch)
{
    watch->traces = 0;
}

uint64_t npg_run_watch_reference(const npg_view_part *part)
{
    uint64_t traces = trace_of(0xcbf29ce484222325, part->folder, "reference.ply");
    return part->reference ? traces & 0x1fffffffffffff : 0; /* what a double holds */
}

const char *npg_run_phase_word(npg_run_phase phase)
{
    static const char *const words[] = {"preparing", "solving", "writing", "done", "stopped"};
    return words[phase];
}

bool npg_run_phase_is_end(npg_run_phase phase)
{
    return phase == NPG_RUN_DONE || phase == NPG_RUN_STOPPED;
}
