#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <sidestep/plugin/parameters.hpp>
#include <sidestep/runtime/host.hpp>
#include <sidestep/runtime/planning_race.hpp>
#include <sidestep/runtime/planning_settings.hpp>

namespace sidestep {

/// An optimiser, a sampling planner, or both in a race; what a block with these keys is read into
/// derives from this.
struct PlannerSettings {
  std::vector<std::string> seeds = {"straight"};
  Node optimiser;
  Node sampler;
};
/// Declares them after what is declared already.
template <class Entry>
[[nodiscard]] Parameters<Entry> declare_planner(Parameters<Entry> parameters) {
  return std::move(parameters)
      .add("seeds", &Entry::seeds,
           "First guesses, raced over the cores: `straight`, a line (and, beside others, lines "
           "that are perturbed); `sampled`, the sampler's path, which the optimiser polishes if "
           "there is one.")
      .add("optimiser", &Entry::optimiser, "The block of the optimiser.",
           {.plugin = PluginKind::kOptimiser})
      .add("sampler", &Entry::sampler, "The block of the sampling planner, for the seed `sampled`.",
           {.plugin = PluginKind::kOptimiser});
}
/// Appends a kConfig error for each seed of such a block that is unknown or lacks its plugin.
void check_planner(const Node& block, std::vector<Error>& errors);

/// What the planner's own checks see: what its sampler says, as far as it has one, else "field".
[[nodiscard]] std::string checker_of(const PlannerSettings& settings);

/// A motion that is asked for.
struct MotionQuery {
  std::shared_ptr<const DistanceField> field;
  Eigen::VectorXd q_start;
  Eigen::VectorXd q_goal;
  std::vector<CostTerm> terms = {};  ///< Besides the standard ones.
  std::uint64_t seed = 0;            ///< Of lines that are perturbed.
};

/// Plans motions of one robot in one map after the other: poses the problem, races for it, times
/// what is found and answers only with what passes its check. Not for several threads at once.
class MotionPlanner {
 public:
  /// `by_shapes`: what is found among exact shapes (SceneField) is checked by the robot's own
  /// shapes rather than its spheres.
  MotionPlanner(std::shared_ptr<const RobotModel> robot, std::vector<PlanningRace::Lane> lanes,
                PlanningSettings planning, CheckSettings check, bool by_shapes = false);

  /// Creates the plugins that the settings name, with a seed. Their block has passed
  /// check_planner(). Fails as Host::create() does. [main]
  [[nodiscard]] static Result<MotionPlanner> create(Host& host,
                                                    const std::shared_ptr<const RobotModel>& robot,
                                                    const PlannerSettings& settings,
                                                    PlanningSettings planning, CheckSettings check,
                                                    std::uint64_t seed);

  /// Without a trajectory, and with the reason, where none was found and where the query makes no
  /// sense. Ends at the deadline, or soon after a stop is asked for. Fails where a planner or a
  /// check does. [planning]; allocates.
  [[nodiscard]] Result<RaceResult> plan(const MotionQuery& query, const Deadline& deadline,
                                        const std::stop_token& stop = {});

  /// The problem that a query is posed as.
  [[nodiscard]] Problem pose(const MotionQuery& query) const;

 private:
  std::shared_ptr<const RobotModel> robot_;
  PlanningSettings planning_;
  CheckSettings check_;
  bool by_shapes_;
  FieldChecks checks_;
  PlanningRace race_;
};

}  // namespace sidestep
