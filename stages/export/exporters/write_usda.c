/* USDA writer: a USD stage as text, the surface's points as time samples.
 *
 *     /capture          Xform, the default prim
 *     /capture/surface  Mesh: points.timeSamples and extent.timeSamples with the frame's index as the time
 *                       code, faces once, no subdivision, primvars:displayColor and primvars:st where the
 *                       reference has colours and UVs; primvars:displayColor.timeSamples where frames have
 *                       colours of their own
 *
 * timeCodesPerSecond is the rate of the capture, metersPerUnit and upAxis as the options say.  Floats have
 * nine digits and so come back as they were; colours of frames have five behind the point, which tells all
 * bytes of sRGB apart.  Samples of extent and colours stand before those of the points, each with a fixed
 * number of bytes, and are filled in as poses come. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

#define EXTENT_SIZE 144 /* bytes of one sample of the extent, padded with blanks          */
#define COLOUR_SIZE 29  /* of one colour of a frame: "(0.12345, 0.12345, 0.12345), "       */
#define LEAD_SIZE   40  /* before and behind a frame's colours: indent, time, "[", and "]," */

typedef struct usda_state {
    npg_writer writer;
    uint64_t extent_at; /* of the next sample              */
    uint64_t colour_at; /* the same, of the frames' colours */
    char *colour_text;  /* one sample of them, owned        */
} usda_state;

/* ---- text ---- */

static void print_number(npg_file *file, double value)
{
    char text[40];
    npg_file_write(file, text, npg_number_print(text, sizeof text, "%.9g", value));
}

static void print_tuple(npg_file *file, const float *values, int count)
{
    for (int i = 0; i < count; i++) {
        npg_file_write(file, i ? ", " : "(", i ? 2 : 1);
        print_number(file, (double)values[i]);
    }
    npg_file_write(file, ")", 1);
}

static void print_tuples(npg_file *file, const float *values, size_t rows, int width)
{
    npg_file_write(file, "[", 1);
    for (size_t i = 0; i < rows; i++) {
        if (i) npg_file_write(file, ", ", 2);
        print_tuple(file, values + i * (size_t)width, width);
    }
    npg_file_write(file, "]", 1);
}

static void print_stage(npg_file *file, const npg_export_facts *facts)
{
    char fps[40], metres[40];
    npg_number_print(fps, sizeof fps, "%.9g", facts->fps);
    npg_number_print(metres, sizeof metres, "%.9g", facts->metres_per_unit);
    npg_file_print(
        file,
        "#usda 1.0\n(\n    defaultPrim = \"capture\"\n    endTimeCode = %lld\n    framesPerSecond = %s\n"
        "    metersPerUnit = %s\n    startTimeCode = %lld\n    timeCodesPerSecond = %s\n    upAxis = \"%s\"\n)\n\n",
        (long long)facts->last_index, fps, metres, (long long)facts->first_index, fps,
        facts->is_z_up ? "Z" : "Y");
}

static void print_faces(npg_file *file, const npg_export_facts *facts)
{
    npg_file_print(file, "        int[] faceVertexCounts = [");
    for (size_t f = 0; f < facts->face_count; f++) npg_file_print(file, f ? ", 3" : "3");
    npg_file_print(file, "]\n        int[] faceVertexIndices = [");
    for (size_t i = 0; i < 3 * facts->face_count; i++)
        npg_file_print(file, i ? ", %u" : "%u", (unsigned)facts->faces[i]);
    npg_file_print(file, "]\n");
}

/* Display colours are linear light, what scanners write is sRGB. */
static void print_colours(npg_file *file, const npg_export_facts *facts)
{
    npg_file_print(file, "        color3f[] primvars:displayColor = [");
    for (size_t i = 0; i < facts->vert_count; i++) {
        float linear[3];
        for (size_t c = 0; c < 3; c++) linear[c] = npg_srgb_to_linear(facts->colours[4 * i + c]);
        if (i) npg_file_write(file, ", ", 2);
        print_tuple(file, linear, 3);
    }
    npg_file_print(file, "] (\n            interpolation = \"vertex\"\n        )\n");
}

static void print_uvs(npg_file *file, const npg_export_facts *facts)
{
    bool is_corner = facts->corner_uvs != NULL;
    npg_file_print(file, "        texCoord2f[] primvars:st = ");
    print_tuples(file, is_corner ? facts->corner_uvs : facts->uvs,
                 is_corner ? 3 * facts->face_count : facts->vert_count, 2);
    npg_file_print(file, " (\n            interpolation = \"%s\"\n        )\n",
                   is_corner ? "faceVarying" : "vertex");
}

/* Room for all samples of the extent, to be filled in. */
static void print_extent(usda_state *s)
{
    char blanks[EXTENT_SIZE];
    memset(blanks, ' ', sizeof blanks);
    blanks[sizeof blanks - 1] = '\n';
    npg_file_print(s->writer.file, "        float3[] extent.timeSamples = {\n");
    s->extent_at = npg_file_size(s->writer.file);
    for (int64_t i = 0; i < s->writer.facts->pose_count; i++)
        npg_file_write(s->writer.file, blanks, sizeof blanks);
    npg_file_print(s->writer.file, "        }\n");
}

