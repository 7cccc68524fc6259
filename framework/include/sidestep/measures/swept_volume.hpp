#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/robot/robot_model.hpp>

namespace sidestep {

/// The voxels that a robot's spheres have entered, and those of them that a frame had seen before:
/// voxels whose centres lie in a sphere and no lower than a height. Where it stood at first was not
/// entered. [mapping]
class SweptVolume {
 public:
  /// `grid`: that of the map.
  SweptVolume(std::shared_ptr<const RobotModel> robot, const GridSpec& grid, double min_z_m);

  /// The robot's configuration in the map's frame as a frame was taken, and what the map has known
  /// since that frame: a robot hides from its sensors what it is in.
  void enter(std::span<const double> q, const VoxelBits& known);

  [[nodiscard]] std::int64_t entered_vox() const noexcept { return entered_vox_; }
  [[nodiscard]] std::int64_t seen_vox() const noexcept { return seen_vox_; }

 private:
  std::shared_ptr<const RobotModel> robot_;
  GridSpec grid_;
  double min_z_m_;
  std::vector<bool> is_entered_;  ///< Each voxel.
  bool has_stood_ = false;
  std::int64_t entered_vox_ = 0;
  std::int64_t seen_vox_ = 0;
  std::vector<Eigen::Vector3d> centres_m_;
  Scratch scratch_;
};

}  // namespace sidestep
