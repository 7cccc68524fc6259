#pragma once

#include <filesystem>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/geometry/transform.hpp>

namespace sidestep::pcd {

struct StampedPose {
  Stamp stamp;
  Transform T_world_sensor = Transform::Identity();
};

/// The poses of a file with 'stamp tx ty tz qx qy qz qw' a line (Sturm et al. 2012), in the order
/// of the file; lines that are empty or begin with # are skipped. Fails with kNotFound, or with
/// kConfig at file:line.
[[nodiscard]] Result<std::vector<StampedPose>> read_poses(const std::filesystem::path& file);

/// A time in seconds, of at most 285 years. Fails with kConfig.
[[nodiscard]] Result<Stamp> read_stamp(const std::string& text, const std::string& where);

}  // namespace sidestep::pcd
