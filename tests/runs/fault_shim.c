/* Fault shim: makes a system fail under the command, by LD_PRELOAD.
 *
 *     NPG_FAULT=KIND:N[+]      the N-th write below NPG_FAULT_UNDER (N-th and all later ones with +) does
 *                              KIND: ENOSPC, EIO, SHORT (half of the bytes), EINTR;
 *                              SYNC: the N-th fsync has EIO; RENAME: the N-th rename has EIO
 *     NPG_FAULT_UNDER=DIR      absolute; only files in this folder count
 *     NPG_FAULT_MARK=FILE      appears once the fault has happened
 *     NPG_FAULT_SIGNAL=NUMBER:KIND:INDEX
 *                              the process gets this signal, once, behind the first record of this kind, of this index
 *                              or a later one, that it has written into a store (pipeline/store.h)
 *     NPG_FAULT_CLOCK=SECONDS  the calendar clock jumps by this much to and fro with every look at it
 *     NPG_FAULT_KERNEL=A=>B    in the OpenCL sources that are built, A is B
 *     NPG_FAULT_DRIVER=WORDS   the OpenCL driver says these when it is first asked, and aborts
 */
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>

enum kind { NONE, NO_SPACE, BROKEN, SHORT, INTERRUPTED, SYNC, RENAME };

static enum kind kind;
static long at;
static int from_then_on;
static const char *under, *mark;
static _Atomic long seen;

__attribute__((constructor)) static void read_orders(void)
{
    static const struct {
        const char *name;
        enum kind kind;
    } kinds[] = {{"ENOSPC", NO_SPACE},   {"EIO", BROKEN}, {"SHORT", SHORT},
                 {"EINTR", INTERRUPTED}, {"SYNC", SYNC},  {"RENAME", RENAME}};
    const char *order = getenv("NPG_FAULT"), *colon = order ? strchr(order, ':') : NULL;
    under = getenv("NPG_FAULT_UNDER");
    mark = getenv("NPG_FAULT_MARK");
    if (!colon || !under) return;
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        if (strlen(kinds[i].name) == (size_t)(colon - order) &&
            !strncmp(order, kinds[i].name, (size_t)(colon - order)))
            kind = kinds[i].kind;
    char *end;
    at = strtol(colon + 1, &end, 10);
    from_then_on = *end == '+';
}

/* Whether this call, one of its kind on a file of ours, is the one. */
static int is_time(void)
{
    long now = atomic_fetch_add(&seen, 1) + 1;
    if (now != at && !(from_then_on && now > at)) return 0;
    if (mark) close(open(mark, O_WRONLY | O_CREAT | O_CLOEXEC, 0666));
    return 1;
}

static int is_under(const char *path)
{
    size_t size = strlen(under);
    return !strncmp(path, under, size) && (path[size] == '/' || !path[size]);
}

static int is_ours(int fd)
{
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, path, sizeof path - 1);
    if (size < 0) return 0;
    path[size] = 0;
    return is_under(path);
}

/* Bytes that this write may do: all, half of them, or -1 with errno. */
static ssize_t allowed(int fd, size_t size)
{
    if (kind < NO_SPACE || kind > INTERRUPTED || !is_ours(fd) || !is_time()) return (ssize_t)size;
    if (kind == SHORT) return (ssize_t)(size / 2 ? size / 2 : size);
    errno = kind == NO_SPACE ? ENOSPC : kind == BROKEN ? EIO : EINTR;
    return -1;
}

ssize_t write(int fd, const void *data, size_t size)
{
    ssize_t now = allowed(fd, size);
    return now < 0 ? -1 : syscall(SYS_write, fd, data, (size_t)now);
}

ssize_t writev(int fd, const struct iovec *parts, int count)
{
    ssize_t now = count > 0 ? allowed(fd, parts[0].iov_len) : 0;
    if (now < 0) return -1;
    return count > 0 && (size_t)now < parts[0].iov_len
               ? syscall(SYS_write, fd, parts[0].iov_base, (size_t)now)
               : syscall(SYS_writev, fd, parts, count);
}

