#include "simulated_executor.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <deque>
#include <mutex>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/error.hpp>
#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/core/node.hpp>
#include <sidestep/core/time.hpp>
#include <sidestep/planning/goal_source.hpp>
#include <sidestep/robot/robot_model.hpp>
#include <sidestep/trajectory/robot_motion.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "drift.hpp"
#include "simulated_robot.hpp"

namespace sidestep::simulated {
namespace {

/// Normal noise on joint positions. What is added at a step of the simulation depends on the seed
/// and that step alone, whenever and however often it is asked for.
class MeasurementNoise {
 public:
  MeasurementNoise(double sigma, std::uint64_t seed) : sigma_(sigma), seed_(seed) {}

  [[nodiscard]] Eigen::VectorXd measured(const Eigen::VectorXd& q, std::int64_t step) const;

 private:
  double sigma_;
  std::uint64_t seed_;
};

Eigen::VectorXd MeasurementNoise::measured(const Eigen::VectorXd& q, std::int64_t step) const {
  if (sigma_ == 0.0) return q;
  std::uint64_t state = mix(seed_ ^ mix(static_cast<std::uint64_t>(step)));
  Eigen::VectorXd noisy = q;
  for (double& value : noisy) {  // Box and Muller 1958
    const double radius = std::sqrt(-2.0 * std::log(uniform(state)));
    value += sigma_ * radius * std::cos(2.0 * std::numbers::pi * uniform(state));
  }
  return noisy;
}

/// Goals that come at times fixed beforehand.
class ScheduledGoals {
 public:
  /// Reads the parameter `goals`. Fails with kConfig, at the position, where an entry is no map,
  /// has no time, or one before that of the entry above it.
  [[nodiscard]] static Result<ScheduledGoals> read(const Node& goals);

  /// The last that is due; those before it, due since the last call, have been overtaken.
  [[nodiscard]] std::optional<GoalRequest> next(Stamp now);
  [[nodiscard]] bool is_empty() const noexcept { return waiting_.empty(); }

