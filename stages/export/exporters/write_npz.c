/* NPZ writer: arrays for numpy.load("motion.npz").
 *
 *     vertices          (T, V, 3) float32    as written, T frames that have a mesh
 *     faces             (F, 3) int32
 *     reference         (V, 3) float32       the surface at the keyframe
 *     rotation          (T, 3, 3) float64    the rigid motion that takes the reference closest to the frame:
 *     translation       (T, 3) float64       vertices[t] is about reference @ rotation[t].T + translation[t]
 *     index, number     (T,) int64           place in time, number of the input's file
 *     time              (T,) float64         seconds, index / fps
 *     fps               () float64
 *     metres_per_unit   () float64
 *     up                () one letter
 *     colours           (V, 4) uint8         where the reference has them
 *     frame_colours     (T, V, 4) uint8      with colours of each frame: alpha 255 where it saw the vertex
 *     uvs               (V, 2) float32       where the reference has them
 *     corner_uvs        (F, 3, 2) float32    where the reference has them
 */
#include <stdio.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"

enum {
    FACES,
    REFERENCE,
    ROTATION,
    TRANSLATION,
    INDEX,
    NUMBER,
    TIME,
    FPS,
    UNIT,
    UP,
    COLOURS,
    UVS,
    CORNER_UVS,
    FRAME_COLOURS,
    VERTICES, /* last: it is written straight through */
    ARRAYS
};

enum { HEADER = 128 }; /* of an array, with its name and shape */

typedef struct npz_state {
    npg_writer writer;
    npg_zip zip;
    npg_zip_member members[ARRAYS];
    int at[ARRAYS]; /* place among the members, -1: not there */
    size_t member_count;
} npz_state;

typedef struct array { /* how an array is described */
    const char *name, *type;
    size_t item; /* bytes */
    int64_t shape[3];
    int rank;
} array;

static array describe(int which, const npg_export_facts *facts)
{
    int64_t t = facts->pose_count, v = (int64_t)facts->vert_count, f = (int64_t)facts->face_count;
    switch (which) {
    case FACES: return (array){"faces", "<i4", 4, {f, 3}, 2};
    case REFERENCE: return (array){"reference", "<f4", 4, {v, 3}, 2};
    case ROTATION: return (array){"rotation", "<f8", 8, {t, 3, 3}, 3};
    case TRANSLATION: return (array){"translation", "<f8", 8, {t, 3}, 2};
    case INDEX: return (array){"index", "<i8", 8, {t}, 1};
    case NUMBER: return (array){"number", "<i8", 8, {t}, 1};
    case TIME: return (array){"time", "<f8", 8, {t}, 1};
    case FPS: return (array){"fps", "<f8", 8, {0}, 0};
    case UNIT: return (array){"metres_per_unit", "<f8", 8, {0}, 0};
    case UP: return (array){"up", "<U1", 4, {0}, 0};
    case COLOURS: return (array){"colours", "|u1", 1, {v, 4}, 2};
    case FRAME_COLOURS: return (array){"frame_colours", "|u1", 1, {t, v, 4}, 3};
    case UVS: return (array){"uvs", "<f4", 4, {v, 2}, 2};
    case CORNER_UVS: return (array){"corner_uvs", "<f4", 4, {f, 3, 2}, 3};
    default: return (array){"vertices", "<f4", 4, {t, v, 3}, 3};
    }
}

static bool is_there(int which, const npg_export_facts *facts)
{
    return which == COLOURS         ? facts->colours != NULL
           : which == FRAME_COLOURS ? facts->has_pose_colours
           : which == UVS           ? facts->uvs != NULL
           : which == CORNER_UVS    ? facts->corner_uvs != NULL
                                    : true;
}

static uint64_t data_bytes(const array *a)
{
    uint64_t size = a->item;
    for (int i = 0; i < a->rank; i++) size *= (uint64_t)a->shape[i];
    return size;
}

static uint64_t bytes(const npg_export_facts *facts)
{
    uint64_t sum = 0;
    if (facts->pose_count < 0) return 0;
    for (int i = 0; i < ARRAYS; i++) {
        array a = describe(i, facts);
        if (is_there(i, facts)) sum += data_bytes(&a) + 2 * HEADER;
    }
    return sum;
}

/* ---- arrays ---- */

