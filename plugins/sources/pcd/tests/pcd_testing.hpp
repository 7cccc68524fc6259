#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <Eigen/Core>

namespace sidestep::pcd::testing {

using Points = std::vector<Eigen::Vector3f>;

/// A header for points with the fields `fields` of four bytes each, x, y and z among them.
std::string header(std::size_t points, const std::string& encoding,
                   const std::string& fields = "x y z",
                   const std::string& viewpoint = "0 0 0 1 0 0 0");

std::string ascii_pcd(const Points& points, const std::string& viewpoint = "0 0 0 1 0 0 0");
std::string binary_pcd(const Points& points);

/// Bytes as a file holds them.
template <class T>
std::string bytes(const T& value) {
  return std::string(reinterpret_cast<const char*>(&value), sizeof value);
}

enum class PclFormat { kAscii, kBinary, kBinaryCompressed };
/// Writes points with an intensity each, by PCL, with a viewpoint.
void write_with_pcl(const std::filesystem::path& file, const Points& points, PclFormat format,
                    const Eigen::Vector4f& origin, const Eigen::Vector4f& qwxyz);

}  // namespace sidestep::pcd::testing
