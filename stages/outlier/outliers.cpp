// Isolated points (PCL's StatisticalOutlierRemoval).
#include <pcl/filters/statistical_outlier_removal.h>
#include <pcl/point_types.h>

#include <algorithm>
#include <cstring>

#include "geometry/guard.hpp"
#include "outlier/outliers.h"

npg_status npg_outliers_statistical(uint8_t *keep, size_t *dropped, const float *points, size_t point_count,
                                    int neighbours, double ratio)
{
    NPG_REQUIRE(neighbours >= 1 && ratio >= 0);
    *dropped = 0;
    std::fill_n(keep, point_count, uint8_t(1)); // keep may be null for no points
    if (point_count <= size_t(neighbours)) return NPG_OK;
    return npg::guard("PCL's outlier filter", [&] {
        pcl::PointCloud<pcl::PointXYZ>::Ptr cloud(new pcl::PointCloud<pcl::PointXYZ>);
        cloud->reserve(point_count);
        for (size_t i = 0; i < point_count; i++)
            cloud->push_back({points[3 * i], points[3 * i + 1], points[3 * i + 2]});
        pcl::StatisticalOutlierRemoval<pcl::PointXYZ> filter(true);
        filter.setInputCloud(cloud);
        filter.setMeanK(neighbours);
        filter.setStddevMulThresh(ratio);
        pcl::Indices kept;
        filter.filter(kept);
        std::memset(keep, 0, point_count);
        for (auto i : kept) keep[i] = 1;
        *dropped = point_count - kept.size();
        return NPG_OK;
    });
}
