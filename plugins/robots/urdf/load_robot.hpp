#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

namespace sidestep::urdf_robot {

/// What a profile says of a robot's base.
struct BaseOptions {
  std::string type = "fixed";
  std::vector<std::string> joints{"odom_x", "odom_y", "odom_t"};
  std::vector<double> lower_m{-10.0, -10.0};
  std::vector<double> upper_m{10.0, 10.0};
  double max_velocity_mps = 0.2;
  double max_turn_rate_radps = 1.0;
  std::optional<double> max_acceleration_mps2;
  std::optional<double> max_turn_acceleration_radps2;
  std::optional<double> max_braking_mps2;
  std::optional<double> max_turn_braking_radps2;
  [[nodiscard]] bool drives() const noexcept { return type != "fixed"; }
  static Parameters<BaseOptions> parameters();
};

/// Where the root link of a robot that does not drive is.
struct MountOptions {
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d rpy_rad = Eigen::Vector3d::Zero();
  static Parameters<MountOptions> parameters();
};

/// Replaces what the URDF says of a joint. In m or rad, per second, per second squared.
struct JointLimitOptions {
  std::optional<double> lower;
  std::optional<double> upper;
  std::optional<double> max_velocity;
  std::optional<double> max_acceleration;
  std::optional<double> max_braking;
  static Parameters<JointLimitOptions> parameters();
};

/// Couples a joint to another, as <mimic> does.
struct CoupledJointOptions {
  std::string joint;
  double multiplier = 1.0;
  double offset = 0.0;
  static Parameters<CoupledJointOptions> parameters();
};

struct SphereOptions {
  std::string link;
  Eigen::Vector3d centre_m = Eigen::Vector3d::Zero();
  double radius_m = 0.0;
  static Parameters<SphereOptions> parameters();
};

/// The head of a profile.
struct HeadOptions {
  std::string pan_joint;
  std::string tilt_joint;
  std::string camera_link;
  static Parameters<HeadOptions> parameters();
};

struct SelfCollisionOptions {
  Node pairs;
  static Parameters<SelfCollisionOptions> parameters();
};

/// What is wrong with the key `braking` of a map of limits, beside its key `acceleration`: it
/// stands alone, or lies below it. Appended to `errors`, at the position of `braking`.
void check_braking(const Node& limits, std::string_view braking, std::string_view acceleration,
                   std::vector<Error>& errors);

/// A robot profile, as the file has it. What needs the URDF to be understood is still a Node.
struct Profile {
  std::string name;
  std::filesystem::path urdf;
  std::string root_link;
  std::string tip_link;
  std::vector<std::string> joints;
  Node groups;
  Node group;  ///< The name of the one that is planned; null for all joints.
  BaseOptions base;
  Node mount;  ///< MountOptions.
  Node joint_limits;
  Node fixed_joints;
  Node coupled_joints;
  std::optional<HeadOptions> head;
  std::vector<SphereOptions> spheres;
  std::string spheres_from = "profile";
  double sphere_protrusion_m = 0.05;
  std::string shapes_from = "urdf";
  SelfCollisionOptions self_collision;
  Node poses;
  Node package_paths;
  static Parameters<Profile> parameters();

  Node document;  ///< The whole file, for positions; null without a file.
  Node held;      ///< The name of the pose in which the others are; null for none.
  /// Those of `fixed_joints` that the profile has itself.
  std::set<std::string> fixed_by_profile;

  /// Where something of the profile stands, e.g. mark("spheres", 3); the robot's if nowhere.
  [[nodiscard]] const Node* item(std::string_view key, std::size_t index) const noexcept;
};

/// The file of a profile that is given by name (<path>/<name>/profile.yaml in one of
/// `robot_paths`), by its folder or as a file. Fails with kNotFound, naming the nearest profile.
[[nodiscard]] Result<std::filesystem::path> find_profile(
    const Node& profile, const std::vector<std::filesystem::path>& robot_paths);

/// Reads and checks a profile; all that is wrong with it is appended to `errors`.
[[nodiscard]] Profile read_profile(const std::filesystem::path& file,
                                   const DocumentReader& documents, std::vector<Error>& errors);

/// What a configuration says of its robot.
struct Options {
  Node profile;
  Node group;
  Node held;
  Node mount;
  std::filesystem::path urdf;
  std::optional<std::string> base;
  std::string root_link;
  std::string tip_link;
  std::vector<std::string> joints;
  Node joint_limits;
  Node fixed_joints;
  Node package_paths;
  double sphere_protrusion_m = 0.05;
  static Parameters<Options> parameters();
  [[nodiscard]] std::vector<OptionMistake> check() const;
};

/// A robot from a profile, or from a URDF as it is. options.check() must find nothing wrong.
[[nodiscard]] Result<std::unique_ptr<KinematicTree>> load_robot(const Options& options,
                                                                const HostContext& context);

}  // namespace sidestep::urdf_robot
