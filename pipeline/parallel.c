/* Parallel: a pool of threads that do the parts of one piece of work. */
#include "pipeline/parallel.h"

#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <unistd.h>

/* What one call of npg_parallel() asks for; on its stack. */
typedef struct work {
    npg_part part;
    void *user;
    size_t count, next, left; /* parts, the next to be taken, those that are not done yet */
    size_t failed;            /* the lowest part that failed, count: none                 */
    npg_status status;        /* of that part ...                                         */
    char error[512];          /* ... with its text, which is per thread (npg_error_text)   */
    struct work *below;
} work;

/* One lock for all: parts are few and long against what is done under it. */
static struct pool {
    pthread_mutex_t lock;
    pthread_cond_t has_parts, has_ended;
    work *top; /* with parts to be taken, the newest first: what was asked for inside a part ends before it */
    size_t threads, idle;
} pool = {.lock = PTHREAD_MUTEX_INITIALIZER,
          .has_parts = PTHREAD_COND_INITIALIZER,
          .has_ended = PTHREAD_COND_INITIALIZER};

static size_t core_count(void)
{
    cpu_set_t set;
    if (!sched_getaffinity(0, sizeof set, &set)) return (size_t)CPU_COUNT(&set);
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    return cores < 1 ? 1 : (size_t)cores;
}

static void take_off(const work *w)
{
    work **at = &pool.top;
    while (*at != w) at = &(*at)->below;
    *at = w->below;
}

/* Do the work's next part; the lock is held before and behind it, and open meanwhile. */
static void do_part(work *w)
{
    size_t index = w->next++;
    if (w->next == w->count) take_off(w);
    pthread_mutex_unlock(&pool.lock);
    npg_status status = w->part(w->user, index);
    pthread_mutex_lock(&pool.lock);
    if (status && index < w->failed) {
        w->failed = index;
        w->status = status;
        snprintf(w->error, sizeof w->error, "%s", npg_error_text());
    }
    if (!--w->left) pthread_cond_broadcast(&pool.has_ended);
}

static void *serve(void *unused)
{
    (void)unused;
    pthread_mutex_lock(&pool.lock);
    for (;;) {
        pool.idle++;
        while (!pool.top) pthread_cond_wait(&pool.has_parts, &pool.lock);
        pool.idle--;
        do_part(pool.top);
    }
    return NULL;
}

/* A child that was forked has none of the threads. */
static void begin_anew(void)
{
    pool = (struct pool){.lock = PTHREAD_MUTEX_INITIALIZER,
                         .has_parts = PTHREAD_COND_INITIALIZER,
                         .has_ended = PTHREAD_COND_INITIALIZER};
}

static void watch_forks(void)
{
    pthread_atfork(NULL, NULL, begin_anew);
}

/* One thread for each core but the caller's.  They are there until the process ends. */
static void start_threads(void)
{
    pthread_attr_t detached;
    pthread_t thread;
    if (pool.threads || pthread_attr_init(&detached)) return;
    pthread_attr_setdetachstate(&detached, PTHREAD_CREATE_DETACHED);
    for (size_t i = 1; i < core_count(); i++)
        pool.threads += !pthread_create(&thread, &detached, serve, NULL);
    pthread_attr_destroy(&detached);
}

npg_status npg_parallel(npg_part part, void *user, size_t count)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    if (!count) return NPG_OK;
    if (count == 1) return part(user, 0);
    work w = {.part = part, .user = user, .count = count, .left = count, .failed = count};
    pthread_once(&once, watch_forks);
    pthread_mutex_lock(&pool.lock);
    start_threads();
    w.below = pool.top;
    pool.top = &w;
    for (size_t i = 1; i < count && i <= pool.idle; i++) pthread_cond_signal(&pool.has_parts);
    while (w.next < count) do_part(&w);
    while (w.left) pthread_cond_wait(&pool.has_ended, &pool.lock);
    pthread_mutex_unlock(&pool.lock);
    return w.failed < count ? npg_error(w.status, "%s", w.error) : NPG_OK;
}

size_t npg_parallel_parts(size_t count, size_t least, size_t most)
{
    size_t parts = core_count();
    if (most && parts > most) parts = most;
    /* One part more than full ones: below `least` items there is one, from there on two. */
    if (parts > count / least + 1) parts = count / least + 1;
    return parts > NPG_PARALLEL_MAX ? NPG_PARALLEL_MAX : parts;
}
