/* Latch: a count behind a condition variable. */
#include "pipeline/latch.h"

#include <pthread.h>
#include <stdbool.h>

#include "pipeline/memory.h"

struct npg_latch {
    pthread_mutex_t lock; /* guards what follows */
    pthread_cond_t changed;
    int64_t count;
    bool is_aborted;
};

npg_status npg_latch_open(npg_latch **latch, int64_t count)
{
    NPG_TRY(npg_alloc(latch, NPG_FOR_RUN, sizeof **latch));
    pthread_mutex_init(&(*latch)->lock, NULL);
    pthread_cond_init(&(*latch)->changed, NULL);
    (*latch)->count = count;
    return NPG_OK;
}

void npg_latch_close(npg_latch **latch)
{
    if (!*latch) return;
    pthread_cond_destroy(&(*latch)->changed);
    pthread_mutex_destroy(&(*latch)->lock);
    npg_release(latch);
}

void npg_latch_raise(npg_latch *latch, int64_t count)
{
    pthread_mutex_lock(&latch->lock);
    if (count > latch->count) latch->count = count;
    pthread_cond_broadcast(&latch->changed);
    pthread_mutex_unlock(&latch->lock);
}

npg_status npg_latch_wait(npg_latch *latch, int64_t count)
{
    pthread_mutex_lock(&latch->lock);
    while (latch->count < count && !latch->is_aborted) pthread_cond_wait(&latch->changed, &latch->lock);
    npg_status status = latch->is_aborted ? NPG_ABORTED : NPG_OK;
    pthread_mutex_unlock(&latch->lock);
    return status;
}

void npg_latch_abort(npg_latch *latch)
{
    pthread_mutex_lock(&latch->lock);
    latch->is_aborted = true;
    pthread_cond_broadcast(&latch->changed);
    pthread_mutex_unlock(&latch->lock);
}
