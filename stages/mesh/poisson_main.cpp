// neupig-poisson: screened Poisson reconstruction in a process of its own (PCL), because it may crash, eat
// all memory or call exit() on bad input.  Based on:
// M. Kazhdan, H. Hoppe, Screened Poisson Surface Reconstruction, 2013.
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/surface/3rdparty/poisson4/octree_poisson.h>
// The solver comes before PCL's templates that call it.
#include "mesh/poisson_solver.hpp"
#include <pcl/surface/3rdparty/poisson4/function_data.h>
#include <pcl/surface/3rdparty/poisson4/geometry.h>
#include <pcl/surface/3rdparty/poisson4/multi_grid_octree_data.h>
#include <pcl/surface/3rdparty/poisson4/ppolynomial.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <stdexcept>
#include <vector>

#include "mesh/poisson_wire.h"
#include "pipeline/child.h"
#include "pipeline/confine.h"

namespace
{

// Two threads on every machine, never more: the sum of two parts is the same in either order, that of three
// is not, and the same points are to give the same bits.
constexpr int thread_count = NPG_POISSON_THREADS;

bool read_all(int fd, void *data, size_t size)
{
    for (char *at = static_cast<char *>(data); size;) {
        ssize_t got = read(fd, at, size);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got;
        size -= size_t(got);
    }
    return true;
}

bool write_all(int fd, const void *data, size_t size)
{
    for (const char *at = static_cast<const char *>(data); size;) {
        ssize_t put = write(fd, at, size);
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return false;
        at += put;
        size -= size_t(put);
    }
    return true;
}

// Sanitizers reserve terabytes of address space: no limit can hold under them.
void limit_memory(uint64_t bytes)
{
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    if (!bytes) return;
    rlimit limit = {rlim_t(bytes), rlim_t(bytes)};
    setrlimit(RLIMIT_AS, &limit);
#else
    (void)bytes;
#endif
}

pcl::PointCloud<pcl::PointNormal>::Ptr read_cloud(const npg_poisson_request &request)
{
    pcl::PointCloud<pcl::PointNormal>::Ptr cloud(new pcl::PointCloud<pcl::PointNormal>);
    std::vector<float> rows(6 * 4096);
    cloud->reserve(request.point_count);
    for (uint64_t done = 0; done < request.point_count;) {
        uint64_t now = std::min<uint64_t>(4096, request.point_count - done);
        if (!read_all(STDIN_FILENO, rows.data(), now * 6 * sizeof(float))) return nullptr;
        for (uint64_t i = 0; i < now; i++) {
            const float *row = &rows[6 * i];
            cloud->emplace_back(row[0], row[1], row[2], row[3], row[4], row[5]);
        }
        done += now;
    }
    return cloud;
}

using Position = std::array<float, 3>;
using Face = std::array<uint32_t, 3>;

struct Mesh {
    std::vector<Position> positions;
    std::vector<Face> faces;
};

using Surface = pcl::poisson::CoredVectorMeshData;
using Place = pcl::poisson::Point3D<float>;

// The first level of the octree is whole: where no points are the function is as smooth as this.
constexpr int whole_depth = 5;
constexpr int divided_depth = 8; // levels below are solved, and their surface drawn, part by part
constexpr float points_per_cell = 1.5f, box_growth = 1.1f, accuracy = 1e-3f;
constexpr int least_steps = 8;

void draw(Surface &surface, Place &center, float &scale, const npg_poisson_request &request,
          const pcl::PointCloud<pcl::PointNormal>::ConstPtr &cloud)
{
    using namespace pcl::poisson;
    int depth = int(request.depth);
    Octree<2> tree;
    TreeNodeData::UseIndex = 1;
    TreeOctNode::SetAllocator(1 << 12);
    tree.threads = thread_count;
    tree.setBSplineData(depth, Real(1) / Real(1 << depth), true);
    tree.setTree<pcl::PointNormal>(cloud, depth, whole_depth, depth - 2, points_per_cell, box_growth, center,
                                   scale, false, request.point_weight, true);
    tree.ClipTree();
    tree.finalize();
    tree.RefineBoundary(divided_depth);
    tree.SetLaplacianConstraints();
    tree.LaplacianMatrixIteration(divided_depth, false, least_steps, accuracy);
    tree.GetMCIsoTriangles(tree.GetIsoValue(), divided_depth, &surface, 0, 1, true, false);
}

Mesh triangles(Surface &surface, const Place &center, float scale)
{
    Mesh mesh;
    auto add = [&](const Place &p) {
        Position at;
        for (size_t i = 0; i < 3; i++) at[i] = p.coords[i] * scale + center.coords[i] + 0.0f; // -0 becomes 0
        if (!std::isfinite(at[0] + at[1] + at[2])) throw std::runtime_error("a vertex is not finite");
        mesh.positions.push_back(at);
    };
    size_t first = surface.inCorePoints.size();
    for (const Place &p : surface.inCorePoints) add(p);
    Place p;
    while (surface.nextOutOfCorePoint(p)) add(p);
    std::vector<pcl::poisson::CoredVertexIndex> corners;
    while (surface.nextPolygon(corners)) {
        std::vector<uint32_t> at;
        for (const auto &c : corners) at.push_back(uint32_t(c.inCore ? c.idx : c.idx + int(first)));
        for (size_t k = 2; k < at.size(); k++) mesh.faces.push_back({at[0], at[k - 1], at[k]});
    }
    return mesh;
}

// PCL's threads add vertices and faces as they find them, in another order in every run: both are sorted
// here.  Vertices at the same place become one, since nothing could tell them apart; a face that loses a
// corner by that goes.
Mesh in_order(const Mesh &found)
{
    Mesh mesh;
    mesh.positions = found.positions;
    std::sort(mesh.positions.begin(), mesh.positions.end());
    mesh.positions.erase(std::unique(mesh.positions.begin(), mesh.positions.end()), mesh.positions.end());
    std::vector<uint32_t> place;
    for (const Position &p : found.positions)
        place.push_back(uint32_t(std::lower_bound(mesh.positions.begin(), mesh.positions.end(), p) -
                                 mesh.positions.begin()));
    for (const Face &f : found.faces) {
        Face face = {place.at(f[0]), place.at(f[1]), place.at(f[2])};
        if (face[0] == face[1] || face[1] == face[2] || face[2] == face[0]) continue;
        std::rotate(face.begin(), std::min_element(face.begin(), face.end()), face.end());
        mesh.faces.push_back(face);
    }
    std::sort(mesh.faces.begin(), mesh.faces.end());
    return mesh;
}

bool write_mesh(int fd, const Mesh &mesh)
{
    npg_poisson_reply reply = {};
    std::memcpy(reply.magic, NPG_POISSON_ANSWER, sizeof reply.magic);
    reply.vert_count = mesh.positions.size();
    reply.face_count = mesh.faces.size();
    return write_all(fd, &reply, sizeof reply) &&
           write_all(fd, mesh.positions.data(), mesh.positions.size() * sizeof(Position)) &&
           write_all(fd, mesh.faces.data(), mesh.faces.size() * sizeof(Face)) &&
           write_all(fd, NPG_POISSON_END, 8);
}

int reconstruct(int out)
{
    npg_poisson_request request;
    if (!read_all(STDIN_FILENO, &request, sizeof request) || std::memcmp(request.magic, NPG_POISSON_ASK, 8)) {
        std::fprintf(stderr, "no request on standard input: this program is started by neupig alone\n");
        return 3;
    }
    limit_memory(request.memory_limit);
    npg_confine_time(request.cpu_limit_s);
    auto cloud = read_cloud(request);
    if (!cloud) {
        std::fprintf(stderr, "the request ends before its %llu points\n",
                     (unsigned long long)request.point_count);
        return 3;
    }
    Surface surface;
    Place center;
    float scale = 1;
    draw(surface, center, scale, request, cloud);
    return write_mesh(out, in_order(triangles(surface, center, scale))) ? 0 : 1;
}

int guarded(int out)
{
    try {
        return reconstruct(out);
    } catch (const std::bad_alloc &) {
        std::fprintf(stderr, "no memory\n");
        return 6;
    } catch (const std::exception &e) {
        std::fprintf(stderr, "%s\n", e.what());
        return 1;
    }
}

} // namespace

int main(int, char **argv)
{
    npg_end_with_parent(argv[1], SIGKILL); // before all else
    // What libraries print must not get between the bytes of the answer.
    int out = dup(STDOUT_FILENO);
    dup2(STDERR_FILENO, STDOUT_FILENO);
    npg_confine_calls(); // what PCL makes of hostile points stays in here; older kernels have limits alone
    int code = guarded(out);
    // Without the checks at exit: PCL's reconstruction keeps memory that nothing points to any more.
    std::fflush(nullptr);
    _exit(code);
}
