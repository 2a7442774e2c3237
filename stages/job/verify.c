/* Verify: whether the files that done.json lists are those that were written. */
#include <string.h>

#include "job/job_internal.h"
#include "pipeline/struct_size.h"

typedef struct verifying {
    npg_verified found;
    char first[1024]; /* what is wrong with the first damaged file */
    void *user;
    void (*damaged)(void *user, const char *text);
} verifying;

static void note_damaged(verifying *v)
{
    if (!v->found.damaged++) snprintf(v->first, sizeof v->first, "%s", npg_error_text());
    if (v->damaged) v->damaged(v->user, npg_error_text());
}

static npg_status verify_folder(verifying *v, const char *folder, int depth);

/* One entry; of a segment (segment_0000/done.json) also what that lists in turn. */
static npg_status verify_entry(verifying *v, const char *folder, const json_t *entry, int depth)
{
    const char *name = json_string_value(json_object_get(entry, "path"));
    const char *end = name ? strstr(name, "/done.json") : NULL;
    v->found.files++;
    bool is_list =
        end && !depth && npg_path_stays(name); /* which is exchanged where a segment gets more formats */
    npg_status status = is_list ? NPG_OK : npg_file_check(entry, folder, name ? name : "");
    if (status == NPG_BAD_INPUT) note_damaged(v);
    if (status || !is_list) return status == NPG_BAD_INPUT ? NPG_OK : status;
    char path[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(path, folder, name));
    path[strlen(path) - strlen(end)] = 0;
    return verify_folder(v, path, depth + 1);
}

static npg_status verify_folder(verifying *v, const char *folder, int depth)
{
    json_t *done, *entry;
    size_t i;
    NPG_TRY(npg_json_load(&done, folder, "done.json", NPG_BAD_INPUT));
    const json_t *files = json_object_get(done, "files");
    npg_status status = json_array_size(files) ? NPG_OK
                        : done ? npg_error(NPG_BAD_INPUT, "%s/done.json lists no files", folder)
                               : npg_error(NPG_BAD_INPUT, "%s is not done: there is no done.json", folder);
    json_array_foreach(files, i, entry) if (!status) status = verify_entry(v, folder, entry, depth);
    json_decref(done);
    return status;
}

npg_status npg_verify(npg_verified *found, const char *output, void *user,
                      void (*damaged)(void *user, const char *text))
{
    verifying v = {.found = {.struct_size = sizeof v.found}, .user = user, .damaged = damaged};
    NPG_REQUIRE(found && output);
    NPG_TRY(verify_folder(&v, output, 0));
    NPG_TRY(npg_struct_give(found, &v.found, sizeof v.found, NPG_SIZE_UP_TO(npg_verified, damaged), "found"));
    if (v.found.damaged < 2) return v.found.damaged ? npg_error(NPG_BAD_INPUT, "%s", v.first) : NPG_OK;
    return npg_error(NPG_BAD_INPUT, "%s, and %zu of the other files of %s", v.first, v.found.damaged - 1,
                     output);
}
