/* Export as work to be timed: the file of one frame. */
#include "export/export.h"
#include "pipeline/memory.h"

typedef struct writing {
    npg_mesh_view view;
    const char *path;
} writing;

static npg_status write_frame(void *user)
{
    const writing *w = user;
    return npg_write_mesh(w->path, &w->view);
}

npg_status npg_export_work(const npg_mesh *mesh, const char *path, npg_work_visit *visit, void *user)
{
    double *world;
    const double V = (double)mesh->vert_count, F = (double)mesh->face_count;
    NPG_TRY(npg_alloc_array(&world, NPG_FOR_RUN, mesh->vert_count, 3 * sizeof *world));
    for (size_t i = 0; i < 3 * mesh->vert_count; i++) world[i] = (double)mesh->vert_pos[i];
    writing w = {.path = path,
                 .view = {.vert_count = mesh->vert_count,
                          .face_count = mesh->face_count,
                          .vert_world = world,
                          .vert_normals = mesh->vert_normals,
                          .faces = mesh->faces}};
    /* positions as double and normals come in, both as float go out; faces: three numbers, and a byte */
    npg_work work = {.name = "export_ply",
                     .call = write_frame,
                     .user = &w,
                     .bytes = V * (24 + 12 + 24) + F * (12 + 13),
                     .vertex_frames = V,
                     .on_host = true};
    npg_status status = visit(user, &work);
    npg_release(&world);
    return status;
}
