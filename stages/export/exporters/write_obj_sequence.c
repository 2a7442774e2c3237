/* OBJ sequence beside a PLY one: OUT/obj/<prefix>_0000.obj. */

#include "export/exporters/exporters_internal.h"

typedef struct obj_state {
    npg_writer writer;
    npg_mesh_names names;
} obj_state;

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

static npg_status open_sequence(void *state)
{
    obj_state *s = state;
    const npg_export_facts *facts = s->writer.facts;
    s->names = (npg_mesh_names){facts->prefix, "obj", facts->width};
    return npg_export_folder(facts->output, "obj");
}

static npg_status write_pose(void *state, const npg_pose *pose)
{
    obj_state *s = state;
    char file[NPG_MESH_NAME_SIZE + 8] = "obj/", path[NPG_PATH_SIZE];
    npg_mesh_name(file + 4, &s->names, pose->number);
    NPG_TRY(npg_path_of(path, s->writer.facts->output, file));
    npg_status status = npg_write_obj_pose(path, s->writer.facts, pose->pos, pose->normals, pose->colours);
    return status ? status : npg_export_made(s->writer.facts->log, "obj", file, pose->index, 1);
}

const npg_exporter npg_exporter_obj = {.name = "obj",
                                       .help = "OBJ sequence",
                                       .state_size = sizeof(obj_state),
                                       .bytes = bytes,
                                       .open = open_sequence,
                                       .pose = write_pose};
