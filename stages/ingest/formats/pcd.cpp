// PCD through PCL.
#include "ingest/formats/pcd.h"

#include <cstring>
#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include "geometry/guard.hpp"

namespace
{

using Field = pcl::PCLPointField;

const Field *find(const pcl::PCLPointCloud2 &cloud, const char *name)
{
    for (const auto &field : cloud.fields)
        if (field.name == name) return &field;
    return nullptr;
}

template <class T> double as(const std::uint8_t *at)
{
    T value;
    std::memcpy(&value, at, sizeof value);
    return double(value);
}

double value_of(const std::uint8_t *row, const Field &field)
{
    const std::uint8_t *at = row + field.offset;
    switch (field.datatype) {
    case Field::INT8: return as<std::int8_t>(at);
    case Field::UINT8: return as<std::uint8_t>(at);
    case Field::INT16: return as<std::int16_t>(at);
    case Field::UINT16: return as<std::uint16_t>(at);
    case Field::INT32: return as<std::int32_t>(at);
    case Field::UINT32: return as<std::uint32_t>(at);
    case Field::FLOAT32: return as<float>(at);
    case Field::FLOAT64: return as<double>(at);
    default: throw std::runtime_error("field " + field.name + " has a type that can't be read");
    }
}

// "rgb" or "rgba": 0xAARRGGBB in four bytes, whatever type the header gives them.
const Field *find_colour(const pcl::PCLPointCloud2 &cloud)
{
    const Field *field = find(cloud, "rgb");
    if (!field) field = find(cloud, "rgba");
    bool has_four = field && (field->datatype == Field::FLOAT32 || field->datatype == Field::UINT32 ||
                              field->datatype == Field::INT32);
    return has_four && field->count <= 1 ? field : nullptr;
}

void colour_of(std::uint8_t rgba[4], const std::uint8_t *row, const Field *field)
{
    std::uint32_t bits;
    if (!field) return;
    std::memcpy(&bits, row + field->offset, sizeof bits);
    for (int c = 0; c < 3; c++) rgba[c] = std::uint8_t(bits >> (16 - 8 * c));
    rgba[3] = 255;
}

npg_status hand_over(const pcl::PCLPointCloud2 &cloud, const char *path, size_t expected,
                     const npg_pcd_sink *sink)
{
    const char *names[] = {"x", "y", "z", "normal_x", "normal_y", "normal_z"};
    const Field *fields[6];
    for (int i = 0; i < 6; i++) fields[i] = find(cloud, names[i]);
    size_t count = size_t(cloud.width) * cloud.height;
    if (!fields[0] || !fields[1] || !fields[2])
        return npg_error(NPG_BAD_INPUT, "%s: PCL found no fields x, y and z", path);
    if (count != expected || cloud.data.size() < count * cloud.point_step)
        return npg_error(NPG_BAD_INPUT, "%s: PCL read %zu points where the header has %zu", path, count,
                         expected);
    bool has_normals = fields[3] && fields[4] && fields[5];
    const Field *colour = find_colour(cloud);
    NPG_TRY(sink->begin(sink->user, count, has_normals, colour != nullptr));
    for (size_t i = 0; i < count; i++) {
        double values[6] = {0, 0, 0, 0, 0, 0};
        const std::uint8_t *row = cloud.data.data() + i * cloud.point_step;
        for (int c = 0; c < (has_normals ? 6 : 3); c++) values[c] = value_of(row, *fields[c]);
        std::uint8_t rgba[4] = {0, 0, 0, 0};
        colour_of(rgba, row, colour);
        sink->add(sink->user, values, values + 3, rgba);
    }
    return NPG_OK;
}

} // namespace

npg_status npg_pcd_load(const char *path, size_t expected_count, const npg_pcd_sink *sink)
{
    return npg::guard("PCD", [&] {
        pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
        pcl::PCLPointCloud2 cloud;
        Eigen::Vector4f origin;
        Eigen::Quaternionf orientation;
        int version = 0;
        if (pcl::PCDReader().read(path, cloud, origin, orientation, version) < 0)
            return npg_error(NPG_BAD_INPUT, "%s: PCL can't read this PCD file", path);
        return hand_over(cloud, path, expected_count, sink);
    });
}
