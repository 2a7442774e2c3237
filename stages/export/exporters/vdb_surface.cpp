// Level sets of surfaces as OpenVDB files.
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>

extern "C" {
#include "export/exporters/exporters_internal.h"
}
#include "geometry/guard.hpp"

namespace
{

constexpr float HALF_WIDTH = 3; // of the narrow band, in voxels: OpenVDB's own default

openvdb::FloatGrid::Ptr make_grid(const npg_vdb_surface &s)
{
    const npg_export_facts &facts = *s.writer.facts;
    std::vector<openvdb::Vec3s> points(facts.vert_count);
    std::vector<openvdb::Vec3I> triangles(s.face_count);
    for (size_t i = 0; i < points.size(); i++) points[i] = openvdb::Vec3s(s.pose->pos + 3 * i);
    for (size_t f = 0; f < s.face_count; f++) triangles[f] = openvdb::Vec3I(s.faces + 3 * f);
    auto transform = openvdb::math::Transform::createLinearTransform(facts.voxel_share * facts.longest);
    auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, points, triangles, HALF_WIDTH);
    grid->setName("surface");
    return grid;
}

bool has_inside(const openvdb::FloatGrid &grid)
{
    for (auto value = grid.cbeginValueOn(); value; ++value)
        if (*value < 0) return true;
    return false;
}

} // namespace

npg_status npg_vdb_save_surface(const char *path, const npg_vdb_surface *s)
{
    const npg_export_facts &facts = *s->writer.facts;
    return npg::guard("OpenVDB", [&] {
        openvdb::initialize();
        auto grid = make_grid(*s);
        if (!has_inside(*grid))
            return npg_error(NPG_FAILED,
                             "OpenVDB: frame %lld: nothing is inside the surface; "
                             "voxels of %g are too large for it",
                             (long long)s->pose->number, facts.voxel_share * facts.longest);
        openvdb::MetaMap about;
        about.insertMeta("npg_version", openvdb::StringMetadata(npg_version()));
        about.insertMeta("npg_index", openvdb::Int64Metadata(s->pose->index));
        about.insertMeta("npg_number", openvdb::Int64Metadata(s->pose->number));
        about.insertMeta("npg_fps", openvdb::DoubleMetadata(facts.fps));
        about.insertMeta("npg_metres_per_unit", openvdb::DoubleMetadata(facts.metres_per_unit));
        about.insertMeta("npg_up", openvdb::StringMetadata(facts.is_z_up ? "z" : "y"));
        openvdb::io::File file(path);
        file.write(openvdb::GridCPtrVec{grid}, about);
        file.close();
        return NPG_OK;
    });
}
