#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/point_rules.hpp>
#include <sidestep/sensing/frame.hpp>

namespace sidestep::voxel_grid {

/// What one frame says of each voxel when every point's own ray is cast, one after the other:
/// the definition that both integration paths approximate.
class ReferenceCaster {
 public:
  enum State : std::uint8_t { kUnseen, kMiss, kHit };

  ReferenceCaster(const GridSpec& grid, const PointRules& rules)
      : grid_(grid), rules_(rules), states_(grid.voxel_count()) {}

  void add(const Frame& frame) {
    const DepthImage& image = std::get<DepthImage>(frame.measurement);
    for (int v = 0; v < image.camera.height_px; ++v) {
      for (int u = 0; u < image.camera.width_px; ++u) {
        const double depth_m = static_cast<double>(image.at(u, v));
        if (depth_m > 0.0) add_point(frame.T_world_camera, image.camera.unproject(u, v, depth_m));
      }
    }
  }

  [[nodiscard]] State at(const Eigen::Vector3i& voxel) const {
    return static_cast<State>(states_[grid_.linear(voxel)]);
  }

 private:
  void add_point(const Transform& T_world_camera, const Eigen::Vector3d& p_camera) {
    const PointFate fate = rules_.fate(p_camera, T_world_camera * p_camera);
    if (fate == PointFate::kInvalid) return;
    const double reach =
        fate == PointFate::kOutOfRange ? rules_.max_range_m / p_camera.norm() : 1.0;
    const Eigen::Vector3d end = T_world_camera * Eigen::Vector3d(p_camera * reach);
    mark_line(T_world_camera.translation(), end);
    const Eigen::Vector3i voxel = grid_.voxel_at(end);
    if (!grid_.contains(voxel)) return;
    std::uint8_t& state = states_[grid_.linear(voxel)];
    if (fate == PointFate::kInsert) {
      state = kHit;
    } else if (state == kUnseen) {
      state = kMiss;
    }
  }

  /// Visits the voxels between consecutive crossings of voxel planes, each crossing computed
  /// from the line itself.
  void mark_line(const Eigen::Vector3d& from_world, const Eigen::Vector3d& to_world) {
    const Eigen::Vector3d from = (from_world - grid_.origin_m) / grid_.resolution_m;
    const Eigen::Vector3d along = (to_world - from_world) / grid_.resolution_m;
    int crossed[3] = {0, 0, 0};
    double t = 0.0;
    while (t < 1.0) {
      double next = 1.0;
      int axis_of_next = -1;
      for (int axis = 0; axis < 3; ++axis) {
        if (along[axis] == 0.0) continue;
        const double plane = along[axis] > 0.0 ? std::floor(from[axis]) + 1.0 + crossed[axis]
                                               : std::ceil(from[axis]) - 1.0 - crossed[axis];
        const double at = (plane - from[axis]) / along[axis];
        if (at >= next) continue;
        next = at;
        axis_of_next = axis;
      }
      if (axis_of_next < 0) return;  // what is left lies in the end's voxel
      const Eigen::Vector3d middle = from + 0.5 * (t + next) * along;
      const Eigen::Vector3i voxel = middle.array().floor().cast<int>().matrix();
      if (next > t && grid_.contains(voxel)) {
        std::uint8_t& state = states_[grid_.linear(voxel)];
        if (state == kUnseen) state = kMiss;
      }
      ++crossed[axis_of_next];
      t = next;
    }
  }

  GridSpec grid_;
  PointRules rules_;
  std::vector<std::uint8_t> states_;
};

}  // namespace sidestep::voxel_grid
