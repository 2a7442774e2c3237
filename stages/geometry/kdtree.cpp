// k-d tree of N points (nanoflann).
#include "geometry/kdtree.h"

#include <algorithm>
#include <limits>
#include <memory>
#include <nanoflann.hpp>
#include <thread>
#include <vector>

#include "geometry/guard.hpp"

namespace
{

constexpr size_t LEAF = 12; // points in a leaf; nanoflann advises 10 to 50

struct Cloud {
    const float *points;
    size_t count;
    size_t kdtree_get_point_count() const { return count; }
    float kdtree_get_pt(size_t i, size_t axis) const { return points[3 * i + axis]; }
    template <class Box> bool kdtree_get_bbox(Box &) const { return false; }
};

using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Cloud, float, uint32_t>,
                                                 Cloud, 3, uint32_t>;

// The k nearest, ties by index: nanoflann's own result set keeps whichever came first.
class NearestSet
{
  public:
    using DistanceType = float;
    NearestSet(uint32_t *index, float *dist, size_t k) : index_(index), dist_(dist), k_(k), count_(0)
    {
        std::fill(index, index + k, std::numeric_limits<uint32_t>::max());
        std::fill(dist, dist + k, std::numeric_limits<float>::infinity());
    }
    size_t size() const { return count_; }
    bool full() const { return count_ == k_; }
    // nanoflann asks for distances below this: the next float lets equal ones through, so that the index
    // decides.
    float worstDist() const { return std::nextafter(dist_[k_ - 1], std::numeric_limits<float>::infinity()); }
    bool addPoint(float dist, uint32_t index)
    {
        size_t at = k_;
        while (at > 0 && (dist < dist_[at - 1] || (dist == dist_[at - 1] && index < index_[at - 1]))) at--;
        if (at == k_) return true;
        for (size_t i = k_ - 1; i > at; i--) {
            dist_[i] = dist_[i - 1];
            index_[i] = index_[i - 1];
        }
        dist_[at] = dist;
        index_[at] = index;
        count_ = std::min(count_ + 1, k_);
        return true;
    }

  private:
    uint32_t *index_;
    float *dist_;
    size_t k_, count_;
};

// Counts points; "full" from the start, so that the radius bounds the search.
class CountSet
{
  public:
    using DistanceType = float;
    CountSet(float radius_sq, uint32_t enough) : radius_sq_(radius_sq), enough_(enough), count_(0) {}
    uint32_t count() const { return count_; }
    size_t size() const { return count_; }
    bool full() const { return true; }
    float worstDist() const { return radius_sq_; }
    bool addPoint(float dist, uint32_t)
    {
        if (dist < radius_sq_) count_++;
        return !enough_ || count_ < enough_;
    }

  private:
    float radius_sq_;
    uint32_t enough_, count_;
};

// body(first, last) over equal parts of 0..count on several threads.
template <class Body> void in_parts(size_t count, int threads, Body body)
{
    size_t parts = threads > 0 ? size_t(threads) : std::max(1u, std::thread::hardware_concurrency());
    if (count < 1024) parts = 1; // not worth a thread; set by trial
    std::vector<std::thread> helpers;
    for (size_t p = 1; p < parts; p++)
        helpers.emplace_back([=] { body(count * p / parts, count * (p + 1) / parts); });
    body(0, count / parts);
    for (auto &helper : helpers) helper.join();
}

} // namespace

struct npg_kdtree {
    Cloud cloud;
    Tree tree;
    npg_kdtree(const float *points, size_t count)
        : cloud{points, count}, tree(3, cloud, nanoflann::KDTreeSingleIndexAdaptorParams(LEAF))
    {
    }
};

npg_status npg_kdtree_open(npg_kdtree **out, const float *points, size_t point_count)
{
    *out = nullptr;
    NPG_REQUIRE(points && point_count >= 1);
    return npg::guard("k-d tree", [&] {
        *out = std::make_unique<npg_kdtree>(points, point_count).release();
        return NPG_OK;
    });
}

void npg_kdtree_close(npg_kdtree **tree)
{
    delete *tree;
    *tree = nullptr;
}

npg_status npg_kdtree_nearest(const npg_kdtree *tree, uint32_t *index, float *dist_sq, const float *queries,
                              size_t query_count, size_t k, int threads)
{
    NPG_REQUIRE(k >= 1);
    return npg::guard("k-d tree", [&] {
        in_parts(query_count, threads, [=](size_t first, size_t last) {
            for (size_t i = first; i < last; i++) {
                NearestSet set(index + i * k, dist_sq + i * k, k);
                tree->tree.findNeighbors(set, queries + 3 * i, nanoflann::SearchParams());
            }
        });
        return NPG_OK;
    });
}

npg_status npg_kdtree_count(const npg_kdtree *tree, uint32_t *count, const float *queries, size_t query_count,
                            float radius, uint32_t enough, int threads)
{
    return npg::guard("k-d tree", [&] {
        in_parts(query_count, threads, [=](size_t first, size_t last) {
            for (size_t i = first; i < last; i++) {
                CountSet set(radius * radius, enough);
                tree->tree.findNeighbors(set, queries + 3 * i, nanoflann::SearchParams());
                count[i] = set.count();
            }
        });
        return NPG_OK;
    });
}
