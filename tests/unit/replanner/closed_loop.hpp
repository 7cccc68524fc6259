#pragma once

#include <algorithm>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/planning/executor.hpp>
#include <sidestep/runtime/loop_policies.hpp>
#include <sidestep/runtime/replanner.hpp>

#include "support/ball_robot.hpp"

namespace sidestep::testing_support {

struct Ball {
  Eigen::Vector3d centre_m;
  double radius_m;

  [[nodiscard]] double distance_m(const Eigen::Vector3d& p) const {
    return (p - centre_m).norm() - radius_m;
  }
};
using Balls = std::vector<Ball>;

inline double distance_m(const Balls& balls, const Eigen::Vector3d& p) {
  double least = std::numeric_limits<double>::infinity();
  for (const Ball& ball : balls) least = std::min(least, ball.distance_m(p));
  return least;
}

/// The exact distance to balls; without a sign 0 within them.
class BallField final : public DistanceField {
 public:
  BallField(Balls balls, Stamp stamp, bool is_signed = true)
      : DistanceField({.grid = {Eigen::Vector3d(-10, -10, -10), 0.1, {200, 200, 200}},
                       .is_signed = is_signed,
                       .max_distance_m = 5.0,
                       .lipschitz = 1.0,
                       .stamp = stamp}),
        balls_(std::move(balls)) {}

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override {
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      distances_m[i] = 5.0;
      Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
      for (const Ball& ball : balls_) {
        if (ball.distance_m(points_m[i]) >= distances_m[i]) continue;
        distances_m[i] = ball.distance_m(points_m[i]);
        gradient = (points_m[i] - ball.centre_m).normalized();
      }
      if (!info().is_signed) distances_m[i] = std::max(0.0, distances_m[i]);
      if (!gradients.empty()) gradients[i] = gradient;
      if (!statuses.empty()) statuses[i] = FieldStatus::kKnown;
    }
  }

 private:
  Balls balls_;
};

/// Tracks perfectly; what it does wrong is switched on by the test.
class FakeExecutor final : public Executor {
 public:
  FakeExecutor(Eigen::VectorXd q, MotionLimits limits)
      : limits_(std::move(limits)), trajectory_(make_trajectory(static_cast<int>(q.size()), 1, 0)) {
    std::copy(q.begin(), q.end(), trajectory_.q(0).begin());
  }

  [[nodiscard]] Result<Measured> current() override {
    if (is_throwing) throw std::runtime_error("the cable is loose");
    if (is_silent) return fail(ErrorCode::kIo, "no message from the robot");
    Measured measured{state(), now};
    measured.state.q += offset;
    if (distort) distort(measured);
    return measured;
  }
  [[nodiscard]] Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    ++follows;
    if (refusals > 0) {
      --refusals;
      return fail(ErrorCode::kUnsupported, "the brakes are on");
    }
    trajectory_ = trajectory;
    start_ = start;
    return {};
  }
  /// Evenly in every joint: q(t) = q + v (t - t^2 / (2 T)).
  [[nodiscard]] Result<void> stop() override {
    ++stop_requests;
    if (refuses_to_stop) return fail(ErrorCode::kIo, "no brakes");
    ++stops;
    const RobotState from = state();
    double duration_s = 1e-3;
    for (std::size_t j = 0; j < limits_.acceleration.size(); ++j) {
      const double speed = std::abs(from.qdot[static_cast<Eigen::Index>(j)]);
      duration_s = std::max(duration_s, speed / limits_.acceleration[j]);
    }
    trajectory_ = make_trajectory(static_cast<int>(from.q.size()), 2, duration_s);
    for (std::size_t j = 0; j < limits_.acceleration.size(); ++j) {
      const auto at = static_cast<Eigen::Index>(j);
      trajectory_.q(0)[j] = from.q[at];
      trajectory_.qdot(0)[j] = from.qdot[at];
      trajectory_.q(1)[j] = from.q[at] + 0.5 * duration_s * from.qdot[at];
    }
    start_ = now;
    return {};
  }
  [[nodiscard]] RobotState state() const {
    RobotState at{Eigen::VectorXd(trajectory_.dof), Eigen::VectorXd(trajectory_.dof)};
    const auto dof = static_cast<std::size_t>(trajectory_.dof);
    const double time_s = now.seconds() - start_.seconds();
    trajectory_.sample(time_s, std::span(at.q.data(), dof), std::span(at.qdot.data(), dof));
    return at;
  }

  Stamp now;
  bool is_throwing = false;
  bool is_silent = false;
  bool refuses_to_stop = false;
  int refusals = 0;
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  std::function<void(Measured&)> distort;  ///< What is measured.
  int stop_requests = 0;
  int stops = 0;
  int follows = 0;

 private:
  MotionLimits limits_;
  Trajectory trajectory_;
  Stamp start_;
};

/// Goes straight, or else through a point beside the ball that is in the way, on the side it likes.
class DetourPlanner final : public Optimiser {
 public:
  explicit DetourPlanner(const Balls& mapped) : mapped_(mapped) {}

