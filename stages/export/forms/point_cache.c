/* Point cache: what PC2 and MDD share, a header and then the vertices of every frame as float32. */
#include "export/forms/point_cache.h"

#include <stdio.h>
#include <unistd.h>

#include "export/forms/write_obj.h"
#include "pipeline/file.h"

npg_status npg_cache_check(const char *form, const npg_form_facts *facts)
{
    if (facts->vert_count > INT32_MAX)
        return npg_error(NPG_USAGE,
                         "%s can't hold the capture: it counts vertices in 31 bits, and there are %zu", form,
                         facts->vert_count);
    if (facts->pose_count > INT32_MAX || facts->last_index - facts->first_index >= INT32_MAX)
        return npg_error(NPG_USAGE,
                         "%s can't hold the capture: it counts frames in 31 bits, and there are %lld", form,
                         (long long)facts->pose_count);
    return NPG_OK;
}

uint64_t npg_cache_bytes(const npg_form_facts *facts)
{
    return facts->pose_count < 0 ? 0 : (uint64_t)facts->pose_count * (12 * facts->vert_count + 4);
}

npg_status npg_cache_open(npg_cache *cache, const npg_form_facts *facts, const char *form)
{
    char *path;
    cache->facts = facts;
    cache->form = form;
    snprintf(cache->name, sizeof cache->name, "motion.%s", form);
    NPG_TRY(npg_alloc_array(&cache->row, NPG_FOR_FILES, facts->vert_count, 12));
    NPG_TRY(npg_join_path(&path, facts->output, cache->name));
    npg_status status = npg_file_open(&cache->file, path);
    npg_release(&path);
    return status;
}

npg_status npg_cache_write(npg_cache *cache, const npg_pose *pose,
                           size_t (*put)(unsigned char *out, uint64_t bits, size_t size))
{
    size_t count = 3 * cache->facts->vert_count;
    for (size_t i = 0; i < count; i++) put(cache->row + 4 * i, npg_float_bits(pose->pos[i]), 4);
    return npg_file_write(cache->file, cache->row, 4 * count);
}

/* The mesh whose vertices the cache moves. */
static npg_status write_reference(const npg_form_facts *facts)
{
    char *path;
    NPG_TRY(npg_join_path(&path, facts->output, "reference.obj"));
    npg_status status = NPG_OK;
    if (!npg_is_there(path)) { /* the other point cache may have made it in this pass */
        status = npg_write_obj_pose(path, facts, facts->rest, NULL, NULL);
        if (!status) status = npg_form_made(facts->log, "obj", "reference.obj", facts->first_index, 1);
    }
    npg_release(&path);
    return status;
}

npg_status npg_cache_finish(void *state)
{
    npg_cache *cache = state;
    const npg_form_facts *facts = cache->facts;
    int64_t frames = facts->last_index - facts->first_index + 1;
    NPG_TRY(npg_file_commit(&cache->file));
    NPG_TRY(npg_form_made(facts->log, cache->form, cache->name, facts->first_index, frames));
    return write_reference(facts);
}

void npg_cache_close(void *state)
{
    npg_cache *cache = state;
    npg_file_discard(&cache->file);
    npg_release(&cache->row);
}
