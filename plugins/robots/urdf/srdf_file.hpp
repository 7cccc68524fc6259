#pragma once

#include <filesystem>
#include <map>
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
};

/// Reads an SRDF. Passes over end effectors, passive and virtual joints. Fails with kIo or kConfig,
/// naming the file and the line.
[[nodiscard]] Result<Srdf> read_srdf(const std::filesystem::path& file);

}  // namespace sidestep::urdf_robot
