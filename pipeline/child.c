/* Child: run a helper program with bytes in, bytes out, a time limit and a way to stop it. */
#include "pipeline/child.h"

#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "pipeline/clock.h"
#include "pipeline/memory.h"

extern char **environ;

#define POLL_MS        100 /* should_stop and the time limit are checked this often */
#define EXIT_NO_MEMORY 6   /* by agreement with the helpers, as of neupig itself */

typedef struct child {
    const npg_child_job *job;
    pid_t pid;
    int in, out, err;    /* our ends of its standard streams; -1: closed */
    size_t sent;         /* bytes of the input */
    size_t capacity;     /* of the output */
    size_t error_length; /* of what is kept of its standard error */
    npg_child_result *result;
} child;

/* ---- where the program is ---- */

static const char library_mark[] = "an address in this library";

/* Beside a file (a build folder), or in a folder of the installation, seen from PREFIX/bin, PREFIX/lib or
 * PREFIX/lib/<machine>. */
static bool find_near(char path[4096], const char *file, const char *folder, const char *name)
{
    static const char *const ways[] = {"", "../", "../../"};
    const char *slash = strrchr(file, '/');
    for (size_t i = 0; slash && i < sizeof ways / sizeof *ways; i++) {
        int length =
            snprintf(path, 4096, "%.*s%s%s%s", (int)(slash - file + 1), file, ways[i], i ? folder : "", name);
        if (length < 4096 && access(path, R_OK) == 0) return true;
    }
    return false;
}

/* What was installed can be moved, and the program may be anybody's. */
bool npg_find_installed(char path[4096], const char *folder, const char *name)
{
    char self[PATH_MAX];
    Dl_info library = {.dli_fname = NULL};
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    self[length > 0 ? length : 0] = 0;
    return find_near(path, self, folder, name) || (dladdr(library_mark, &library) && library.dli_fname &&
                                                   find_near(path, library.dli_fname, folder, name));
}

static npg_status find_program(char path[4096], const char *name)
{
    snprintf(path, 4096, "%s", name);
    if (*name != '/' && npg_find_installed(path, "libexec/neupig/", name)) return NPG_OK;
    if (*name != '/') snprintf(path, 4096, "%s/%s", NPG_LIBEXEC_DIR, name);
    if (access(path, X_OK) == 0) return NPG_OK;
    return npg_error(NPG_FAILED,
                     "the helper program %s is neither beside the program nor beside the library nor in %s",
                     name, NPG_LIBEXEC_DIR);
}

/* ---- start ---- */

static void close_end(int *fd)
{
    if (*fd >= 0) close(*fd);
    *fd = -1;
}

/* Our environment, and that a thread of OpenMP's which waits for another one sleeps, unless the user says otherwise: where
 * the cores are shared with other work, spinning costs more than the second thread gains.  The runtime reads this while
 * it is loaded, before any code of the helper. */
static npg_status make_environment(char ***made)
{
    static char waits[] = "OMP_WAIT_POLICY=passive";
    size_t count = 0;
    while (environ && environ[count]) count++;
    NPG_TRY(npg_alloc_array(made, NPG_FOR_RUN, count + 2, sizeof **made)); /* it ends with zero */
    if (count) memcpy(*made, environ, count * sizeof **made);
    if (!getenv("OMP_WAIT_POLICY")) (*made)[count] = waits;
    return NPG_OK;
}

/* Signals that the host blocks or ignores must not change what the child does. */
static npg_status spawn(child *c, const char *path, int in, int out, int err)
{
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, all;
    char parent[24], *arguments[] = {(char *)(uintptr_t)path, parent, NULL}, **environment;
    NPG_TRY(make_environment(&environment));
    snprintf(parent, sizeof parent, "%ld", (long)getpid());
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    posix_spawn_file_actions_adddup2(&actions, in, 0);
    posix_spawn_file_actions_adddup2(&actions, out, 1);
    posix_spawn_file_actions_adddup2(&actions, err, 2);
    posix_spawn_file_actions_addclosefrom_np(&actions, 3);
    sigemptyset(&none);
    sigfillset(&all);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &all);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    int error = posix_spawn(&c->pid, path, &actions, &attributes, arguments, environment);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    npg_release(&environment);
    errno = error;
    return error ? npg_error_errno(NPG_FAILED, "can't start %s", path) : NPG_OK;
}

/* Sockets instead of pipes: a write to a dead child must not raise SIGPIPE in the host. */
static npg_status start(child *c, const char *path)
{
    int in[2] = {-1, -1}, out[2] = {-1, -1}, err[2] = {-1, -1};
    npg_status status = NPG_OK;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, in) || pipe2(out, O_CLOEXEC) ||
        pipe2(err, O_CLOEXEC))
        status = npg_error_errno(NPG_FAILED, "can't make a pipe to %s", path);
    if (!status) status = spawn(c, path, in[1], out[1], err[1]);
    close_end(&in[1]);
    close_end(&out[1]);
    close_end(&err[1]);
    c->in = in[0];
    c->out = out[0];
    c->err = err[0];
    if (status) return status;
    fcntl(c->in, F_SETFL, O_NONBLOCK);
    fcntl(c->out, F_SETFL, O_NONBLOCK);
    fcntl(c->err, F_SETFL, O_NONBLOCK);
    return NPG_OK;
}

