#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include <sidestep/core/log.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "checker.hpp"

namespace sidestep::joint_paths {

struct PathOptions {
  std::string checker = "field";
  bool any_turn = false;
  int goal_configurations = 8;
  double max_time_s = 5.0;
  double resolution_m = 0.005;
};

/// The declarations of PathOptions, from which `Options` derives.
template <class Options>
[[nodiscard]] Parameters<Options> path_parameters() {
  return Parameters<Options>()
      .add("checker", &PathOptions::checker,
           "What says whether a motion is clear: the robot's spheres against the distance `field`; "
           "FCL on the shapes of its URDF against a scene's `primitives` and meshes; or against an "
           "octree of a map's occupied voxels (`octomap`).",
           {.choices = {"field", "primitives", "octomap"}})
      .add("any_turn", &PathOptions::any_turn,
           "Joints that turn without limits may end any whole number of turns from the goal. For "
           "plans that are driven as they are: as a start of gp_chain they would end elsewhere.")
      .add(
          "goal_configurations", &PathOptions::goal_configurations,
          "Where a goal is left to costs, as to `end_effector`: the search ends at the first of so "
          "many configurations that reach it, found by inverse kinematics.",
          {.min = 1, .max = 1000})
      .add("max_time_s", &PathOptions::max_time_s,
           "Gives up after this long, or at the caller's deadline if that is sooner.",
           {.unit = "s", .min = 0.001})
      .add("resolution_m", &PathOptions::resolution_m,
           "A motion that is not shown clear before no sphere (or shape) moves more than this "
           "between two checks counts as blocked.",
           {.unit = "m", .min = 1e-4});
}

/// A planner of paths in joint space, from rest to rest at corners: what such planners do around
/// their search. `log` must outlive it. [planning]
class PathPlanner : public Optimiser {
 public:
  PathPlanner(const PathOptions& options, std::uint64_t seed, Log& log)
      : log_(log),
        checker_(make_checker(options.checker)),
        goal_configurations_(static_cast<std::size_t>(options.goal_configurations)),
        max_time_s_(options.max_time_s),
        seed_(seed) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) final;

 protected:
  [[nodiscard]] std::uint64_t seed() const noexcept { return seed_; }
  [[nodiscard]] Log& log() const noexcept { return log_; }

 private:
  /// Whether the options suit the problem.
  [[nodiscard]] virtual Result<void> check(const Problem&) { return {}; }
  /// A path to any of `goals`, of which the problem's is the first; `checker`, which looks at the
  /// problem, calls its start and them clear.
  [[nodiscard]] virtual Result<Solution> search(const Problem& problem,
                                                std::span<const Eigen::VectorXd> goals,
                                                Checker& checker, const Deadline& deadline) = 0;

  Log& log_;
  std::unique_ptr<Checker> checker_;
  std::size_t goal_configurations_;
  double max_time_s_;
  std::uint64_t seed_;
};

/// A path of dof values a vertex, timed from rest to rest, on a rolling base by drive() (for which
/// the rest is); a failure where that cannot be.
[[nodiscard]] Solution timed(const Problem& problem, std::span<const double> path, Checker& checker,
                             double resolution_m, const Deadline& deadline);

[[nodiscard]] Solution no_path(std::string reason);

}  // namespace sidestep::joint_paths
