#include "simulated_executor.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <sstream>
#include <string>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "measurement_noise.hpp"
#include "scheduled_goals.hpp"
#include "simulated_robot.hpp"
#include "start_state.hpp"

namespace sidestep::simulated {
namespace {

std::string number(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

tl::unexpected<Error> refuse(std::string why) {
  return fail(ErrorCode::kInvalidArgument, std::move(why), "executor simulated");
}

/// The largest absolute velocity of a joint from one support state to the next: the derivative of
/// a cubic is a parabola, so it is at an end or at the vertex.
double peak_velocity(const Trajectory& trajectory, int state, int joint) {
  const auto j = static_cast<std::size_t>(joint);
  const double from = trajectory.qdot(state)[j];
  if (state + 1 == trajectory.size()) return std::abs(from);
  const auto i = static_cast<std::size_t>(state);
  const double dt_s = trajectory.times_s[i + 1] - trajectory.times_s[i];
  const double to = trajectory.qdot(state + 1)[j];
  const double mean = (trajectory.q(state + 1)[j] - trajectory.q(state)[j]) / dt_s;
  double peak = std::max(std::abs(from), std::abs(to));
  // v(f) = from + b f + c f^2 with v(1) = to and the mean over [0, 1].
  const double c = 3.0 * (from + to - 2.0 * mean);
  const double b = to - from - c;
  const double vertex = -0.5 * b / c;
  if (vertex > 0.0 && vertex < 1.0) peak = std::max(peak, std::abs(from + 0.5 * b * vertex));
  return peak;
}

class SimulatedExecutor final : public Executor, public TrueRobot, public GoalSource {
 public:
  SimulatedExecutor(const Options& options, const HostContext& context, Eigen::VectorXd start,
                    ScheduledGoals goals)
      : robot_model_(context.robot),
        clock_(context.clock),
        motion_(context.motion ? context.motion : std::make_shared<RobotMotion>()),
        delay_ns_(Stamp::from_seconds(options.delay_s).ns),
        start_tolerance_(options.start_tolerance),
        velocity_tolerance_(options.velocity_tolerance),
        steps_per_record_(std::max<std::int64_t>(1, std::llround(1e3 / options.measured_rate_hz))),
        noise_(options.position_noise, context.seed),
        goals_(std::move(goals)),
        robot_(motion_limits(robot_model_->description(), {1.0, 1.0, options.assumed_ramp_s}),
               options.lag_s, std::move(start), clock_.now()) {
    motion_->record_truth(robot_.state(), robot_.time());
    motion_->record(measured(), robot_.time());
  }

  Result<Measured> current() override {
    const std::lock_guard lock(mutex_);
    bring_forward();
    return Measured{measured(), robot_.time()};
  }

  Result<void> follow(const Trajectory& trajectory, Stamp start) override {
    SIDESTEP_TRY(check(trajectory));
    const std::lock_guard lock(mutex_);
    const Stamp now = bring_forward();
    const Stamp felt_start = later(start);
    const Stamp from = std::max(felt_start, later(now));
    SIDESTEP_TRY(check_start(trajectory, felt_start, from));
    robot_.follow(std::make_shared<const Trajectory>(trajectory), felt_start, from);
    motion_->follow(trajectory, start);
    return {};
  }

  Result<void> stop() override {
    const std::lock_guard lock(mutex_);
    const Stamp now = bring_forward();
    robot_.brake(later(now));
    motion_->follow({}, now);
    return {};
  }

  RobotState true_state(Stamp stamp) override {
    const std::lock_guard lock(mutex_);
    bring_forward();
    if (stamp >= robot_.time()) return robot_.state();
    if (auto state = motion_->truth(stamp)) return *state;
    return robot_.state();  // longer ago than anything is kept
  }

  std::optional<GoalRequest> next_goal() override { return goals_.next(clock_.now()); }
  void report(const GoalReport&) override {}  // nobody asked
  bool is_open() const override { return !goals_.is_empty(); }

 private:
  [[nodiscard]] Stamp later(Stamp stamp) const noexcept { return {stamp.ns + delay_ns_}; }

  Stamp bring_forward() {
    const Stamp now = clock_.now();
    while (robot_.time().ns + SimulatedRobot::kStep_ns <= now.ns) {
      robot_.step();
      motion_->record_truth(robot_.state(), robot_.time());
      if (robot_.steps() % steps_per_record_ == 0) motion_->record(measured(), robot_.time());
    }
    return now;
  }

  [[nodiscard]] RobotState measured() const {
    return {noise_.measured(robot_.state().q, robot_.steps()), robot_.state().qdot};
  }

  [[nodiscard]] Result<void> check(const Trajectory& trajectory) const {
    const RobotDescription& robot = robot_model_->description();
    if (auto valid = trajectory.validate(); !valid) return refuse(valid.error().message);
    if (trajectory.dof != robot.dof()) {
      return refuse("the trajectory has " + std::to_string(trajectory.dof) + " joints, robot '" +
                    robot.name + "' has " + std::to_string(robot.dof()));
    }
    for (int i = 0; i < trajectory.size(); ++i) {
      for (int j = 0; j < robot.dof(); ++j) {
        const Joint& joint = robot.joints[idx(j)];
        const double peak = peak_velocity(trajectory, i, j);
        if (peak <= joint.max_velocity * (1.0 + velocity_tolerance_)) continue;
        return refuse("the trajectory moves joint '" + joint.name + "' at " + number(peak) +
                      " per s after " + number(trajectory.times_s[idx(i)]) + " s, its limit is " +
                      number(joint.max_velocity));
      }
    }
    return {};
  }

  [[nodiscard]] Result<void> check_start(const Trajectory& trajectory, Stamp start,
                                         Stamp from) const {
    const Eigen::VectorXd expected = robot_.told_position(from);
    std::vector<double> begin(static_cast<std::size_t>(trajectory.dof));
    trajectory.sample(static_cast<double>(from.ns - start.ns) * 1e-9, begin, {});
    for (int j = 0; j < trajectory.dof; ++j) {
      const double gap = std::abs(begin[idx(j)] - expected[j]);
      if (gap <= start_tolerance_) continue;
      return refuse("the trajectory begins with joint '" +
                    robot_model_->description().joints[idx(j)].name + "' at " +
                    number(begin[idx(j)]) + ", it will be at " + number(expected[j]) +
                    " then (at " + number(from.seconds()) + " s)");
    }
    return {};
  }

  std::shared_ptr<const RobotModel> robot_model_;
  const Clock& clock_;
  std::shared_ptr<RobotMotion> motion_;
  std::int64_t delay_ns_;
  double start_tolerance_;
  double velocity_tolerance_;
  std::int64_t steps_per_record_;
  MeasurementNoise noise_;
  ScheduledGoals goals_;  ///< [planning] only.
  std::mutex mutex_;
  SimulatedRobot robot_;
};

}  // namespace

Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                  const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot to move", "executor simulated");
  }
  auto start = SIDESTEP_TRY(read_start(options.start, context.robot->description()));
  auto goals = SIDESTEP_TRY(ScheduledGoals::read(options.goals));
  return std::unique_ptr<Executor>(
      std::make_unique<SimulatedExecutor>(options, context, std::move(start), std::move(goals)));
}

}  // namespace sidestep::simulated