  [[nodiscard]] Result<Solution> solve(const Problem& problem, const Trajectory& initial,
                                       const Deadline& deadline) override {
    ++solves;
    if (misbehave) {
      if (auto answer = misbehave(problem, initial, deadline)) return *std::move(answer);
    }
    const Eigen::Vector3d from = problem.start.q, to = problem.goal.q;
    std::vector<Eigen::Vector3d> points{from};
    const Ball* in_the_way = nullptr;
    for (int i = 0; i <= 100; ++i) {
      const Eigen::Vector3d p = from + 0.01 * i * (to - from);
      for (const Ball& ball : mapped_) {
        if (ball.distance_m(p) < kRoom_m && in_the_way == nullptr) in_the_way = &ball;
      }
    }
    if (in_the_way != nullptr) {
      points.push_back(in_the_way->centre_m +
                       Eigen::Vector3d(0, side * (in_the_way->radius_m + 2 * kRoom_m), 0));
    }
    points.push_back(to);
    Solution solution;
    solution.status = SolveStatus::kConverged;
    solution.trajectory =
        through(points, keeps_velocity ? problem.start.qdot : Eigen::VectorXd::Zero(3));
    solution.cost = 1.0;
    return solution;
  }

  /// From start to goal, whatever is in the way.
  static Solution straight(const Problem& problem) {
    Solution solution;
    solution.status = SolveStatus::kConverged;
    solution.trajectory = through({problem.start.q, problem.goal.q}, problem.start.qdot);
    return solution;
  }

  /// Cubic pieces, at about 0.5 m/s.
  static Trajectory through(const std::vector<Eigen::Vector3d>& points,
                            const Eigen::Vector3d& velocity) {
    Trajectory out = make_trajectory(3, static_cast<int>(points.size()), 1.0);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const int state = static_cast<int>(i);
      Eigen::Vector3d v = Eigen::Vector3d::Zero();
      if (i == 0) v = velocity;
      if (i > 0) {
        out.times_s[i] =
            out.times_s[i - 1] + std::max(0.1, 2.0 * (points[i] - points[i - 1]).norm());
      }
      if (i > 0 && i + 1 < points.size()) v = 0.4 * (points[i + 1] - points[i - 1]).normalized();
      std::copy(points[i].begin(), points[i].end(), out.q(state).begin());
      std::copy(v.begin(), v.end(), out.qdot(state).begin());
    }
    return out;
  }

  static constexpr double kRoom_m = 0.35;
  double side = 1.0;
  bool keeps_velocity = true;
  int solves = 0;
  std::function<std::optional<Result<Solution>>(const Problem&, const Trajectory&, const Deadline&)>
      misbehave;

 private:
  const Balls& mapped_;
};

class QuietLog final : public Log {
 public:
  void write(LogLevel level, std::string_view message) override {
    if (level == LogLevel::kWarning) warnings.emplace_back(message);
  }
  std::vector<std::string> warnings;
};

/// A ball of 0.2 m that goes from the origin to (4, 0, 0), a map thirty times a second, a replanner
/// stepped every 4 ms; the clock stands still during a step.
class ClosedLoop {
 public:
  static constexpr double kRadius_m = 0.2;
  static constexpr double kStep_s = 0.004;
  static constexpr double kAcceleration = 1.0;

  explicit ClosedLoop(ReplannerSettings settings = defaults())
      : robot(std::make_shared<BallRobot>(kRadius_m)),
        limits{{1.0, 1.0, 1.0}, {kAcceleration, kAcceleration, kAcceleration}, {"x", "y", "z"}},
        executor(Eigen::Vector3d::Zero(), limits),
        planner(mapped),
        settings_(std::move(settings)) {
    pose = [this](std::shared_ptr<const DistanceField> field, const RobotState& start,
                  const RobotState& to) {
      Problem problem;
      problem.robot = robot;
      problem.field = std::move(field);
      problem.space = {Space::kFree, Space::kFree};
      problem.start = start;
      problem.goal = to;
      problem.support_states = 21;
      problem.dt_s = 0.4;
      problem.qc = Eigen::Vector3d::Ones();
      return problem;
    };
  }

  ~ClosedLoop() {
    if (!judged) return;
    for (const PolicyBreach& breach : judged->breaches()) {
      ADD_FAILURE() << "policy " << breach.policy << " is broken at " << breach.stamp.seconds()
                    << " s: " << breach.what << "\n"
                    << story();
    }
  }

  static ReplannerSettings defaults() {
    ReplannerSettings settings;
    settings.limit_wall_time = false;
    // Of the planner of these tests, not of a search that needs none.
    std::erase(settings.escalation, "base_path");
    return settings;
  }

  static RobotState goal() { return {Eigen::Vector3d(4, 0, 0), Eigen::Vector3d::Zero()}; }

