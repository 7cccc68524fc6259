#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/core/error.hpp>
#include <sidestep/geometry/grid.hpp>
#include <sidestep/planning/problem.hpp>

namespace sidestep {

/// An obstacle of a recorded scene, its edges along the world's axes.
struct RecordedBox {
  Eigen::Vector3d lower_m = Eigen::Vector3d::Zero();
  Eigen::Vector3d upper_m = Eigen::Vector3d::Zero();
};

/// How the peer posed every problem of a file, in the terms of GPMP2.
struct RecordedSettings {
  int support_states = 0;
  double dt_s = 0.0;
  double qc = 0.0;  ///< Of every joint.
  int interpolated_checks = 0;
  double epsilon_m = 0.0;
  double sigma_obstacle_m = 0.0;
  double sigma_endpoint = 0.0;  ///< Of start and goal, position and velocity.
};

/// The peer's result for one problem.
struct RecordedOutcome {
  int scene = 0;
  int pair = 0;
  int iterations = 0;  ///< Outer ones: accepted steps. Below 0 where they were not counted.
  double initial_cost = 0.0;
  double final_cost = 0.0;
  bool free_at_checks = false;  ///< See clearance_at_checks_m().
  bool free_exactly = false;    ///< See exact_clearance_m().
  double total_ms = 0.0;        ///< CPU time, building the problem included.
  double optimise_ms = 0.0;     ///< CPU time without that.
};

/// All problems of a file, or some, solved under one set of stopping rules on one kind of field.
struct RecordedRun {
  std::string label;  ///< E.g. "study", "replan".
  bool is_signed = false;
  double relative_tolerance = 0.0;
  int max_iterations = 0;
  std::vector<RecordedOutcome> outcomes;
};

/// Planning problems that a peer, GPMP2, has solved, with what it made of each: every pair of
/// configurations in every scene of boxes.
struct RecordedProblems {
  std::filesystem::path file;
  std::shared_ptr<const RobotModel> robot;
  /// The robot's first three joints are x, y and heading of a mobile base. The peer's state was a
  /// Lie group then, ours is a vector in the world: costs cannot be held against each other.
  bool has_base = false;
  GridSpec grid;  ///< The centres of its voxels are the nodes of the peer's field.
  Eigen::Vector3d first_node_m = Eigen::Vector3d::Zero();  ///< As written, to the last digit.
  std::vector<std::vector<RecordedBox>> scenes;
  std::vector<Eigen::VectorXd> configurations;
  std::vector<std::pair<int, int>> pairs;  ///< Of configurations: start and goal.
  RecordedSettings settings;
  std::vector<RecordedRun> runs;
};

/// Reads a file of recorded problems (JSON). Robots: serial arms by their Denavit-Hartenberg
/// parameters in either convention, such an arm on a lift on a mobile base, a point. Fails with
/// kNotFound, kIo, or kConfig, naming the file and the line or the entry. [any]
[[nodiscard]] Result<RecordedProblems> read_recorded_problems(const std::filesystem::path& file);

/// The field of a scene as the recording defines it: a node is occupied if it lies less than half
/// a cell from a box along every axis, distances are exact between nodes, 1000 m in an empty scene.
[[nodiscard]] std::shared_ptr<const DistanceField> recorded_field(const RecordedProblems& problems,
                                                                  int scene, bool is_signed);

/// A pair as the peer posed it: GP prior, priors on start and goal at rest, obstacle cost at
/// support and interpolated states. Outside the field costs nothing. A mobile base turns the
/// shorter way round.
[[nodiscard]] Problem recorded_problem(const RecordedProblems& problems,
                                       std::shared_ptr<const DistanceField> field, int pair);

/// The peer's straight line: its velocities are per interval, not per second, and ignore the ends
/// at rest, so that the initial cost is huge and gone after one iteration. A mobile base goes
/// straight as its Lie group does: along an arc, by the constant twist that leads to the goal.
[[nodiscard]] Trajectory recorded_initial(const RecordedProblems& problems, const Problem& problem);

/// The least clearance of any sphere in a field at the states that costs see; outside is free. A
/// recording judges every run so in the signed field.
[[nodiscard]] double clearance_at_checks_m(const Problem& problem, const DistanceField& field,
                                           const Trajectory& trajectory);

/// The least clearance of any sphere to the boxes themselves, exactly, in one configuration.
/// Infinity in an empty scene.
[[nodiscard]] double exact_clearance_m(const RecordedProblems& problems, int scene,
                                       std::span<const double> q);

/// The same along a trajectory, at 21 states an interval,
/// both ends included, as the recording judged.
[[nodiscard]] double exact_clearance_m(const RecordedProblems& problems, int scene,
                                       const Trajectory& trajectory);

}  // namespace sidestep
