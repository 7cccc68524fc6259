#include "objective.hpp"

#include <algorithm>
#include <limits>
#include <mutex>
#include <vector>

#include <ompl/base/objectives/PathLengthOptimizationObjective.h>
#include <ompl/base/objectives/StateCostIntegralObjective.h>

#include <sidestep/planning/costs.hpp>

namespace sidestep::ompl_optimiser {
namespace {

namespace ob = ::ompl::base;

constexpr double kTieBreak = 1e-3;

class KeepingClear final : public ob::StateCostIntegralObjective {
 public:
  KeepingClear(const ob::SpaceInformationPtr& information, double share, const Options& options,
               const Problem& problem, const Search& search)
      : ob::StateCostIntegralObjective(information, true),
        share_(share),
        weight_(options.clearance_weight),
        clearance_m_(options.clearance_m),
        problem_(problem),
        search_(search),
        above_floor_(problem.space, problem.robot->description()),
        q_(search.space().dof()),
        centres_m_(problem.robot->description().spheres.size()),
        distances_m_(centres_m_.size()),
        statuses_(centres_m_.size()) {
    description_ = "Path length and clearance";
  }

  ob::Cost stateCost(const ob::State* state) const override {
    const double missing = std::max(0.0, 1.0 - clearance_of(state) / clearance_m_);
    return ob::Cost(share_ + weight_ * missing * missing);
  }
  /// No motion costs less than its length's share.
  ob::Cost motionCostHeuristic(const ob::State* from, const ob::State* to) const override {
    return ob::Cost(share_ * si_->distance(from, to));
  }

 private:
  [[nodiscard]] double clearance_of(const ob::State* state) const {
    const std::scoped_lock lock(mutex_);
    const RobotDescription& robot = problem_.robot->description();
    search_.to_joints(state, q_);
    problem_.robot->sphere_centres(q_, centres_m_, scratch_);
    query_with_policy(*problem_.field, problem_.space, centres_m_, distances_m_, {}, statuses_);
    double least_m = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < centres_m_.size(); ++s) {
      least_m = std::min(
          {least_m, distances_m_[s] - robot.spheres[s].radius_m, above_floor_(s, centres_m_[s])});
    }
    return least_m;
  }

  double share_;
  double weight_;
  double clearance_m_;
  const Problem& problem_;
  const Search& search_;
  FloorClearance above_floor_;
  mutable std::mutex mutex_;  ///< Of what follows: planners may have threads of their own.
  mutable std::vector<double> q_;
  mutable std::vector<Eigen::Vector3d> centres_m_;
  mutable std::vector<double> distances_m_;
  mutable std::vector<FieldStatus> statuses_;
  mutable Scratch scratch_;
};

}  // namespace

ob::OptimizationObjectivePtr make_objective(const ob::SpaceInformationPtr& information,
                                            const Options& options, const Problem& problem,
                                            const Search& search) {
  if (options.objective == "length") {
    return std::make_shared<ob::PathLengthOptimizationObjective>(information);
  }
  const double share = options.objective == "clearance" ? kTieBreak : 1.0;
  return std::make_shared<KeepingClear>(information, share, options, problem, search);
}

}  // namespace sidestep::ompl_optimiser
