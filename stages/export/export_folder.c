/* The results' folder: can it be written, and what of an earlier run lies in it. */
#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "export/exporters/exporters_internal.h"
#include "job/job.h"
#include "pipeline/order.h"

#define PROBE_BYTES (256 << 10)

void npg_mesh_name(char name[NPG_MESH_NAME_SIZE], const npg_mesh_names *names, int64_t number)
{
    snprintf(name, NPG_MESH_NAME_SIZE, "%s_%0*lld.%s", names->prefix, names->width, (long long)number,
             names->ending);
}

int npg_number_width(int64_t number_max)
{
    int width = 4;
    for (int64_t limit = 10000; number_max >= limit && width < 18; limit *= 10) width++;
    return width;
}

npg_status npg_folder_probe(const char *output)
{
    static const char zeros[4096];
    char path[NPG_PATH_SIZE];
    npg_file *file;
    NPG_TRY(npg_make_folder(output));
    NPG_TRY(npg_path_of(path, output, ".write-test"));
    npg_status status = npg_file_open(&file, path);
    if (!status) {
        for (size_t i = 0; i < PROBE_BYTES / sizeof zeros; i++) npg_file_write(file, zeros, sizeof zeros);
        status = npg_file_commit(&file);
        unlink(path);
    }
    return status;
}

/* ---- mesh files of any run ---- */

bool npg_mesh_name_read(const char *name, const char *endings, int64_t *number)
{
    size_t length = strlen(name);
    if (name[0] == '.' && length > 6 && !strcmp(name + length - 5, ".part")) length -= 5;
    char ending[8] = "";
    if (length < 7) return false;
    snprintf(ending, sizeof ending, "%.4s ", name + length - 4);
    if (!strstr(endings, ending)) return false;
    size_t first = length - 4;
    while (first > 0 && isdigit((unsigned char)name[first - 1])) first--;
    if (length - 4 - first < 4 || length - 4 - first > 18) return false;
    if (first > 1 && name[first - 1] == '-') first--; /* numbers may be negative */
    *number = strtoll(name + first, NULL, 10);
    return first > 1 && name[first - 1] == '_';
}

/* Call visit(user, folder, name, number) for each mesh file; a folder that does not exist has none. */
typedef npg_status visit_mesh(void *user, const char *folder, const char *name, int64_t number);

typedef struct meshes {
    const char *folder;
    visit_mesh *visit;
    void *user;
} meshes;

static npg_status visit_name(void *user, const char *name)
{
    const meshes *m = user;
    int64_t number;
    return npg_mesh_name_read(name, ".ply .obj ", &number) ? m->visit(m->user, m->folder, name, number)
                                                           : NPG_OK;
}

static npg_status each_mesh(const char *output, visit_mesh *visit, void *user)
{
    char folder[NPG_PATH_SIZE];
    NPG_TRY(npg_path_of(folder, output, "meshes"));
    return npg_folder_each(folder, NPG_DISK, visit_name, &(meshes){folder, visit, user});
}

typedef struct own_meshes {
    bool are_ours; /* a run was here before: what has our names may be its */
    const npg_mesh_names *names;
    const int64_t *numbers;
    size_t number_count;
} own_meshes;

static npg_status refuse_foreign(void *user, const char *folder, const char *name, int64_t number)
{
    const own_meshes *own = user;
    char own_name[NPG_MESH_NAME_SIZE];
    npg_mesh_name(own_name, own->names, number);
    if (name[0] == '.') return NPG_OK;
    if (own->are_ours && !strcmp(name, own_name) && own->number_count &&
        bsearch(&number, own->numbers, own->number_count, sizeof number, npg_order_int64))
        return NPG_OK;
    return npg_error(NPG_USAGE,
                     "%s/%s is not of this job, and would be lost or mix with its frames: "
                     "choose another output folder, or set overwrite to remove what earlier runs left",
                     folder, name);
}

bool npg_folder_has_run(const char *output)
{
    return npg_is_in_folder(output, "done.json") || npg_is_in_folder(output, "frames.jsonl") ||
           npg_is_in_folder(output, NPG_FRAME_LOG_NAME) || npg_is_in_folder(output, "job/job.json");
}

npg_status npg_folder_check(const char *output, const npg_mesh_names *names, const int64_t *numbers,
                            size_t number_count)
{
    own_meshes own = {npg_folder_has_run(output), names, numbers, number_count};
    return each_mesh(output, refuse_foreign, &own);
}

/* ---- room ---- */

static npg_status add_size(void *user, const char *folder, const char *name, int64_t number)
{
    uint64_t *sum = user;
    struct stat info;
    char path[NPG_PATH_SIZE];
    (void)number;
    NPG_TRY(npg_path_of(path, folder, name));
    if (!stat(path, &info)) *sum += (uint64_t)info.st_size;
    return NPG_OK;
}

npg_status npg_folder_has_room(const char *output, uint64_t bytes)
{
    struct statvfs info;
    uint64_t old_bytes = 0;
    NPG_TRY(each_mesh(output, add_size, &old_bytes));
    bytes -= old_bytes < bytes ? old_bytes : bytes;
    if (statvfs(output, &info)) return npg_error_errno(NPG_DISK, "can't look at the disk of %s", output);
    uint64_t block = info.f_frsize ? info.f_frsize : 1;
    if (bytes / block <= info.f_bavail) return NPG_OK;
    return npg_error(NPG_DISK, "%s: the results take about %llu MiB, but only %llu MiB are free", output,
                     (unsigned long long)(bytes >> 20),
                     (unsigned long long)((double)info.f_bavail * (double)block / 1048576));
}

/* ---- removing ---- */

static npg_status remove_mesh(void *user, const char *folder, const char *name, int64_t number)
{
    (void)user;
    (void)number;
    return npg_file_remove(folder, name);
}

npg_status npg_folder_clear(const char *output)
{
    static const char *const names[] = {
        "done.json", "report.json", "frames.jsonl", "frames.partial.jsonl", "reference.ply", "topology.json"};
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) NPG_TRY(npg_file_remove(output, names[i]));
    NPG_TRY(npg_exporters_clear(output));
    return each_mesh(output, remove_mesh, NULL);
}
