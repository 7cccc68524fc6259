#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {
namespace {

using testing::HasSubstr;

RobotDescription robot(std::vector<double> max_velocity, double max_acceleration = kInfinity) {
  RobotDescription out;
  out.name = "test";
  for (const double velocity : max_velocity) {
    Joint joint;
    joint.name = "joint_" + std::to_string(out.joints.size());
    joint.lower = -10.0;
    joint.upper = 10.0;
    joint.max_velocity = velocity;
    joint.max_acceleration = max_acceleration;
    out.joints.push_back(joint);
  }
  return out;
}

struct Peaks {
  Eigen::VectorXd velocity, acceleration;
};

/// The largest speed and acceleration of each joint, by dense sampling.
Peaks peaks(const Trajectory& trajectory) {
  const auto dof = static_cast<std::size_t>(trajectory.dof);
  Peaks out{Eigen::VectorXd::Zero(trajectory.dof), Eigen::VectorXd::Zero(trajectory.dof)};
  std::vector<double> q(dof), qdot(dof), before(dof);
  constexpr int kSteps = 200'000;
  const double step_s = trajectory.duration_s() / kSteps;
  trajectory.sample(0.0, q, before);
  for (int i = 1; i <= kSteps; ++i) {
    trajectory.sample(i * step_s, q, qdot);
    for (std::size_t j = 0; j < dof; ++j) {
      const auto k = static_cast<Eigen::Index>(j);
      out.velocity[k] = std::max(out.velocity[k], std::abs(qdot[j]));
      out.acceleration[k] = std::max(out.acceleration[k], std::abs(qdot[j] - before[j]) / step_s);
    }
    before = qdot;
  }
  return out;
}

TEST(EstimateHorizon, GivesACubicTimeToRespectTheLimits) {
  const auto description = robot({0.5, 2.0});
  const std::vector<double> start{0.0, 0.0}, goal{1.0, 1.0};
  const Horizon horizon = estimate_horizon(description, start, goal, 0.1, 0.8);
  EXPECT_EQ(horizon.dt_s, 0.1);
  // 1.5 * 1 m / (0.8 * 0.5 m/s) = 3.75 s: 38 intervals of 0.1 s.
  EXPECT_EQ(horizon.states, 39);
}

TEST(EstimateHorizon, CountsAccelerationWhereItIsKnown) {
  const std::vector<double> start{0.0}, goal{-1.0};
  // sqrt(6 * 1 / 1.5) = 2 s, against 0.15 s for the velocity alone.
  EXPECT_EQ(estimate_horizon(robot({10.0}, 1.5), start, goal, 0.25, 1.0).states, 10);
}

TEST(EstimateHorizon, HasAtLeastThreeStatesAndAnEnd) {
  const std::vector<double> here{0.0}, there{5.0};
  EXPECT_EQ(estimate_horizon(robot({1.0}), here, here, 0.1, 1.0).states, 3);
  EXPECT_EQ(estimate_horizon(robot({1e-12}), here, there, 0.1, 1.0).states, 10'000);
  EXPECT_EQ(estimate_horizon(robot({0.0}), here, there, 0.1, 1.0).states, 10'000);
  const std::vector<double> nowhere{std::nan("")};
  EXPECT_EQ(estimate_horizon(robot({1.0}), here, nowhere, 0.1, 1.0).states, 3);
}

TEST(TimePath, RespectsEveryLimitAndUsesOneOfThem) {
  std::mt19937 generator(2);
  std::uniform_real_distribution<double> uniform(-3.0, 3.0);
  const auto description = robot({0.5, 1.0, 2.0}, 1.5);
  std::vector<double> path(3 * 7);
  for (double& value : path) value = uniform(generator);
  const auto timed = time_path(description, path, 0.7);
  ASSERT_TRUE(timed.has_value()) << timed.error().describe();
  ASSERT_TRUE(timed->validate().has_value());
  EXPECT_EQ(timed->size(), 7);
  const Peaks peak = peaks(*timed);
  double most_used = 0.0;
  for (int j = 0; j < 3; ++j) {
    const double limit = 0.7 * description.joints[static_cast<std::size_t>(j)].max_velocity;
    EXPECT_LE(peak.velocity[j], limit);
    EXPECT_LE(peak.acceleration[j], 1.5 * (1.0 + 1e-6));
    most_used = std::max({most_used, peak.velocity[j] / limit, peak.acceleration[j] / 1.5});
  }
  EXPECT_GT(most_used, 0.99);
}

TEST(TimePath, TakesTheLeastTimeOfACubic) {
  const auto timed = time_path(robot({0.5}), std::vector<double>{0.0, 1.0}, 1.0);
  ASSERT_TRUE(timed.has_value());
  EXPECT_NEAR(timed->duration_s(), 3.0, 1e-6);
}

TEST(TimePath, StopsAtCornersOnly) {
  // Along x with four vertices on the line and a repeated one, then along y.
  const std::vector<double> path{0, 0, 0.1, 0, 0.5, 0, 0.5, 0, 1, 0, 1, 1};
  const auto timed = time_path(robot({1.0, 1.0}), path, 1.0);
  ASSERT_TRUE(timed.has_value());
  ASSERT_EQ(timed->size(), 3);
  EXPECT_EQ(timed->q(1)[0], 1.0);
  EXPECT_EQ(timed->q(1)[1], 0.0);
  EXPECT_NEAR(timed->duration_s(), 3.0, 1e-6);
  std::vector<double> q(2), qdot(2);
  for (double time_s = 0.0; time_s <= 3.0; time_s += 0.05) {  // never off the path
    timed->sample(time_s, q, qdot);
    EXPECT_LT(std::min(std::abs(q[1]), std::abs(q[0] - 1.0)), 1e-12);
  }
  timed->sample(0.75, q, qdot);
  EXPECT_GT(qdot[0], 1.0 - 1e-6);  // at full speed past the vertex at 0.5
}

TEST(TimePath, StopsWhereThePathTurnsBack) {
  const auto timed = time_path(robot({1.0}), std::vector<double>{0, 1, 0.5, -1}, 1.0);
  ASSERT_TRUE(timed.has_value());
  ASSERT_EQ(timed->size(), 3);
  EXPECT_EQ(timed->q(1)[0], 1.0);
}

TEST(TimePath, FollowsASlowCurve) {
  // Vertices on a circle whose neighbours differ in direction by 1e-4: nothing may be merged
  // away, for the deviation would add up.
  std::vector<double> path;
  for (int i = 0; i <= 1000; ++i) {
    path.push_back(std::sin(1e-4 * i));
    path.push_back(1.0 - std::cos(1e-4 * i));
  }
  const auto timed = time_path(robot({1.0, 1.0}), path, 1.0);
  ASSERT_TRUE(timed.has_value());
  std::vector<double> q(2);
  for (double time_s = 0.0; time_s < timed->duration_s(); time_s += 0.01) {
    timed->sample(time_s, q, {});
    EXPECT_NEAR(std::hypot(q[0], q[1] - 1.0), 1.0, 2e-8);
  }
}

TEST(TimePath, RestsOnAPathThatStaysPut) {
  for (const std::vector<double>& path :
       {std::vector<double>{0.3, 0.4}, std::vector<double>{0.3, 0.4, 0.3, 0.4}}) {
    const auto timed = time_path(robot({1.0, 1.0}), path, 1.0);
    ASSERT_TRUE(timed.has_value());
    ASSERT_TRUE(timed->validate().has_value());
    EXPECT_EQ(timed->size(), 2);
    EXPECT_EQ(timed->q(1)[1], 0.4);
  }
}

TEST(TimePath, RefusesWhatItCannotTime) {
  const auto message = [](const RobotDescription& description, std::vector<double> path,
                          double speed_fraction) {
    const auto timed = time_path(description, path, speed_fraction);
    if (timed) return std::string("timed");
    EXPECT_EQ(timed.error().code, ErrorCode::kInvalidArgument);
    return timed.error().message;
  };
  EXPECT_THAT(message(robot({1.0, 1.0}), {0, 0, 1}, 1.0), HasSubstr("3 values"));
  EXPECT_THAT(message(robot({1.0}), {}, 1.0), HasSubstr("0 values"));
  EXPECT_THAT(message(robot({1.0, 1.0}), {0, 0, 1, std::nan("")}, 1.0), HasSubstr("joint_1"));
  EXPECT_THAT(message(robot({1.0, 0.0}), {0, 0, 1, 1}, 1.0), HasSubstr("joint_1"));
  EXPECT_THAT(message(robot({1.0}), {0, 1}, 1.1), HasSubstr("speed fraction"));
  EXPECT_THAT(message(robot({}), {0, 1}, 1.0), HasSubstr("no joints"));
}

}  // namespace
}  // namespace sidestep
