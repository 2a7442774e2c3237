/* Memory: aligned, zeroed, counted, from the user's allocator;
 * the n-th request can be made to fail.
 *
 * Threads: all functions may be called from any thread; the counters are atomic. */
#ifndef NPG_MEMORY_H
#define NPG_MEMORY_H

#include <stdbool.h>

#include "pipeline/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum npg_purpose {                 /* what the message of a refusal names */
                           NPG_FOR_FRAMES, /* points, normals and vertices of the frames in flight */
                           NPG_FOR_MESH,   /* reference mesh and what is derived from it           */
                           NPG_FOR_FIT,    /* the optimisation, host side                          */
                           NPG_FOR_DEVICE, /* device buffers                                       */
                           NPG_FOR_QUERY,  /* search structures                                    */
                           NPG_FOR_FILES,  /* readers, writers, lists of names                     */
                           NPG_FOR_RUN,    /* everything small                                     */
                           NPG_PURPOSES
} npg_purpose;

/* size bytes, all zero, aligned to 64; *out is NULL on failure.  size 0 gives NULL and NPG_OK.
 * NPG_MEMORY when the system, the limit or an injected failure refuses. */
npg_status npg_alloc(void *out, npg_purpose purpose, size_t size);

/* The same for count * size, checked for overflow. */
npg_status npg_alloc_array(void *out, npg_purpose purpose, size_t count, size_t size);

/* Make *array hold at least `need` elements of `size` bytes; its content stays, the rest is zero.  *capacity
 * is the number it holds; it grows by half.  On failure array and capacity are as before. */
npg_status npg_grow(void *array, size_t *capacity, size_t need, size_t size, npg_purpose purpose);

/* A copy of text. */
npg_status npg_copy_text(char **out, const char *text);

/* Free *memory (what npg_alloc gave) and null it; NULL inside is fine. */
void npg_release(void *memory);

/* All memory of one object, or the scratch of one function: each array is taken from it, one call frees all.
 * {.purpose = ...} is an empty arena that holds nothing.  It is sticky: after the first refusal every take
 * gives NULL, so take all arrays, then ask once with npg_arena_status().  One thread at a time. */
typedef struct npg_arena {
    npg_purpose purpose;
    npg_status status; /* of the first take that was refused */
    void *last;        /* the array taken last; each knows the one before it */
} npg_arena;

/* count elements of `size` bytes as npg_alloc_array gives them; NULL for none, and on failure. */
void *npg_arena_take(npg_arena *arena, size_t count, size_t size);

/* The same, filled with a copy of what lies at `from` (NULL: zeroes). */
void *npg_arena_copy(npg_arena *arena, const void *from, size_t count, size_t size);

/* npg_grow() of an array that is NULL or was grown in this arena; NPG_MEMORY once a take was refused. */
npg_status npg_arena_grow(npg_arena *arena, void *array, size_t *capacity, size_t need, size_t size);

/* A copy of text. */
char *npg_arena_text(npg_arena *arena, const char *text);

/* NPG_OK, or NPG_MEMORY once a take was refused; the error text is the refusal's. */
npg_status npg_arena_status(const npg_arena *arena);

/* Free all that was taken; the arena is empty again and good, with the same purpose. */
void npg_arena_release(npg_arena *arena);

/* An object whose first member is the arena of all that it has; and free both (NULL inside is fine). */
npg_status npg_object_open(void *out, npg_purpose purpose, size_t size);
void npg_object_close(void *object);

/* Count bytes that another library holds for us; negative gives them back.  NPG_MEMORY when the limit is
 * passed (the count is then unchanged). */
npg_status npg_memory_count(npg_purpose purpose, ptrdiff_t bytes);

/* No more than this many bytes in use (0: no limit). */
void npg_memory_set_limit(size_t bytes);

/* Tests: the n-th request from now (1 is the next) fails, and so do all after it when
 * `from_then_on`; 0 ends that. */
void npg_memory_fail_at(uint64_t n, bool from_then_on);

#ifdef __cplusplus
}
#endif

#endif
