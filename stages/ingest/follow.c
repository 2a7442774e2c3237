/* Follow: the frames of a folder that grows. */
#include "ingest/ingest_internal.h"

#include <errno.h>
#include <fnmatch.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

#include "pipeline/clock.h"

/* Between two scans of the folder: a file that is the same in both is complete, on every file system. */
#define SCAN_MS 250

typedef struct file {
    char *name; /* first: npg_natural_order() asks for it; owned */
    off_t size, refused_size;
    struct timespec changed; /* as the file system tells; only compared for being equal */
    double since_s;          /* when it was first seen as it is                         */
    bool is_stable, was_refused;
} file;

struct npg_follow {
    npg_follow_settings settings;
    char *folder, *pattern, *last; /* owned; pattern may be NULL; last: the name that was taken last */
    const char *ending;            /* of all frames, once one was taken; else NULL */
    file *files;                   /* not taken yet, in natural order; owned */
    size_t count, capacity;
    size_t taken_count;
    npg_follow_facts facts;
    int64_t number;
    int64_t gap_before; /* the last number before which some were left out */
    bool is_ended, is_changed;
    double idle_since_s;
};

/* ---- opening ---- */

static npg_status split_place(npg_follow *follow, const char *where)
{
    struct stat info;
    NPG_TRY(npg_copy_text(&follow->folder, where));
    char *slash = strrchr(follow->folder, '/');
    if (stat(where, &info) && strpbrk(slash ? slash : where, "*?[")) {
        NPG_TRY(npg_copy_text(&follow->pattern, slash ? slash + 1 : where));
        if (!slash) memcpy(follow->folder, ".", 2); /* the pattern has at least as many letters */
        if (slash) slash[slash == follow->folder] = 0;
    }
    if (stat(follow->folder, &info))
        return npg_error(NPG_BAD_INPUT, "%s: can't be followed: %s", follow->folder, strerror(errno));
    if (!S_ISDIR(info.st_mode))
        return npg_error(NPG_BAD_INPUT, "%s: only a folder can be followed", follow->folder);
    return NPG_OK;
}

npg_status npg_follow_open(npg_follow **out, const npg_follow_settings *settings)
{
    npg_follow *follow;
    *out = NULL;
    NPG_TRY(npg_alloc(&follow, NPG_FOR_FILES, sizeof *follow));
    follow->settings = *settings;
    npg_status status = split_place(follow, settings->where);
    if (status) npg_follow_close(&follow);
    *out = follow;
    return status;
}

void npg_follow_close(npg_follow **slot)
{
    npg_follow *follow = *slot;
    if (!follow) return;
    for (size_t i = 0; i < follow->count; i++) npg_release(&follow->files[i].name);
    npg_release(&follow->files);
    npg_release(&follow->folder);
    npg_release(&follow->pattern);
    npg_release(&follow->last);
    npg_release(slot);
}

const npg_follow_facts *npg_follow_facts_of(const npg_follow *follow)
{
    return &follow->facts;
}

/* Of the names of frames; the one that most have. */
static void choose_ending(npg_follow *follow, const void *names, size_t count, size_t size)
{
    size_t most;
    if (!follow->pattern) follow->ending = npg_ending_of_most(&most, names, count, size, NULL);
}

/* The name of the file becomes the last one's. */
static void note_taken(npg_follow *follow, char *name, int64_t number)
{
    if (follow->taken_count++)
        follow->facts.step = npg_common_divisor(number - follow->number, follow->facts.step);
    follow->number = number;
    npg_release(&follow->last);
    follow->last = name;
}

npg_status npg_follow_pass(npg_follow *follow, const char *name, size_t digits, int64_t number)
{
    char *copy;
    NPG_TRY(npg_copy_text(&copy, name));
    choose_ending(follow, &copy, 1, sizeof copy);
    follow->facts.digits = digits;
    note_taken(follow, copy, number);
    return NPG_OK;
}

/* ---- scanning the folder ---- */

static bool is_frame_name(const npg_follow *follow, const char *name)
{
    if (name[0] == '.' || !strcmp(name, follow->settings.end_name)) return false;
    if (follow->pattern) return fnmatch(follow->pattern, name, FNM_PERIOD) == 0;
    if (!npg_format_by_ending(name)) return false;
    return !follow->ending || !strcasecmp(strrchr(name, '.'), follow->ending);
}