/* ---- its input and output ---- */

#define READ_MIN 65536 /* free room before each read of the output: what a pipe holds */

static void send_input(child *c)
{
    const npg_child_job *job = c->job;
    size_t first = job->input_size[0], part = c->sent >= first, skip = part ? c->sent - first : c->sent;
    size_t left = job->input_size[part] - skip;
    ssize_t put = left ? send(c->in, (const char *)job->input[part] + skip, left, MSG_NOSIGNAL) : 0;
    if (put > 0) c->sent += (size_t)put;
    bool broken = put < 0 && errno != EAGAIN && errno != EINTR;
    if (broken || c->sent == first + job->input_size[1]) close_end(&c->in);
}

static npg_status read_output(child *c)
{
    npg_child_result *r = c->result;
    if (c->capacity - r->output_size < READ_MIN)
        NPG_TRY(npg_grow(&r->output, &c->capacity, r->output_size + READ_MIN, 1, NPG_FOR_MESH));
    ssize_t got = read(c->out, r->output + r->output_size, c->capacity - r->output_size);
    if (got > 0) r->output_size += (size_t)got;
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) close_end(&c->out);
    if (r->output_size > c->job->output_max)
        return npg_error(NPG_FAILED, "%s answers with more than %zu bytes", c->job->program,
                         c->job->output_max);
    return NPG_OK;
}

/* Keep the end of what the child prints on standard error. */
static void read_errors(child *c)
{
    char text[256], *kept = c->result->last_line;
    size_t room = sizeof c->result->last_line - 1;
    ssize_t got = read(c->err, text, sizeof text);
    if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) close_end(&c->err);
    for (ssize_t i = 0; i < got; i++) {
        if (c->error_length == room) memmove(kept, kept + 1, --c->error_length);
        kept[c->error_length++] = text[i];
    }
}

static npg_status exchange(child *c)
{
    double end_s = npg_clock_s() + c->job->time_limit_s;
    while (c->out >= 0 || c->err >= 0) {
        struct pollfd ends[3] = {{c->in, POLLOUT, 0}, {c->out, POLLIN, 0}, {c->err, POLLIN, 0}};
        poll(ends, 3, POLL_MS);
        if (c->job->should_stop && c->job->should_stop(c->job->user)) return NPG_STOPPED;
        if (npg_clock_s() > end_s)
            return npg_error(NPG_FAILED, "%s was not done after %g s and was stopped", c->job->program,
                             c->job->time_limit_s);
        if (ends[0].revents) send_input(c);
        if (ends[1].revents) NPG_TRY(read_output(c));
        if (ends[2].revents) read_errors(c);
    }
    return NPG_OK;
}

/* ---- end ---- */

void npg_keep_last_line(char *text)
{
    size_t length = strlen(text);
    while (length && (text[length - 1] == '\n' || text[length - 1] == '\r')) text[--length] = 0;
    char *line = strrchr(text, '\n');
    if (line) memmove(text, line + 1, strlen(line));
}

static npg_status judge(const child *c, int how)
{
    const char *program = c->job->program, *line = c->result->last_line;
    if (WIFEXITED(how) && WEXITSTATUS(how) == 0) return NPG_OK;
    if (WIFSIGNALED(how))
        return npg_error(NPG_FAILED, "%s was killed by signal %d (%s)%s%s", program, WTERMSIG(how),
                         strsignal(WTERMSIG(how)), *line ? ": " : "", line);
    return npg_error(WEXITSTATUS(how) == EXIT_NO_MEMORY ? NPG_MEMORY : NPG_FAILED,
                     "%s ended with exit code %d%s%s", program, WEXITSTATUS(how), *line ? ": " : "", line);
}

/* A host that ignores SIGCHLD gets no exit status: then the answer's own end mark must do. */
static npg_status reap(child *c, npg_status status)
{
    int how = 0;
    pid_t pid;
    close_end(&c->in);
    close_end(&c->out);
    close_end(&c->err);
    if (status) kill(c->pid, SIGKILL);
    do pid = waitpid(c->pid, &how, 0);
    while (pid < 0 && errno == EINTR);
    npg_keep_last_line(c->result->last_line);
    return status || pid < 0 ? status : judge(c, how);
}

npg_status npg_child_run(npg_child_result *result, const npg_child_job *job)
{
    char path[4096];
    child c = {.job = job, .in = -1, .out = -1, .err = -1, .result = result};
    memset(result, 0, sizeof *result);
    NPG_TRY(find_program(path, job->program));
    npg_status status = start(&c, path);
    if (!status) {
        status = reap(&c, exchange(&c));
    } else {
        close_end(&c.in);
        close_end(&c.out);
        close_end(&c.err);
    }
    if (status) npg_release(&result->output);
    return status;
}