/* Bytes of one frame's colours; 0 without any. */
static size_t colours_size(const npg_export_facts *facts)
{
    return facts->has_pose_colours ? facts->vert_count * COLOUR_SIZE + LEAD_SIZE : 0;
}

/* Room for the colours of all frames. */
static npg_status print_colour_samples(usda_state *s)
{
    size_t size = colours_size(s->writer.facts);
    if (!size) return NPG_OK;
    NPG_TRY(npg_alloc(&s->colour_text, NPG_FOR_FILES, size + 1));
    memset(s->colour_text, ' ', size);
    s->colour_text[size - 1] = '\n';
    npg_file_print(s->writer.file, "        color3f[] primvars:displayColor.timeSamples = {\n");
    s->colour_at = npg_file_size(s->writer.file);
    for (int64_t i = 0; i < s->writer.facts->pose_count; i++)
        npg_file_write(s->writer.file, s->colour_text, size);
    return npg_file_print(s->writer.file, "        }\n");
}

/* ---- the exporter ---- */

/* Three numbers of about ten characters a vertex, with what parts them. */
static uint64_t bytes(const npg_export_facts *facts)
{
    uint64_t pose = facts->vert_count * 36 + EXTENT_SIZE + colours_size(facts);
    return (uint64_t)facts->pose_count * pose;
}

static npg_status open_usda(void *state)
{
    usda_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    print_stage(s->writer.file, facts);
    npg_file_print(s->writer.file, "def Xform \"capture\" (\n    kind = \"component\"\n)\n{\n"
                                   "    def Mesh \"surface\"\n    {\n"
                                   "        uniform token subdivisionScheme = \"none\"\n"
                                   "        uniform token orientation = \"rightHanded\"\n");
    print_faces(s->writer.file, facts);
    if (facts->colours) print_colours(s->writer.file, facts);
    if (facts->uvs) print_uvs(s->writer.file, facts);
    print_extent(s);
    NPG_TRY(print_colour_samples(s));
    return npg_file_print(s->writer.file, "        point3f[] points.timeSamples = {\n");
}

static npg_status write_extent(usda_state *s, const npg_pose *pose)
{
    float box[6] = {FLT_MAX, FLT_MAX, FLT_MAX, -FLT_MAX, -FLT_MAX, -FLT_MAX};
    char text[EXTENT_SIZE + 1], numbers[6][40];
    for (size_t i = 0; i < 3 * s->writer.facts->vert_count; i++) {
        box[i % 3] = fminf(box[i % 3], pose->pos[i]);
        box[3 + i % 3] = fmaxf(box[3 + i % 3], pose->pos[i]);
    }
    for (int i = 0; i < 6; i++) npg_number_print(numbers[i], sizeof numbers[i], "%.9g", (double)box[i]);
    int length =
        snprintf(text, sizeof text, "            %lld: [(%s, %s, %s), (%s, %s, %s)],", (long long)pose->index,
                 numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]);
    NPG_TRY(npg_file_patch(s->writer.file, s->extent_at, text, (size_t)length));
    s->extent_at += EXTENT_SIZE;
    return NPG_OK;
}

/* A number from 0 to 1 with five digits behind the point, whatever the locale says. */
static char *put_share(char *at, float share)
{
    int value = (int)lrintf(100000 * share);
    *at++ = (char)('0' + value / 100000);
    *at++ = '.';
    for (int unit = 10000; unit; unit /= 10) *at++ = (char)('0' + value / unit % 10);
    return at;
}

static npg_status write_colours(usda_state *s, const npg_pose *pose)
{
    size_t size = colours_size(s->writer.facts), verts = s->writer.facts->vert_count;
    if (!size) return NPG_OK;
    char *at = s->colour_text;
    at += snprintf(at, LEAD_SIZE, "            %lld: [", (long long)pose->index);
    for (size_t i = 0; i < verts; i++) {
        for (size_t c = 0; c < 3; c++) {
            memcpy(at, c ? ", " : "(", 2);
            at = put_share(at + (c ? 2 : 1), npg_srgb_to_linear(pose->colours[4 * i + c]));
        }
        const char *end = i + 1 < verts ? "), " : ")],";
        memcpy(at, end, 3);
        at += 3;
    }
    NPG_TRY(npg_file_patch(s->writer.file, s->colour_at, s->colour_text, (size_t)(at - s->colour_text)));
    s->colour_at += size;
    return NPG_OK;
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    usda_state *s = state;
    NPG_TRY(write_extent(s, pose));
    NPG_TRY(write_colours(s, pose));
    npg_file_print(s->writer.file, "            %lld: ", (long long)pose->index);
    print_tuples(s->writer.file, pose->pos, s->writer.facts->vert_count, 3);
    return npg_file_print(s->writer.file, ",\n");
}

static npg_status finish_usda(void *state)
{
    return npg_file_print(((usda_state *)state)->writer.file, "        }\n    }\n}\n");
}

static void close_usda(void *state)
{
    npg_release(&((usda_state *)state)->colour_text);
}

const npg_exporter npg_exporter_usda = {.name = "usda",
                                        .is_surface = true,
                                        .file = "motion.usda",
                                        .is_float = true,
                                        .state_size = sizeof(usda_state),
                                        .bytes = bytes,
                                        .open = open_usda,
                                        .pose = write_pose,
                                        .finish = finish_usda,
                                        .close = close_usda};
