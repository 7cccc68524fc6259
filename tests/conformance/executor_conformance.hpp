#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <ostream>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/executor.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "gaze_conformance.hpp"
#include "manual_clock.hpp"

/// What every Executor must hold whose robot moves by the clock that it is lent. In a test of your
/// own:
///
///     INSTANTIATE_TEST_SUITE_P(mine, ExecutorConformance,
///                              testing::Values(ExecutorCase{"mine", [](auto robot,
///                              const Clock& clock, auto motion) { return
///                              make_mine(robot, clock, motion); }}));
namespace sidestep::conformance {

struct ExecutorCase {
  std::string name;
  /// A new one, whose robot is at rest.
  std::function<std::shared_ptr<Executor>(std::shared_ptr<const RobotModel>, const Clock&,
                                          std::shared_ptr<RobotMotion>)>
      make;
  double tracking_error = 1e-3;  ///< Of a measured position from the commanded one, m or rad.
  double delay_s = 0.0;          ///< After which it acts on what it is told, at the latest.
  double braking_share = 1.0;    ///< Of the limits of braking, that its stops use.
  double truth_error = 1e-3;     ///< Of a true position from the measured one, m or rad.

  friend std::ostream& operator<<(std::ostream& out, const ExecutorCase& c) {
    return out << c.name;
  }
};

/// robot_with_head(), but that its head is fixed, and that x brakes with 2 m/s^2.
[[nodiscard]] inline std::shared_ptr<const KinematicTree> robot_without_head() {
  const auto looker = robot_with_head();
  RobotDescription robot = looker->description();
  robot.head.reset();
  robot.joints[0].max_braking = 2.0;
  auto tree = KinematicTree::create(std::move(robot), looker->tree_joints());
  if (!tree) throw std::runtime_error(tree.error().describe());
  return std::move(*tree);
}

/// A cubic to rest at `q`, and when it starts.
struct Way {
  Way(const RobotState& from, const Eigen::VectorXd& q, double duration_s, Stamp start_at)
      : trajectory(straight_line(from, {q, Eigen::VectorXd::Zero(q.size())}, 2, duration_s)),
        start(start_at) {}

  [[nodiscard]] RobotState at_s(double time_s) const {
    RobotState state{Eigen::VectorXd(trajectory.dof), Eigen::VectorXd(trajectory.dof)};
    trajectory.sample(time_s, as_span(state.q), as_span(state.qdot));
    return state;
  }
  [[nodiscard]] double time_s(Stamp stamp) const {
    return static_cast<double>(stamp.ns - start.ns) * 1e-9;
  }

  Trajectory trajectory;
  Stamp start;
};

/// The robot above; its way is 0.6 m along x and -0.5 m along y in 2 s. Half-way it is fastest,
/// 0.45 and -0.375 m/s.
class ExecutorConformance : public testing::TestWithParam<ExecutorCase> {
 protected:
  using Measured = Executor::Measured;

  void SetUp() override { ASSERT_NE(executor_, nullptr); }

  [[nodiscard]] Stamp in_s(double seconds) const {
    return {clock_.now().ns + Stamp::from_seconds(seconds).ns};
  }
  /// The newest; what holds of every measurement is looked at.
  Measured current() {
    auto measured = executor_->current();
    if (!measured) throw std::runtime_error(measured.error().describe());
    const auto& [state, stamp] = *measured;
    const int dof = robot_->description().dof();
    if (state.q.size() != dof || state.qdot.size() != dof) throw std::runtime_error("joints lack");
    EXPECT_TRUE(state.q.allFinite() && state.qdot.allFinite());
    EXPECT_LE(stamp.ns, clock_.now().ns);
    EXPECT_GE(stamp.ns, last_.ns) << "time goes back";
    last_ = stamp;
    return *measured;
  }
  /// What is measured every 5 ms.
  std::vector<Measured> run_s(double duration_s) {
    constexpr double kStep_s = 0.005;
    std::vector<Measured> all(idx(std::lround(duration_s / kStep_s)));
    for (Measured& measured : all) {
      clock_.advance_s(kStep_s);
      measured = current();
    }
    return all;
  }
  /// On its way from where it stands.
  Way set_out(double start_in_s = 0.0) {
    const RobotState from{current().state.q, Eigen::Vector2d::Zero()};
    Way way(from, from.q + Eigen::Vector2d(0.6, -0.5), 2.0, in_s(start_in_s));
    follow(way);
    return way;
  }
  void follow(const Way& way) {
    const auto done = executor_->follow(way.trajectory, way.start);
    ASSERT_TRUE(done) << done.error().describe();
  }

