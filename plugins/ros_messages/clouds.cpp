#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>

#include "byte_order.hpp"
#include "conversions.hpp"

namespace sidestep::ros_messages {
namespace {

struct Coordinate {
  std::size_t offset = 0;
  bool is_double = false;

  [[nodiscard]] std::size_t end() const { return offset + (is_double ? 8 : 4); }
  [[nodiscard]] float read(const std::uint8_t* point, bool swapped) const {
    if (!is_double) return std::bit_cast<float>(read_raw<std::uint32_t>(point + offset, swapped));
    return static_cast<float>(
        std::bit_cast<double>(read_raw<std::uint64_t>(point + offset, swapped)));
  }
};

Result<Coordinate> find_coordinate(const PointCloud2& message, const char* name) {
  const auto field = std::ranges::find_if(
      message.fields, [&](const PointField& candidate) { return candidate.name == name; });
  if (field == message.fields.end())
    return bad_message(std::string("the cloud has no field ") + name);
  const bool is_double = field->datatype == PointField::FLOAT64;
  if (!is_double && field->datatype != PointField::FLOAT32) {
    return bad_message(std::string("the cloud's field ") + name + " is no floating-point number");
  }
  const Coordinate coordinate{field->offset, is_double};
  if (coordinate.end() > message.point_step) {
    return bad_message(std::string("the cloud's field ") + name + " lies beyond the " +
                       std::to_string(message.point_step) + " bytes of a point");
  }
  return coordinate;
}

Result<void> check_cloud_bytes(const PointCloud2& message) {
  const std::size_t row = static_cast<std::size_t>(message.width) * message.point_step;
  if (message.height > 1 && message.row_step < row) {
    return bad_message("a row of the cloud has " + std::to_string(message.row_step) +
                       " bytes, its points need " + std::to_string(row));
  }
  if (message.width == 0 || message.height == 0) return {};
  const std::size_t needed = static_cast<std::size_t>(message.height - 1) * message.row_step + row;
  if (message.data.size() < needed) {
    return bad_message("the cloud has " + std::to_string(message.data.size()) +
                       " bytes, its size says " + std::to_string(needed));
  }
  return {};
}

}  // namespace

Result<PointCloud> point_cloud(const PointCloud2& message) {
  std::array<Coordinate, 3> coordinates;
  for (std::size_t i = 0; i < coordinates.size(); ++i) {
    static constexpr std::array<const char*, 3> kNames{"x", "y", "z"};
    coordinates[i] = SIDESTEP_TRY(find_coordinate(message, kNames[i]));
  }
  SIDESTEP_TRY(check_cloud_bytes(message));
  const bool swapped = is_foreign(message.is_bigendian != 0);
  PointCloud cloud;
  if (message.width == 0) return cloud;
  // The product is at most the number of bytes, which was checked.
  cloud.points_m.reserve(static_cast<std::size_t>(message.width) * message.height);
  for (std::size_t v = 0; v < message.height; ++v) {
    const std::uint8_t* point = message.data.data() + v * message.row_step;
    for (std::size_t u = 0; u < message.width; ++u, point += message.point_step) {
      const Eigen::Vector3f p(coordinates[0].read(point, swapped),
                              coordinates[1].read(point, swapped),
                              coordinates[2].read(point, swapped));
      if (p.allFinite()) cloud.points_m.push_back(p);
    }
  }
  return cloud;
}

PointCloud2 to_point_cloud(const PointCloud& cloud, Stamp stamp, const std::string& frame) {
  PointCloud2 message;
  message.header.stamp = to_ros_time(stamp);
  message.header.frame_id = frame;
  message.height = 1;
  message.width = static_cast<std::uint32_t>(cloud.points_m.size());
  message.point_step = sizeof(Eigen::Vector3f);
  message.row_step = message.width * message.point_step;
  message.is_dense = 1;
  message.is_bigendian = std::endian::native == std::endian::big ? 1 : 0;
  for (std::size_t i = 0; i < 3; ++i) {
    PointField field;
    field.name = std::string(1, static_cast<char>('x' + i));
    field.offset = static_cast<std::uint32_t>(i * sizeof(float));
    field.datatype = PointField::FLOAT32;
    field.count = 1;
    message.fields.push_back(field);
  }
  message.data.resize(message.row_step);
  if (!cloud.points_m.empty()) {
    std::memcpy(message.data.data(), cloud.points_m.data(), message.data.size());
  }
  return message;
}

}  // namespace sidestep::ros_messages
