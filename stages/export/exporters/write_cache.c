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
#include <stdio.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"

typedef size_t put_bytes(unsigned char *out, uint64_t bits, size_t size);

typedef struct cache {
    const npg_export_facts *facts;
    const char *format;
    put_bytes *put; /* the byte order */
    char name[32];
    npg_file *file;
    unsigned char *row; /* one pose's bytes, owned */
} cache;

static int64_t frames_of(const npg_export_facts *facts)
{
    return facts->last_index - facts->first_index + 1;
}

static npg_status check(const char *format, const npg_export_facts *facts)
{
    if (facts->vert_count > INT32_MAX)
        return npg_error(NPG_USAGE,
                         "%s can't hold the capture: it counts vertices in 31 bits, and there are %zu",
                         format, facts->vert_count);
    if (facts->pose_count > INT32_MAX || frames_of(facts) > INT32_MAX)
        return npg_error(NPG_USAGE,
                         "%s can't hold the capture: it counts frames in 31 bits, and there are %lld", format,
                         (long long)facts->pose_count);
    return NPG_OK;
}

static npg_status check_pc2(const npg_export_facts *facts)
{
    return check("pc2", facts);
}

static npg_status check_mdd(const npg_export_facts *facts)
{
    return check("mdd", facts);
}

static uint64_t bytes(const npg_export_facts *facts)
{
    return facts->pose_count < 0 ? 0 : (uint64_t)facts->pose_count * (12 * facts->vert_count + 4);
}

static npg_status open_cache(cache *c, const npg_export_facts *facts, const char *format, put_bytes *put)
{
    c->facts = facts;
    c->format = format;
    c->put = put;
    snprintf(c->name, sizeof c->name, "motion.%s", format);
    NPG_TRY(npg_alloc_array(&c->row, NPG_FOR_FILES, facts->vert_count, 12));
    return npg_export_open(&c->file, facts->output, c->name);
}

static npg_status open_pc2(void *state, const npg_export_facts *facts)
{
    cache *c = state;
    unsigned char header[32] = "POINTCACHE2";
    NPG_TRY(open_cache(c, facts, "pc2", npg_put_little));
    npg_put_little(header + 12, 1, 4);
    npg_put_little(header + 16, facts->vert_count, 4);
    npg_put_little(header + 20, npg_float_bits((float)facts->first_index), 4);
    npg_put_little(header + 24, npg_float_bits(1), 4);
    npg_put_little(header + 28, (uint64_t)frames_of(facts), 4);
    return npg_file_write(c->file, header, sizeof header);
}

static npg_status open_mdd(void *state, const npg_export_facts *facts)
{
    cache *c = state;
    unsigned char word[4];
    NPG_TRY(open_cache(c, facts, "mdd", npg_put_big));
    npg_file_write(c->file, word, npg_put_big(word, (uint64_t)frames_of(facts), 4));
    npg_file_write(c->file, word, npg_put_big(word, facts->vert_count, 4));
    for (int64_t i = facts->first_index; i <= facts->last_index; i++) {
        float seconds = (float)((double)i / facts->fps);
        npg_file_write(c->file, word, npg_put_big(word, npg_float_bits(seconds), 4));
    }
    return NPG_OK;
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    cache *c = state;
    size_t count = 3 * c->facts->vert_count;
    for (size_t i = 0; i < count; i++) c->put(c->row + 4 * i, npg_float_bits(pose->pos[i]), 4);
    return npg_file_write(c->file, c->row, 4 * count);
}

/* The mesh whose vertices the cache moves. */
static npg_status write_reference(const npg_export_facts *facts)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, facts->output, "reference.obj"));
    npg_status status = NPG_OK;
    if (!npg_is_there(path)) { /* the other point cache may have made it in this pass */
        status = npg_write_obj_pose(path, facts, facts->rest, NULL, NULL);
        if (!status) status = npg_export_made(facts->log, "obj", "reference.obj", facts->first_index, 1);
    }
    return status;
}

static npg_status finish(void *state)
{
    cache *c = state;
    NPG_TRY(npg_file_commit(&c->file));
    NPG_TRY(npg_export_made(c->facts->log, c->format, c->name, c->facts->first_index, frames_of(c->facts)));
    return write_reference(c->facts);
}

static void close_cache(void *state)
{
    cache *c = state;
    npg_file_discard(&c->file);
    npg_release(&c->row);
}

const npg_exporter npg_exporter_pc2 = {.name = "pc2",
                                       .help = "PC2 point cache with reference.obj",
                                       .is_float = true,
                                       .has_fixed_rate = true,
                                       .state_size = sizeof(cache),
                                       .check = check_pc2,
                                       .bytes = bytes,
                                       .open = open_pc2,
                                       .pose = write_pose,
                                       .finish = finish,
                                       .close = close_cache};

const npg_exporter npg_exporter_mdd = {.name = "mdd",
                                       .help = "MDD point cache with reference.obj",
                                       .is_float = true,
                                       .has_fixed_rate = true,
                                       .state_size = sizeof(cache),
                                       .check = check_mdd,
                                       .bytes = bytes,
                                       .open = open_mdd,
                                       .pose = write_pose,
                                       .finish = finish,
                                       .close = close_cache};
