// Volumes (OpenVDB).
#include <openvdb/openvdb.h>
#include <openvdb/tools/MeshToVolume.h>
#include <openvdb/tools/VolumeToMesh.h>

#include <mutex>

extern "C" {
#include "mesh/vdb.h"
}
#include "geometry/guard.hpp"

namespace
{

void initialise_once()
{
    static std::once_flag once;
    std::call_once(once, [] { openvdb::initialize(); });
}

// Quads are cut along their shorter diagonal.
void add_quad(uint32_t *faces, const openvdb::Vec4I &q, const std::vector<openvdb::Vec3s> &points)
{
    bool first = (points[q[0]] - points[q[2]]).lengthSqr() <= (points[q[1]] - points[q[3]]).lengthSqr();
    const int way[2][6] = {{0, 1, 3, 1, 2, 3}, {0, 1, 2, 0, 2, 3}};
    for (int i = 0; i < 6; i++) faces[i] = q[way[first][i]];
}

// Level sets are negative inside; OpenVDB's faces are then clockwise from outside: turned here.
void turn(uint32_t *faces, size_t face_count)
{
    for (size_t f = 0; f < face_count; f++) std::swap(faces[3 * f + 1], faces[3 * f + 2]);
}

npg_status take(npg_mesh **out, const std::vector<openvdb::Vec3s> &points,
                const std::vector<openvdb::Vec3I> &triangles, const std::vector<openvdb::Vec4I> &quads)
{
    npg_mesh *mesh;
    NPG_TRY(npg_mesh_open(&mesh, points.size(), triangles.size() + 2 * quads.size()));
    for (size_t i = 0; i < points.size(); i++)
        for (int a = 0; a < 3; a++) mesh->vert_pos[3 * i + size_t(a)] = points[i][a];
    uint32_t *at = mesh->faces;
    for (const auto &t : triangles)
        for (int k = 0; k < 3; k++) *at++ = t[k];
    for (const auto &q : quads) {
        add_quad(at, q, points);
        at += 6;
    }
    turn(mesh->faces, mesh->face_count);
    *out = mesh;
    return NPG_OK;
}

} // namespace

npg_status npg_vdb_remesh(npg_mesh **mesh, double voxel)
{
    NPG_REQUIRE(mesh && *mesh && voxel > 0);
    return npg::guard("OpenVDB", [&] {
        initialise_once();
        const npg_mesh *old = *mesh;
        std::vector<openvdb::Vec3s> points(old->vert_count);
        std::vector<openvdb::Vec3I> triangles(old->face_count);
        std::vector<openvdb::Vec4I> quads;
        for (size_t i = 0; i < old->vert_count; i++) points[i] = openvdb::Vec3s(old->vert_pos + 3 * i);
        for (size_t f = 0; f < old->face_count; f++) triangles[f] = openvdb::Vec3I(old->faces + 3 * f);
        auto transform = openvdb::math::Transform::createLinearTransform(voxel);
        auto grid = openvdb::tools::meshToLevelSet<openvdb::FloatGrid>(*transform, points, triangles, 3.0f);
        points.clear();
        triangles.clear();
        openvdb::tools::volumeToMesh(*grid, points, triangles, quads, 0.0, 0.0);
        if (quads.empty() && triangles.empty())
            return npg_error(NPG_FAILED, "OpenVDB: the level set has no surface");
        npg_mesh *made;
        NPG_TRY(take(&made, points, triangles, quads));
        npg_mesh_unref(mesh);
        *mesh = made;
        return NPG_OK;
    });
}
