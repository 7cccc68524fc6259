#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <sidestep/certificates/certify.hpp>
#include <sidestep/plugin/context.hpp>
#include <sidestep/problems/problem_set.hpp>

namespace sidestep {

struct RobotInput {
  std::string robot;  ///< A profile, by its name or file, or a URDF.
  std::optional<std::filesystem::path> srdf;
  std::vector<std::string> fixed;          ///< JOINT=VALUE: joints that stay there.
  std::vector<std::string> package_paths;  ///< FOLDER or NAME=FOLDER, for package:// of a URDF.
};
/// Reads a robot. Which links are held against each other: those of the profile; with an SRDF all
/// that it does not disable; of a URDF alone all that two joints or more move against each other.
/// Fails with kConfig, kNotFound or kIo, naming file and line.
[[nodiscard]] Result<std::shared_ptr<const KinematicTree>> read_certified_robot(
    const RobotInput& input, const HostContext& context);

/// A robot that carries something: a link more for each object, held against all links but its own
/// and those that it may touch. Fails with kConfig for links that there are not. `where`: for
/// messages.
[[nodiscard]] Result<std::shared_ptr<const KinematicTree>> carrying(
    const KinematicTree& robot, std::span<const CarriedObject> objects, const std::string& where);

/// What a robot keeps apart from, and what it carries.
struct SceneInput {
  CertifiedScene apart_from;
  std::vector<CarriedObject> attached;
};
/// Reads a scene, all in the frame of the robot's root:
/// - YAML of this project (docs/reference/scenes.md), or a PlanningScene of MoveIt
///   (read_moveit_scene());
/// - .bt and .ot: the occupied leaves of an OctoMap;
/// - .pcd: balls of `point_radius_m` about the points;
/// - FAMILY.json#INDEX: the scene of a problem of a set (docs/reference/problem_sets.md);
/// - .bag: the occupied voxels of the last map of a recorded run.
/// Fails with kConfig, kNotFound or kIo, naming the file and, where it has lines, the line.
[[nodiscard]] Result<SceneInput> read_certified_scene(const std::filesystem::path& file,
                                                      const RobotDescription& robot,
                                                      std::optional<double> point_radius_m);

struct MotionFormat {
  std::optional<Joining> joining;
  std::vector<std::string> joints;  ///< Of columns without names, in their order.
  std::optional<double> step_s;     ///< Between rows without times; nothing: waypoints.
};
struct NamedMotion {
  std::string name;  ///< Of its file; of one of several with its number.
  PolynomialMotion motion;
};
/// Reads motions by the names of the robot's joints, all of them and no others, in any order:
/// - CSV with a header: `time_s`, JOINT, JOINT.velocity, JOINT.acceleration;
/// - YAML, as `rostopic echo -n 1` and `ros2 topic echo --once` print it: a RobotTrajectory or
///   DisplayTrajectory of MoveIt, or a JointTrajectory;
/// - .npy of NumPy: rows of positions; .txt: a path of OMPL as its print() or printAsMatrix() has
///   it. Their joints are MotionFormat::joints;
/// - .bag: every trajectory of a recorded run.
/// Rows without times are waypoints. Joined as is said; else as a joint_trajectory_controller does:
/// by quintics where there are velocities and accelerations, by cubics where there are velocities,
/// else linearly. Fails with kConfig or kIo, naming file and line.
[[nodiscard]] Result<std::vector<NamedMotion>> read_motions(const std::filesystem::path& file,
                                                            const RobotDescription& robot,
                                                            const MotionFormat& format);

}  // namespace sidestep
