#include <pcl/io/pcd_io.h>
#include <pcl/point_types.h>

#include "pcd_testing.hpp"

namespace sidestep::pcd::testing {

void write_with_pcl(const std::filesystem::path& file, const Points& points, PclFormat format,
                    const Eigen::Vector4f& origin, const Eigen::Vector4f& qwxyz) {
  pcl::PointCloud<pcl::PointXYZI> cloud;
  for (std::size_t i = 0; i < points.size(); ++i) {
    cloud.emplace_back(points[i].x(), points[i].y(), points[i].z(), static_cast<float>(i % 7));
  }
  cloud.sensor_origin_ = origin;
  cloud.sensor_orientation_ = Eigen::Quaternionf(qwxyz[0], qwxyz[1], qwxyz[2], qwxyz[3]);
  pcl::PCDWriter writer;
  switch (format) {
    case PclFormat::kAscii: writer.writeASCII(file.string(), cloud, 9); break;
    case PclFormat::kBinary: writer.writeBinary(file.string(), cloud); break;
    case PclFormat::kBinaryCompressed: writer.writeBinaryCompressed(file.string(), cloud); break;
  }
}

}  // namespace sidestep::pcd::testing
