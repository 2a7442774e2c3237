/* PC2 writer: a point cache, little-endian, for the mesh OUT/reference.obj.
 *
 *     "POINTCACHE2\0", int32 version 1, int32 points, float32 first sample's frame,
 *     float32 frames per sample, int32 samples; then samples x points x 3 float32
 *
 * The form has neither times nor units: sample k is frame first + k. */
#include "export/forms/point_cache.h"

static npg_status write_header(npg_file *file, const npg_form_facts *facts)
{
    unsigned char header[32] = "POINTCACHE2";
    npg_put_little(header + 12, 1, 4);
    npg_put_little(header + 16, facts->vert_count, 4);
    npg_put_little(header + 20, npg_float_bits((float)facts->first_index), 4);
    npg_put_little(header + 24, npg_float_bits(1), 4);
    npg_put_little(header + 28, (uint64_t)(facts->last_index - facts->first_index + 1), 4);
    return npg_file_write(file, header, sizeof header);
}

static npg_status check_pc2(const npg_form_facts *facts)
{
    return npg_cache_check("pc2", facts);
}

static npg_status open_pc2(void *state, const npg_form_facts *facts)
{
    NPG_TRY(npg_cache_open(state, facts, "pc2"));
    return write_header(((npg_cache *)state)->file, facts);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    return npg_cache_write(state, pose, npg_put_little);
}

const npg_form npg_form_pc2 = {.name = "pc2",
                               .help = "PC2 point cache with reference.obj",
                               .is_float = true,
                               .has_fixed_rate = true,
                               .state_size = sizeof(npg_cache),
                               .check = check_pc2,
                               .bytes = npg_cache_bytes,
                               .open = open_pc2,
                               .pose = write_pose,
                               .finish = npg_cache_finish,
                               .close = npg_cache_close};
