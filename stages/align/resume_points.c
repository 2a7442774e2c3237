/* Resume points: what stage align needs behind the last frame that a window waits for. */
#include "align/align_internal.h"

#include <string.h>

void npg_resume_points_open(npg_resume_points *list)
{
    pthread_mutex_init(&list->lock, NULL);
}

void npg_resume_points_close(npg_resume_points *list)
{
    for (size_t i = 0; i < list->count; i++) npg_release(&list->points[i].bytes);
    npg_release(&list->points);
    pthread_mutex_destroy(&list->lock);
}

npg_status npg_resume_points_add(npg_resume_points *list, int64_t read, unsigned char *bytes, size_t size)
{
    pthread_mutex_lock(&list->lock);
    npg_status status =
        npg_grow(&list->points, &list->capacity, list->count + 1, sizeof *list->points, NPG_FOR_FIT);
    if (!status) list->points[list->count++] = (struct npg_resume_point){read, bytes, size};
    pthread_mutex_unlock(&list->lock);
    if (status) npg_release(&bytes);
    return status;
}

npg_status npg_resume_points_save(npg_resume_points *list, int64_t read, npg_store *out, const char *block)
{
    size_t past = 0;
    pthread_mutex_lock(&list->lock);
    while (past < list->count && list->points[past].read < read) npg_release(&list->points[past++].bytes);
    list->count -= past;
    if (past) memmove(list->points, list->points + past, list->count * sizeof *list->points);
    const struct npg_resume_point *p = list->count ? &list->points[0] : NULL;
    npg_status status =
        p && p->read == read
            ? npg_store_put(out, block, p->bytes, p->size)
            : npg_error(NPG_FAILED, "no state of the alignment behind %lld frames", (long long)read);
    pthread_mutex_unlock(&list->lock);
    return status;
}
