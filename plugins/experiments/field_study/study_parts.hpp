#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/core/time.hpp>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/mapping/mapper.hpp>
#include <sidestep/mapping/occupancy_view.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/planning/validity_check.hpp>
#include <sidestep/plugin/parameters.hpp>
#include <sidestep/report/result_columns.hpp>
#include <sidestep/results/divided_run.hpp>
#include <sidestep/results/recorder.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/runtime/experiment.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/planning_settings.hpp>
#include <sidestep/runtime/results_store.hpp>

namespace sidestep {

// Settings.

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
};

/// Keys of a `planning` block that have no effect in a study: every problem is solved once, from a
/// straight line, until the optimiser ends, and its trajectory is judged as it is.
inline const std::vector<std::string> kUnusedOfStudyPlanning = {
    "max_unknown_share", "retime", "time_limit_s", "attempts", "epsilon_moving_m"};

/// Reads a configuration; appends what no schema can know: names, ranges, regions, blocks that do
/// not fit. What does not fit its schema has been reported, and is passed over.
[[nodiscard]] FieldStudy read_field_study(const Configuration& configuration,
                                          std::vector<Error>& errors);

/// Everything that can be wrong with a configuration of a field study.
void check_field_study(const Configuration& configuration, Host& host, std::vector<Error>& errors);

// Problems.

using StudyBox = Eigen::AlignedBox3d;

/// The boxes of one scene: sides, then centres, each coordinate uniform in the robot's ranges.
/// Depends on the seed, the robot's name and the scene's number alone.
[[nodiscard]] std::vector<StudyBox> draw_boxes(const StudyRobotEntry& robot, int boxes, int scene,
                                               std::uint64_t seed);

/// Mean of the boxes' sides, along the axes along which they vary; 0 for no box.
[[nodiscard]] double mean_side_m(const StudyRobotEntry& robot, std::span<const StudyBox> boxes);

/// States of a robot, uniform in the joints' ranges, each free of self-collision and with every
/// sphere inside `grid`. Fails with kConfig where hardly any state is.
[[nodiscard]] Result<std::vector<Eigen::VectorXd>> draw_states(
    const StudyRobot& study, const std::shared_ptr<const RobotModel>& robot, int count,
    std::uint64_t seed);

/// The exact signed distance to boxes, within a kilometre of the origin: what trajectories are
/// judged against. Knows no voxels.
[[nodiscard]] std::shared_ptr<const SceneField> true_field(std::span<const StudyBox> boxes);

/// The map of a scene: a voxel is occupied where its cube and a box overlap, as it is in a map of
/// a scene whose surfaces were all seen and whose insides are full.
class BoxMap final : public Mapper, public OccupancyView {
 public:
  explicit BoxMap(const GridSpec& grid);

  /// Replaces the scene; what changed against the one before.
  [[nodiscard]] MapUpdate set_boxes(std::span<const StudyBox> boxes);

  /// Scenes come from set_boxes(); frames are refused.
  [[nodiscard]] Result<MapUpdate> integrate(const Frame& frame) override;
  [[nodiscard]] const GridSpec& grid() const noexcept override { return grid_; }
  [[nodiscard]] const GridSpec& occupancy_grid() const noexcept override { return grid_; }
  [[nodiscard]] VoxelBits occupied() const noexcept override { return {occupied_, words_per_row_}; }
  [[nodiscard]] VoxelBits known() const noexcept override { return {known_, words_per_row_}; }

 private:
  void fill(const StudyBox& box, std::vector<std::uint64_t>& bits) const;

  GridSpec grid_;
  int words_per_row_ = 0;
  std::vector<std::uint64_t> occupied_;
  std::vector<std::uint64_t> known_;
  std::int64_t sequence_ = 0;
};

/// The two kinds of field that a study compares, as indices.
inline constexpr std::size_t kUnsigned = 0;
inline constexpr std::size_t kSigned = 1;
inline constexpr std::array<const char*, 2> kFieldNames = {"unsigned", "signed"};

/// What one field led to on one problem.
struct FieldOutcome {
  bool attempted = false;  ///< False where the problem was skipped: nothing else is meaningful.
  SolveStatus status = SolveStatus::kFailed;
  bool collision_free = false;  ///< In the true scene, over continuous time.
  int iterations = 0;           ///< That changed the trajectory, as GPMP2 counts them.
  int steps = 0;                ///< Tried, accepted or not.
  double cost = 0.0;
  double clearance_m = 0.0;  ///< Least, to the true scene; infinity without obstacles.
  double solve_ms = 0.0;
  double check_ms = 0.0;
};

/// One row of the study: a pair of states in a scene.
struct ProblemOutcome {
  std::int64_t problem = 0;  ///< scene * pairs + pair.
  bool start_free = false;
  bool goal_free = false;
  std::array<FieldOutcome, 2> fields;

