/* OBJ sequence beside a PLY one: OUT/obj/<prefix>_0000.obj. */
#include "export/exporters/exporters_internal.h"

npg_status npg_write_obj_pose(const char *path, const npg_export_facts *facts, const float *pos,
                              const float *normals, const uint8_t *colours)
{
    double *world;
    NPG_TRY(npg_alloc_array(&world, NPG_FOR_FILES, facts->vert_count, 3 * sizeof *world));
    for (size_t i = 0; i < 3 * facts->vert_count; i++) world[i] = (double)pos[i];
    npg_mesh_view view = {.vert_count = facts->vert_count,
                          .face_count = facts->face_count,
                          .vert_world = world,
                          .vert_normals = normals,
                          .faces = facts->faces,
                          .vert_colours = colours ? colours : facts->colours,
                          .vert_uvs = facts->uvs,
                          .turns_faces = facts->turns_faces};
    npg_status status =
        facts->like ? npg_write_obj_like(path, facts->like, &view) : npg_write_obj(path, &view);
    npg_release(&world);
    return status;
}

static uint64_t bytes(const npg_export_facts *facts)
{
    uint64_t per_vert = facts->has_normals ? 100 : 70; /* with its two faces, about */
    return (uint64_t)facts->pose_count * facts->vert_count * per_vert;
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    return npg_write_obj_pose(pose->path, ((npg_writer *)state)->facts, pose->pos, pose->normals,
                              pose->colours);
}

const npg_exporter npg_exporter_obj = {.name = "obj",
                                       .folder = "obj",
                                       .ending = "obj",
                                       .state_size = sizeof(npg_writer),
                                       .bytes = bytes,
                                       .pose = write_pose};
