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

}  // namespace sidestep
