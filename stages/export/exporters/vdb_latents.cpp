// Latent grids as features, with their first principal component, as OpenVDB files.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>

#include <cmath>
#include <map>
#include <string>
#include <vector>

extern "C" {
#include "export/exporters/vdb.h"
#include "job/vdb_file.h"
}
#include "geometry/guard.hpp"
#include "job/vdb_writer.hpp"

namespace
{

using openvdb::FloatGrid;
using openvdb::Vec3SGrid;

// The grids of one level, by their first channel; without values until it is their turn.
struct level {
    std::map<int, openvdb::GridBase::Ptr> grids;
    int nodes, channels;
    double lambda;
    std::vector<double> values; // [n][n][n][C]
};

int channels_of(const openvdb::GridBase &grid)
{
    return grid.isType<Vec3SGrid>() ? 3 : 1;
}

// Calls body(coordinate, place of its first channel) for every node.
template <class Body> void each_node(const level &l, Body body)
{
    size_t at = 0;
    for (int i = 0; i < l.nodes; i++)
        for (int j = 0; j < l.nodes; j++)
            for (int k = 0; k < l.nodes; k++, at += size_t(l.channels)) body(openvdb::Coord(i, j, k), at);
}

// One value between a grid and the row of a node.
void to_doubles(double *to, const openvdb::Vec3s &from)
{
    for (int c = 0; c < 3; c++) to[c] = double(from[c]);
}
void to_doubles(double *to, float from)
{
    *to = double(from);
}
void from_doubles(openvdb::Vec3s &to, const double *from)
{
    to = openvdb::Vec3s(float(from[0]), float(from[1]), float(from[2]));
}
void from_doubles(float &to, const double *from)
{
    to = float(*from);
}

template <class Grid> void read_values(level &l, Grid &grid, size_t channel)
{
    auto accessor = grid.getConstAccessor();
    each_node(l, [&](const openvdb::Coord &node, size_t at) {
        to_doubles(&l.values[at + channel], accessor.getValue(node));
    });
}

template <class Grid> void write_values(const level &l, Grid &grid, size_t channel)
{
    auto accessor = grid.getAccessor();
    each_node(l, [&](const openvdb::Coord &node, size_t at) {
        typename Grid::ValueType value;
        from_doubles(value, &l.values[at + channel]);
        accessor.setValueOn(node, value);
    });
}

// Calls vec3(grid, channel) or single(grid, channel) for every grid, by the type of its values.
template <class Vec3, class Single> void each_grid(level &l, Vec3 vec3, Single single)
{
    size_t channel = 0;
    for (auto &[first, grid] : l.grids) {
        if (channels_of(*grid) == 3)
            vec3(*openvdb::gridPtrCast<Vec3SGrid>(grid), channel);
        else
            single(*openvdb::gridPtrCast<FloatGrid>(grid), channel);
        channel += size_t(channels_of(*grid));
    }
}

npg_status sort_into_levels(std::map<int, level> &levels, const openvdb::GridPtrVec &grids, const char *path)
{
    for (const auto &grid : grids) {
        if (!grid->isType<Vec3SGrid>() && !grid->isType<FloatGrid>())
            return npg_error(NPG_BAD_INPUT, "%s: the grid %s is of another type", path,
                             grid->getName().c_str());
        level &l = levels[grid->metaValue<int32_t>("npg_level")];
        l.nodes = grid->metaValue<int32_t>("npg_nodes");
        l.lambda = grid->metaValue<double>("npg_lambda");
        if (l.nodes < 1 || l.nodes > 4096) // damage: the fit's grids have at most some hundred nodes per axis
            return npg_error(NPG_BAD_INPUT, "%s: the grid %s has %d nodes", path, grid->getName().c_str(),
                             l.nodes);
        l.grids[grid->metaValue<int32_t>("npg_channel_first")] = grid;
        l.channels += channels_of(*grid);
    }
    return NPG_OK;
}

using openvdb::Mat4d;

// Row vectors times this matrix: written[a] = scale sign[a] (world - centre)[from[a]].
Mat4d world_to_written(const npg_placement *p)
{
    Mat4d matrix = Mat4d::zero();
    for (int a = 0; a < 3; a++) {
        matrix[p->from[a]][a] = p->scale * p->sign[a];
        matrix[3][a] = -p->scale * p->sign[a] * p->centre[p->from[a]];
    }
    matrix[3][3] = 1;
    return matrix;
}

Mat4d unit_to_world(const openvdb::MetaMap &about)
{
    Mat4d matrix = Mat4d::identity();
    double scale = 1 / about.metaValue<double>("npg_unit_per_world");
    matrix.setToScale(openvdb::Vec3d(scale));
    matrix.setTranslation(about.metaValue<openvdb::Vec3d>("npg_world_centre"));
    return matrix;
}

const char space_key[] = "npg_space";

// Grids over places to written coordinates, or to the unit cube where OpenVDB can't hold their voxels there.
void place(openvdb::GridBase &grid, const npg_placement *p, const openvdb::MetaMap &about)
{
    if (!p || grid.getName().rfind("position", 0) != 0) return;
    bool is_unit = grid.getMetadata<openvdb::StringMetadata>(space_key) != nullptr;
    Mat4d to_world = unit_to_world(about), matrix = world_to_written(p);
    if (is_unit) matrix = to_world * matrix;
    if (matrix == Mat4d::identity()) return;
    double step = grid.voxelSize()[0] * std::cbrt(std::abs(matrix.getMat3().det()));
    if (step >= NPG_VDB_VOXEL_MIN) {
        grid.transform().postMult(matrix);
        grid.removeMeta(space_key);
    } else if (!is_unit) {
        grid.transform().postMult(to_world.inverse());
        grid.insertMeta(space_key, openvdb::StringMetadata("unit"));
    }
}

npg_status make_component(FloatGrid::Ptr &out, const level &l)
{
    const openvdb::GridBase &like = *l.grids.begin()->second;
    size_t count = l.values.size() / size_t(l.channels);
    std::vector<double> values(count), direction(size_t(l.channels));
    double share;
    NPG_TRY(
        npg_features_component(values.data(), direction.data(), &share, l.values.data(), count, l.channels));
    out = FloatGrid::create();
    out->setTransform(like.transform().copy());
    out->setName(like.getName().substr(0, like.getName().rfind("_c")) + "_pc1");
    if (auto space = like[space_key]) out->insertMeta(space_key, *space);
    out->insertMeta("npg_share", openvdb::DoubleMetadata(share));
    out->insertMeta("npg_level", openvdb::Int32Metadata(like.metaValue<int32_t>("npg_level")));
    auto accessor = out->getAccessor();
    each_node(l, [&](const openvdb::Coord &node, size_t at) {
        accessor.setValueOn(node, float(values[at / size_t(l.channels)]));
    });
    return NPG_OK;
}

npg_status make_features(npg::vdb_writer &file, level &l, const npg_placement *placement,
                         const openvdb::MetaMap &about)
{
    size_t n = size_t(l.nodes);
    FloatGrid::Ptr component;
    l.values.resize(n * n * n * size_t(l.channels));
    each_grid(
        l, [&](Vec3SGrid &grid, size_t channel) { read_values(l, grid, channel); },
        [&](FloatGrid &grid, size_t channel) { read_values(l, grid, channel); });
    NPG_TRY(npg_features_solve(l.values.data(), l.nodes, l.channels, l.lambda));
    each_grid(
        l, [&](Vec3SGrid &grid, size_t channel) { write_values(l, grid, channel); },
        [&](FloatGrid &grid, size_t channel) { write_values(l, grid, channel); });
    for (auto &[first, grid] : l.grids) place(*grid, placement, about);
    NPG_TRY(make_component(component, l));
    for (auto &[first, grid] : l.grids) file.add(grid);
    file.add(component);
    return NPG_OK;
}

int32_t count_with_components(const std::map<int, level> &levels)
{
    size_t count = levels.size();
    for (const auto &[at, l] : levels) count += l.grids.size();
    return int32_t(count);
}

} // namespace

npg_status npg_vdb_save_latents(const char *path, npg_vdb_span *span, const char *grids_path,
                                const npg_placement *placement)
{
    NPG_REQUIRE(path && span && grids_path);
    return npg::guard("OpenVDB", [&] {
        openvdb::initialize();
        openvdb::io::File in(grids_path);
        in.open(false);
        std::map<int, level> levels;
        NPG_TRY(sort_into_levels(levels, *in.readAllGridMetadata(), grids_path));
        if (levels.empty()) return npg_error(NPG_BAD_INPUT, "%s: no latent grids", grids_path);
        const openvdb::GridBase &one = *levels.begin()->second.grids.begin()->second;
        *span = {one.metaValue<int64_t>("npg_frame_first"), one.metaValue<int64_t>("npg_frame_last")};
        npg::vdb_writer out(path, *in.getMetadata(), count_with_components(levels));
        for (auto &[at, l] : levels) {
            for (auto &[first, grid] : l.grids) grid = in.readGrid(grid->getName());
            NPG_TRY(make_features(out, l, placement, *in.getMetadata()));
            l = level(); // one level in memory at a time
        }
        out.close();
        return NPG_OK;
    });
}
