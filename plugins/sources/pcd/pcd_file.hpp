#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::pcd {

/// The points of a PCD file, in the file's frame and order, without those that are not finite.
struct PcdCloud {
  std::vector<Eigen::Vector3f> points_m;
  std::optional<Transform> T_world_sensor;  ///< VIEWPOINT, where the file has one.
};

/// Reads a PCD file of versions 0.5 to 0.7, ascii, binary or binary_compressed. Its fields x, y
/// and z must be floating-point numbers; other fields are skipped. Fails with kBadFrame, naming the
/// file and where it can the line, where the file cannot be read, is cut off, is damaged or holds
/// no point.
[[nodiscard]] Result<PcdCloud> read_pcd(const std::filesystem::path& path);

}  // namespace sidestep::pcd
