#include "rrt_connect.hpp"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>

#include "path_planner.hpp"
#include "search.hpp"
#include "shorten.hpp"

namespace sidestep::rrt_connect {

using joint_paths::Checker;
using joint_paths::JointSpace;
using joint_paths::no_path;
using joint_paths::Steering;

Parameters<Options> Options::parameters() {
  return joint_paths::path_parameters<Options>()
      .add("max_samples", &Options::max_samples, "Gives up after this many samples.", {.min = 1})
      .add("range_m", &Options::range_m,
           "Longest extension of a tree. Configurations are as far apart as the Euclidean norm of "
           "how far each joint moves the sphere that it moves farthest.",
           {.unit = "m", .min = 1e-3, .max = 100.0})
      .add("least_lever_m", &Options::least_lever_m,
           "A joint counts as moving some sphere by at least this a radian, or a metre.",
           {.unit = "m", .min = 1e-3, .max = 100.0})
      .add("domain", &Options::domain,
           "A configuration that could not be extended draws only samples that are nearer than so "
           "many ranges.",
           {.min = 1.0, .max = 1e6})
      .add("shorten_tries", &Options::shorten_tries,
           "Stretches of the path that are tried to be drawn straight, at most: fewer where the "
           "search was short, so that shortening takes no longer. Vertices that are not needed "
           "are left out besides.",
           {.min = 0, .max = 1e6});
}

namespace {

constexpr std::int64_t kLooksPerTry = 10;

class RrtConnect final : public joint_paths::PathPlanner {
 public:
  RrtConnect(const Options& options, std::uint64_t seed, Log& log)
      : PathPlanner(options, seed, log), options_(options) {}

 private:
  [[nodiscard]] Result<Solution> search(const Problem& problem,
                                        std::span<const Eigen::VectorXd> goals, Checker& checker,
                                        const Deadline& whole) override {
    const Deadline deadline = whole.capped_s(options_.max_time_s);
    const JointSpace space(problem, goals,
                           joint_paths::motion_weights(problem, options_.least_lever_m),
                           options_.any_turn);
    Search search(space, as_span(problem.start.q), checker,
                  {options_.range_m, options_.domain, options_.resolution_m}, seed(), deadline);
    std::vector<double> path(as_span(problem.start.q).begin(), as_span(problem.start.q).end());
    const Steering steering(problem.robot->description(), std::vector<double>(space.dof(), 1.0));
    steering.append(as_span(problem.start.q), as_span(space.goals().front()), path);
    if (!is_clear(path, space.dof(), checker)) {
      std::optional<std::vector<double>> found;
      while (!found && search.samples() < options_.max_samples && !deadline.expired()) {
        found = search.grow();
      }
      if (!found) return nothing_found(whole, search.samples());
      path = *std::move(found);
    }
    const auto tries =
        std::min<std::int64_t>(options_.shorten_tries, search.looks() / kLooksPerTry);
    const Shortening how{times_per_unit(problem), options_.resolution_m, static_cast<int>(tries),
                         steering};
    const double found_s = path_length(path, how.weights);
    if (path.size() > 2 * space.dof()) {
      shorten(path, how, checker, derive_seed(seed(), "shorten"), deadline);
    }
    Solution solution = joint_paths::timed(problem, path, checker, options_.resolution_m, deadline);
    solution.iterations = static_cast<int>(search.samples());
    solution.initial_cost = found_s;
    solution.cost = path_length(path, how.weights);
    return solution;
  }

  [[nodiscard]] bool is_clear(std::span<const double> path, std::size_t dof,
                              Checker& checker) const {
    for (std::size_t i = dof; i < path.size(); i += dof) {
      if (!checker.is_clear(path.subspan(i - dof, dof), path.subspan(i, dof),
                            options_.resolution_m)) {
        return false;
      }
    }
    return true;
  }

  /// Of each joint, at full speed.
  [[nodiscard]] static std::vector<double> times_per_unit(const Problem& problem) {
    std::vector<double> times;
    for (const Joint& joint : problem.robot->description().joints) {
      times.push_back(1.0 / joint.max_velocity);
    }
    return times;
  }

  [[nodiscard]] Solution nothing_found(const Deadline& deadline, std::int64_t samples) const {
    Solution solution =
        no_path("no path to the goal was found with " + std::to_string(samples) + " samples");
    solution.iterations = static_cast<int>(samples);
    if (deadline.expired()) {
      solution.status = SolveStatus::kDeadline;
      solution.reason += ", when the deadline came";
    } else if (samples < options_.max_samples) {
      solution.reason += format(" in %.3g s", options_.max_time_s);
    }
    return solution;
  }

  Options options_;
};

}  // namespace

std::unique_ptr<Optimiser> make_rrt_connect(const Options& options, std::uint64_t seed, Log& log) {
  return std::make_unique<RrtConnect>(options, seed, log);
}

}  // namespace sidestep::rrt_connect
