#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include <sidestep/plugin/context.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep {

struct NewRobotOptions {
  std::filesystem::path urdf;
  std::optional<std::filesystem::path> srdf;
  std::vector<std::string> package_paths;  ///< FOLDER or NAME=FOLDER.
  std::string group;          ///< Of the SRDF, whose joints are planned; empty: all that can be.
  std::filesystem::path out;  ///< The profile's folder, which is made.
  double protrusion_m = 0.04;
};

/// What was made, and what its owner should know.
struct NewRobot {
  std::filesystem::path profile;
  std::shared_ptr<const KinematicTree> robot;
  std::vector<std::string> held;   ///< Joints that are not planned, each with the reason.
  std::vector<std::string> notes;  ///< A sentence each.
};

/// How far one step of the making has come.
using NewRobotProgress =
    std::function<void(std::size_t done, std::size_t total, std::string_view what)>;

/// Makes a profile of a URDF: which joints are planned, spheres that cover its shapes, which pairs
/// of links are held against each other (those that the SRDF does not disable, else found by
/// sampling), poses (the SRDF's, or one at rest). Writes `out`/profile.yaml when all is done, and
/// nothing before. Fails as the URDF's, the SRDF's and the profile's readers do, where no joint is
/// left to plan, and with kIo where `out` holds a profile already or cannot be written. [main]
[[nodiscard]] Result<NewRobot> make_robot_profile(const NewRobotOptions& options,
                                                  const HostContext& context,
                                                  const NewRobotProgress& progress,
                                                  const std::stop_token& stop);

}  // namespace sidestep