/* Size and time of the file now, against those of the scan before. */
static void note_change(npg_follow *follow, file *f, const struct stat *now)
{
    bool is_same = f->since_s > 0 && f->size == now->st_size && f->changed.tv_sec == now->st_mtim.tv_sec &&
                   f->changed.tv_nsec == now->st_mtim.tv_nsec;
    f->is_stable = is_same && npg_clock_s() - f->since_s >= 1e-3 * SCAN_MS;
    if (is_same) return;
    f->size = now->st_size;
    f->changed = now->st_mtim;
    f->since_s = npg_clock_s();
    follow->is_changed = true;
}

static npg_status add_file(npg_follow *follow, const char *name)
{
    NPG_TRY(npg_grow(&follow->files, &follow->capacity, follow->count + 1, sizeof(file), NPG_FOR_FILES));
    file *added = &follow->files[follow->count];
    *added = (file){0};
    NPG_TRY(npg_copy_text(&added->name, name));
    follow->count++;
    return NPG_OK;
}

/* One name of the folder: known, new, or not after the last frame in natural order.  passed counts these:
 * frames that were accepted, and files that came too late. */
typedef struct scan {
    npg_follow *follow;
    size_t known, passed;
} scan;

static npg_status note_name(void *user, const char *name)
{
    scan *s = user;
    npg_follow *follow = s->follow;
    const file key = {.name = (char *)name};
    if (!is_frame_name(follow, name)) return NPG_OK;
    if (follow->last && npg_natural_compare(name, follow->last) <= 0) {
        s->passed++;
        return NPG_OK;
    }
    /* those added by this scan are not in order yet */
    bool is_known = s->known && bsearch(&key, follow->files, s->known, sizeof key, npg_natural_order);
    return is_known ? NPG_OK : add_file(follow, name);
}

static npg_status stat_files(npg_follow *follow)
{
    size_t kept = 0;
    for (size_t i = 0; i < follow->count; i++) {
        file f = follow->files[i];
        struct stat info;
        char path[NPG_PATH_SIZE];
        NPG_TRY(npg_path_of(path, follow->folder, f.name));
        bool is_there = !stat(path, &info) && !S_ISDIR(info.st_mode);
        if (is_there && follow->settings.confine) NPG_TRY(npg_path_confine(path, follow->folder));
        if (!is_there) { /* taken away again, or a folder */
            npg_release(&follow->files[i].name);
            continue;
        }
        note_change(follow, &f, &info);
        follow->files[i].name = NULL;
        follow->files[kept++] = f;
    }
    follow->count = kept;
    return NPG_OK;
}

static npg_status scan_folder(npg_follow *follow)
{
    scan s = {.follow = follow, .known = follow->count};
    /* Asked before the names are listed: who writes the end file last has written all frames by then. */
    const char *end_name = follow->settings.end_name;
    bool is_end = end_name[0] && npg_is_in_folder(follow->folder, end_name);
    NPG_TRY(npg_folder_each(follow->folder, NPG_BAD_INPUT, note_name, &s));
    NPG_TRY(stat_files(follow));
    if (follow->count) qsort(follow->files, follow->count, sizeof(file), npg_natural_order);
    /* Of the names that were passed, all but the accepted ones turned up behind a later frame. */
    size_t late = s.passed > follow->taken_count ? s.passed - follow->taken_count : 0;
    if (late > follow->facts.late_count) follow->facts.late_count = late;
    follow->is_ended |= is_end;
    return NPG_OK;
}

npg_status npg_follow_count_new(npg_follow *follow, size_t *count)
{
    NPG_TRY(scan_folder(follow));
    *count = follow->count;
    return NPG_OK;
}

/* ---- waiting ---- */

static npg_status wait_and_scan(npg_follow *follow)
{
    if (follow->settings.stopping(follow->settings.user))
        return npg_error(NPG_STOPPED, "%s: stopped", follow->folder);
    poll(NULL, 0, SCAN_MS);
    follow->is_changed = false;
    NPG_TRY(scan_folder(follow));
    double now_s = npg_clock_s(), idle_s = follow->settings.idle_s;
    if (follow->is_changed) follow->idle_since_s = now_s;
    if (idle_s > 0 && now_s - follow->idle_since_s >= idle_s) follow->is_ended = true;
    return NPG_OK;
}

/* ---- accepting files as frames ---- */

static int64_t number_of(const npg_follow *follow, const file *f)
{
    int64_t number = npg_name_number(f->name, follow->facts.digits, NULL);
    return number < 0 ? (int64_t)follow->taken_count : number; /* no number in the names: counted from 0 */
}

/* Once, before the first frame: the ending that most of the files have is the frames', and of the runs of
 * digits in the first two names the last one that grows is the number. */
