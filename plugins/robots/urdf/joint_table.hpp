#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/robot/kinematic_tree.hpp>

#include "load_robot.hpp"
#include "urdf_file.hpp"

namespace sidestep::urdf_robot {

/// Which of the URDF's joints are planned, where the others stay, and the limits of the former.
class JointTable {
 public:
  /// Appends every mistake of the profile to `errors`.
  JointTable(const UrdfModel& model, const Profile& profile, std::vector<Error>& errors);

  /// The planned joints: the base's, then the URDF's.
  [[nodiscard]] const std::vector<Joint>& planned() const noexcept { return planned_; }
  /// The same before a group was chosen from them.
  [[nodiscard]] const std::vector<Joint>& of_profile() const noexcept { return of_profile_; }
  /// Whether there is a base that drives, planned or held.
  [[nodiscard]] bool has_base() const noexcept { return has_base_; }
  /// How its x, y or heading, 0 to 2, moves its link.
  [[nodiscard]] TreeJoint base_joint(std::size_t number) const;
  /// The base where it is planned and cannot go sideways.
  [[nodiscard]] std::optional<RollingBase> rolling() const;
  /// Where a joint is that is not of the group.
  [[nodiscard]] double held_at(const std::string& name) const;

  /// How a joint of the URDF moves its link, with mimicry resolved to the planned joint or to
  /// the fixed value behind it.
  [[nodiscard]] TreeJoint tree_joint(const UrdfJoint& joint) const;

  /// A joint that a head turns by, named at `where`. Appends a mistake, and returns nothing, where
  /// it does not turn, is planned, or mimics another.
  [[nodiscard]] std::optional<Joint> head_joint(const std::string& name, const Node& where);

 private:
  void add_base(const BaseOptions& base);
  void read_limits();
  /// Lays limits over those of a joint of the base.
  void limit_base(const JointLimitOptions& own, const Node& where, Joint& joint);
  void read_fixed();
  void choose_planned();
  /// The groups of the profile, as far as they make sense.
  [[nodiscard]] std::map<std::string, std::set<std::string>> read_groups();
  /// Leaves the joints of a group, and holds the others.
  void choose_group(const std::map<std::string, std::set<std::string>>& groups);
  void hold(const std::set<std::string>& group);
  [[nodiscard]] std::pair<double, double> base_limits(const std::string& name) const;
  [[nodiscard]] bool is_of_base(const std::string& name) const;
  /// With its limits; what they lack is told at `where`, or where the URDF has the joint.
  [[nodiscard]] Joint with_limits(const UrdfJoint& joint, const Node* where);
  [[nodiscard]] std::vector<std::string> default_joints() const;
  [[nodiscard]] Error unknown_joint(const Node& where, const std::string& name) const;
  /// Lower and upper: the profile's own where it has any, else the URDF's; infinite without.
  [[nodiscard]] std::pair<double, double> position_limits(const UrdfJoint& joint) const;
  [[nodiscard]] double rest_value(const UrdfJoint& joint) const;

  const UrdfModel& model_;
  const Profile& profile_;
  std::vector<Error>& errors_;
  std::vector<Joint> planned_;
  std::vector<Joint> of_profile_;
  bool has_base_ = false;
  std::map<std::string, JointLimitOptions> limits_;
  std::map<std::string, double> fixed_;
};

}  // namespace sidestep::urdf_robot
