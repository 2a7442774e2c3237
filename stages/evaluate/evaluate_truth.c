/* Truth: a folder of true meshes, and how near a frame comes to its own. */
#include <ctype.h>
#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate/evaluate_truth.h"
#include "geometry/metrics.h"
#include "ingest/formats/reader.h"
#include "pipeline/file.h"

#define SAMPLES 100000 /* of either surface, as neupig eval takes; set by trial               */
#define TAU     0.005  /* of the F-score, in diagonals: the F-0.5 % of the paper's evaluation */

typedef struct truth_file {
    int64_t number;
    char *path; /* owned */
} truth_file;

struct npg_truth {
    truth_file *files; /* sorted by number; owned */
    size_t count, capacity;
    double diagonal;    /* 0 until the first comparison */
    uint32_t *truth_of; /* V, of the first frame compared; owned */
    size_t truth_vert_count;
};

/* ---- the folder ---- */

/* The last run of digits of a mesh file's name. */
static bool number_of_name(int64_t *number, const char *name)
{
    const char *dot = strrchr(name, '.');
    if (name[0] == '.' || !dot || (strcmp(dot, ".ply") != 0 && strcmp(dot, ".obj") != 0)) return false;
    const char *end = dot;
    while (end > name && !isdigit((unsigned char)end[-1])) end--;
    const char *first = end;
    while (first > name && isdigit((unsigned char)first[-1])) first--;
    if (first == end || end - first > 18) return false; /* 18 digits always fit an int64_t */
    *number = strtoll(first, NULL, 10);
    return true;
}

static int by_number(const void *left, const void *right)
{
    const truth_file *a = left, *b = right;
    return a->number < b->number ? -1 : a->number > b->number;
}

static npg_status add_file(npg_truth *truth, const char *folder, const char *name, int64_t number)
{
    NPG_TRY(npg_grow(&truth->files, &truth->capacity, truth->count + 1, sizeof *truth->files, NPG_FOR_FILES));
    NPG_TRY(npg_join_path(&truth->files[truth->count].path, folder, name));
    truth->files[truth->count++].number = number;
    return NPG_OK;
}

static npg_status list_files(npg_truth *truth, const char *folder)
{
    int64_t number;
    npg_status status = NPG_OK;
    DIR *listing = opendir(folder);
    if (!listing) return npg_error(NPG_BAD_INPUT, "truth %s: %s", folder, strerror(errno));
    for (struct dirent *entry; !status && (entry = readdir(listing));)
        if (number_of_name(&number, entry->d_name)) status = add_file(truth, folder, entry->d_name, number);
    closedir(listing);
    NPG_TRY(status);
    if (!truth->count) return npg_error(NPG_BAD_INPUT, "truth %s: no numbered .ply or .obj file", folder);
    qsort(truth->files, truth->count, sizeof *truth->files, by_number);
    for (size_t i = 1; i < truth->count; i++)
        if (truth->files[i].number == truth->files[i - 1].number)
            return npg_error(NPG_BAD_INPUT, "truth %s: %s and %s have the same number", folder,
                             truth->files[i - 1].path, truth->files[i].path);
    return NPG_OK;
}

npg_status npg_truth_open(npg_truth **out, const char *folder, bool is_confined)
{
    npg_truth *truth;
    NPG_TRY(npg_alloc(&truth, NPG_FOR_FILES, sizeof *truth));
    npg_status status = list_files(truth, folder);
    for (size_t i = 0; is_confined && i < truth->count && !status; i++)
        status = npg_error_prefix(npg_path_confine(truth->files[i].path, folder), "truth");
    if (status) npg_truth_close(&truth);
    *out = truth;
    return status;
}

void npg_truth_close(npg_truth **slot)
{
    npg_truth *truth = *slot;
    if (!truth) return;
    for (size_t i = 0; i < truth->count; i++) npg_release(&truth->files[i].path);
    npg_release(&truth->files);
    npg_release(&truth->truth_of);
    npg_release(slot);
}

/* ---- comparing ---- */

static const char *path_of(const npg_truth *truth, int64_t number)
{
    truth_file key = {.number = number};
    const truth_file *file = bsearch(&key, truth->files, truth->count, sizeof *truth->files, by_number);
    return file ? file->path : NULL;
}

/* Read a true mesh in the run's local coordinates. */
static npg_status read_truth(npg_mesh **mesh, const char *path, const npg_facts *facts)
{
    npg_origin origin = facts->origin;
    return npg_error_prefix(npg_read_mesh(mesh, path, &origin), "truth");
}

static npg_status find_diagonal(npg_truth *truth, const npg_facts *facts)
{
    npg_mesh *mesh;
    const char *path = path_of(truth, facts->number_min);
    if (!path) path = truth->files[0].path;
    NPG_TRY(read_truth(&mesh, path, facts));
    truth->diagonal = npg_points_diagonal(mesh->vert_pos, mesh->vert_count);
    npg_mesh_unref(&mesh);
    if (!(truth->diagonal > 0)) return npg_error(NPG_BAD_INPUT, "truth %s: all vertices in one place", path);
    return NPG_OK;
}

static npg_status open_predicted(npg_mesh **mesh, const npg_frame *frame, const npg_facts *facts)
{
    const npg_mesh *reference = facts->reference;
    NPG_TRY(npg_mesh_open(mesh, frame->vert_count, reference->face_count));
    npg_box_unit_to_local(&facts->box, (*mesh)->vert_pos, frame->vert_unit, frame->vert_count);
    memcpy((*mesh)->faces, reference->faces, reference->face_count * 3 * sizeof *reference->faces);
    return NPG_OK;
}

static npg_status compare_meshes(npg_truth *truth, npg_frame *frame, const npg_mesh *predicted,
                                 const npg_mesh *true_mesh, uint64_t seed)
{
    npg_frame_metrics found;
    npg_metrics_settings settings = {SAMPLES, TAU, truth->diagonal, seed, 0};
    NPG_TRY(npg_metrics_compare(&found, predicted, true_mesh, &settings, (uint64_t)frame->index));
    frame->figures.truth_cd = found.cd;
    frame->figures.truth_nc = found.nc;
    frame->figures.truth_f = found.f;
    if (!truth->truth_of) {
        NPG_TRY(npg_metrics_tie(&truth->truth_of, predicted, true_mesh));
        truth->truth_vert_count = true_mesh->vert_count;
    }
    bool is_constant = true_mesh->vert_count == truth->truth_vert_count;
    frame->figures.truth_corr =
        is_constant ? npg_metrics_drift(predicted, true_mesh, truth->truth_of, truth->diagonal) : (double)NAN;
    return NPG_OK;
}

npg_status npg_truth_compare(npg_truth *truth, npg_frame *frame, const npg_facts *facts, uint64_t seed)
{
    npg_mesh *predicted = NULL, *true_mesh = NULL;
    const char *path = path_of(truth, frame->number);
    if (!path) return NPG_OK;
    if (!(truth->diagonal > 0)) NPG_TRY(find_diagonal(truth, facts));
    npg_status status = open_predicted(&predicted, frame, facts);
    if (!status) status = read_truth(&true_mesh, path, facts);
    if (!status) status = compare_meshes(truth, frame, predicted, true_mesh, seed);
    npg_mesh_unref(&predicted);
    npg_mesh_unref(&true_mesh);
    return status;
}
