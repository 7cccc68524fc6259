#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include <sidestep/geometry/grid.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep {

/// What somebody printed of one robot and one kind of field.
struct PublishedOutcome {
  double failure_percent = 0.0;
  double iterations_mean = 0.0;
  double iterations_sd = 0.0;
  double cost_mean = 0.0;
  double cost_sd = 0.0;

  static Parameters<PublishedOutcome> parameters();
};

/// `published` of a robot: both fields' figures.
struct PublishedComparison {
  PublishedOutcome unsigned_field;
  PublishedOutcome signed_field;

  static Parameters<PublishedComparison> parameters();
};

/// One entry of `experiment.robots`.
struct StudyRobotEntry {
  std::string name;
  Node robot;         ///< A robot's plugin and parameters.
  Node planning;      ///< What differs from the `planning` block.
  Node state_ranges;  ///< {JOINT: [lower, upper], ...}
  Eigen::Vector3d box_lower_m{-1.0, -1.0, 0.0};
  Eigen::Vector3d box_upper_m{1.0, 1.0, 1.0};
  Eigen::Vector3d side_lower_m{0.0, 0.0, 0.0};
  Eigen::Vector3d side_upper_m{1.0, 1.0, 1.0};
  Eigen::Vector3d origin_m{-2.0, -2.0, -1.0};
  Eigen::Vector3d extent_m{4.0, 4.0, 3.0};
  std::optional<double> resolution_m;
  std::optional<int> support_states;
  std::optional<double> duration_s;
  std::optional<PublishedComparison> published;

  static Parameters<StudyRobotEntry> parameters();
};

/// The `experiment` block of a field study.
struct FieldStudySettings : ExperimentSettings {
  std::vector<StudyRobotEntry> robots;
  int states = 18;
  int scenes = 100;
  int boxes_per_scene = 1;
  double resolution_m = 0.05;
  std::string start_or_goal_in_collision = "solve";
  double confidence = 0.95;
  int bootstrap_samples = 2000;
  std::string published_as = "published";

  static Parameters<FieldStudySettings> parameters();

  [[nodiscard]] std::int64_t pairs() const { return std::int64_t{states} * (states - 1) / 2; }
  [[nodiscard]] bool skips_collisions() const { return start_or_goal_in_collision == "skip"; }
};

/// One robot of the study, with all that is the same for every one of its problems.
struct StudyRobot {
  StudyRobotEntry entry;
  PlanningSettings planning;  ///< The block with the entry's own values laid over it.
  GridSpec grid;              ///< Of its fields.
};

/// A configuration of a field study, read.
struct FieldStudy {
  FieldStudySettings settings;
  CheckSettings check;
  std::vector<StudyRobot> robots;
  Node field_block;  ///< Without `signed`.
  Node optimiser_block;
};

/// Keys of a `planning` block that have no effect in a study: every problem is solved once, from a
/// straight line, until the optimiser ends, and its trajectory is judged as it is.
[[nodiscard]] std::vector<std::string> unused_of_study_planning();

/// The field's block for one kind of field.
[[nodiscard]] Node study_field_block(const Node& field, bool is_signed);

/// Reads a configuration; appends what no schema can know: names, ranges, regions, blocks that do
/// not fit. What does not fit its schema has been reported, and is passed over.
[[nodiscard]] FieldStudy read_field_study(const Configuration& configuration,
                                          std::vector<Error>& errors);

/// The joint ranges that states are drawn from: `state_ranges`, else the joints' limits. Appends an
/// error for each unknown joint, empty range, value beyond a limit, and joint without limits that
/// has no range.
struct JointRange {
  double lower = 0.0;
  double upper = 0.0;
};
[[nodiscard]] std::vector<JointRange> read_state_ranges(const StudyRobotEntry& entry,
                                                        const RobotDescription& robot,
                                                        std::vector<Error>& errors);

/// Everything that can be wrong with a configuration of a field study.
void check_field_study(const Configuration& configuration, Host& host, std::vector<Error>& errors);

}  // namespace sidestep