  /// Each is where it was to be, then or a little before, by the delay.
  static void expect_on(const Way& way, const std::vector<Measured>& measured) {
    const double error = GetParam().tracking_error;
    for (const auto& [state, stamp] : measured) {
      const double time_s = way.time_s(stamp);
      const Eigen::ArrayXd now = way.at_s(time_s).q, then = way.at_s(time_s - GetParam().delay_s).q;
      const Eigen::ArrayXd q = state.q;
      ASSERT_TRUE((q <= now.max(then) + error).all() && (q >= now.min(then) - error).all())
          << q.transpose() << ", told " << now.transpose() << " at " << time_s << " s";
    }
  }
  static void expect_near(const Eigen::VectorXd& q, const Eigen::VectorXd& expected, double error) {
    ASSERT_EQ(q.size(), expected.size());
    ASSERT_LE((q - expected).cwiseAbs().maxCoeff(), error)
        << q.transpose() << ", expected " << expected.transpose();
  }
  void expect_rest() {
    const Eigen::VectorXd q = current().state.q;
    for (const Measured& later : run_s(1.0)) expect_near(later.state.q, q, 2.0 * error_);
  }

  const double error_ = GetParam().tracking_error;
  std::shared_ptr<const RobotModel> robot_ = robot_without_head();
  ManualClock clock_{Stamp::from_seconds(100.0)};
  std::shared_ptr<RobotMotion> motion_ = std::make_shared<RobotMotion>(60.0);
  std::shared_ptr<Executor> executor_ = GetParam().make(robot_, clock_, motion_);
  Stamp last_;
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(ExecutorConformance);

TEST_P(ExecutorConformance, StandsUntilItIsToldToMove) { expect_rest(); }

TEST_P(ExecutorConformance, FollowsATrajectoryToItsEnd) {
  const Way way = set_out();
  const auto measured = run_s(2.0);
  expect_on(way, measured);
  Eigen::VectorXd by_velocity = way.at_s(0.0).q;
  for (std::size_t i = 1; i < measured.size(); ++i) {
    const double step_s = measured[i].stamp.seconds() - measured[i - 1].stamp.seconds();
    by_velocity += step_s * measured[i].state.qdot;
  }
  expect_near(by_velocity, measured.back().state.q, 0.05 + 2.0 * error_);
  run_s(GetParam().delay_s);
  expect_near(current().state.q, way.at_s(2.0).q, error_);
  expect_rest();
}

TEST_P(ExecutorConformance, ReportsWhatItMeasuresAndWhatItFollows) {
  EXPECT_FALSE(motion_->planned(clock_.now()));
  const Way way = set_out();
  const auto measured = run_s(2.0);
  const auto newest = motion_->newest();
  ASSERT_TRUE(newest);
  EXPECT_GE(newest->ns, in_s(-0.1).ns);
  EXPECT_LE(newest->ns, clock_.now().ns);
  for (const auto& [state, stamp] : measured) {
    const auto planned = motion_->planned(stamp);
    ASSERT_TRUE(planned);
    expect_near(planned->q, way.at_s(way.time_s(stamp)).q, error_);
    if (stamp > *newest) continue;
    const auto reported = motion_->measured(stamp);
    ASSERT_TRUE(reported);
    expect_near(reported->q, state.q, 2.0 * error_);
  }
  ASSERT_TRUE(executor_->stop());
  EXPECT_FALSE(motion_->planned(clock_.now())) << "it follows nothing any more";
}

TEST_P(ExecutorConformance, BeginsAnotherTrajectoryWhenThatIsToStart) {
  const Way way = set_out();
  run_s(0.5);
  const Way back(way.at_s(1.0), way.at_s(0.0).q, 4.0, in_s(0.5));
  follow(back);
  expect_on(way, run_s(0.495));
  run_s(0.01 + GetParam().delay_s);
  expect_on(back, run_s(4.0));
  expect_near(current().state.q, back.at_s(4.0).q, error_);
}

TEST_P(ExecutorConformance, JoinsATrajectoryThatHasBegun) {
  run_s(0.5);
  const Way way = set_out(-0.1);
  run_s(0.7 + GetParam().delay_s);
  expect_on(way, run_s(1.4));
}

TEST_P(ExecutorConformance, RefusesWhatItCannotFollowAndGoesOn) {
  const Way way = set_out();
  auto measured = run_s(0.5);
  const RobotState there = way.at_s(1.0);
  const auto refuses = [&](const Trajectory& trajectory) {
    return !executor_->follow(trajectory, in_s(0.5));
  };
  EXPECT_TRUE(refuses({}));
  EXPECT_TRUE(refuses(make_trajectory(3, 3, 0.5))) << "of another number of joints";
  const RobotState elsewhere{there.q + Eigen::Vector2d(0.5, 0.0), there.qdot};
  EXPECT_TRUE(refuses(Way(elsewhere, elsewhere.q, 2.0, {}).trajectory)) << "0.5 m away";
  const Eigen::Vector2d far = there.q + Eigen::Vector2d(0.0, 2.0);
  EXPECT_TRUE(refuses(Way(there, far, 0.5, {}).trajectory)) << "6 m/s, where 0.5 are the limit";
  Trajectory broken = Way(there, there.q, 2.0, {}).trajectory;
  broken.positions.back() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refuses(broken));
  const auto later = run_s(2.0);
  measured.insert(measured.end(), later.begin(), later.end());
  expect_on(way, measured);
  const auto planned = motion_->planned(way.start);
  ASSERT_TRUE(planned);
  expect_near(planned->q, way.at_s(0.0).q, error_);
}

/// Told by another thread, as by a button.
TEST_P(ExecutorConformance, StopsByItsBrakesAndGoesOnAfterwards) {
  const Way way = set_out();
  run_s(1.0);
  const Eigen::VectorXd begin = current().state.q;
  {
    const std::jthread other([&] { EXPECT_TRUE(executor_->stop()); });
    for (int i = 0; i < 100; ++i) current();
  }
  const auto& joints = robot_->description().joints;
  const Eigen::Array2d braking(joints[0].braking(), joints[1].braking());
  const Eigen::Array2d speed = way.at_s(1.0).qdot.cwiseAbs();
  const double duration_s = (speed / braking).maxCoeff() / GetParam().braking_share;
  run_s(GetParam().delay_s + duration_s + 0.02);
  expect_rest();
  const Eigen::Array2d gone = (current().state.q - begin).cwiseAbs();
  EXPECT_TRUE((gone >= speed.square() / (2.0 * braking) - 2.0 * error_).all())
      << gone.transpose() << ": it brakes harder than it may";
  EXPECT_TRUE((gone <= speed * (GetParam().delay_s + 0.5 * duration_s) + 2.0 * error_).all())
      << gone.transpose() << ": it goes on for longer than it need";
  const Way on = set_out();
  expect_on(on, run_s(2.0));
}

TEST_P(ExecutorConformance, ForgetsAtAStopWhatWasToBegin) {
  const Way way = set_out(0.3);
  run_s(0.1);
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(executor_->stop());
    expect_rest();
  }
  expect_near(current().state.q, way.at_s(0.0).q, error_);
}

