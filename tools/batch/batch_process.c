/* Process of one capture: neupig run in a child, its output, and how it is stopped. */
#include "tools/batch/batch.h"

#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pipeline/child.h"
#include "pipeline/clock.h"
#include "pipeline/file.h"
#include "pipeline/json_file.h"
#include "pipeline/memory.h"
#include "tools/progress.h"

#define GRACE_SECONDS 10 /* a run that was asked ends within 5 s; then it is killed */

/* ---- start ---- */

static bool find_done(struct stat *info, const npg_capture *capture)
{
    char path[NPG_PATH_SIZE];
    return !npg_path_of(path, capture->output, "done.json") && !stat(path, info);
}

/* What is set, as an object that --method takes, but for the paths that may be no UTF-8. */
static char *text_of_options(const npg_options *options)
{
    npg_option_info info = {.struct_size = sizeof info};
    json_t *method = json_object();
    for (size_t i = 0; npg_options_describe(i, &info) == NPG_OK; i++) {
        const char *value = npg_options_get(options, info.name);
        if (npg_options_is_set(options, info.name) && *value && strcmp(info.name, "input") != 0 &&
            strcmp(info.name, "output") != 0)
            json_object_set_new(method, strcmp(info.name, "method") != 0 ? info.name : "preset",
                                npg_json_text(value));
    }
    char *text = json_dumps(method, JSON_COMPACT);
    json_decref(method);
    return text;
}

static void log_record(const npg_capture *capture, json_t *record)
{
    char path[NPG_PATH_SIZE];
    int fd = -1;
    if (!npg_path_of(path, capture->output, "log.jsonl"))
        fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    npg_log_file_write(&fd, record);
    if (fd >= 0) close(fd);
}

/* What the child does first.  In its own process group, so that a signal from the terminal reaches it through this
 * process alone and that it can be killed with all that it has started; with no signal blocked; and it stops when the
 * batch is gone, however that ended. */
static void become_run(const npg_process *p, const char *const *words, const char *parent)
{
    sigset_t none;
    int nothing = open("/dev/null", O_RDONLY);
    setpgid(0, 0);
    npg_end_with_parent(parent, SIGTERM);
    dup2(nothing, STDIN_FILENO);
    dup2(p->out, STDOUT_FILENO);
    dup2(p->err, STDERR_FILENO);
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, NULL);
    closefrom(3);
    execv("/proc/self/exe", (char **)(uintptr_t)words);
    _exit(127);
}

/* Its output goes to files without a name, so that it never waits for anybody to read. */
static npg_status start(npg_process *p, const char *const *words)
{
    char parent[24];
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    p->out = memfd_create("output", MFD_CLOEXEC);
    p->err = memfd_create("errors", MFD_CLOEXEC);
    if (p->out < 0 || p->err < 0 || fcntl(p->out, F_SETFL, O_APPEND) || fcntl(p->err, F_SETFL, O_APPEND))
        return npg_error_errno(NPG_FAILED, "can't take the output of neupig run");
    p->pid = fork();
    if (p->pid < 0) return npg_error_errno(NPG_FAILED, "can't start neupig run");
    if (p->pid == 0) become_run(p, words, parent);
    setpgid(p->pid, p->pid); /* whoever is first */
    return NPG_OK;
}

static void clear(npg_process *p)
{
    if (p->out >= 0) close(p->out);
    if (p->err >= 0) close(p->err);
    json_decref(p->progress);
    *p = (npg_process){.out = -1, .err = -1};
}

static npg_status run(npg_process *p, const char *log_path)
{
    const npg_capture *capture = p->capture;
    char *options = text_of_options(capture->options);
    bool in_segments = capture->segments == NPG_BATCH_SEGMENTS_AUTO;
    const char *const words[] = {"neupig",
                                 "run",
                                 "--progress",
                                 "json",
                                 "--quiet",
                                 "--log-file",
                                 log_path,
                                 "--segments",
                                 in_segments ? "auto" : "one",
                                 "--method",
                                 options,
                                 "--output",
                                 capture->output,
                                 "--",
                                 capture->input,
                                 NULL};
    json_t *command = json_array();
    for (size_t i = 0; words[i]; i++) json_array_append_new(command, npg_json_text(words[i]));
    log_record(capture, json_pack("{s:s,s:o}", "event", "command", "command", command));
    npg_status status = options ? start(p, words) : npg_error(NPG_MEMORY, "no memory");
    free(options);
    return status;
}

