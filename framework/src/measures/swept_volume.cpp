#include <sidestep/measures/swept_volume.hpp>

#include <utility>

namespace sidestep {

SweptVolume::SweptVolume(std::shared_ptr<const RobotModel> robot, const GridSpec& grid,
                         double min_z_m)
    : robot_(std::move(robot)),
      grid_(grid),
      min_z_m_(min_z_m),
      is_entered_(grid.voxel_count()),
      centres_m_(robot_->description().spheres.size()) {}

void SweptVolume::enter(std::span<const double> q, const VoxelBits& known) {
  const bool is_first = !std::exchange(has_stood_, true);
  robot_->sphere_centres(q, centres_m_, scratch_);
  for (std::size_t s = 0; s < centres_m_.size(); ++s) {
    const double radius_m = robot_->description().spheres[s].radius_m;
    const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(radius_m);
    const Eigen::Vector3i low = grid_.voxel_at(centres_m_[s] - reach_m).cwiseMax(0);
    const Eigen::Vector3i high =
        grid_.voxel_at(centres_m_[s] + reach_m).cwiseMin((grid_.size_vox.array() - 1).matrix());
    for (int z = low.z(); z <= high.z(); ++z) {
      for (int y = low.y(); y <= high.y(); ++y) {
        for (int x = low.x(); x <= high.x(); ++x) {
          const Eigen::Vector3i voxel(x, y, z);
          const Eigen::Vector3d centre_m = grid_.centre_m(voxel);
          if (centre_m.z() < min_z_m_ || (centre_m - centres_m_[s]).norm() > radius_m) continue;
          auto is_entered = is_entered_[grid_.linear(voxel)];
          if (is_entered) continue;
          is_entered = true;
          if (is_first) continue;
          ++entered_vox_;
          seen_vox_ += known.at(grid_, voxel) ? 1 : 0;
        }
      }
    }
  }
}

}  // namespace sidestep
