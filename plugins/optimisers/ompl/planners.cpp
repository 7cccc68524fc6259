#include "planners.hpp"

#include <ompl/geometric/planners/informedtrees/BITstar.h>
#include <ompl/geometric/planners/prm/PRM.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>
#include <ompl/geometric/planners/rrt/RRTstar.h>

namespace sidestep::ompl_optimiser {
namespace {

namespace ob = ::ompl::base;
namespace og = ::ompl::geometric;

/// PRM, except that it counts instead of looking at the clock, and looks for a path between two
/// rounds of growth instead of from a thread beside it: equal seeds give equal roadmaps.
class CountingPrm final : public og::PRM {
 public:
  using og::PRM::PRM;

  ob::PlannerStatus solve(const ob::PlannerTerminationCondition& done) override {
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

 private:
  static constexpr int kGrowSamples = 40;
  static constexpr int kExpandSamples = 10;

  static ob::PlannerTerminationCondition counted(const ob::PlannerTerminationCondition& done,
                                                 int count) {
    return ob::PlannerTerminationCondition(
        [&done, count]() mutable { return count-- <= 0 || done; });
  }
};

}  // namespace

ob::PlannerPtr make_planner(const ob::SpaceInformationPtr& information, const std::string& name,
                            double range) {
  if (name == "PRM") return std::make_shared<CountingPrm>(information);
  if (name == "BITstar") return std::make_shared<og::BITstar>(information);
  if (name == "RRTstar") {
    auto planner = std::make_shared<og::RRTstar>(information);
    planner->setRange(range);
    return planner;
  }
  auto planner = std::make_shared<og::RRTConnect>(information);
  planner->setRange(range);
  return planner;
}

bool improves_until_stopped(const std::string& name) {
  return name == "RRTstar" || name == "BITstar";
}

}  // namespace sidestep::ompl_optimiser