  [[nodiscard]] bool is_attempted() const noexcept {
    return fields[0].attempted && fields[1].attempted;
  }
  [[nodiscard]] bool is_solvable() const noexcept {
    return fields[0].collision_free || fields[1].collision_free;
  }
  [[nodiscard]] bool is_solved_by_both() const noexcept {
    return fields[0].collision_free && fields[1].collision_free;
  }
};

/// What a results store holds of a scene.
struct SceneRow {
  std::int64_t scene = 0;
  double mean_side_m = 0.0;
  std::array<double, 2> field_ms{};  ///< Time to make each kind of field.
};

/// What all problems of one scene share. Immutable; any thread.
struct StudyScene {
  int scene = 0;
  std::array<std::shared_ptr<const DistanceField>, 2> fields;
  std::shared_ptr<const ValidityCheck> check;  ///< Against the true scene, obstacles alone.
  std::vector<char> state_free;                ///< By state.
  SceneRow row;
};

/// The states of a pair: 0 is (0, 1), then (0, 2), ....
[[nodiscard]] std::pair<int, int> states_of_pair(std::int64_t pair, int states);

/// Solves problems of one robot, one after the other; one object a thread. The optimiser is the
/// configuration's, from a straight line; what is collision-free is for scene.check to say.
struct StudySolver {
  const StudyRobot& study;
  std::shared_ptr<const RobotModel> robot;
  std::span<const Eigen::VectorXd> states;
  PluginPtr<Optimiser> optimiser;
  bool skips_collisions;

  /// Fails with kCancelled where the deadline passes, and with what the optimiser fails with.
  [[nodiscard]] Result<ProblemOutcome> solve(const StudyScene& scene, std::int64_t pair,
                                             const Deadline& deadline);
  /// The same in one kind of field.
  [[nodiscard]] Result<FieldOutcome> solve_in(const StudyScene& scene, std::size_t kind, int start,
                                              int goal, const Deadline& deadline);
};

// Rows of the store.

/// What a results store holds of one robot.
struct StudyRobotRows {
  std::string name;
  int dof = 0;
  int spheres = 0;
  int states = 0;
  int scenes = 0;
  int boxes_per_scene = 0;
  double resolution_m = 0.0;
  std::int64_t planned = 0;  ///< Problems that this store should come to hold.
  std::optional<PublishedComparison> published;
  std::vector<Eigen::VectorXd> drawn_states;
  std::vector<SceneRow> drawn;           ///< By scene.
  std::vector<ProblemOutcome> problems;  ///< By problem.

  [[nodiscard]] std::int64_t pairs() const { return std::int64_t{states} * (states - 1) / 2; }
  [[nodiscard]] std::int64_t scene_of(const ProblemOutcome& problem) const {
    return problem.problem / pairs();
  }
};

/// What a results store holds of a study: everything that its summary is made from.
struct StudyRecord : DividedRun {
  double confidence = 0.95;
  int bootstrap_samples = 0;
  std::string published_as;
  std::vector<StudyRobotRows> robots;

  [[nodiscard]] std::int64_t planned() const {
    return std::accumulate(robots.begin(), robots.end(), std::int64_t{0},
                           [](std::int64_t sum, const auto& r) { return sum + r.planned; });
  }
  [[nodiscard]] std::int64_t solved() const {
    return std::accumulate(robots.begin(), robots.end(), std::int64_t{0},
                           [](auto sum, const auto& r) { return sum + std::ssize(r.problems); });
  }
};

/// Everything but what is solved: series "study", "robot" and "state/ROBOT".
void record_study(const StudyRecord& study, Recorder& recorder);
/// Series "scene/ROBOT".
void record_scene(const SceneRow& scene, std::size_t robot, Recorder& recorder);
/// Series "problem/ROBOT".
void record_problem(const ProblemOutcome& problem, std::size_t robot, Recorder& recorder);

/// Reads back what was recorded. Fails with kIo where the store is that of no study.
[[nodiscard]] Result<StudyRecord> read_study(const std::filesystem::path& file);

// Summary and report.

/// Both fields of one robot against each other (numerics: protocol of the paper's Table I): its row
/// of `robots` in summary.json.
[[nodiscard]] nlohmann::ordered_json compare_fields(const StudyRecord& study,
                                                    const StudyRobotRows& robot);

/// Verdict, summary.json and tables of what the store in `run` holds.
[[nodiscard]] Result<ExperimentOutcome> conclude_study(const std::filesystem::path& run,
                                                       bool interrupted,
                                                       const std::optional<Error>& fault);

/// Fills in the tables of terminal and spreadsheet, made of what summary.json tells.
void show_study(const nlohmann::ordered_json& summary, ExperimentOutcome& outcome);

/// How such runs are shown.
[[nodiscard]] const report::RunReport& study_report();

}  // namespace sidestep
