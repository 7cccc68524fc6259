#pragma once

#include <ompl/base/OptimizationObjective.h>
#include <ompl/geometric/planners/prm/PRM.h>

namespace sidestep::ompl_optimiser {

/// PRM, except that it counts instead of looking at the clock, and looks for a path between two
/// rounds of growth instead of from a thread beside it: equal seeds give equal roadmaps. With
/// `star`, PRM*: as many connections as the number of milestones asks for.
class CountingPrm final : public ::ompl::geometric::PRM {
 public:
  explicit CountingPrm(const ::ompl::base::SpaceInformationPtr& information, bool star = false)
      : ::ompl::geometric::PRM(information, star) {
    if (star) setName("PRMstar");
  }

  ::ompl::base::PlannerStatus solve(const ::ompl::base::PlannerTerminationCondition& done) override;

 private:
  static constexpr int kGrowSamples = 40;
  static constexpr int kExpandSamples = 10;

  static ::ompl::base::PlannerTerminationCondition counted(
      const ::ompl::base::PlannerTerminationCondition& done, int count);
};

}  // namespace sidestep::ompl_optimiser
