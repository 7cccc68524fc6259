#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/node.hpp>
#include <sidestep/geometry/shape.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "load_robot.hpp"
#include "urdf_file.hpp"

namespace sidestep::urdf_robot {

/// Where packages are.
struct PackagePath {
  std::string name;  ///< Of the package that the folder is; empty: packages are in it.
  std::filesystem::path folder;
};
/// Of a command line: FOLDER, or NAME=FOLDER.
[[nodiscard]] std::vector<PackagePath> package_paths_of(const std::vector<std::string>& texts);

/// Finds and reads the meshes that a URDF names: package://NAME/PATH (and model://), file://,
/// absolute, or relative to the URDF. A package is looked for in `package_paths` (as
/// FOLDER/NAME, or FOLDER itself if it is called NAME, or said to be it) and among the folders
/// above the URDF.
class MeshFinder {
 public:
  MeshFinder(std::filesystem::path urdf, std::vector<PackagePath> package_paths)
      : urdf_(std::move(urdf)), package_paths_(std::move(package_paths)) {}

  /// Fails with kNotFound at `mark`, listing the places tried, or as read_mesh() does.
  [[nodiscard]] Result<std::shared_ptr<const Mesh>> load(const std::string& uri,
                                                         const Eigen::Vector3d& scale,
                                                         const SourceMark& mark) const;

 private:
  [[nodiscard]] std::vector<std::filesystem::path> candidates(const std::string& uri) const;

  std::filesystem::path urdf_;
  std::vector<PackagePath> package_paths_;
};

/// Puts a URDF and a profile together. Appends every mistake to `errors` and returns null then.
[[nodiscard]] std::unique_ptr<KinematicTree> build_robot(const UrdfModel& model,
                                                         const Profile& profile,
                                                         std::vector<Error>& errors);

/// How many of the robot's first joints, and of its first links, are those of a driving base, which
/// the URDF does not have.
[[nodiscard]] std::size_t base_joints(const KinematicTree& robot) noexcept;

}  // namespace sidestep::urdf_robot
