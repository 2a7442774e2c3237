// The grids that npg_vdb_save_levels() wrote, back in their rows: what another program would read.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <cstdio>
#include <string>

extern "C" {
#include "optimize/grids/vdb_grids.h"
#include "tests/job/read_levels.h"
}

namespace
{

std::string name_of(const npg_level &level, int at, int channel)
{
    char text[64];
    const char *kind = level.kind == NPG_LEVEL_NORMAL ? "normal" : "position";
    std::snprintf(text, sizeof text, "%s_L%02d_c%02d", kind, at, channel);
    return text;
}

bool read_grid(openvdb::io::File &file, const npg_level &level, int at, int channel, float *rows)
{
    auto grid = openvdb::gridPtrCast<openvdb::FloatGrid>(file.readGrid(name_of(level, at, channel)));
    size_t row = level.first_row;
    if (!grid || grid->activeVoxelCount() != level.row_count) return false;
    auto accessor = grid->getConstAccessor();
    for (int i = 0; i < level.nodes; i++)
        for (int j = 0; j < level.nodes; j++)
            for (int k = 0; k < level.nodes; k++, row++)
                rows[row * NPG_LATENT_CHANNELS + size_t(channel)] =
                    accessor.getValue(openvdb::Coord(i, j, k));
    return true;
}

} // namespace

bool read_levels(const char *path, const npg_levels *levels, float *rows)
{
    openvdb::initialize();
    openvdb::io::File file(path);
    bool is_whole = true;
    file.open(false); // all at once: no copy in a temporary folder
    for (int at = 0; at < levels->count; at++) {
        const npg_level &level = levels->level[at];
        for (int channel = level.channel_first; channel < level.channel_end; channel++)
            is_whole = read_grid(file, level, at, channel, rows) && is_whole;
    }
    file.close();
    return is_whole;
}
