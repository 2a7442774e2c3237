/* Memory: aligned, zeroed, counted, from the user's allocator;
 * the n-th request can be made to fail. */
#include "pipeline/memory.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "pipeline/struct_size.h"

#define ALIGN 64 /* a cache line, and the widest vector (16 floats) */

typedef struct head { /* sits in the 64 bytes before every block */
    size_t size;
    npg_purpose purpose;
    void *before, *after; /* in an arena: the blocks taken before and after this one */
} head;

_Static_assert(sizeof(head) <= ALIGN, "the head must fit before the block");

static void *default_alloc(void *user, size_t align, size_t size)
{
    (void)user;
    return aligned_alloc(align, (size + align - 1) / align * align);
}

static void default_release(void *user, void *memory)
{
    (void)user;
    free(memory);
}

static npg_allocator allocator = {sizeof(npg_allocator), NULL, default_alloc, default_release};
static _Atomic size_t used_all, peak_all, limit_all;
static _Atomic uint64_t requests, fail_at;
static _Atomic bool fail_from_then_on;

npg_status npg_memory_set_allocator(const npg_allocator *chosen)
{
    if (atomic_load(&used_all))
        return npg_error(NPG_USAGE, "the allocator can't change while %zu bytes are in use",
                         atomic_load(&used_all));
    if (!chosen) {
        allocator = (npg_allocator){sizeof allocator, NULL, default_alloc, default_release};
        return NPG_OK;
    }
    npg_allocator taken;
    NPG_TRY(npg_struct_take(&taken, sizeof taken, chosen, NPG_SIZE_UP_TO(npg_allocator, release),
                            "the allocator"));
    NPG_REQUIRE(taken.alloc && taken.release);
    allocator = taken;
    return NPG_OK;
}

size_t npg_memory_used(void)
{
    return atomic_load(&used_all);
}
size_t npg_memory_peak(void)
{
    return atomic_load(&peak_all);
}
void npg_memory_set_limit(size_t bytes)
{
    atomic_store(&limit_all, bytes);
}

static const char *name_of(npg_purpose purpose)
{
    static const char *const names[NPG_PURPOSES] = {"frames", "mesh",  "fit", "device",
                                                    "query",  "files", "run"};
    return names[purpose];
}

void npg_memory_fail_at(uint64_t n, bool from_then_on)
{
    atomic_store(&fail_from_then_on, from_then_on);
    atomic_store(&fail_at, n ? atomic_load(&requests) + n : 0);
}

static bool must_fail(void)
{
    uint64_t now = atomic_fetch_add(&requests, 1) + 1, at = atomic_load(&fail_at);
    return at && (now == at || (now > at && atomic_load(&fail_from_then_on)));
}

npg_status npg_memory_count(npg_purpose purpose, ptrdiff_t bytes)
{
    size_t change = (size_t)bytes; /* wraps for negative numbers, as the sums below want it */
    size_t now = atomic_fetch_add(&used_all, change) + change, limit = atomic_load(&limit_all);
    if (bytes > 0 && limit && now > limit) {
        atomic_fetch_sub(&used_all, change);
        return npg_error(NPG_MEMORY,
                         "%td more bytes for %s would pass the memory limit of %zu MiB (%zu in use)", bytes,
                         name_of(purpose), limit >> 20, (now - change) >> 20);
    }
    size_t peak = atomic_load(&peak_all);
    while (now > peak && bytes > 0 && !atomic_compare_exchange_weak(&peak_all, &peak, now)) {
    }
    return NPG_OK;
}

npg_status npg_alloc(void *out, npg_purpose purpose, size_t size)
{
    void **result = out;
    *result = NULL;
    if (!size) return NPG_OK;
    if (must_fail() || size > PTRDIFF_MAX - 2 * ALIGN)
        return npg_error(NPG_MEMORY, "no memory: %zu bytes for %s", size, name_of(purpose));
    NPG_TRY(npg_memory_count(purpose, (ptrdiff_t)size));
    unsigned char *block = allocator.alloc(allocator.user, ALIGN, size + ALIGN);
    if (!block) {
        npg_memory_count(purpose, -(ptrdiff_t)size);
        return npg_error(NPG_MEMORY, "no memory: %zu bytes for %s", size, name_of(purpose));
    }
    memset(block, 0, size + ALIGN);
    *(head *)(void *)block = (head){.size = size, .purpose = purpose};
    *result = block + ALIGN;
    return NPG_OK;
}

