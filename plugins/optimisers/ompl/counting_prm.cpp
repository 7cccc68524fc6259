#include "counting_prm.hpp"

namespace sidestep::ompl_optimiser {

namespace ob = ::ompl::base;

ob::PlannerStatus CountingPrm::solve(const ob::PlannerTerminationCondition& done) {
  checkValidity();
  while (const ob::State* start = pis_.nextStart()) {
    startM_.push_back(addMilestone(si_->cloneState(start)));
  }
  while (const ob::State* goal = pis_.nextGoal()) {
    goalM_.push_back(addMilestone(si_->cloneState(goal)));
  }
  if (startM_.empty()) return ob::PlannerStatus::INVALID_START;
  if (goalM_.empty()) return ob::PlannerStatus::INVALID_GOAL;
  bestCost_ = opt_->infiniteCost();
  addedNewSolution_ = false;
  ob::PathPtr path;
  while (true) {
    // Its result says whether the path is good enough for the objective: any is.
    (void)maybeConstructSolution(startM_, goalM_, path);
    if (path) break;
    if (done) return ob::PlannerStatus::TIMEOUT;
    growRoadmap(counted(done, kGrowSamples));
    expandRoadmap(counted(done, kExpandSamples));
  }
  pdef_->addSolutionPath(path, false, 0.0, getName());
  return ob::PlannerStatus::EXACT_SOLUTION;
}

ob::PlannerTerminationCondition CountingPrm::counted(const ob::PlannerTerminationCondition& done,
                                                     int count) {
  return ob::PlannerTerminationCondition([&done, count]() mutable { return count-- <= 0 || done; });
}

}  // namespace sidestep::ompl_optimiser
