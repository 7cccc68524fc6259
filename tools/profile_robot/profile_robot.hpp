#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include <sidestep/core/error.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

/// A robot, and the profile that it is from.
struct ProfileRobot {
  std::shared_ptr<const KinematicTree> tree;
  std::filesystem::path file;
};

/// The robot of a profile, given by name, folder or file, for programs that have no run. Warnings
/// go to stderr. Fails as load_robot() does. [main]
[[nodiscard]] Result<ProfileRobot> load_profile_robot(const std::string& profile);

}  // namespace sidestep
