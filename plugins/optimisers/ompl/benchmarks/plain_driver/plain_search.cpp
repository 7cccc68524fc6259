#include "plain_search.hpp"

#include <utility>

#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <ompl/geometric/planners/rrt/RRTConnect.h>

#include <sidestep/core/time.hpp>

namespace sidestep::plain_driver {
namespace {

namespace ob = ::ompl::base;
namespace og = ::ompl::geometric;

/// Reading the clock twice takes some 0.05 us, a hundredth of a state check: but few are timed. A
/// prime, so that it keeps no step with how motions are cut up.
constexpr std::int64_t kTimedOneIn = 61;

ob::StateSpacePtr joint_space(const RobotDescription& robot) {
  const auto dof = static_cast<unsigned>(robot.dof());
  ob::RealVectorBounds bounds(dof);
  for (unsigned j = 0; j < dof; ++j) {
    bounds.setLow(j, robot.joints[j].lower);
    bounds.setHigh(j, robot.joints[j].upper);
  }
  auto space = std::make_shared<ob::RealVectorStateSpace>(dof);
  space->setBounds(bounds);
  return space;
}

std::span<const double> joints_of(const ob::State* state, const ob::StateSpace& space) {
  return {state->as<ob::RealVectorStateSpace::StateType>()->values, space.getDimension()};
}

ob::ScopedState<> state_of(const ob::StateSpacePtr& space, const Eigen::VectorXd& q) {
  ob::ScopedState<> state(space);
  for (Eigen::Index j = 0; j < q.size(); ++j) state[static_cast<unsigned>(j)] = q[j];
  return state;
}

}  // namespace

PlainSearch::PlainSearch(const std::shared_ptr<const RobotModel>& robot, const Scene& scene,
                         double margin_m)
    : states_(robot, scene, margin_m), setup_(joint_space(robot->description())) {
  const ob::SpaceInformationPtr& information = setup_.getSpaceInformation();
  const ob::StateSpace& space = *setup_.getStateSpace();
  setup_.setStateValidityChecker(
      [this, &space](const ob::State* state) { return is_free(joints_of(state, space)); });
  information->setStateValidityCheckingResolution(kStep_rad / space.getMaximumExtent());
  setup_.setPlanner(std::make_shared<og::RRTConnect>(information));
}

bool PlainSearch::is_free(std::span<const double> q) {
  if (count_.states++ % kTimedOneIn != 0) return states_.is_free(q);
  const Stopwatch watch;
  const bool is_free = states_.is_free(q);
  count_.timed_us += 1e3 * watch.elapsed_ms();
  ++count_.timed;
  return is_free;
}

PlainAnswer plan_plainly(const std::shared_ptr<const RobotModel>& robot, const Scene& scene,
                         const Eigen::VectorXd& q_start, const Eigen::VectorXd& q_goal,
                         double margin_m, double limit_s) {
  PlainAnswer answer;
  Stopwatch watch;
  PlainSearch search(robot, scene, margin_m);
  og::SimpleSetup& setup = search.setup();
  const ob::StateSpacePtr& space = setup.getStateSpace();
  setup.setStartAndGoalStates(state_of(space, q_start), state_of(space, q_goal));
  setup.setup();
  answer.setup_ms = watch.elapsed_ms();

  watch.restart();
  setup.solve(limit_s);
  answer.search_ms = watch.elapsed_ms();
  answer.is_solved = setup.haveExactSolutionPath();
  if (answer.is_solved) {
    watch.restart();
    setup.simplifySolution();
    answer.simplify_ms = watch.elapsed_ms();
    answer.length = setup.getSolutionPath().length();
    for (const ob::State* state : setup.getSolutionPath().getStates()) {
      const std::span<const double> q = joints_of(state, *space);
      answer.path.insert(answer.path.end(), q.begin(), q.end());
    }
  }
  answer.count = search.count();
  answer.is_broken = answer.is_solved && !setup.getSolutionPath().check();
  return answer;
}

}  // namespace sidestep::plain_driver
