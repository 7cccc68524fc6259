#pragma once

#include <string>
#include <utility>

#include <sidestep/plugin/parameters.hpp>

namespace sidestep::ros_messages {

/// Which of a robot's joints are its holonomic base, as options name them.
struct BaseJoints {
  std::string x_joint = "odom_x";
  std::string y_joint = "odom_y";
  std::string yaw_joint = "odom_t";
};

/// Of options that begin with them.
template <class Options>
[[nodiscard]] Parameters<Options> base_joint_parameters() {
  return Parameters<Options>()
      .add("x_joint", &Options::x_joint, "The robot's joint along the world's x.")
      .add("y_joint", &Options::y_joint, "The robot's joint along the world's y.")
      .add("yaw_joint", &Options::yaw_joint, "The robot's joint about the world's z.");
}

}  // namespace sidestep::ros_messages
