/* USDA writer: a USD stage as text, the surface's points as time samples.
 *
 *     /capture           Xform, the default prim
 *     /capture/surface   Mesh: points, normals, velocities (units a second) and extent as time samples with the frame's
 *                        index as the time code, faces once, no subdivision, primvars:displayColor and primvars:st
 *                        where the reference has colours and UVs; primvars:displayColor.timeSamples where frames have
 *                        colours of their own
 *     /capture/material  with colours: a preview surface that shows them
 *
 * timeCodesPerSecond is the rate of the capture, metersPerUnit and upAxis as the options say.  Floats have
 * nine digits and so come back as they were; those that others follow from have six, colours of frames five behind the
 * point, which tells all bytes of sRGB apart.  Each kind of sample but points is gathered in a file of its own, to be put
 * behind them. */
#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "export/exporters/exporters_internal.h"
#include "geometry/geometry.h"
#include "pipeline/file.h"
#include "pipeline/source.h"

typedef enum usda_kind { NORMALS, VELOCITIES, EXTENT, COLOURS, KINDS } usda_kind;

static const char *const kind_names[KINDS] = {"normal3f[] normals", "vector3f[] velocities",
                                              "float3[] extent", "color3f[] primvars:displayColor"};

typedef struct usda_state {
    npg_writer writer;
    npg_file *parts[KINDS]; /* samples, owned */
    npg_arena arena;
    float *normals; /* V x 3 */
    float *pos[3];  /* of the last poses, V x 3 each: the newest is [2] */
    int64_t index[3];
    int64_t count; /* poses so far */
} usda_state;

/* ---- text ---- */

static void print_tuple(npg_file *file, const char *format, const float *values, int count)
{
    char text[40];
    for (int i = 0; i < count; i++) {
        npg_file_write(file, i ? ", " : "(", i ? 2 : 1);
        npg_file_write(file, text, npg_number_print(text, sizeof text, format, (double)values[i]));
    }
    npg_file_write(file, ")", 1);
}

static void print_tuples(npg_file *file, const char *format, const float *values, size_t rows, int width)
{
    npg_file_write(file, "[", 1);
    for (size_t i = 0; i < rows; i++) {
        if (i) npg_file_write(file, ", ", 2);
        print_tuple(file, format, values + i * (size_t)width, width);
    }
    npg_file_write(file, "]", 1);
}

/* One time sample. */
static npg_status print_sample(npg_file *file, int64_t index, const char *format, const float *values,
                               size_t rows)
{
    npg_file_print(file, "            %lld: ", (long long)index);
    print_tuples(file, format, values, rows, 3);
    return npg_file_print(file, ",\n");
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
static void print_colours(npg_file *file, const char *format, const uint8_t *colours, size_t count)
{
    npg_file_write(file, "[", 1);
    for (size_t i = 0; i < count; i++) {
        float linear[3];
        for (size_t c = 0; c < 3; c++) linear[c] = npg_srgb_to_linear(colours[4 * i + c]);
        if (i) npg_file_write(file, ", ", 2);
        print_tuple(file, format, linear, 3);
    }
    npg_file_write(file, "]", 1);
}

static void print_uvs(npg_file *file, const npg_export_facts *facts)
{
    bool is_corner = facts->corner_uvs != NULL;
    npg_file_print(file, "        texCoord2f[] primvars:st = ");
    print_tuples(file, "%.9g", is_corner ? facts->corner_uvs : facts->uvs,
                 is_corner ? 3 * facts->face_count : facts->vert_count, 2);
    npg_file_print(file, " (\n            interpolation = \"%s\"\n        )\n",
                   is_corner ? "faceVarying" : "vertex");
}

static const char material[] =
    "    def Material \"material\"\n    {\n"
    "        token outputs:surface.connect = </capture/material/preview.outputs:surface>\n\n"
    "        def Shader \"preview\"\n        {\n"
    "            uniform token info:id = \"UsdPreviewSurface\"\n"
    "            color3f inputs:diffuseColor.connect = </capture/material/colour.outputs:result>\n"
    "            float inputs:metallic = 0\n            float inputs:roughness = 0.9\n"
    "            token outputs:surface\n        }\n\n"
    "        def Shader \"colour\"\n        {\n"
    "            uniform token info:id = \"UsdPrimvarReader_float3\"\n"
    "            string inputs:varname = \"displayColor\"\n"
    "            float3 outputs:result\n        }\n    }\n\n";

/* ---- the exporter ---- */

/* Three numbers of about ten characters a vertex, with what parts them; shorter ones of normals, velocities, colours. */
static uint64_t bytes(const npg_export_facts *facts)
{
    uint64_t row = 36 + 34 + 42 + (facts->has_pose_colours ? 29 : 0);
    return (uint64_t)facts->pose_count * facts->vert_count * row;
}

static npg_status open_parts(usda_state *s)
{
    const npg_export_facts *facts = s->writer.facts;
    s->arena.purpose = NPG_FOR_FILES;
    s->normals = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof(float));
    for (int i = 0; i < 3; i++) s->pos[i] = npg_arena_take(&s->arena, facts->vert_count, 3 * sizeof(float));
    NPG_TRY(npg_arena_status(&s->arena));
    for (int kind = 0; kind < KINDS; kind++) {
        char name[32];
        snprintf(name, sizeof name, "motion.usda.%d", kind);
        if (kind != COLOURS || facts->has_pose_colours)
            NPG_TRY(npg_file_open_in(&s->parts[kind], facts->output, name));
    }
    return NPG_OK;
}

