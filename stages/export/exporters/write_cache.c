/* Point caches: a header and then the vertices of every frame as float32, for the mesh OUT/reference.obj.
 *
 * PC2, little-endian:
 *
 *     "POINTCACHE2\0", int32 version 1, int32 points, float32 first sample's frame,
 *     float32 frames per sample, int32 samples; then samples x points x 3 float32
 *
 * MDD, big-endian:
 *
 *     int32 frames, int32 points, frames x float32 seconds, frames x points x 3 float32
 *
 * PC2 has neither times nor units, and readers of MDD take its times as even: a frame without a mesh repeats
 * the one before it. */
#include "export/exporters/exporters_internal.h"

typedef struct cache {
    npg_writer writer;
    unsigned char *row; /* one pose's bytes, owned */
} cache;

static int64_t frames_of(const npg_export_facts *facts)
{
    return facts->last_index - facts->first_index + 1;
}

static npg_status check(const npg_export_facts *facts)
{
    if (facts->pose_count <= INT32_MAX && frames_of(facts) <= INT32_MAX) return NPG_OK;
    return npg_error(NPG_USAGE,
                     "a point cache can't hold the capture: it counts frames in 31 bits, and there are %lld",
                     (long long)facts->pose_count);
}

static uint64_t bytes(const npg_export_facts *facts)
{
    return (uint64_t)facts->pose_count * (12 * facts->vert_count + 4);
}

static npg_status open_pc2(void *state)
{
    const npg_writer *writer = state;
    const npg_export_facts *facts = writer->facts;
    unsigned char header[32] = "POINTCACHE2";
    npg_put_little(header + 12, 1, 4);
    npg_put_little(header + 16, facts->vert_count, 4);
    npg_put_little(header + 20, npg_float_bits((float)facts->first_index), 4);
    npg_put_little(header + 24, npg_float_bits(1), 4);
    npg_put_little(header + 28, (uint64_t)frames_of(facts), 4);
    return npg_file_write(writer->file, header, sizeof header);
}

static npg_status open_mdd(void *state)
{
    cache *c = state;
    const npg_export_facts *facts = c->writer.facts;
    unsigned char word[4];
    NPG_TRY(npg_alloc_array(&c->row, NPG_FOR_FILES, facts->vert_count, 12));
    npg_file_write(c->writer.file, word, npg_put_big(word, (uint64_t)frames_of(facts), 4));
    npg_file_write(c->writer.file, word, npg_put_big(word, facts->vert_count, 4));
    for (int64_t i = facts->first_index; i <= facts->last_index; i++) {
        float seconds = (float)((double)i / facts->fps);
        npg_file_write(c->writer.file, word, npg_put_big(word, npg_float_bits(seconds), 4));
    }
    return NPG_OK;
}

/* As they stand in memory: the machines this runs on are little-endian. */
static npg_status write_pc2(void *state, const npg_pose *pose)
{
    const npg_writer *writer = state;
    return npg_file_write(writer->file, pose->pos, 12 * writer->facts->vert_count);
}

static npg_status write_mdd(void *state, const npg_pose *pose)
{
    cache *c = state;
    size_t count = 3 * c->writer.facts->vert_count;
    for (size_t i = 0; i < count; i++) npg_put_big(c->row + 4 * i, npg_float_bits(pose->pos[i]), 4);
    return npg_file_write(c->writer.file, c->row, 4 * count);
}

static void close_cache(void *state)
{
    npg_release(&((cache *)state)->row);
}

const npg_exporter npg_exporter_pc2 = {.name = "pc2",
                                       .file = "motion.pc2",
                                       .is_float = true,
                                       .has_fixed_rate = true,
                                       .with_reference = true,
                                       .state_size = sizeof(npg_writer),
                                       .check = check,
                                       .bytes = bytes,
                                       .open = open_pc2,
                                       .pose = write_pc2};

const npg_exporter npg_exporter_mdd = {.name = "mdd",
                                       .file = "motion.mdd",
                                       .is_float = true,
                                       .has_fixed_rate = true,
                                       .with_reference = true,
                                       .state_size = sizeof(cache),
                                       .check = check,
                                       .bytes = bytes,
                                       .open = open_mdd,
                                       .pose = write_mdd,
                                       .close = close_cache};
