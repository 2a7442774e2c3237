/* Progress: how far a run is, as a bar on a terminal or as JSON lines, and the log on standard error. */
#include "tools/progress.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#include "pipeline/json_file.h"

void npg_reporter_init(npg_reporter *reporter, const npg_reporter_settings *s)
{
    bool terminal = isatty(STDERR_FILENO);
    int show = s->show;
    if (show == NPG_SHOW_AUTO) show = terminal && !s->quiet ? NPG_SHOW_BAR : NPG_SHOW_NONE;
    *reporter = (npg_reporter){.show = show,
                               .level = s->quiet     ? NPG_LOG_WARNING
                                        : s->verbose ? NPG_LOG_DEBUG
                                                     : NPG_LOG_INFO,
                               .colour = terminal && !getenv("NO_COLOR"),
                               .drawn_s = -1,
                               .log_fd = -1};
}

npg_status npg_reporter_open_log(npg_reporter *reporter, const char *path, const char *output)
{
    if (!path[0]) return NPG_OK;
    reporter->log_fd = open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (reporter->log_fd < 0) return npg_error_errno(NPG_DISK, "can't write %s", path);
    npg_log_file_write(&reporter->log_fd,
                       json_pack("{s:s,s:s,s:o,s:I}", "event", "start", "neupig", npg_version(), "output",
                                 npg_json_text(output), "pid", (json_int_t)getpid()));
    return NPG_OK;
}

/* ---- log files ---- */

/* "2026-11-20T08:46:37.123Z" */
static void spell_now(char *text, size_t size)
{
    struct timespec now;
    struct tm parts;
    clock_gettime(CLOCK_REALTIME, &now);
    gmtime_r(&now.tv_sec, &parts);
    size_t length = strftime(text, size, "%Y-%m-%dT%H:%M:%S", &parts);
    snprintf(text + length, size - length, ".%03ldZ", now.tv_nsec / 1000000);
}

