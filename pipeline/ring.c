/* Ring: a bounded queue of chunks between two stages.  Latch: a count behind a condition variable. */
#include "pipeline/ring.h"

#include <pthread.h>
#include <stdbool.h>

#include "pipeline/clock.h"
#include "pipeline/memory.h"

typedef enum ring_state { RING_OPEN, RING_ENDED, RING_ABORTED } ring_state;

struct npg_ring {
    npg_arena arena; /* of the slots */
    pthread_mutex_t lock;
    pthread_cond_t
        changed; /* one side waits for it at a time: the producer for room, or the consumer for chunks */
    ring_state state;
    size_t capacity, count, first;
    double push_wait_s, pop_wait_s;
    npg_chunk **slots; /* capacity of them, with the chunks in them */
};

npg_status npg_ring_open(npg_ring **out, size_t capacity)
{
    npg_ring *ring;
    NPG_REQUIRE(capacity >= 1);
    NPG_TRY(npg_object_open(&ring, NPG_FOR_RUN, sizeof *ring));
    ring->capacity = capacity;
    pthread_mutex_init(&ring->lock, NULL);
    pthread_cond_init(&ring->changed, NULL);
    ring->slots = npg_arena_take(&ring->arena, capacity, sizeof *ring->slots);
    npg_status status = npg_arena_status(&ring->arena);
    if (status) npg_ring_close(&ring);
    *out = ring;
    return status;
}

static void drop_all(npg_ring *ring)
{
    for (; ring->count; ring->count--) {
        npg_chunk_close(&ring->slots[ring->first]);
        ring->first = (ring->first + 1) % ring->capacity;
    }
}

void npg_ring_close(npg_ring **slot)
{
    npg_ring *ring = *slot;
    if (!ring) return;
    drop_all(ring);
    pthread_cond_destroy(&ring->changed);
    pthread_mutex_destroy(&ring->lock);
    npg_object_close(slot);
}

npg_status npg_ring_push(npg_ring *ring, npg_chunk **chunk)
{
    npg_status status = NPG_OK;
    pthread_mutex_lock(&ring->lock);
    double since = npg_clock_s();
    while (ring->state == RING_OPEN && ring->count == ring->capacity)
        pthread_cond_wait(&ring->changed, &ring->lock);
    ring->push_wait_s += npg_clock_s() - since;
    if (ring->state == RING_OPEN) {
        ring->slots[(ring->first + ring->count++) % ring->capacity] = *chunk;
        *chunk = NULL;
        pthread_cond_signal(&ring->changed);
    } else {
        status = ring->state == RING_ABORTED ? NPG_ABORTED
                                             : npg_error(NPG_USAGE, "pushed into a ring that has ended");
    }
    pthread_mutex_unlock(&ring->lock);
    return status;
}

npg_status npg_ring_pop(npg_ring *ring, npg_chunk **chunk)
{
    npg_status status = NPG_OK;
    pthread_mutex_lock(&ring->lock);
    double since = npg_clock_s();
    while (ring->state == RING_OPEN && !ring->count) pthread_cond_wait(&ring->changed, &ring->lock);
    ring->pop_wait_s += npg_clock_s() - since;
    if (ring->state == RING_ABORTED) {
        status = NPG_ABORTED;
    } else if (!ring->count) {
        status = NPG_END;
    } else {
        *chunk = ring->slots[ring->first];
        ring->slots[ring->first] = NULL;
        ring->first = (ring->first + 1) % ring->capacity;
        ring->count--;
        pthread_cond_signal(&ring->changed);
    }
    pthread_mutex_unlock(&ring->lock);
    return status;
}

/* From OPEN to one of the two ends; an abort also takes the place of an end. */
static void set_end(npg_ring *ring, ring_state state)
{
    pthread_mutex_lock(&ring->lock);
    if (state == RING_ABORTED || ring->state == RING_OPEN) ring->state = state;
    if (ring->state == RING_ABORTED) drop_all(ring);
    pthread_cond_broadcast(&ring->changed);
    pthread_mutex_unlock(&ring->lock);
}

void npg_ring_end(npg_ring *ring)
{
    set_end(ring, RING_ENDED);
}
void npg_ring_abort(npg_ring *ring)
{
    set_end(ring, RING_ABORTED);
}

void npg_ring_waits(npg_ring *ring, double *push_wait_s, double *pop_wait_s)
{
    pthread_mutex_lock(&ring->lock);
    *push_wait_s = ring->push_wait_s;
    *pop_wait_s = ring->pop_wait_s;
    pthread_mutex_unlock(&ring->lock);
}

/* ---- latch ---- */

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
