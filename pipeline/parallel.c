/* Parallel: threads for the parts of one piece of work. */
#include "pipeline/parallel.h"

#include <pthread.h>
#include <stdbool.h>
#include <stdio.h>
#include <unistd.h>

typedef struct helper {
    npg_part part;
    void *user;
    size_t index;
    pthread_t thread;
    bool is_started;
    npg_status status;
    char error[512]; /* its error text, which is per thread (npg_error_text) */
} helper;

static void *do_part(void *argument)
{
    helper *h = argument;
    h->status = h->part(h->user, h->index);
    if (h->status) snprintf(h->error, sizeof h->error, "%s", npg_error_text());
    return NULL;
}

npg_status npg_parallel(npg_part part, void *user, size_t count)
{
    helper helpers[NPG_PARALLEL_MAX];
    if (count > NPG_PARALLEL_MAX) count = NPG_PARALLEL_MAX;
    for (size_t i = 0; i < count; i++) {
        helpers[i].part = part;
        helpers[i].user = user;
        helpers[i].index = i;
        helpers[i].is_started = i && !pthread_create(&helpers[i].thread, NULL, do_part, &helpers[i]);
    }
    for (size_t i = 0; i < count; i++)
        if (!helpers[i].is_started) do_part(&helpers[i]);
    for (size_t i = 1; i < count; i++)
        if (helpers[i].is_started) pthread_join(helpers[i].thread, NULL);
    for (size_t i = 0; i < count; i++)
        if (helpers[i].status) return npg_error(helpers[i].status, "%s", helpers[i].error);
    return NPG_OK;
}

size_t npg_parallel_parts(size_t count, size_t least, size_t most)
{
    long cores = sysconf(_SC_NPROCESSORS_ONLN);
    size_t parts = cores < 1 ? 1 : (size_t)cores;
    if (most && parts > most) parts = most;
    /* One part more than full ones: below `least` items there is one, from there on two. */
    if (parts > count / least + 1) parts = count / least + 1;
    return parts > NPG_PARALLEL_MAX ? NPG_PARALLEL_MAX : parts;
}
