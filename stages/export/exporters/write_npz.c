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
 *
 * An NPZ is a ZIP file of NPY arrays, not compressed here.  Their sizes are known before, so all are written side by
 * side in one pass; the longest, the vertices, are the last member and go straight to the end of the file. */
#include <stdio.h>
#include <zlib.h>

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

typedef struct member { /* of the ZIP file: an array */
    char name[32];
    uint64_t size; /* 0: it is not there */
    uint64_t header_at, data_at, filled;
    uint32_t crc;
} member;

typedef struct npz_state {
    npg_writer writer;
    member members[ARRAYS];
} npz_state;

typedef struct array { /* how an array is described; item 0: it is not there */
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
    case COLOURS: return (array){"colours", "|u1", facts->colours != NULL, {v, 4}, 2};
    case FRAME_COLOURS: return (array){"frame_colours", "|u1", facts->has_pose_colours, {t, v, 4}, 3};
    case UVS: return (array){"uvs", "<f4", facts->uvs ? 4 : 0, {v, 2}, 2};
    case CORNER_UVS: return (array){"corner_uvs", "<f4", facts->corner_uvs ? 4 : 0, {f, 3, 2}, 3};
    default: return (array){"vertices", "<f4", 4, {t, v, 3}, 3};
    }
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
    for (int i = 0; i < ARRAYS; i++) {
        array a = describe(i, facts);
        sum += data_bytes(&a) + 2 * HEADER;
    }
    return sum;
}

/* ---- the ZIP file: records with ZIP64 fields, whatever the size ---- */

/* Records and numbers of PKWARE's APPNOTE.TXT, version 6.3. */
#define FIXED_TIME     0x00210000 /* 1980-01-01 00:00, the first one there is: the same bytes every day */
#define LOCAL_HEADER   0x04034b50
#define ENTRY          0x02014b50
#define END_64         0x06064b50
#define END_64_LOCATOR 0x07064b50
#define END            0x06054b50
#define VERSION_64     45
#define ELSEWHERE      0xffffffff /* the number stands in a ZIP64 field */

/* What the header before a member and its entry in the directory have in common: version to sizes. */
static size_t put_common(unsigned char *out, const member *m)
{
    size_t n = npg_put_little(out, VERSION_64, 2);
    n += npg_put_little(out + n, 0x0800, 2); /* names are UTF-8 */
    n += npg_put_little(out + n, 0, 2);      /* stored */
    n += npg_put_little(out + n, FIXED_TIME, 4);
    n += npg_put_little(out + n, m->crc, 4);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    return n + npg_put_little(out + n, ELSEWHERE, 4);
}

/* The name, and behind it a ZIP64 field of `size` bytes that begins with the member's sizes. */
static size_t put_name(unsigned char *out, const member *m, size_t size)
{
    size_t n = strlen(m->name);
    memcpy(out, m->name, n);
    n += npg_put_little(out + n, 1, 2);
    n += npg_put_little(out + n, size, 2);
    n += npg_put_little(out + n, m->size, 8);
    return n + npg_put_little(out + n, m->size, 8);
}

static size_t put_header(unsigned char *out, const member *m)
{
    size_t n = npg_put_little(out, LOCAL_HEADER, 4);
    n += put_common(out + n, m);
    n += npg_put_little(out + n, strlen(m->name), 2);
    n += npg_put_little(out + n, 20, 2);
    return n + put_name(out + n, m, 16);
}

static size_t put_entry(unsigned char *out, const member *m)
{
    size_t n = npg_put_little(out, ENTRY, 4);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += put_common(out + n, m);
    n += npg_put_little(out + n, strlen(m->name), 2);
    n += npg_put_little(out + n, 28, 2);
    n += npg_put_little(out + n, 0, 8); /* comment's length, disk, attributes */
    n += npg_put_little(out + n, 0, 2);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    n += put_name(out + n, m, 24);
    return n + npg_put_little(out + n, m->header_at, 8);
}

