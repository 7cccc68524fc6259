#pragma once

#include <cstdint>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/transform.hpp>

#include "pcd_source.hpp"

namespace sidestep::pcd {

/// Applies the filters, in their order, to points in the optical frame of a camera. `seed` decides
/// what the plane filter tries; equal input gives equal output. Fails with kBadFrame, naming the
/// filter, where it cannot work on these points or leaves none. PCL does the work, on the calling
/// thread.
[[nodiscard]] Result<std::vector<Eigen::Vector3f>> apply_filters(
    const std::vector<Filter>& filters, std::vector<Eigen::Vector3f> points_m,
    const Transform& T_world_camera, std::uint64_t seed);

}  // namespace sidestep::pcd
