/* Writers: the format by the name's ending. */
#include "export/files.h"

#include <string.h>
#include <strings.h>

npg_status npg_write_mesh(const char *path, const npg_mesh_view *mesh)
{
    const char *slash = strrchr(path, '/'), *dot = strrchr(slash ? slash : path, '.');
    if (dot && !strcasecmp(dot, ".ply")) return npg_write_ply(path, mesh);
    if (dot && !strcasecmp(dot, ".obj")) return npg_write_obj(path, mesh);
    return npg_error(NPG_USAGE, "%s: a mesh is written as .ply or .obj", path);
}