static void write_end(npg_file *file, uint64_t count, uint64_t directory_at)
{
    unsigned char out[128];
    uint64_t end_at = npg_file_size(file), directory_size = end_at - directory_at;
    size_t n = npg_put_little(out, END_64, 4);
    n += npg_put_little(out + n, 44, 8);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += npg_put_little(out + n, VERSION_64, 2);
    n += npg_put_little(out + n, 0, 8);
    n += npg_put_little(out + n, count, 8);
    n += npg_put_little(out + n, count, 8);
    n += npg_put_little(out + n, directory_size, 8);
    n += npg_put_little(out + n, directory_at, 8);
    n += npg_put_little(out + n, END_64_LOCATOR, 4);
    n += npg_put_little(out + n, 0, 4);
    n += npg_put_little(out + n, end_at, 8);
    n += npg_put_little(out + n, 1, 4);
    n += npg_put_little(out + n, END, 4);
    n += npg_put_little(out + n, 0, 4);
    n += npg_put_little(out + n, count, 2);
    n += npg_put_little(out + n, count, 2);
    n += npg_put_little(out + n, directory_size, 4);
    n += npg_put_little(out + n, ELSEWHERE, 4);
    n += npg_put_little(out + n, 0, 2);
    npg_file_write(file, out, n);
}

static void write_zeros(npg_file *file, uint64_t size)
{
    static const unsigned char zeros[4096];
    for (; size; size -= size < sizeof zeros ? size : sizeof zeros)
        if (npg_file_write(file, zeros, size < sizeof zeros ? size : sizeof zeros)) return;
}

static void open_zip(npz_state *s)
{
    unsigned char header[128];
    npg_file *file = s->writer.file;
    for (member *m = s->members; m < s->members + ARRAYS; m++) {
        if (!m->size) continue;
        m->header_at = npg_file_size(file);
        npg_file_write(file, header, put_header(header, m));
        m->data_at = npg_file_size(file);
        if (m != &s->members[VERTICES]) write_zeros(file, m->size);
    }
}

/* The next values of an array, as they stand in memory: the machines this runs on are little-endian. */
static npg_status put(npz_state *s, int which, const void *words, size_t word_size, size_t count)
{
    member *m = &s->members[which];
    size_t size = word_size * count;
    if (!m->size) return NPG_OK;
    NPG_REQUIRE(size <= m->size - m->filled);
    uint64_t place = m->data_at + m->filled;
    m->crc = (uint32_t)crc32_z(m->crc, words, size);
    m->filled += size;
    return which == VERTICES ? npg_file_write(s->writer.file, words, size)
                             : npg_file_patch(s->writer.file, place, words, size);
}

static npg_status finish_npz(void *state)
{
    npz_state *s = state;
    npg_file *file = s->writer.file;
    unsigned char record[160];
    size_t count = 0;
    uint64_t at = npg_file_size(file);
    for (const member *m = s->members; m < s->members + ARRAYS; m++) {
        NPG_REQUIRE(m->filled == m->size);
        if (!m->size) continue;
        NPG_TRY(npg_file_patch(file, m->header_at, record, put_header(record, m)));
        npg_file_write(file, record, put_entry(record, m));
        count++;
    }
    write_end(file, count, at);
    return NPG_OK;
}

/* ---- arrays ---- */

/* The magic, version 1.0, and a dictionary padded with blanks to 128 bytes in all. */
static npg_status put_header_of(npz_state *s, int which)
{
    const array a = describe(which, s->writer.facts);
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
    return put(s, which, text, 1, HEADER);
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
    NPG_TRY(put(s, COLOURS, facts->colours, 1, 4 * facts->vert_count));
    NPG_TRY(put(s, UVS, facts->uvs, 4, 2 * facts->vert_count));
    return put(s, CORNER_UVS, facts->corner_uvs, 4, 6 * facts->face_count);
}

/* ---- the exporter ---- */

static npg_status open_npz(void *state)
{
    npz_state *s = state;
    for (int i = 0; i < ARRAYS; i++) {
        const array a = describe(i, s->writer.facts);
        snprintf(s->members[i].name, sizeof s->members[i].name, "%s.npy", a.name);
        s->members[i].size = a.item ? HEADER + data_bytes(&a) : 0;
    }
    open_zip(s);
    for (int i = 0; i < ARRAYS; i++) NPG_TRY(put_header_of(s, i));
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
    NPG_TRY(put(s, FRAME_COLOURS, pose->colours, 1, 4 * facts->vert_count));
    return put(s, VERTICES, pose->pos, 4, 3 * facts->vert_count);
}

const npg_exporter npg_exporter_npz = {.name = "npz",
                                       .file = "motion.npz",
                                       .is_float = true,
                                       .state_size = sizeof(npz_state),
                                       .bytes = bytes,
                                       .open = open_npz,
                                       .pose = write_pose,
                                       .finish = finish_npz};
