// Which of several trajectories a race of planners gives as its answer.
#include <sidestep/runtime/planning_race.hpp>

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/problem.hpp>

#include "support/ball_robot.hpp"

namespace sidestep {
namespace {

/// Returns the same trajectory whatever it is asked, or none.
class Fixed final : public Optimiser {
 public:
  explicit Fixed(Trajectory trajectory) : trajectory_(std::move(trajectory)) {}
  Result<Solution> solve(const Problem&, const Trajectory&, const Deadline&) override {
    Solution solution;
    solution.status = trajectory_.size() > 0 ? SolveStatus::kConverged : SolveStatus::kNoPath;
    solution.trajectory = trajectory_;
    return solution;
  }

 private:
  Trajectory trajectory_;
};

PluginPtr<Optimiser> that_returns(Trajectory trajectory) {
  const auto destroy = [](void* object) { delete static_cast<Fixed*>(object); };
  return {new Fixed(std::move(trajectory)), PluginDeleter{destroy, "optimiser fixed"}};
}

/// A ball of 0.1 m that has to go around another one of 0.3 m.
class PlanningRaceTest : public testing::Test {
 protected:
  PlanningRaceTest() {
    const Scene scene({{"ball", Sphere{0.3}, {Waypoint{}}}});
    const Eigen::Vector3d reach_m = Eigen::Vector3d::Constant(10.0);
    problem_.robot = std::make_shared<testing_support::BallRobot>(0.1);
    problem_.field =
        std::make_shared<SceneField>(scene, Stamp(), Eigen::AlignedBox3d(-reach_m, reach_m));
    problem_.start = {Eigen::Vector3d(-1.0, 0.0, 0.0), Eigen::Vector3d::Zero()};
    problem_.goal = {Eigen::Vector3d(1.0, 0.0, 0.0), Eigen::Vector3d::Zero()};
    problem_.support_states = 21;
    problem_.dt_s = 0.2;
    problem_.qc = Eigen::Vector3d::Ones();
    check_ = make_field_check(problem_.robot, problem_.field, {}, {});
  }

  /// From start to goal by way of (0, y_m), at rest or passing there.
  [[nodiscard]] Trajectory by_way_of(double y_m, double speed_mps) const {
    Trajectory path = make_trajectory(3, 3, 2.0);
    std::ranges::copy(problem_.start.q, path.q(0).begin());
    path.q(1)[1] = y_m;
    path.qdot(1)[0] = speed_mps;
    std::ranges::copy(problem_.goal.q, path.q(2).begin());
    return path;
  }

  [[nodiscard]] RaceResult run(PluginPtr<Optimiser> optimiser) const {
    std::vector<PlanningRace::Lane> lanes;
    lanes.push_back({"sampled", std::move(optimiser), that_returns(by_way_of(0.8, 0.0))});
    PlanningRace race(std::move(lanes), {{1.0, 1.0, 1.0}, {2.0, 2.0, 2.0}, {}});
    auto result = race.run(problem_, {*check_, *check_}, 1, Deadline::after_s(60.0), {});
    EXPECT_TRUE(result) << result.error().describe();
    return result ? std::move(*result) : RaceResult{};
  }

  static double highest_m(const Trajectory& trajectory) {
    double highest = 0.0;
    for (int i = 0; i < trajectory.size(); ++i) highest = std::max(highest, trajectory.q(i)[1]);
    return highest;
  }

  Problem problem_;
  std::unique_ptr<ValidityCheck> check_;
};

TEST_F(PlanningRaceTest, ASampledPathAloneStopsAtItsCorner) {
  const RaceResult result = run(nullptr);
  EXPECT_FALSE(result.is_smooth);
  EXPECT_TRUE(result.earlier.empty());
  EXPECT_DOUBLE_EQ(highest_m(result.trajectory), 0.8);
}

TEST_F(PlanningRaceTest, ItsCornersAreRoundedOffWhereNoOptimiserPolishesIt) {
  const RaceResult result = run(that_returns({}));
  EXPECT_TRUE(result.is_smooth);
  EXPECT_EQ(result.seed, "sampled");
  ASSERT_EQ(result.earlier.size(), 1u);
  EXPECT_FALSE(result.earlier.front().is_smooth);
  EXPECT_LE(result.earlier.front().took_ms, result.took_ms);
  EXPECT_LT(result.trajectory.duration_s(), result.earlier.front().trajectory.duration_s());
  // Half a metre off the corner, whose sides rise by 0.8 in 1: 0.5 |b - a| / 4 below its tip.
  EXPECT_NEAR(highest_m(result.trajectory), 0.8 - 0.25 * 0.5 * 2.0 * 0.8 / std::hypot(1.0, 0.8),
              1e-3);
}

TEST_F(PlanningRaceTest, AnOptimisersTrajectoryIsTheAnswerWhereItCostsLess) {
  const RaceResult result = run(that_returns(by_way_of(0.5, 0.7)));
  EXPECT_TRUE(result.is_smooth);
  ASSERT_EQ(result.earlier.size(), 2u);
  EXPECT_FALSE(result.earlier[0].is_smooth);
  EXPECT_TRUE(result.earlier[1].is_smooth);
  EXPECT_NEAR(highest_m(result.trajectory), 0.5, 0.01);
}

TEST_F(PlanningRaceTest, ARoundedPathStaysTheAnswerWhereTheOptimisersCostsMore) {
  const RaceResult result = run(that_returns(by_way_of(4.0, 0.7)));
  EXPECT_TRUE(result.is_smooth);
  EXPECT_EQ(result.earlier.size(), 1u);
  EXPECT_LT(highest_m(result.trajectory), 0.8);
}

TEST_F(PlanningRaceTest, OneThatTouchesIsNoAnswerHoweverCheap) {
  const RaceResult result = run(that_returns(by_way_of(0.2, 0.7)));
  EXPECT_TRUE(result.is_smooth);
  EXPECT_GT(highest_m(result.trajectory), 0.5);
}

}  // namespace
}  // namespace sidestep