static npg_status open_usda(void *state)
{
    usda_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    npg_file *file = s->writer.file;
    NPG_TRY(open_parts(s));
    print_stage(file, facts);
    npg_file_print(
        file,
        "def Xform \"capture\" (\n    kind = \"component\"\n)\n{\n%s    def Mesh \"surface\"%s\n    {\n"
        "        uniform token subdivisionScheme = \"none\"\n"
        "        uniform token orientation = \"rightHanded\"\n%s",
        facts->colours ? material : "",
        facts->colours ? " (\n        prepend apiSchemas = [\"MaterialBindingAPI\"]\n    )" : "",
        facts->colours ? "        rel material:binding = </capture/material>\n" : "");
    print_faces(file, facts);
    if (facts->colours) {
        npg_file_print(file, "        %s = ", kind_names[COLOURS]);
        print_colours(file, "%.9g", facts->colours, facts->vert_count);
        npg_file_print(file, " (\n            interpolation = \"vertex\"\n        )\n");
    }
    if (facts->uvs) print_uvs(file, facts);
    npg_file_print(file, "        %s (\n            interpolation = \"vertex\"\n        )\n",
                   kind_names[NORMALS]);
    return npg_file_print(file, "        point3f[] points.timeSamples = {\n");
}

static npg_status write_extent(usda_state *s)
{
    float box[6] = {FLT_MAX, FLT_MAX, FLT_MAX, -FLT_MAX, -FLT_MAX, -FLT_MAX};
    for (size_t i = 0; i < 3 * s->writer.facts->vert_count; i++) {
        box[i % 3] = fminf(box[i % 3], s->pos[2][i]);
        box[3 + i % 3] = fmaxf(box[3 + i % 3], s->pos[2][i]);
    }
    return print_sample(s->parts[EXTENT], s->index[2], "%.9g", box, 2);
}

/* At pose `at`, from that before it to that behind it: change over the time between. */
static npg_status write_velocities(usda_state *s, int before, int at, int behind)
{
    double seconds = (double)(s->index[behind] - s->index[before]) / s->writer.facts->fps;
    float *velocities = s->normals; /* they are written */
    for (size_t i = 0; i < 3 * s->writer.facts->vert_count; i++) {
        double way = (double)s->pos[behind][i] - (double)s->pos[before][i];
        velocities[i] = seconds > 0 ? (float)(way / seconds) : 0;
    }
    return print_sample(s->parts[VELOCITIES], s->index[at], "%.6g", velocities, s->writer.facts->vert_count);
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    usda_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    float *oldest = s->pos[0];
    memmove(s->pos, s->pos + 1, 2 * sizeof *s->pos);
    memmove(s->index, s->index + 1, 2 * sizeof *s->index);
    s->pos[2] = oldest;
    s->index[2] = pose->index;
    memcpy(s->pos[2], pose->pos, facts->vert_count * 3 * sizeof(float));
    if (!pose->normals)
        npg_mesh_vertex_normals(s->normals, pose->pos, facts->vert_count, facts->faces, facts->face_count);
    NPG_TRY(print_sample(s->parts[NORMALS], pose->index, "%.6g", pose->normals ? pose->normals : s->normals,
                         facts->vert_count));
    NPG_TRY(write_extent(s));
    if (facts->has_pose_colours) {
        npg_file_print(s->parts[COLOURS], "            %lld: ", (long long)pose->index);
        print_colours(s->parts[COLOURS], "%.5f", pose->colours, facts->vert_count);
        NPG_TRY(npg_file_print(s->parts[COLOURS], ",\n"));
    }
    if (s->count++) NPG_TRY(write_velocities(s, s->count > 2 ? 0 : 1, 1, 2));
    return print_sample(s->writer.file, pose->index, "%.9g", pose->pos, facts->vert_count);
}

static npg_status finish_usda(void *state)
{
    usda_state *s = state;
    npg_file *file = s->writer.file;
    NPG_TRY(write_velocities(s, s->count > 1 ? 1 : 2, 2, 2));
    for (int kind = 0; kind < KINDS; kind++) {
        if (!s->parts[kind]) continue;
        npg_file_print(file, "        }\n        %s.timeSamples = {\n", kind_names[kind]);
        NPG_TRY(npg_file_append(file, &s->parts[kind]));
    }
    return npg_file_print(file, "        }\n    }\n}\n");
}

static void close_usda(void *state)
{
    usda_state *s = state;
    for (int kind = 0; kind < KINDS; kind++) npg_file_discard(&s->parts[kind]);
    npg_arena_release(&s->arena);
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