static void choose_ending_and_number(npg_follow *follow)
{
    follow->facts.digits = 0;
    choose_ending(follow, follow->files, follow->count, sizeof(file));
    size_t kept = 0;
    for (size_t i = 0; i < follow->count; i++) {
        if (is_frame_name(follow, follow->files[i].name))
            follow->files[kept++] = follow->files[i];
        else
            npg_release(&follow->files[i].name);
    }
    follow->count = kept;
    const char *first = follow->files[0].name, *second = kept > 1 ? follow->files[1].name : NULL;
    while (second && npg_name_number(first, follow->facts.digits, NULL) >= 0 &&
           npg_name_number(first, follow->facts.digits, NULL) >=
               npg_name_number(second, follow->facts.digits, NULL))
        follow->facts.digits++;
    if (npg_name_number(first, follow->facts.digits, NULL) < 0) follow->facts.digits = 0;
}

static bool leaves_numbers_out(const npg_follow *follow, const file *head)
{
    int64_t expected = follow->number + (follow->facts.step ? follow->facts.step : 1);
    return follow->settings.finds_gaps && follow->taken_count && number_of(follow, head) > expected;
}

/* Before a number counts as missing the folder is scanned once more: its file may have come since. */
static bool waits_for_number(npg_follow *follow, const file *head)
{
    if (!leaves_numbers_out(follow, head)) return false;
    if (!follow->is_ended && follow->count <= NPG_FOLLOW_LATE) return true;
    bool was_scanned = follow->gap_before == number_of(follow, head);
    follow->gap_before = number_of(follow, head);
    return !was_scanned;
}

static npg_status read_file(npg_follow *follow, const file *head, npg_frame *frame, npg_origin *origin)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, follow->folder, head->name));
    npg_status status = npg_read_cloud(frame, path, origin);
    if (status) NPG_TRY(npg_copy_text(&frame->path, path)); /* npg_read_cloud() sets it on success alone */
    return status;
}

/* The head becomes *frame. */
static npg_status accept_head(npg_follow *follow, npg_frame *frame)
{
    file head = follow->files[0];
    int64_t number = number_of(follow, &head);
    if (follow->taken_count && number <= follow->number)
        return npg_error(NPG_BAD_INPUT, "%s/%s: has the number %lld, and the frame before it %lld",
                         follow->folder, head.name, (long long)number, (long long)follow->number);
    frame->number = number;
    note_taken(follow, head.name, number);
    memmove(follow->files, follow->files + 1, --follow->count * sizeof(file));
    return NPG_OK;
}

/* Whether a file that was refused as it is now will not get better. */
static bool is_broken(const npg_follow *follow, const file *head)
{
    bool has_follower = follow->count > 1 || follow->is_ended;
    return has_follower && npg_clock_s() - head->since_s >= follow->settings.settle_s;
}

/* *is_taken: the head was complete, or broken (NPG_PARTIAL).  A file that its reader refuses is read again
 * only when it has changed, or when is_broken() gives it up: then for the reader's message. */
static npg_status try_head(npg_follow *follow, npg_frame *frame, npg_origin *origin, bool *is_taken)
{
    if (!follow->last) choose_ending_and_number(follow);
    file *head = &follow->files[0];
    *is_taken = false;
    if (waits_for_number(follow, head) || !head->is_stable) return NPG_OK;
    bool is_known_bad = head->was_refused && head->refused_size == head->size;
    if (is_known_bad && !is_broken(follow, head)) return NPG_OK;
    npg_status status = read_file(follow, head, frame, origin);
    bool is_empty = !status && !head->size; /* some writers create the file first and fill it later */
    if (status && status != NPG_BAD_INPUT) return status;
    if ((status || is_empty) && !is_known_bad) { /* perhaps it is still being written */
        npg_frame_clear(frame);
        head->was_refused = true;
        head->refused_size = head->size;
        return NPG_OK;
    }
    *is_taken = true;
    NPG_TRY(accept_head(follow, frame));
    return status ? NPG_PARTIAL : NPG_OK;
}

npg_status npg_follow_next(npg_follow *follow, npg_frame *frame, npg_origin *origin)
{
    bool is_taken = false;
    follow->idle_since_s = npg_clock_s(); /* only time that the run spends waiting here counts as idle */
    for (;;) {
        npg_status status = follow->count ? try_head(follow, frame, origin, &is_taken) : NPG_OK;
        if (status < 0) npg_frame_clear(frame);
        if (status || is_taken) return status;
        if (follow->is_ended && !follow->count) return NPG_END;
        NPG_TRY(wait_and_scan(follow));
    }
}