TEST_P(ExecutorConformance, KnowsWhereItTrulyIsAndWas) {
  auto* const truth = dynamic_cast<TrueRobot*>(executor_.get());
  if (truth == nullptr) GTEST_SKIP() << "offers no TrueRobot";
  const auto look = [&](const Measured& measured) {
    expect_near(truth->true_state(measured.stamp).q, measured.state.q, GetParam().truth_error);
  };
  set_out();
  std::vector<Measured> past;
  while (past.size() < 400) look(past.emplace_back(run_s(0.005).back()));
  for (const Measured& measured : past) look(measured);
}

TEST_P(ExecutorConformance, TurnsNoHeadWhereThereIsNone) {
  auto* const turner = dynamic_cast<HeadTurner*>(executor_.get());
  if (turner == nullptr) GTEST_SKIP() << "offers no HeadTurner";
  EXPECT_FALSE(turner->turn_head({0.5, -0.3}));
  expect_rest();
  EXPECT_FALSE(motion_->head(clock_.now()));
}

TEST_P(ExecutorConformance, TurnsTheHeadAsFastAsItMayAndHoldsIt) {
  robot_ = robot_with_head();
  motion_ = std::make_shared<RobotMotion>(60.0);
  executor_ = GetParam().make(robot_, clock_, motion_);
  auto* const turner = dynamic_cast<HeadTurner*>(executor_.get());
  if (turner == nullptr) GTEST_SKIP() << "offers no HeadTurner";
  ASSERT_TRUE(turner->turn_head({1.0, -0.4}));
  double before_rad = 0.0;
  for (int i = 0; i < 40; ++i) {
    run_s(0.1);
    const auto head = motion_->head(clock_.now());
    ASSERT_TRUE(head);
    EXPECT_LE(std::abs(head->pan_rad - before_rad), 0.1 + 2.0 * error_) << "1 rad/s is the limit";
    before_rad = head->pan_rad;
    if (i < 20) continue;
    EXPECT_NEAR(head->pan_rad, 1.0, error_);
    EXPECT_NEAR(head->tilt_rad, -0.4, error_);
  }
}

}  // namespace sidestep::conformance
