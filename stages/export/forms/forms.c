/* Forms: the table, and whether what was asked for can be had. */
#include "export/forms/forms.h"

#include <string.h>

#define FLOAT_STEPS 16777216 /* 2^24: float rounds by at most 1 / this of the largest coordinate */
#define KEPT_SHARE  1e-6     /* of the box: what positions may lose, a micrometre in a metre */

extern const npg_form npg_form_obj, npg_form_pc2, npg_form_mdd, npg_form_glb, npg_form_usda, npg_form_npz,
    npg_form_vdb;

const npg_form *const npg_forms[] = {&npg_form_obj,  /* beside PLY                           */
                                     &npg_form_pc2,  /* 3ds Max, Blender, Marvelous Designer */
                                     &npg_form_mdd,  /* LightWave, Blender, three.js         */
                                     &npg_form_glb,  /* the web, Blender, Unreal             */
                                     &npg_form_usda, /* USD tools, Unreal                    */
                                     &npg_form_npz,  /* NumPy                                */
                                     &npg_form_vdb,  /* Houdini, Blender                     */
                                     NULL};

/* ---- choosing ---- */

static int find_form(const char *name, size_t length)
{
    for (int i = 0; npg_forms[i]; i++)
        if (strlen(npg_forms[i]->name) == length && !strncmp(npg_forms[i]->name, name, length)) return i;
    return -1;
}

static npg_status refuse_name(const char *name, size_t length)
{
    char names[256] = "ply";
    for (int i = 0; npg_forms[i]; i++) {
        size_t used = strlen(names);
        snprintf(names + used, sizeof names - used, ", %s", npg_forms[i]->name);
    }
    return npg_error(NPG_USAGE, "option export: \"%.*s\" is none of %s", (int)(length > 60 ? 60 : length),
                     name, names);
}

npg_status npg_forms_choose(npg_form_choice *choice, const char *list, bool is_obj)
{
    bool has_ply = false;
    int obj = find_form("obj", 3);
    *choice = (npg_form_choice){.is_obj = is_obj};
    for (const char *name = list; *name;) {
        size_t length = strcspn(name, ",");
        int form = find_form(name, length);
        bool is_ply = length == 3 && !strncmp(name, "ply", 3);
        if (form < 0 && !is_ply) return refuse_name(name, length);
        has_ply = has_ply || is_ply;
        if (form >= 0) choice->is_chosen[form] = true;
        name += length;
        if (*name == ',' && !*++name) return refuse_name(name, 0);
    }
    choice->is_obj = !has_ply && (is_obj || (obj >= 0 && choice->is_chosen[obj]));
    if (obj >= 0) choice->is_chosen[obj] = has_ply && (is_obj || choice->is_chosen[obj]);
    return NPG_OK;
}

bool npg_forms_name(const char *list, const char *name)
{
    size_t length = strlen(name);
    for (; *list; list += *list == ',') {
        size_t size = strcspn(list, ",");
        if (size == length && !strncmp(list, name, length)) return true;
        list += size;
    }
    return false;
}

bool npg_forms_any(const npg_form_choice *choice)
{
    for (int i = 0; npg_forms[i]; i++)
        if (choice->is_chosen[i]) return true;
    return false;
}

json_t *npg_forms_json(const npg_form_choice *choice)
{
    json_t *names = json_array();
    json_array_append_new(names, json_string(choice->is_obj ? "obj" : "ply"));
    for (int i = 0; npg_forms[i]; i++)
        if (choice->is_chosen[i]) json_array_append_new(names, json_string(npg_forms[i]->name));
    return names;
}

/* ---- what can be had ---- */

/* Vertices may lie a little outside the box of the points; the bar has room for that. */
static npg_status check_floats(const npg_form *form, const npg_form_facts *facts)
{
    if (facts->largest / FLOAT_STEPS <= KEPT_SHARE * facts->diagonal) return NPG_OK;
    return npg_error(NPG_USAGE,
                     "%s can't hold the capture: its numbers have 24 bits, "
                     "and coordinates up to %g in a box of diagonal %g "
                     "would lose more than a millionth of it; "
                     "set centre to write them around 0",
                     form->name, facts->largest, facts->diagonal);
}

npg_status npg_forms_check(const npg_form_choice *choice, const npg_form_facts *facts)
{
    for (int i = 0; npg_forms[i]; i++) {
        if (!choice->is_chosen[i]) continue;
        if (npg_forms[i]->is_float) NPG_TRY(check_floats(npg_forms[i], facts));
        if (npg_forms[i]->check) NPG_TRY(npg_forms[i]->check(facts));
    }
    return NPG_OK;
}

uint64_t npg_forms_bytes(const npg_form_choice *choice, const npg_form_facts *facts)
{
    uint64_t sum = 0;
    for (int i = 0; npg_forms[i]; i++)
        if (choice->is_chosen[i] && npg_forms[i]->bytes) sum += npg_forms[i]->bytes(facts);
    return sum;
}
