// neupig-poisson: screened Poisson reconstruction in a process of its own (PCL), because it may crash, eat
// all memory or call exit() on bad input.  One thread: more threads give another mesh in every run. Based on:
// M. Kazhdan, H. Hoppe, Screened Poisson Surface Reconstruction, 2013.
#include <pcl/point_types.h>
#include <pcl/surface/poisson.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <cstring>
#include <new>
#include <vector>

#include "mesh/poisson_wire.h"

namespace
{

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
            pcl::PointNormal p;
            p.x = row[0];
            p.y = row[1];
            p.z = row[2];
            p.normal_x = row[3];
            p.normal_y = row[4];
            p.normal_z = row[5];
            cloud->push_back(p);
        }
        done += now;
    }
    return cloud;
}

bool write_mesh(int fd, const pcl::PointCloud<pcl::PointNormal> &points,
                const std::vector<pcl::Vertices> &polygons)
{
    npg_poisson_reply reply = {};
    std::vector<float> positions;
    std::vector<uint32_t> faces;
    for (const auto &p : points) positions.insert(positions.end(), {p.x, p.y, p.z});
    for (const auto &polygon : polygons)
        for (size_t k = 2; k < polygon.vertices.size(); k++)
            faces.insert(faces.end(), {uint32_t(polygon.vertices[0]), uint32_t(polygon.vertices[k - 1]),
                                       uint32_t(polygon.vertices[k])});
    std::memcpy(reply.magic, NPG_POISSON_ANSWER, sizeof reply.magic);
    reply.vert_count = points.size();
    reply.face_count = faces.size() / 3;
    return write_all(fd, &reply, sizeof reply) &&
           write_all(fd, positions.data(), positions.size() * sizeof(float)) &&
           write_all(fd, faces.data(), faces.size() * sizeof(uint32_t)) && write_all(fd, NPG_POISSON_END, 8);
}

int reconstruct(int out)
{
    npg_poisson_request request;
    if (!read_all(STDIN_FILENO, &request, sizeof request) || std::memcmp(request.magic, NPG_POISSON_ASK, 8)) {
        std::fprintf(stderr, "no request on standard input: this program is started by neupig alone\n");
        return 3;
    }
    limit_memory(request.memory_limit);
    auto cloud = read_cloud(request);
    if (!cloud) {
        std::fprintf(stderr, "the request ends before its %llu points\n",
                     (unsigned long long)request.point_count);
        return 3;
    }
    pcl::Poisson<pcl::PointNormal> poisson;
    poisson.setDepth(int(request.depth));
    poisson.setPointWeight(request.point_weight);
    poisson.setSamplesPerNode(1.5f);
    poisson.setScale(1.1f);
    poisson.setManifold(true);
    poisson.setThreads(1);
    poisson.setInputCloud(cloud);
    pcl::PointCloud<pcl::PointNormal> points;
    std::vector<pcl::Vertices> polygons;
    poisson.reconstruct(points, polygons);
    return write_mesh(out, points, polygons) ? 0 : 1;
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

int main()
{
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    // What libraries print must not get between the bytes of the answer.
    int out = dup(STDOUT_FILENO);
    dup2(STDERR_FILENO, STDOUT_FILENO);
    int code = guarded(out);
    // Without the checks at exit: PCL's reconstruction keeps memory that nothing points to any more.
    std::fflush(nullptr);
    _exit(code);
}