npg_status npg_process_start(npg_process *p, npg_capture *capture)
{
    char log_path[NPG_PATH_SIZE];
    *p = (npg_process){.capture = capture, .out = -1, .err = -1, .begun_s = npg_clock_s()};
    npg_status status = npg_make_folder(capture->output);
    if (!status && !find_done(&p->done_before, capture))
        status = npg_file_remove(capture->output, "verdict.json");
    if (!status) status = npg_path_of(log_path, capture->output, "log.jsonl");
    if (!status) status = run(p, log_path);
    if (status) clear(p);
    return status;
}

/* ---- what it says ---- */

/* The last line of a file, as far as it is written. */
static void read_last_line(char *text, size_t size, int fd)
{
    off_t end = lseek(fd, 0, SEEK_END), most = (off_t)size - 1;
    ssize_t got = pread(fd, text, size - 1, end > most ? end - most : 0);
    text[got > 0 ? got : 0] = 0;
    npg_keep_last_line(text);
}

bool npg_process_read(npg_process *p)
{
    char text[4096];
    read_last_line(text, sizeof text, p->out);
    json_t *record = json_loads(text, 0, NULL);
    const char *event = json_string_value(json_object_get(record, "event"));
    bool is_progress = event && !strcmp(event, "progress");
    if (record && ftruncate(p->out, 0)) is_progress = false; /* what was read is not kept */
    if (is_progress) {
        json_decref(p->progress);
        p->progress = json_incref(record);
    }
    json_decref(record);
    return is_progress;
}

/* Why it failed: the last that it wrote to standard error. */
static const char *failure_text(char *text, size_t size, const npg_process *p)
{
    const char *prefix = "neupig run: ";
    read_last_line(text, size, p->err);
    return !strncmp(text, prefix, strlen(prefix)) ? text + strlen(prefix) : text;
}

/* ---- limits ---- */

static void kill_all(npg_process *p)
{
    kill(-p->pid, SIGKILL);
    p->was_killed = true;
}

void npg_process_stop(npg_process *p, npg_stop_cause cause)
{
    if (p->asked_s > 0) {
        kill_all(p);
        return;
    }
    p->asked_s = npg_clock_s();
    p->cause = cause;
    kill(p->pid, SIGTERM);
}

void npg_process_watch(npg_process *p)
{
    double now_s = npg_clock_s(), time = p->capture->max_time_s;
    if (p->asked_s > 0) {
        if (now_s > p->asked_s + GRACE_SECONDS && !p->was_killed) kill_all(p);
    } else if (time > 0 && now_s > p->begun_s + time) {
        npg_process_stop(p, NPG_STOP_TIME);
    }
}

/* ---- end ---- */

/* It was done before and nothing was done to it: the earlier verdict's time and memory still hold. */
static bool was_done(const npg_process *p, int how)
{
    struct stat now;
    const struct stat *before = &p->done_before;
    bool good = WIFEXITED(how) && (WEXITSTATUS(how) == 0 || WEXITSTATUS(how) == 7);
    return good && find_done(&now, p->capture) && now.st_ino == before->st_ino &&
           !memcmp(&now.st_mtim, &before->st_mtim, sizeof now.st_mtim);
}

static npg_status conclude(npg_process *p, int how, const struct rusage *used)
{
    npg_capture *capture = p->capture;
    npg_verdict *v = &capture->verdict, before;
    char text[sizeof v->message];
    npg_verdict_read(&before, capture);
    npg_verdict_judge(v, capture, how, p->cause, failure_text(text, sizeof text, p));
    v->was_done = was_done(p, how);
    bool keeps = v->was_done && before.is_known;
    v->seconds = keeps ? before.seconds : npg_clock_s() - p->begun_s;
    v->peak_bytes = keeps ? before.peak_bytes : (size_t)used->ru_maxrss << 10;
    log_record(capture, npg_verdict_record(capture));
    return npg_verdict_write(capture);
}

npg_status npg_process_reap(npg_process *p, bool *ended)
{
    int how;
    struct rusage used;
    siginfo_t info = {.si_pid = 0};
    waitid(P_PID, (id_t)p->pid, &info, WEXITED | WNOHANG | WNOWAIT);
    *ended = info.si_pid == p->pid;
    if (!*ended) return NPG_OK;
    kill(-p->pid, SIGKILL); /* a helper that outlived it; the group exists until the process is waited for */
    if (wait4(p->pid, &how, 0, &used) != p->pid)
        return npg_error_errno(NPG_FAILED, "%s: its run can't be waited for", p->capture->name);
    npg_status status = conclude(p, how, &used);
    clear(p);
    return status;
}