npg_status npg_alloc_array(void *out, npg_purpose purpose, size_t count, size_t size)
{
    *(void **)out = NULL;
    if (size && count > SIZE_MAX / size)
        return npg_error(NPG_MEMORY, "no memory: %zu x %zu bytes for %s", count, size, name_of(purpose));
    return npg_alloc(out, purpose, count * size);
}

npg_status npg_grow(void *array, size_t *capacity, size_t need, size_t size, npg_purpose purpose)
{
    void **slot = array, *bigger;
    if (need <= *capacity) return NPG_OK;
    size_t count = need > SIZE_MAX / 2 ? need : *capacity + *capacity / 2;
    if (count < need) count = need;
    if (count < 16) count = 16; /* the first few elements would else each move the array */
    NPG_TRY(npg_alloc_array(&bigger, purpose, count, size));
    if (*slot) memcpy(bigger, *slot, *capacity * size);
    npg_release(slot);
    *slot = bigger;
    *capacity = count;
    return NPG_OK;
}

npg_status npg_copy_text(char **out, const char *text)
{
    size_t size = strlen(text) + 1;
    NPG_TRY(npg_alloc(out, NPG_FOR_RUN, size));
    memcpy(*out, text, size);
    return NPG_OK;
}

static head *head_of(void *memory)
{
    return (head *)(void *)((unsigned char *)memory - ALIGN);
}

void npg_release(void *memory)
{
    void **slot = memory;
    if (!*slot) return;
    head h = *head_of(*slot);
    allocator.release(allocator.user, head_of(*slot));
    *slot = NULL;
    npg_memory_count(h.purpose, -(ptrdiff_t)h.size);
}

void *npg_arena_take(npg_arena *arena, size_t count, size_t size)
{
    void *taken;
    if (!arena->status) arena->status = npg_alloc_array(&taken, arena->purpose, count, size);
    if (arena->status || !taken) return NULL;
    head_of(taken)->before = arena->last;
    if (arena->last) head_of(arena->last)->after = taken;
    return arena->last = taken;
}

npg_status npg_arena_grow(npg_arena *arena, void *array, size_t *capacity, size_t need, size_t size)
{
    void **slot = array;
    if (arena->status || need <= *capacity) return arena->status;
    const head links = *slot ? *head_of(*slot) : (head){.before = arena->last};
    arena->status = npg_grow(slot, capacity, need, size, arena->purpose);
    if (arena->status) return arena->status;
    head_of(*slot)->before = links.before;
    head_of(*slot)->after = links.after;
    if (links.before) head_of(links.before)->after = *slot;
    if (links.after) head_of(links.after)->before = *slot;
    if (!links.after) arena->last = *slot;
    return NPG_OK;
}

void *npg_arena_copy(npg_arena *arena, const void *from, size_t count, size_t size)
{
    void *taken = npg_arena_take(arena, count, size);
    if (taken && from) memcpy(taken, from, count * size);
    return taken;
}

char *npg_arena_text(npg_arena *arena, const char *text)
{
    return npg_arena_copy(arena, text, strlen(text) + 1, 1);
}

npg_status npg_arena_status(const npg_arena *arena)
{
    return arena->status;
}

void npg_arena_release(npg_arena *arena)
{
    while (arena->last) {
        void *taken = arena->last;
        arena->last = head_of(taken)->before;
        npg_release(&taken);
    }
    arena->status = NPG_OK;
}

npg_status npg_object_open(void *out, npg_purpose purpose, size_t size)
{
    npg_arena **object = out;
    NPG_TRY(npg_alloc(object, purpose, size));
    (*object)->purpose = purpose;
    return NPG_OK;
}

void npg_object_close(void *object)
{
    npg_arena **slot = object;
    if (*slot) npg_arena_release(*slot);
    npg_release(slot);
}
