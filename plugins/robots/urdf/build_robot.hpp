#pragma once

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

}  // namespace sidestep::urdf_robot