/* The magic, version 1.0, and a dictionary padded with blanks to 128 bytes in all. */
static npg_status put_header(npz_state *s, int which)
{
    array a = describe(which, s->writer.facts);
    char shape[96] = "", text[HEADER + 1];
    for (int i = 0; i < a.rank; i++) {
        size_t used = strlen(shape);
        snprintf(shape + used, sizeof shape - used, "%s%lld%s", i ? " " : "", (long long)a.shape[i],
                 i + 1 < a.rank || a.rank == 1 ? "," : "");
    }
    /* Format: numpy.lib.format, version 1.0. */
    int length = snprintf(text + 10, sizeof text - 10,
                          "{'descr': '%s', 'fortran_order': False, 'shape': (%s), }", a.type, shape);
    memcpy(text, "\x93NUMPY\x01\x00", 8);
    npg_put_little((unsigned char *)text + 8, HEADER - 10, 2);
    memset(text + 10 + length, ' ', (size_t)(HEADER - 11 - length));
    text[HEADER - 1] = '\n';
    return npg_zip_put(&s->zip, (size_t)s->at[which], text, HEADER);
}

/* The next values of an array, as they stand in memory: the machines this runs on are little-endian. */
static npg_status put(npz_state *s, int which, const void *words, size_t word_size, size_t count)
{
    return npg_zip_put(&s->zip, (size_t)s->at[which], words, word_size * count);
}

static npg_status put_fixed(npz_state *s)
{
    const npg_export_facts *facts = s->writer.facts;
    const uint32_t up = facts->is_z_up ? 'z' : 'y';
    NPG_TRY(put(s, FACES, facts->faces, 4, 3 * facts->face_count));
    NPG_TRY(put(s, REFERENCE, facts->rest, 4, 3 * facts->vert_count));
    NPG_TRY(put(s, FPS, &facts->fps, 8, 1));
    NPG_TRY(put(s, UNIT, &facts->metres_per_unit, 8, 1));
    NPG_TRY(put(s, UP, &up, 4, 1));
    if (facts->colours) NPG_TRY(put(s, COLOURS, facts->colours, 1, 4 * facts->vert_count));
    if (facts->uvs) NPG_TRY(put(s, UVS, facts->uvs, 4, 2 * facts->vert_count));
    if (facts->corner_uvs) NPG_TRY(put(s, CORNER_UVS, facts->corner_uvs, 4, 6 * facts->face_count));
    return NPG_OK;
}

/* ---- the exporter ---- */

static npg_status open_npz(void *state)
{
    npz_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    for (int i = 0; i < ARRAYS; i++) {
        array a = describe(i, facts);
        s->at[i] = is_there(i, facts) ? (int)s->member_count : -1;
        if (s->at[i] < 0) continue;
        npg_zip_member *member = &s->members[s->member_count++];
        snprintf(member->name, sizeof member->name, "%s.npy", a.name);
        member->size = HEADER + data_bytes(&a);
    }
    NPG_TRY(npg_zip_open(&s->zip, s->writer.file, s->members, s->member_count));
    for (int i = 0; i < ARRAYS; i++)
        if (s->at[i] >= 0) NPG_TRY(put_header(s, i));
    return put_fixed(s);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    npz_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    double rotation[3][3], translation[3], time = (double)pose->index / facts->fps;
    npg_rigid_fit(rotation, translation, facts->rest, pose->pos, facts->vert_count);
    NPG_TRY(put(s, ROTATION, rotation, 8, 9));
    NPG_TRY(put(s, TRANSLATION, translation, 8, 3));
    NPG_TRY(put(s, INDEX, &pose->index, 8, 1));
    NPG_TRY(put(s, NUMBER, &pose->number, 8, 1));
    NPG_TRY(put(s, TIME, &time, 8, 1));
    if (facts->has_pose_colours) NPG_TRY(put(s, FRAME_COLOURS, pose->colours, 1, 4 * facts->vert_count));
    return put(s, VERTICES, pose->pos, 4, 3 * facts->vert_count);
}

static npg_status finish_npz(void *state)
{
    return npg_zip_finish(&((npz_state *)state)->zip);
}

const npg_exporter npg_exporter_npz = {.name = "npz",
                                       .help = "NumPy arrays with each frame's rigid motion",
                                       .file = "motion.npz",
                                       .is_float = true,
                                       .is_indexed = true,
                                       .state_size = sizeof(npz_state),
                                       .bytes = bytes,
                                       .open = open_npz,
                                       .pose = write_pose,
                                       .finish = finish_npz};