 private:
  struct Scheduled {
    double at_s = 0.0;
    GoalRequest request;
  };
  std::deque<Scheduled> waiting_;
};

Result<ScheduledGoals> ScheduledGoals::read(const Node& goals) {
  ScheduledGoals read;
  if (goals.is_null()) return read;
  if (!goals.is_list()) {
    return tl::make_unexpected(goals.error("expected a list of goals, found " + goals.kind(),
                                           "e.g. [{at_s: 2.0, goal: {joints: {odom_x: 1.0}}}]"));
  }
  for (const Node& entry : goals.items()) {
    const Node* at = entry.find("at_s");
    if (at == nullptr) {
      return tl::make_unexpected(
          entry.error("the goal has no `at_s`", "say when it comes, in seconds of the run"));
    }
    const auto at_s = SIDESTEP_TRY(at->as_double());
    if (!read.waiting_.empty() && at_s < read.waiting_.back().at_s) {
      return tl::make_unexpected(at->error("the goal comes before the one above it"));
    }
    Scheduled goal{at_s, {std::to_string(read.waiting_.size() + 1), {}}};
    Node::Map wish;
    for (const Node::Entry& part : entry.entries()) {
      if (part.key != "at_s") wish.push_back(part);
    }
    if (!wish.empty()) goal.request.wish = Node(std::move(wish), entry.mark());
    read.waiting_.push_back(std::move(goal));
  }
  return read;
}

std::optional<GoalRequest> ScheduledGoals::next(Stamp now) {
  std::optional<GoalRequest> newest;
  while (!waiting_.empty() && waiting_.front().at_s <= now.seconds()) {
    newest = std::move(waiting_.front().request);
    waiting_.pop_front();
  }
  return newest;
}

/// The configuration that a map of joint names to positions gives, joints left out at 0. Fails with
/// kConfig for an unknown joint, or one outside its limits.
[[nodiscard]] Result<Eigen::VectorXd> read_start(const Node& start, const RobotDescription& robot);

constexpr double kRounding = 1e-9;

Error unknown_joint(const Node& value, const std::string& name, const RobotDescription& robot) {
  std::vector<std::string> names;
  std::string list;
  for (const Joint& joint : robot.joints) {
    names.push_back(joint.name);
    list += (list.empty() ? "" : ", ") + joint.name;
  }
  return value.error("robot '" + robot.name + "' has no joint '" + name + "'",
                     did_you_mean(name, names, "its joints: " + list));
}

Result<Eigen::VectorXd> read_start(const Node& start, const RobotDescription& robot) {
  Eigen::VectorXd q = Eigen::VectorXd::Zero(robot.dof());
  if (!start.is_null() && !start.is_map()) {
    return tl::make_unexpected(
        start.error("'start' must be a map of joint names to positions, found " + start.kind()));
  }
  for (const auto& [name, mark, value] : start.entries()) {
    const auto joint = robot.joint_index(name);
    if (!joint) return tl::make_unexpected(unknown_joint(value, name, robot));
    q[*joint] = SIDESTEP_TRY(value.as_double());
  }
  for (int j = 0; j < robot.dof(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    if (q[j] >= joint.lower - kRounding && q[j] <= joint.upper + kRounding) continue;
    const Node* given = start.find(joint.name);
    return tl::make_unexpected((given != nullptr ? *given : start)
                                   .error("joint '" + joint.name + "' cannot start at " +
                                              std::to_string(q[j]) + ", outside its limits " +
                                              std::to_string(joint.lower) + " to " +
                                              std::to_string(joint.upper),
                                          given != nullptr ? "" : "give it a place in 'start'"));
  }
  return q;
}

std::string number(double value) { return format("%g", value); }

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

/// The head's two joints, at rest as the robot's profile has it; nothing where it has none.
std::optional<SimulatedRobot> simulated_head(const std::shared_ptr<const RobotModel>& robot,
                                             const Options& options, Stamp at) {
  const auto head = Head::create(robot);
  if (!head) return {};
  RobotDescription joints;
  joints.joints = {head->description().pan.joint, head->description().tilt.joint};
  return SimulatedRobot(motion_limits(joints, {1.0, 1.0, options.assumed_ramp_s}), options.lag_s,
                        Eigen::Vector2d(head->rest().pan_rad, head->rest().tilt_rad), at);
}

class SimulatedExecutor final : public Executor,
                                public TrueRobot,
                                public GoalSource,
                                public HeadTurner {
 public:
  SimulatedExecutor(const Options& options, const HostContext& context, Eigen::VectorXd start,
                    ScheduledGoals goals, Drift drift)
      : robot_model_(context.robot),
        clock_(context.clock),
        motion_(context.motion ? context.motion : std::make_shared<RobotMotion>()),
        delay_ns_(Stamp::from_seconds(options.delay_s).ns),
        start_tolerance_(options.start_tolerance),
        velocity_tolerance_(options.velocity_tolerance),
        steps_per_record_(std::max<std::int64_t>(1, std::llround(1e3 / options.measured_rate_hz))),
        noise_(options.position_noise, context.seed),
        goals_(std::move(goals)),
        drift_(std::move(drift)),
        robot_(motion_limits(robot_model_->description(), {1.0, 1.0, options.assumed_ramp_s}),
               options.lag_s, std::move(start), clock_.now()),
        head_fails_at_s_(options.head_fails_at_s),
        head_(simulated_head(robot_model_, options, clock_.now())) {
    motion_->record_truth(robot_.state(), robot_.time());
    record();
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

  Result<void> turn_head(const HeadAngles& to) override {
    const std::lock_guard lock(mutex_);
    if (!head_) return refuse("robot '" + robot_model_->description().name + "' has no head");
    const Stamp from = later(bring_forward());
    if (head_fails_at_s_ && from.seconds() >= *head_fails_at_s_) {
      head_->brake(from);
      return {};
    }
    const std::array angles{to.pan_rad, to.tilt_rad};
    head_->follow(std::make_shared<const Trajectory>(resting(angles, 1.0)), from, from);
    return {};
  }

  RobotState true_state(Stamp stamp) override {
    const std::lock_guard lock(mutex_);
    bring_forward();
    if (stamp >= robot_.time()) return drift_.truth(robot_.state());
    if (auto state = motion_->truth(stamp)) return *state;
    return drift_.truth(robot_.state());  // longer ago than anything is kept
  }

  std::optional<GoalRequest> next_goal() override { return goals_.next(clock_.now()); }
  void report(const GoalReport&) override {}  // nobody asked
  bool is_open() const override { return !goals_.is_empty(); }

 private:
  [[nodiscard]] Stamp later(Stamp stamp) const noexcept { return {stamp.ns + delay_ns_}; }

  Stamp bring_forward() {
    const Stamp now = clock_.now();
    while (robot_.time().ns + SimulatedRobot::kStep_ns <= now.ns) {
      const Eigen::VectorXd before = robot_.state().q;
      robot_.step();
      drift_.step(before, robot_.state().q);
      if (head_) head_->step();
      motion_->record_truth(drift_.truth(robot_.state()), robot_.time());
      if (robot_.steps() % steps_per_record_ == 0) record();
    }
    return now;
  }

  void record() {
    if (head_) {  // first: whoever knows the robot's state at a time knows its head, too
      const Eigen::VectorXd& q = head_->state().q;
      motion_->record_head({q[0], q[1]}, robot_.time());
    }
    motion_->record(measured(), robot_.time());
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
  Drift drift_;
  std::mutex mutex_;
  SimulatedRobot robot_;
  std::optional<double> head_fails_at_s_;
  std::optional<SimulatedRobot> head_;  ///< Nothing where the robot has none.
};

}  // namespace

Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                  const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot to move", "executor simulated");
  }
  auto start = SIDESTEP_TRY(read_start(options.start, context.robot->description()));
  auto goals = SIDESTEP_TRY(ScheduledGoals::read(options.goals));
  auto drift = SIDESTEP_TRY(
      Drift::create(options.drift_share, options.drift_rad_per_m, *context.robot, context.seed));
  return std::unique_ptr<Executor>(std::make_unique<SimulatedExecutor>(
      options, context, std::move(start), std::move(goals), std::move(drift)));
}

}  // namespace sidestep::simulated
