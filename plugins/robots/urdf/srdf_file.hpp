#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/node.hpp>

namespace sidestep::urdf_robot {

/// What MoveIt's description of a robot says, by the names of joints and links. Plain data.
struct Srdf {
  struct Group {
    std::string name;
    std::vector<std::string> joints, links, groups;
    std::vector<std::pair<std::string, std::string>> chains;  ///< Base link and tip link.
  };
  struct Pose {
    std::string name;
    std::map<std::string, double> joints;  ///< m or rad.
  };
  struct DisabledPair {
    std::string a, b;  ///< Links.
    SourceMark mark;
  };
  std::filesystem::path file;
  std::vector<Group> groups;
  std::vector<Pose> poses;
  std::vector<DisabledPair> disabled;
  std::set<std::string> virtual_joints;    ///< Which put the robot into the world.
  std::map<std::string, int> passed_over;  ///< Elements of no use here, by name.
};

/// Reads an SRDF whole: what it may hold by MoveIt is read, or counted as passed over; what it may
/// not fails with kConfig, naming file, line and column. Fails with kIo.
[[nodiscard]] Result<Srdf> read_srdf(const std::filesystem::path& file);

}  // namespace sidestep::urdf_robot
