/* Parallel: threads for the parts of one piece of work. */
#include "parallel.h"

#include <pthread.h>
#include <stdbool.h>
#include <unistd.h>

typedef struct helper {
    npg_part part;
    void *user;
    size_t index;
    pthread_t thread;
    bool is_started;
} helper;

static void *do_part(void *argument)
{
    const helper *h = argument;
    h->part(h->user, h->index);
    return NULL;
}

void npg_parallel(npg_part part, void *user, size_t count)
{
    helper helpers[NPG_PARALLEL_MAX];
    if (count > NPG_PARALLEL_MAX) count = NPG_PARALLEL_MAX;
    for (size_t i = 0; i < count; i++) {
        helpers[i] = (helper){.part = part, .user = user, .index = i};
        if (i) helpers[i].is_started = !pthread_create(&helpers[i].thread, NULL, do_part, &helpers[i]);
    }
    for (size_t i = 0; i < count; i++)
        if (!helpers[i].is_started) part(user, i);
    for (size_t i = 1; i < count; i++)
        if (helpers[i].is_started) pthread_join(helpers[i].thread, NULL);
}

size_t npg_parallel_parts(size_t count, size_t least, size_t most)
{
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    size_t parts = cores < 1 ? 1 : (size_t)cores;
    if (most && parts > most) parts = most;
    if (parts > count / least + 1) parts = count / least + 1;
    return parts > NPG_PARALLEL_MAX ? NPG_PARALLEL_MAX : parts;
}
