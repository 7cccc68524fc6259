#include <sidestep/trajectory/trajectory.hpp>

#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sidestep {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;

Trajectory wavy() {
  std::mt19937 generator(9);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  Trajectory out = make_trajectory(2, 5, 0.5);
  out.times_s = {0.0, 0.4, 1.0, 1.1, 2.0};
  for (double& value : out.positions) value = uniform(generator);
  for (double& value : out.velocities) value = uniform(generator);
  return out;
}

TEST(TrajectorySample, PassesThroughItsSupportStates) {
  const Trajectory trajectory = wavy();
  std::vector<double> q(2), qdot(2);
  for (int i = 0; i < trajectory.size(); ++i) {
    trajectory.sample(trajectory.times_s[static_cast<std::size_t>(i)], q, qdot);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_DOUBLE_EQ(q[j], trajectory.q(i)[j]);
      EXPECT_DOUBLE_EQ(qdot[j], trajectory.qdot(i)[j]);
    }
  }
}

TEST(TrajectorySample, VelocityIsTheDerivativeOfPosition) {
  const Trajectory trajectory = wavy();
  std::vector<double> q(2), qdot(2), above(2), below(2);
  for (double time_s = 0.013; time_s < 1.99; time_s += 0.05) {
    trajectory.sample(time_s, q, qdot);
    trajectory.sample(time_s + 1e-6, above, {});
    trajectory.sample(time_s - 1e-6, below, {});
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(qdot[j], (above[j] - below[j]) / 2e-6, 1e-7) << time_s;
    }
  }
}

TEST(TrajectorySample, HoldsTheEnds) {
  const Trajectory trajectory = wavy();
  std::vector<double> q(2), qdot(2);
  trajectory.sample(-1.0, q, qdot);
  EXPECT_EQ(q[0], trajectory.q(0)[0]);
  trajectory.sample(std::numeric_limits<double>::infinity(), q, qdot);
  EXPECT_EQ(q[1], trajectory.q(4)[1]);
  EXPECT_EQ(qdot[1], trajectory.qdot(4)[1]);
}

TEST(TrajectoryValidate, NamesWhatIsWrong) {
  EXPECT_TRUE(wavy().validate().has_value());
  const auto message = [](auto&& change) {
    Trajectory trajectory = wavy();
    change(trajectory);
    const auto valid = trajectory.validate();
    return valid ? std::string("valid") : valid.error().message;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message([&](Trajectory& t) { t.positions[5] = nan; }),
              HasSubstr("position at state 2, joint 1"));
  EXPECT_THAT(message([&](Trajectory& t) { t.velocities[0] = 1.0 / 0.0; }),
              HasSubstr("velocity at state 0, joint 0"));
  EXPECT_THAT(message([](Trajectory& t) { t.times_s[3] = 1.0; }), HasSubstr("state 3"));
  EXPECT_THAT(message([&](Trajectory& t) { t.times_s[2] = nan; }), HasSubstr("state 2"));
  EXPECT_THAT(message([](Trajectory& t) { t.times_s[0] = -0.1; }), HasSubstr("first time"));
  EXPECT_THAT(message([](Trajectory& t) { t.positions.pop_back(); }), HasSubstr("10 positions"));
  EXPECT_THAT(message([](Trajectory& t) { t = Trajectory{}; }), HasSubstr("no joints"));
}

TEST(StraightLine, MovesAtConstantVelocityBetweenItsEnds) {
  const RobotState start{Eigen::Vector2d(0.0, 1.0), Eigen::Vector2d(0.3, 0.0)};
  const RobotState goal{Eigen::Vector2d(2.0, -1.0), Eigen::Vector2d(0.0, -0.2)};
  const Trajectory line = straight_line(start, goal, 5, 0.5);
  ASSERT_TRUE(line.validate().has_value());
  EXPECT_THAT(line.times_s, ElementsAre(0.0, 0.5, 1.0, 1.5, 2.0));
  EXPECT_THAT(line.q(1), ElementsAre(DoubleNear(0.5, 1e-15), DoubleNear(0.5, 1e-15)));
  EXPECT_THAT(line.qdot(0), ElementsAre(0.3, 0.0));
  EXPECT_THAT(line.qdot(2), ElementsAre(DoubleNear(1.0, 1e-15), DoubleNear(-1.0, 1e-15)));
  EXPECT_THAT(line.q(4), ElementsAre(2.0, -1.0));
  EXPECT_THAT(line.qdot(4), ElementsAre(0.0, -0.2));
}

TEST(Refit, KeepsATrajectoryThatFitsAlready) {
  Trajectory previous = wavy();
  previous.times_s = {0.0, 0.5, 1.0, 1.5, 2.0};
  const Trajectory again = refit(previous, 0.0, 5, 0.5);
  for (std::size_t i = 0; i < previous.positions.size(); ++i) {
    EXPECT_NEAR(again.positions[i], previous.positions[i], 1e-14);
    EXPECT_NEAR(again.velocities[i], previous.velocities[i], 1e-14);
  }
}

TEST(Refit, StretchesWhatRemains) {
  const Trajectory previous = wavy();
  const Trajectory rest = refit(previous, 0.8, 13, 0.2);  // 1.2 s become 2.4 s
  ASSERT_TRUE(rest.validate().has_value());
  EXPECT_NEAR(rest.duration_s(), 2.4, 1e-12);
  std::vector<double> q(2), qdot(2);
  for (int i = 0; i < 13; ++i) {
    previous.sample(0.8 + 0.1 * i, q, qdot);
    for (std::size_t j = 0; j < 2; ++j) {
      EXPECT_NEAR(rest.q(i)[j], q[j], 1e-12);
      EXPECT_NEAR(rest.qdot(i)[j], 0.5 * qdot[j], 1e-12);
    }
  }
}

TEST(Refit, RestsWhereThePreviousOneHasEnded) {
  const Trajectory previous = wavy();
  const Trajectory rest = refit(previous, 7.0, 4, 0.2);
  ASSERT_TRUE(rest.validate().has_value());
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(rest.q(i)[0], previous.q(4)[0]);
    EXPECT_EQ(rest.qdot(i)[0], 0.0);
  }
}

}  // namespace
}  // namespace sidestep