void npg_log_file_write(int *fd, json_t *record)
{
    char now[40], newline[] = "\n";
    spell_now(now, sizeof now);
    json_t *line = *fd >= 0 && record ? json_pack("{s:s}", "time", now) : NULL;
    if (line) json_object_update(line, record);
    char *text = line ? json_dumps(line, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
    if (text) {
        const struct iovec whole[] = {{text, strlen(text)}, {newline, 1}};
        ssize_t written = writev(*fd, whole, 2);
        if (written != (ssize_t)whole[0].iov_len + 1) {
            fprintf(stderr, "neupig: the log file can't be written any more: %s\n",
                    written < 0 ? strerror(errno) : "no room for a whole line");
            close(*fd);
            *fd = -1;
        }
    }
    free(text);
    json_decref(line);
    json_decref(record);
}

/* ---- log ---- */

void npg_reporter_pause(npg_reporter *reporter)
{
    if (reporter->bar_drawn) fputs("\r\033[K", stderr);
    reporter->bar_drawn = false;
}

static json_t *json_of_record(const npg_log_record *record)
{
    static const char *const levels[] = {"error", "warning", "info", "debug"};
    json_t *line =
        json_pack("{s:s,s:s,s:s,s:f,s:o}", "event", "log", "level", levels[record->level], "stage",
                  record->stage, "elapsed_s", record->time_s, "message", npg_json_text(record->message));
    if (line && record->frame >= 0) json_object_set_new(line, "frame", json_integer(record->frame));
    return line;
}

static void show_record(void *user, const npg_log_record *record)
{
    static const char *const words[] = {"error: ", "warning: ", "", ""};
    static const char *const colours[] = {"\033[31m", "\033[33m", "", "\033[2m"};
    npg_reporter *reporter = user;
    char frame[40] = "";
    if (record->level <= NPG_LOG_INFO || record->level <= reporter->level)
        npg_log_file_write(&reporter->log_fd, json_of_record(record));
    if (record->level > reporter->level) return;
    npg_reporter_pause(reporter);
    bool says_frame = !strncmp(record->message, "frame ", 6);
    if (record->frame >= 0 && !says_frame)
        snprintf(frame, sizeof frame, "frame %lld: ", (long long)record->frame);
    fprintf(stderr, "%s[%8.2f] %s: %s%s%s%s\n", reporter->colour ? colours[record->level] : "",
            record->time_s, record->stage, words[record->level], frame, record->message,
            reporter->colour ? "\033[0m" : "");
}

/* ---- progress ---- */

#define DRAW_S 0.1 /* the bar is drawn no more often: terminals are slow */

void npg_spell_time(char *out, size_t size, double seconds)
{
    if (!(seconds >= 0) || seconds > 1e8) { /* three years: an estimate of nothing */
        snprintf(out, size, "?");
        return;
    }
    long whole = lround(seconds), hours = whole / 3600, minutes = whole / 60 % 60;
    if (hours)
        snprintf(out, size, "%ld:%02ld:%02ld", hours, minutes, whole % 60);
    else
        snprintf(out, size, "%ld:%02ld", minutes, whole % 60);
}

static int terminal_width(void)
{
    struct winsize size;
    return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 20 ? size.ws_col : 80;
}

static void draw_bar(npg_reporter *reporter, const npg_progress *progress)
{
    char left[32], elapsed[32], tail[160], bar[32];
    if (reporter->drawn_s >= 0 && progress->elapsed_s - reporter->drawn_s < DRAW_S && progress->share < 1)
        return;
    reporter->drawn_s = progress->elapsed_s;
    npg_spell_time(left, sizeof left, progress->left_s);
    npg_spell_time(elapsed, sizeof elapsed, progress->elapsed_s);
    int at = snprintf(tail, sizeof tail, " %3.0f %% %s, left %s, %s", 100 * progress->share, elapsed, left,
                      progress->stage ? progress->stage : "");
    if (progress->steps > 0)
        at += snprintf(tail + at, sizeof tail - (size_t)at, " %lld/%lld", (long long)progress->step,
                       (long long)progress->steps);
    if (progress->windows > 1 && at < (int)sizeof tail)
        at += snprintf(tail + at, sizeof tail - (size_t)at, " of window %lld/%lld",
                       (long long)progress->window + 1, (long long)progress->windows);
    if (isfinite(progress->loss) && at < (int)sizeof tail)
        snprintf(tail + at, sizeof tail - (size_t)at, ", loss %.3g", progress->loss);
    enum { CELLS = 20 };
    double share = fmin(fmax(progress->share, 0), 1);
    for (int i = 0; i < CELLS; i++) bar[i] = i < (int)(share * CELLS) ? '=' : ' ';
    bar[CELLS] = 0;
    int room = terminal_width() - CELLS - 3;
    fprintf(stderr, "\r\033[K[%s]%.*s", bar, room > 0 ? room : 0, tail);
    fflush(stderr);
    reporter->bar_drawn = true;
}

void npg_reporter_print(const npg_reporter *reporter, json_t *record)
{
    bool is_shown = reporter->show == NPG_SHOW_JSON;
    char *text = is_shown ? json_dumps(record, JSON_COMPACT | JSON_REAL_PRECISION(6)) : NULL;
    if (text) puts(text);
    fflush(stdout);
    free(text);
    json_decref(record);
}

static void print_json(const npg_reporter *reporter, const npg_progress *progress)
{
    npg_reporter_print(
        reporter, json_pack("{ss ss so so so sI sI sI sI sI sI so}", "event", "progress", "stage",
                            progress->stage ? progress->stage : "", "share", npg_json_real(progress->share),
                            "elapsed_s", npg_json_real(progress->elapsed_s), "left_s",
                            npg_json_real(progress->left_s >= 0 ? progress->left_s : (double)NAN),
                            "frames_done", (json_int_t)progress->frames_done, "frames",
                            (json_int_t)progress->frames, "step", (json_int_t)progress->step, "steps",
                            (json_int_t)progress->steps, "window", (json_int_t)progress->window, "windows",
                            (json_int_t)progress->windows, "loss", npg_json_real(progress->loss)));
}

static void show_progress(void *user, const npg_progress *progress)
{
    npg_reporter *reporter = user;
    if (reporter->show == NPG_SHOW_BAR) draw_bar(reporter, progress);
    if (reporter->show == NPG_SHOW_JSON) print_json(reporter, progress);
}

npg_hooks npg_reporter_hooks(npg_reporter *reporter)
{
    return (npg_hooks){sizeof(npg_hooks), reporter, show_record, show_progress};
}

void npg_reporter_end(npg_reporter *reporter, npg_status status, const char *output)
{
    npg_reporter_pause(reporter);
    json_t *line = json_pack("{s:s,s:s,s:i,s:o}", "event", "end", "status", npg_status_name(status),
                             "exit_code", npg_status_exit_code(status), "output", npg_json_text(output));
    if (line && status < 0) json_object_set_new(line, "message", npg_json_text(npg_error_text()));
    npg_log_file_write(&reporter->log_fd, json_incref(line));
    npg_reporter_print(reporter, line);
    if (reporter->log_fd >= 0) close(reporter->log_fd);
    reporter->log_fd = -1;
}

void npg_reporter_log(npg_reporter *reporter, npg_log_level level, double time_s, const char *stage,
                      const char *format, ...)
{
    char text[900];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    npg_log_record record = {sizeof record, level, time_s, stage, -1, text};
    show_record(reporter, &record);
}
