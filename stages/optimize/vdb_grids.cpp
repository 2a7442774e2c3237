// Latent grids as OpenVDB files that other programs open.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <cstdio>
#include <string>

extern "C" {
#include "job/vdb_file.h"
#include "optimize/vdb_grids.h"
}
#include "geometry/guard.hpp"
#include "job/vdb_writer.hpp"

namespace
{

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

std::string name_of(const npg_level &level, int at, int channel)
{
    char text[64];
    std::snprintf(text, sizeof text, "%s_L%02d_c%02d", level.kind == NPG_LEVEL_NORMAL ? "normal" : "position",
                  at, channel);
    return text;
}

// A node's values from the first of a grid's channels on.
void take(const float *from, float &to)
{
    to = from[0];
}
void take(const float *from, openvdb::Vec3s &to)
{
    to = openvdb::Vec3s(from[0], from[1], from[2]);
}
void give(const float &from, float *to)
{
    to[0] = from;
}
void give(const openvdb::Vec3s &from, float *to)
{
    for (int c = 0; c < 3; c++) to[c] = from[c];
}

// Calls body(coordinate, row) for every node of a level.
template <class Body> void each_node(const npg_level &level, Body body)
{
    size_t row = level.first_row;
    for (int i = 0; i < level.nodes; i++)
        for (int j = 0; j < level.nodes; j++)
            for (int k = 0; k < level.nodes; k++) body(openvdb::Coord(i, j, k), row++);
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
    grid.insertMeta("npg_screen", openvdb::DoubleMetadata(level.screen));
    grid.insertMeta("npg_degree", openvdb::DoubleMetadata(level.degree));
    grid.insertMeta("npg_channel_first", openvdb::Int32Metadata(channel));
    grid.insertMeta("npg_frame_first", openvdb::Int64Metadata(place.frame_first));
    grid.insertMeta("npg_frame_last", openvdb::Int64Metadata(place.frame_last));
}

template <class Grid>
void add_grid(npg::vdb_writer &file, const npg_level &level, int at, int channel, const float *rows,
              const npg_vdb_place &place)
{
    auto grid = Grid::create();
    auto accessor = grid->getAccessor();
    each_node(level, [&](const openvdb::Coord &node, size_t row) {
        typename Grid::ValueType value;
        take(rows + row * NPG_LATENT_CHANNELS + size_t(channel), value);
        accessor.setValueOn(node, value);
    });
    describe(*grid, level, at, channel, place);
    file.add(grid);
}

template <class Grid>
npg_status read_grid(openvdb::io::File &file, const npg_level &level, int at, int channel, float *rows)
{
    auto base = file.readGrid(name_of(level, at, channel));
    auto grid = openvdb::gridPtrCast<Grid>(base);
    size_t nodes = size_t(level.nodes), all = nodes * nodes * nodes;
    if (!grid || grid->activeVoxelCount() != all)
        return npg_error(NPG_BAD_INPUT, "the grid %s has %zu values in place of %zu",
                         name_of(level, at, channel).c_str(), grid ? size_t(grid->activeVoxelCount()) : 0,
                         all);
    auto accessor = grid->getConstAccessor();
    each_node(level, [&](const openvdb::Coord &node, size_t row) {
        give(accessor.getValue(node), rows + row * NPG_LATENT_CHANNELS + size_t(channel));
    });
    return NPG_OK;
}

// Calls vec3(at, channel) or single(at, channel) for every grid that the levels make.
template <class Vec3, class Single> npg_status each_grid(const npg_levels *levels, Vec3 vec3, Single single)
{
    for (int at = 0; at < levels->count; at++) {
        const npg_level &level = levels->level[at];
        if (level.kind == NPG_LEVEL_HASHED) continue;
        int channel = level.channel_first;
        for (; channel + 3 <= level.channel_end; channel += 3) NPG_TRY(vec3(at, channel));
        for (; channel < level.channel_end; channel++) NPG_TRY(single(at, channel));
    }
    return NPG_OK;
}

int32_t grid_count(const npg_levels *levels)
{
    int32_t count = 0;
    auto one_more = [&](int, int) {
        count++;
        return NPG_OK;
    };
    each_grid(levels, one_more, one_more);
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
        NPG_TRY(each_grid(
            levels,
            [&](int at, int channel) {
                add_grid<Vec3SGrid>(file, levels->level[at], at, channel, rows, *place);
                return NPG_OK;
            },
            [&](int at, int channel) {
                add_grid<FloatGrid>(file, levels->level[at], at, channel, rows, *place);
                return NPG_OK;
            }));
        file.close();
        return NPG_OK;
    });
}

npg_status npg_vdb_load_levels(const char *path, const npg_levels *levels, float *rows)
{
    return npg::guard("OpenVDB", [&] {
        openvdb::initialize();
        openvdb::io::File file(path);
        file.open(false); // all at once: no copy in a temporary folder
        npg_status status = each_grid(
            levels,
            [&](int at, int channel) {
                return read_grid<Vec3SGrid>(file, levels->level[at], at, channel, rows);
            },
            [&](int at, int channel) {
                return read_grid<FloatGrid>(file, levels->level[at], at, channel, rows);
            });
        file.close();
        return status;
    });
}
