/* Exporters: the table, and whether what was asked for can be had. */
#include "export/exporters/exporters_internal.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define FLOAT_STEPS 16777216 /* 2^24: float rounds by at most 1 / this of the largest coordinate */
#define KEPT_SHARE  1e-6     /* of the box: what positions may lose, a micrometre in a metre */

extern const npg_exporter npg_exporter_ply, npg_exporter_obj, npg_exporter_pc2, npg_exporter_mdd,
    npg_exporter_glb, npg_exporter_glb_meshopt, npg_exporter_vat, npg_exporter_usda, npg_exporter_npz,
    npg_exporter_vdb;

const npg_exporter *const npg_exporters[] = {
    &npg_exporter_ply,         /* beside OBJ                           */
    &npg_exporter_obj,         /* beside PLY                           */
    &npg_exporter_pc2,         /* 3ds Max, Blender, Marvelous Designer */
    &npg_exporter_mdd,         /* LightWave, Blender, three.js         */
    &npg_exporter_glb,         /* the web, Blender, Unreal             */
    &npg_exporter_glb_meshopt, /* the web, compact                     */
    &npg_exporter_vat,         /* Unreal, Unity, Godot                 */
    &npg_exporter_usda,        /* USD tools, Unreal                    */
    &npg_exporter_npz,         /* NumPy                                */
    &npg_exporter_vdb,         /* Houdini, Blender                     */
    NULL};

/* ---- choosing ---- */

static int find_exporter(const char *name, size_t length)
{
    for (int i = 0; npg_exporters[i]; i++)
        if (strlen(npg_exporters[i]->name) == length && !strncmp(npg_exporters[i]->name, name, length))
            return i;
    return -1;
}

static npg_status refuse_name(const char *name, size_t length)
{
    char names[256] = "";
    for (int i = 0; npg_exporters[i]; i++) {
        size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, "%s%s", i ? ", " : "", npg_exporters[i]->name);
    }
    return npg_error(NPG_USAGE, "option export: \"%.*s\" is none of %s", (int)(length > 60 ? 60 : length),
                     name, names);
}

npg_status npg_exporters_choose(npg_export_choice *choice, const char *list, const char *sequence)
{
    bool is_chosen[NPG_EXPORTERS_MAX] = {false};
    int ply = find_exporter("ply", 3), obj = find_exporter("obj", 3);
    *choice = (npg_export_choice){0};
    for (const char *name = list; *name;) {
        size_t length = strcspn(name, ",");
        int at = find_exporter(name, length);
        if (at < 0) return refuse_name(name, length);
        is_chosen[at] = true;
        name += length;
        if (*name == ',' && !*++name) return refuse_name(name, 0);
    }
    choice->has_sequence = is_chosen[ply] || is_chosen[obj];
    choice->is_obj = sequence ? !strcmp(sequence, "obj") : !is_chosen[ply] && is_chosen[obj];
    is_chosen[choice->is_obj ? obj : ply] = false;
    for (int i = 0, count = 0; npg_exporters[i]; i++)
        if (is_chosen[i]) choice->chosen[count++] = npg_exporters[i];
    return NPG_OK;
}

bool npg_exporters_has(const npg_export_choice *choice, const char *name)
{
    int i = 0;
    while (choice->chosen[i] && strcmp(choice->chosen[i]->name, name) != 0) i++;
    return choice->chosen[i];
}

char *npg_exporters_list(const npg_export_choice *choice)
{
    size_t size = 4;
    for (int i = 0; choice->chosen[i]; i++) size += strlen(choice->chosen[i]->name) + 1;
    char *list = malloc(size);
    if (list) strcpy(list, choice->is_obj ? "obj" : "ply");
    for (int i = 0; choice->chosen[i] && list; i++) strcat(strcat(list, ","), choice->chosen[i]->name);
    return list;
}

json_t *npg_exporters_json(const npg_export_choice *choice)
{
    json_t *names = json_array();
    json_array_append_new(names, json_string(choice->is_obj ? "obj" : "ply"));
    for (int i = 0; choice->chosen[i]; i++)
        json_array_append_new(names, json_string(choice->chosen[i]->name));
    return names;
}

/* ---- what can be had ---- */

/* Vertices may lie a little outside the box of the points; the bar has room for that. */
static npg_status check_floats(const npg_exporter *exporter, const npg_export_facts *facts)
{
    if (facts->largest / FLOAT_STEPS <= KEPT_SHARE * facts->diagonal) return NPG_OK;
    return npg_error(NPG_USAGE,
                     "%s can't hold the capture: its numbers have 24 bits, "
                     "and coordinates up to %g in a box of diagonal %g "
                     "would lose more than a millionth of it; "
                     "set centre to write them around 0",
                     exporter->name, facts->largest, facts->diagonal);
}

npg_status npg_exporters_check(const npg_export_choice *choice, const npg_export_facts *facts)
{
    for (int i = 0; choice->chosen[i]; i++) {
        if (choice->chosen[i]->is_surface && !facts->face_count && facts->vert_count)
            return npg_error(NPG_USAGE, "%s holds surfaces, and these are points without faces",
                             choice->chosen[i]->name);
        if (choice->chosen[i]->is_float) NPG_TRY(check_floats(choice->chosen[i], facts));
        if (choice->chosen[i]->check) NPG_TRY(choice->chosen[i]->check(facts));
    }
    return NPG_OK;
}

uint64_t npg_exporters_bytes(const npg_export_choice *choice, const npg_export_facts *facts)
{
    uint64_t sum = 0;
    for (int i = 0; choice->chosen[i] && facts->pose_count > 0; i++) sum += choice->chosen[i]->bytes(facts);
    return sum;
}

npg_status npg_export_folder(const char *output, const char *name)
{
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, output, name));
    return npg_make_folder(path);
}

float npg_srgb_to_linear(uint8_t byte)
{
    double value = byte / 255.0;
    return (float)(value <= 0.04045 ? value / 12.92 : pow((value + 0.055) / 1.055, 2.4));
}
