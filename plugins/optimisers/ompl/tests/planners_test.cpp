#include "planners.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include <ompl/base/SpaceInformation.h>
#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "conformance/test_host.hpp"
#include "ompl_optimiser.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::ompl_optimiser {
namespace {

/// Those that search from threads of their own, in an order that is the system's; and LBTRRT, which
/// does not repeat itself either.
const std::set<std::string> kUnrepeatable = {
    "AnytimePathShortening", "CForest", "LBTRRT", "SPARS", "SPARStwo", "pRRT", "pSBL"};

const std::set<std::string> kPatient = {"AnytimePathShortening", "SPARStwo", "pSBL"};

SceneObject box_at(const Eigen::Vector3d& size_m, const Eigen::Vector3d& xyz_m) {
  SceneObject object;
  object.name = "box";
  object.shape = Box{size_m};
  Transform pose = Transform::Identity();
  pose.translation() = xyz_m;
  object.waypoints = {{0.0, pose}};
  return object;
}

/// The base must go round a post, or its arm over it.
class PlannerByName : public testing::TestWithParam<std::string> {
 protected:
  PlannerByName() {
    problem_.robot = testing_support::mobile_arm();
    problem_.field = std::make_shared<const SceneField>(
        scene_, Stamp(),
        Eigen::AlignedBox3d(Eigen::Vector3d(-2, -2, -1), Eigen::Vector3d(2, 2, 3)));
    problem_.space = {Space::kFree, Space::kOccupied};
    problem_.start = rest(-1.0, 0.1);
    problem_.goal = rest(1.0, -0.1);
    problem_.support_states = 10;
    problem_.dt_s = 0.5;
    problem_.qc = Eigen::VectorXd::Ones(7);
  }
  static RobotState rest(double x, double y) {
    Eigen::VectorXd q(7);
    q << x, y, 0.0, 0.2, -0.8, 1.2, 0.0;
    return {q, Eigen::VectorXd::Zero(7)};
  }
  Solution solve(const std::string& planner, std::uint64_t seed, const char* objective = "length") {
    Options options;
    options.planner = planner;
    options.max_time_s = 60.0;
    options.optimise_iterations = 400;
    // Some do not say when they have found a first path, and some need many iterations.
    options.max_iterations = kPatient.contains(planner) ? 200'000 : 5'000;
    options.objective = objective;
    options.clearance_m = 0.4;
    auto solution = make_ompl_optimiser(options, seed, log_)->solve(problem_, {}, Deadline());
    EXPECT_TRUE(solution) << solution.error().describe();
    return solution ? std::move(*solution) : Solution{};
  }
  /// The least distance to the post along a trajectory, by the scene's own distances.
  double clearance_m(const Trajectory& trajectory) const {
    const RobotDescription& robot = problem_.robot->description();
    std::vector<double> q(7);
    std::vector<Eigen::Vector3d> centres_m(robot.spheres.size());
    Scratch scratch;
    double least_m = 1e9;
    for (double t = 0.0; t <= trajectory.duration_s(); t += 2e-3) {
      trajectory.sample(t, q, {});
      problem_.robot->sphere_centres(q, centres_m, scratch);
      for (std::size_t s = 0; s < centres_m.size(); ++s) {
        least_m = std::min(least_m, scene_.signed_distance(centres_m[s], 0.0).distance_m -
                                        robot.spheres[s].radius_m);
      }
    }
    return least_m;
  }

  Scene scene_{{box_at({0.3, 0.5, 2.0}, {0.0, 0.0, 0.5})}};
  Problem problem_;
  conformance::RecordingLog log_;
};

TEST_P(PlannerByName, FindsAWayThatIsClear) {
  const Solution solution = solve(GetParam(), 3);
  ASSERT_GT(solution.trajectory.size(), 0) << solution.reason;
  EXPECT_GE(clearance_m(solution.trajectory), 0.0);
  const auto check = make_field_check(problem_.robot, problem_.field, problem_.space, {});
  const auto verdict = check->check(solution.trajectory, 0.0, Deadline());
  ASSERT_TRUE(verdict);
  EXPECT_TRUE(verdict->valid()) << verdict->describe();
}

TEST_P(PlannerByName, RepeatsItself) {
  if (kUnrepeatable.contains(GetParam())) GTEST_SKIP() << "one of OMPL's that does not";
  const Solution first = solve(GetParam(), 5), second = solve(GetParam(), 5);
  ASSERT_GT(first.trajectory.size(), 0) << first.reason;
  EXPECT_EQ(first.trajectory.positions, second.trajectory.positions);
}

INSTANTIATE_TEST_SUITE_P(All, PlannerByName, testing::ValuesIn(planner_names()),
                         [](const auto& of) { return of.param; });

class ClearanceObjective : public PlannerByName {};

TEST_P(ClearanceObjective, KeepsFartherAwayThanTheShortestPath) {
  const double by_length_m = clearance_m(solve(GetParam(), 3).trajectory);
  const double by_both_m = clearance_m(solve(GetParam(), 3, "length_and_clearance").trajectory);
  EXPECT_GT(by_both_m, by_length_m + 0.02);
}

INSTANTIATE_TEST_SUITE_P(Improving, ClearanceObjective, testing::Values("RRTstar", "BITstar"),
                         [](const auto& of) { return of.param; });

std::vector<OptionMistake> mistakes_of(const std::string& planner, const char* name,
                                       const char* value) {
  Options options;
  options.planner = planner;
  options.planner_parameters =
      Node(Node::Map{{name, {}, Node(Node::Scalar{value, false}, {})}}, SourceMark{});
  return options.check();
}

TEST(PlannerParameters, AreThoseThatThePlannerDeclares) {
  EXPECT_TRUE(mistakes_of("BITstar", "samples_per_batch", "200").empty());
  EXPECT_TRUE(mistakes_of("BITstar", "use_k_nearest", "false").empty());
  EXPECT_TRUE(mistakes_of("RRTConnect", "range", "0.5").empty());

  const auto unknown = mistakes_of("BITstar", "samples_per_bach", "200");
  ASSERT_EQ(unknown.size(), 1u);
  EXPECT_EQ(unknown[0].parameters.front(), "parameters.samples_per_bach");
  EXPECT_NE(unknown[0].hint.find("'samples_per_batch'"), std::string::npos) << unknown[0].hint;
  EXPECT_NE(unknown[0].hint.find("rewire_factor"), std::string::npos) << unknown[0].hint;

  const auto no_number = mistakes_of("RRTConnect", "range", "0.5 rad");
  ASSERT_EQ(no_number.size(), 1u);
  EXPECT_EQ(no_number[0].what, "must be a number, not '0.5 rad'");
}

TEST(PlannerParameters, ReachThePlanner) {
  auto space = std::make_shared<::ompl::base::RealVectorStateSpace>(2);
  space->setBounds(0.0, 1.0);
  const auto planner =
      make_planner(std::make_shared<::ompl::base::SpaceInformation>(space), "BITstar");
  EXPECT_EQ(set_parameter(*planner, "samples_per_batch", "217"), "");
  std::string value;
  EXPECT_TRUE(planner->params().getParam("samples_per_batch", value));
  EXPECT_EQ(value, "217");
}

}  // namespace
}  // namespace sidestep::ompl_optimiser
