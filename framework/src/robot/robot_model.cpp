#include <sidestep/robot/robot_model.hpp>

#include <algorithm>

namespace sidestep {
namespace {

template <class Named>
std::optional<int> index_of(const std::vector<Named>& items, std::string_view name) noexcept {
  const auto it = std::ranges::find(items, name, &Named::name);
  if (it == items.end()) return {};
  return static_cast<int>(it - items.begin());
}

}  // namespace

std::optional<int> RobotDescription::joint_index(std::string_view joint_name) const noexcept {
  return index_of(joints, joint_name);
}

std::optional<int> RobotDescription::link_index(std::string_view link_name) const noexcept {
  return index_of(links, link_name);
}

const NamedPose* RobotDescription::find_pose(std::string_view pose_name) const noexcept {
  const auto it = std::ranges::find(poses, pose_name, &NamedPose::name);
  return it == poses.end() ? nullptr : &*it;
}

void RobotModel::sphere_centre_lanes(std::span<const double> q, std::span<PointLanes> centres_m,
                                     Scratch& scratch) const {
  const std::size_t count = description().spheres.size();
  if (count == 0) return;
  const std::size_t n = q.size() / description().joints.size();
  Scratch::Scope scope(scratch);
  const auto in_rows_m = scope.array<Eigen::Vector3d>(n * count);
  sphere_centres(q, in_rows_m, scratch);
  for (std::size_t row = 0; row < padded(n); ++row) {
    for (std::size_t s = 0; s < count; ++s) {
      const Eigen::Vector3d& centre_m = in_rows_m[std::min(row, n - 1) * count + s];
      PointLanes& out = centres_m[row / kLanes * count + s];
      out.x[row % kLanes] = centre_m.x();
      out.y[row % kLanes] = centre_m.y();
      out.z[row % kLanes] = centre_m.z();
    }
  }
}

}  // namespace sidestep