/* A record's head is written last: the record that it begins is whole. */
static void signal_behind(const void *data, size_t size)
{
    static _Atomic int is_done;
    struct {
        char magic[8], kind[8];
        int64_t index;
    } head;
    char wanted[8];
    int number;
    long index;
    const char *order = getenv("NPG_FAULT_SIGNAL");
    if (!order || size < sizeof head || sscanf(order, "%d:%7[^:]:%ld", &number, wanted, &index) != 3) return;
    memcpy(&head, data, sizeof head);
    if (!memcmp(head.magic, "NPGREC01", sizeof head.magic) && !strncmp(head.kind, wanted, sizeof head.kind) &&
        head.index >= index && !atomic_exchange(&is_done, 1))
        kill(getpid(), number);
}

ssize_t pwrite(int fd, const void *data, size_t size, off_t place)
{
    ssize_t now = allowed(fd, size);
    if (now >= 0) now = syscall(SYS_pwrite64, fd, data, (size_t)now, place);
    signal_behind(data, now < 0 ? 0 : (size_t)now);
    return now;
}

ssize_t pwrite64(int fd, const void *data, size_t size, off_t place)
{
    return pwrite(fd, data, size, place);
}

int fsync(int fd)
{
    if (kind != SYNC || !is_ours(fd) || !is_time()) return (int)syscall(SYS_fsync, fd);
    errno = EIO;
    return -1;
}

int fdatasync(int fd)
{
    if (kind != SYNC || !is_ours(fd) || !is_time()) return (int)syscall(SYS_fdatasync, fd);
    errno = EIO;
    return -1;
}

int rename(const char *from, const char *to)
{
    char whole[4096];
    const char *path = to[0] == '/' ? to : whole;
    if (kind == RENAME && to[0] != '/' && getcwd(whole, sizeof whole)) {
        size_t used = strlen(whole);
        snprintf(whole + used, sizeof whole - used, "/%s", to);
    }
    if (kind != RENAME || !is_under(path) || !is_time())
        return (int)syscall(SYS_renameat, AT_FDCWD, from, AT_FDCWD, to);
    errno = EIO;
    return -1;
}

/* ---- the calendar clock ---- */

static long jump(void)
{
    static _Atomic unsigned looks;
    const char *text = getenv("NPG_FAULT_CLOCK");
    return text ? (atomic_fetch_add(&looks, 1) % 2 ? 1 : -1) * atol(text) : 0;
}

int clock_gettime(clockid_t clock, struct timespec *now)
{
    int status = (int)syscall(SYS_clock_gettime, clock, now);
    if (!status && clock == CLOCK_REALTIME) now->tv_sec += jump();
    return status;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone)
{
    int status = (int)syscall(SYS_gettimeofday, now, zone);
    if (!status) now->tv_sec += jump();
    return status;
}

time_t time(time_t *out)
{
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (out) *out = now.tv_sec;
    return now.tv_sec;
}

/* ---- the driver ---- */

cl_int clGetPlatformIDs(cl_uint capacity, cl_platform_id *platforms, cl_uint *count)
{
    typedef cl_int get(cl_uint, cl_platform_id *, cl_uint *);
    get *real = NULL;
    const char *words = getenv("NPG_FAULT_DRIVER");
    *(void **)&real = dlsym(RTLD_NEXT, "clGetPlatformIDs");
    if (!words) return real(capacity, platforms, count);
    fprintf(stderr, "%s\n", words);
    abort();
}

/* ---- kernels ---- */

static char *altered(const char *text, const char *order)
{
    const char *arrow = strstr(order, "=>");
    char wanted[256];
    if (!arrow || (size_t)(arrow - order) >= sizeof wanted) return NULL;
    memcpy(wanted, order, (size_t)(arrow - order));
    wanted[arrow - order] = 0;
    const char *place = strstr(text, wanted);
    if (!place) return NULL;
    size_t size = strlen(text) + strlen(arrow) + 1;
    char *out = malloc(size);
    if (out) snprintf(out, size, "%.*s%s%s", (int)(place - text), text, arrow + 2, place + strlen(wanted));
    return out;
}

cl_program clCreateProgramWithSource(cl_context context, cl_uint count, const char **texts,
                                     const size_t *lengths, cl_int *code)
{
    typedef cl_program create(cl_context, cl_uint, const char **, const size_t *, cl_int *);
    create *real = NULL;
    const char *order = getenv("NPG_FAULT_KERNEL");
    *(void **)&real = dlsym(RTLD_NEXT, "clCreateProgramWithSource");
    char *other = order && count == 1 && !lengths ? altered(texts[0], order) : NULL;
    const char *one = other;
    cl_program program = real(context, count, other ? &one : texts, lengths, code);
    free(other);
    return program;
}
