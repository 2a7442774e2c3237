// A level set, read with OpenVDB itself.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/LevelSetMeasure.h>

#include "tests/export/read_surface.h"

void read_surface(const char *path, double *area, double *volume, double *voxel)
{
    openvdb::initialize();
    openvdb::io::File file(path);
    file.open(false);
    auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid("surface"));
    file.close();
    bool is_level_set = grid && grid->getGridClass() == openvdb::GRID_LEVEL_SET;
    *area = is_level_set ? openvdb::tools::levelSetArea(*grid) : -1;
    *volume = is_level_set ? openvdb::tools::levelSetVolume(*grid) : -1;
    *voxel = is_level_set ? grid->voxelSize()[0] : -1;
}
