#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

#include "profile.hpp"
#include "urdf_file.hpp"

namespace sidestep::urdf_robot {

/// Puts a URDF and a profile together. Appends every mistake to `errors` and returns null then.
[[nodiscard]] std::unique_ptr<KinematicTree> build_robot(const UrdfModel& model,
                                                         const Profile& profile,
                                                         std::vector<Error>& errors);

/// How many of the robot's first joints, and of its first links, are those of a driving base, which
/// the URDF does not have.
[[nodiscard]] std::size_t base_joints(const KinematicTree& robot) noexcept;

}  // namespace sidestep::urdf_robot
