/* MDD writer: a point cache, big-endian, for the mesh OUT/reference.obj.
 *
 *     int32 frames, int32 points, frames x float32 seconds, frames x points x 3 float32
 *
 * Readers take the times as even, so a frame without a mesh repeats the one before it. */
#include "export/forms/point_cache.h"

static npg_status write_header(npg_file *file, const npg_form_facts *facts)
{
    unsigned char word[4];
    int64_t frames = facts->last_index - facts->first_index + 1;
    npg_file_write(file, word, npg_put_big(word, (uint64_t)frames, 4));
    npg_file_write(file, word, npg_put_big(word, facts->vert_count, 4));
    for (int64_t i = 0; i < frames; i++) {
        float seconds = (float)((double)(facts->first_index + i) / facts->fps);
        npg_file_write(file, word, npg_put_big(word, npg_float_bits(seconds), 4));
    }
    return NPG_OK;
}

static npg_status check_mdd(const npg_form_facts *facts)
{
    return npg_cache_check("mdd", facts);
}

static npg_status open_mdd(void *state, const npg_form_facts *facts)
{
    NPG_TRY(npg_cache_open(state, facts, "mdd"));
    return write_header(((npg_cache *)state)->file, facts);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    return npg_cache_write(state, pose, npg_put_big);
}

const npg_form npg_form_mdd = {.name = "mdd",
                               .help = "MDD point cache with reference.obj",
                               .is_float = true,
                               .has_fixed_rate = true,
                               .state_size = sizeof(npg_cache),
                               .check = check_mdd,
                               .bytes = npg_cache_bytes,
                               .open = open_mdd,
                               .pose = write_pose,
                               .finish = npg_cache_finish,
                               .close = npg_cache_close};
