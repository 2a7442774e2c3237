// Latent grids as OpenVDB files that other programs open.
#include <openvdb/openvdb.h>

#include <cstdio>
#include <string>

extern "C" {
#include "job/vdb_file.h"
#include "optimize/grids/vdb_grids.h"
}
#include "geometry/guard.hpp"
#include "job/vdb_writer.hpp"

namespace
{

std::string name_of(const npg_level &level, int at, int channel)
{
    char text[64];
    std::snprintf(text, sizeof text, "%s_L%02d_c%02d", level.kind == NPG_LEVEL_NORMAL ? "normal" : "position",
                  at, channel);
    return text;
}

double unit_step(const npg_level &level)
{
    return 2.0 / (level.nodes - 1);
}

// Whether a grid's voxels have to stay in the cube [-1, 1]^3, though they stand for places.
bool stays_unit(const npg_level &level, const npg_vdb_place &place)
{
    return level.kind != NPG_LEVEL_NORMAL && unit_step(level) / place.unit_per_world < NPG_VDB_VOXEL_MIN;
}

openvdb::math::Transform::Ptr transform_of(const npg_level &level, const npg_vdb_place &place)
{
    bool is_unit = level.kind == NPG_LEVEL_NORMAL || stays_unit(level, place);
    double scale = is_unit ? 1 : 1 / place.unit_per_world, step = unit_step(level) * scale;
    openvdb::Vec3d first(-scale);
    if (!is_unit) first += openvdb::Vec3d(place.world_centre);
    auto transform = openvdb::math::Transform::createLinearTransform(step);
    transform->postTranslate(first);
    return transform;
}

void describe(openvdb::GridBase &grid, const npg_level &level, int at, int channel,
              const npg_vdb_place &place)
{
    grid.setName(name_of(level, at, channel));
    grid.setTransform(transform_of(level, place));
    if (stays_unit(level, place)) grid.insertMeta("npg_space", openvdb::StringMetadata("unit"));
    grid.insertMeta("npg_level", openvdb::Int32Metadata(at));
    grid.insertMeta("npg_nodes", openvdb::Int32Metadata(level.nodes));
    grid.insertMeta("npg_lambda", openvdb::DoubleMetadata(level.lambda));
    grid.insertMeta("npg_channel", openvdb::Int32Metadata(channel));
    grid.insertMeta("npg_frame_first", openvdb::Int64Metadata(place.frame_first));
    grid.insertMeta("npg_frame_last", openvdb::Int64Metadata(place.frame_last));
}

void add_grid(npg::vdb_writer &file, const npg_level &level, int at, int channel, const float *rows,
              const npg_vdb_place &place)
{
    auto grid = openvdb::FloatGrid::create();
    auto accessor = grid->getAccessor();
    const float *from = rows + level.first_row * NPG_LATENT_CHANNELS + size_t(channel);
    for (int i = 0; i < level.nodes; i++)
        for (int j = 0; j < level.nodes; j++)
            for (int k = 0; k < level.nodes; k++, from += NPG_LATENT_CHANNELS)
                accessor.setValueOn(openvdb::Coord(i, j, k), *from);
    describe(*grid, level, at, channel, place);
    file.add(grid);
}

int32_t grid_count(const npg_levels *levels)
{
    int32_t count = 0;
    for (int at = 0; at < levels->count; at++)
        count += levels->level[at].channel_end - levels->level[at].channel_first;
    return count;
}

} // namespace

npg_status npg_vdb_save_levels(const char *path, const npg_levels *levels, const float *rows,
                               const npg_vdb_place *place)
{
    return npg::guard("OpenVDB", [&] {
        openvdb::initialize();
        openvdb::MetaMap about;
        about.insertMeta("npg_version", openvdb::StringMetadata(npg_version()));
        about.insertMeta("npg_window", openvdb::Int64Metadata(place->window));
        about.insertMeta("npg_levels", openvdb::Int32Metadata(levels->count));
        about.insertMeta("npg_world_centre", openvdb::Vec3DMetadata(openvdb::Vec3d(place->world_centre)));
        about.insertMeta("npg_unit_per_world", openvdb::DoubleMetadata(place->unit_per_world));
        npg::vdb_writer file(path, about, grid_count(levels));
        for (int at = 0; at < levels->count; at++) {
            const npg_level &level = levels->level[at];
            for (int channel = level.channel_first; channel < level.channel_end; channel++)
                add_grid(file, level, at, channel, rows, *place);
        }
        file.close();
        return NPG_OK;
    });
}
