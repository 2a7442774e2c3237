/* Live: the page of a run that is at work, written anew until the run has ended. */
#include <stdio.h>
#include <sys/stat.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "tools/view/view_internal.h"

#define LOOK_S     2  /* between two looks at the folder; a run that begins is not taken for one that ended */
#define PAUSE_MOST 10 /* a page that takes long to make is made more rarely: a tenth of a processor at most */

/* Whether any process has a lock on this file of the folder.  Asked of the system's list: to try the lock
 * oneself could keep a run from it.  Where there is no list it counts as held. */
static bool is_locked(const char *folder, const char *name)
{
    char path[4096], line[256];
    struct stat info;
    snprintf(path, sizeof path, "%s/%s", folder, name);
    if (stat(path, &info)) return false;
    FILE *list = fopen("/proc/locks", "re");
    bool found = !list;
    while (list && !found && fgets(line, sizeof line, list)) {
        unsigned long long there;
        found = sscanf(line, "%*d: %*s %*s %*s %*d %*x:%*x:%llu", &there) == 1 &&
                there == (unsigned long long)info.st_ino;
    }
    if (list) fclose(list);
    return found;
}

static bool is_at_work(const char *path)
{
    return is_locked(path, "job/lock") || is_locked(path, ".segments.lock");
}

/* How many frames there are; -1: the lists can't be read just now (a run begins anew). */
static int64_t count_frames(const char *path)
{
    npg_view_result result;
    int64_t count = 0;
    if (npg_view_result_open(&result, path, 1, true)) return -1;
    for (size_t i = 0; i < result.part_count; i++) count += (int64_t)result.parts[i].count;
    npg_view_result_close(&result);
    return count;
}

npg_status npg_view_follow(npg_view_facts *facts, const npg_view_order *order)
{
    npg_view_order now = *order;
    int64_t shown = -2;
    double due_s = 0;
    now.is_live = true;
    for (bool was_at_work = true;; sleep(LOOK_S)) {
        bool is_now = is_at_work(order->paths[0]);
        if (!is_now && !was_at_work) return npg_view_page_write(facts, order);
        was_at_work = is_now;
        int64_t count = count_frames(order->paths[0]);
        double begin_s = npg_clock_s();
        if (count == shown || count < 0 || begin_s < due_s) continue;
        NPG_TRY(npg_view_page_write(facts, &now));
        if (shown == -2) {
            printf("%s\n", order->output);
            fflush(stdout);
        }
        shown = count;
        due_s = npg_clock_s() + PAUSE_MOST * (npg_clock_s() - begin_s);
    }
}