  void make() {
    judged.emplace(LoopPolicies(robot, limits, {Space::kFree, Space::kFree}, settings_), executor,
                   slot);
    replanner.emplace(Replanner::Parts{.robot = robot,
                                       .executor = judged->executor(),
                                       .optimiser = planner,
                                       .sampler = sampler,
                                       .slot = slot,
                                       .pose_problem = pose,
                                       .goal = goal(),
                                       .space = {Space::kFree, Space::kFree},
                                       .limits = limits,
                                       .log = log,
                                       .executor_name = "executor fake",
                                       .optimiser_name = "optimiser detour",
                                       .sampler_name = "sampler",
                                       .map_trouble = map_trouble,
                                       .predictor = predictor,
                                       .predictor_name = "predictor goes_on",
                                       .other_goal = other_goal,
                                       .moving_costs = moving_costs,
                                       .objection = objection},
                      settings_);
  }

  /// Steps until a time, or until the goal is reached; `before` is told the time of each step.
  void run(double until_s, const std::function<void(double)>& before = {}) {
    if (!replanner) make();
    for (; ticks * kStep_s < until_s; ++ticks) {
      const double t = ticks * kStep_s;
      if (before) before(t);
      executor.now = Stamp::from_seconds(t + clock_offset_s);
      if (maps && ticks % 8 == 0) {
        mapped = obstacles;
        publish(Stamp::from_seconds(executor.now.seconds() - map_age_s));
      }
      status = judged->step(*replanner, executor.now, events);
      if (note_step) note_step(judged->last());
      note_motion();
      if (status == Replanner::Status::kReached) break;
    }
  }

  [[nodiscard]] const ReplannerEvent* first(ReplannerEvent::Kind kind) const {
    const auto found = std::ranges::find(events, kind, &ReplannerEvent::kind);
    return found == events.end() ? nullptr : &*found;
  }
  [[nodiscard]] int count(ReplannerEvent::Kind kind) const {
    return static_cast<int>(std::ranges::count(events, kind, &ReplannerEvent::kind));
  }
  [[nodiscard]] std::string story() const {
    std::string text;
    for (const ReplannerEvent& event : events) {
      text += std::to_string(event.stamp.seconds()) + " " + std::string(to_string(event.kind)) +
              " (" + std::string(to_string(event.reason)) + ", " + event.guess +
              "): " + event.cause + "\n";
    }
    return text;
  }

  std::shared_ptr<BallRobot> robot;
  MotionLimits limits;
  FakeExecutor executor;
  Balls obstacles;  ///< The truth.
  Balls mapped;     ///< As of the last map.
  DetourPlanner planner;
  Optimiser* sampler = nullptr;
  Predictor* predictor = nullptr;
  std::optional<CostSettings> moving_costs;
  std::function<std::shared_ptr<const Tracks>(Stamp)> tracks;  ///< Of a map; none where empty.
  std::function<std::string()> map_trouble;
  Replanner::PoseProblem pose;
  std::function<std::optional<Eigen::VectorXd>(std::shared_ptr<const DistanceField>)> other_goal;
  std::function<std::string(const Trajectory&)> objection;
  SnapshotSlot slot;
  std::function<void(const LoopStep&)> note_step;
  QuietLog log;
  std::optional<JudgedLoop> judged;  ///< Every step is.
  std::optional<Replanner> replanner;
  Replanner::Status status = Replanner::Status::kWaiting;
  std::vector<ReplannerEvent> events;
  bool maps = true;
  bool fields_are_signed = true;
  bool tells_what_moves = false;  ///< All of the obstacles do, then.
  double map_age_s = 0.0;
  double clock_offset_s = 0.0;
  int ticks = 0;

  // Of the motion really executed.
  std::vector<Eigen::Vector3d> path;
  double least_clearance_m = std::numeric_limits<double>::infinity();
  double largest_velocity_step = 0.0;

 private:
  void publish(Stamp stamp) {
    MapSnapshot snapshot{std::make_shared<BallField>(mapped, stamp, fields_are_signed), nullptr};
    if (tells_what_moves) {
      auto moving = std::make_shared<MovingObstacles>();
      for (const Ball& ball : mapped) moving->balls.push_back({ball.centre_m, ball.radius_m});
      moving->stamp = stamp;
      snapshot.moving = std::move(moving);
    }
    if (tracks) snapshot.tracks = tracks(stamp);
    slot.publish(std::move(snapshot));
  }

  void note_motion() {
    const RobotState at = executor.state();
    least_clearance_m = std::min(least_clearance_m, distance_m(obstacles, at.q) - kRadius_m);
    if (!path.empty()) {
      largest_velocity_step =
          std::max(largest_velocity_step, (at.qdot - last_velocity_).cwiseAbs().maxCoeff());
    }
    last_velocity_ = at.qdot;
    path.push_back(at.q);
  }

  ReplannerSettings settings_;
  Eigen::Vector3d last_velocity_ = Eigen::Vector3d::Zero();
};

inline void expect_goal(const ClosedLoop& loop) {
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_LE((loop.path.back() - loop.goal().q).cwiseAbs().maxCoeff(), 0.02);
}

}  // namespace sidestep::testing_support
