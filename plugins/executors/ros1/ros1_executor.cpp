#include "ros1_executor.hpp"

#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include <ros/init.h>

#include <sidestep/planning/goal_source.hpp>
#include <sidestep/planning/map_display.hpp>
#include <sidestep/trajectory/braking.hpp>
#include <sidestep/trajectory/robot_motion.hpp>
#include <sidestep/trajectory/splice.hpp>

#include "commands.hpp"
#include "conversions.hpp"
#include "figures.hpp"
#include "gaze.hpp"
#include "goal_topics.hpp"
#include "joint_extent.hpp"
#include "map_view.hpp"
#include "markers.hpp"
#include "node.hpp"
#include "robot_link.hpp"
#include "run_time.hpp"

namespace sidestep::ros1_executor {
namespace {

constexpr const char* kWhere = "executor ros1";
/// Within which a robot that is not told to move counts as standing, m/s or rad/s.
constexpr double kRest = 0.01;
constexpr double kMasterPeriod_s = 0.5;

tl::unexpected<Error> refuse(std::string why, std::string hint = {}) {
  return fail(ErrorCode::kInvalidArgument, std::move(why), kWhere, std::move(hint));
}

/// What an executor consists of, made before it.
struct Parts {
  ros1_node::MasterProbe master;
  JointFeed feed;
  CommandWriter writer;
  MarkerPainter painter;
  std::optional<Gaze> gaze;
};

class Ros1Executor : public Executor, public MapDisplay {
 public:
  Ros1Executor(const Options& options, const HostContext& context, Parts parts)
      : options_(options),
        robot_(context.robot),
        clock_(context.clock),
        log_(context.log),
        motion_(context.motion ? context.motion : std::make_shared<RobotMotion>()),
        limits_(motion_limits(robot_->description(),
                              {1.0, options.acceleration_fraction, options.assumed_ramp_s})),
        time_(options.watch.clock_tolerance_s),
        writer_(std::move(parts.writer)),
        painter_(std::move(parts.painter)),
        gaze_(std::move(parts.gaze)),
        link_(options, std::move(parts.feed), std::move(parts.master)),
        map_view_(options.markers.map, options.world_frame) {}

  /// A robot is not left moving.
  ~Ros1Executor() override {
    if (!is_following(clock_.now())) return;
    (void)stop();
    std::this_thread::sleep_for(kFlush);
  }

  Result<void> connect();
  Result<Measured> current() override;
  Result<void> follow(const Trajectory& trajectory, Stamp start) override;
  Result<void> stop() override;
  bool wants_map() override { return map_view_.is_wanted(); }
  void show_map(std::shared_ptr<const DistanceField> field) override {
    map_view_.show(std::move(field));
  }

 protected:
  /// roscpp writes messages from a thread of its own, and not once the program has ended.
  static constexpr auto kFlush = std::chrono::milliseconds(50);
  /// Takes messages in, as current() does, also while the robot has nothing to do. Where it is, or
  /// why that is not known.
  Result<Eigen::VectorXd> attend();

 private:
  [[nodiscard]] bool is_shadow() const { return options_.mode == "shadow"; }
  [[nodiscard]] double since_start_s(Stamp now) const {
    return 1e-9 * static_cast<double>(now.ns - start_.ns);
  }
  [[nodiscard]] bool is_following(Stamp now) const {
    return followed_.size() > 0 && since_start_s(now) < followed_.duration_s();
  }
  [[nodiscard]] std::optional<RobotState> told(Stamp now) const;
  [[nodiscard]] std::optional<Measured> measured() const;
  /// Measured, or in shadow what it would be.
  [[nodiscard]] std::optional<Measured> state_at(Stamp now) const;
  [[nodiscard]] Result<void> check_start(const Trajectory& trajectory, Stamp start,
                                         Stamp now) const;
  [[nodiscard]] Result<void> check_box(const Trajectory& trajectory) const;
  [[nodiscard]] Result<void> check_confirmed(const Trajectory& trajectory, Stamp now);
  /// Nothing was commanded yet, and nothing moves.
  [[nodiscard]] bool stands_by_itself() const {
    const auto state = measured();
    return followed_.size() == 0 && state && state->state.qdot.cwiseAbs().maxCoeff() <= kRest;
  }
  [[nodiscard]] Trajectory stopping(Stamp now) const;
  void adopt(Trajectory trajectory, Stamp start);
  void send(Stamp now);
  void command(const Trajectory& window, const Trajectory& plan, double from_s, Stamp ros_stamp);
  void compare_held() const;
  void show(Stamp now, const Eigen::VectorXd& q);

  Options options_;
  std::shared_ptr<const RobotModel> robot_;
  const Clock& clock_;
  Log& log_;
  std::shared_ptr<RobotMotion> motion_;
  MotionLimits limits_;
  std::mutex mutex_;
  ros1_node::RunTime time_;
  CommandWriter writer_;
  MarkerPainter painter_;
  std::optional<Gaze> gaze_;
  RobotLink link_;
  MapView map_view_;
  Trajectory followed_;  ///< Kept once it has ended, for it is still held there.
  Stamp start_;
  Stamp sent_;
  bool sent_whole_ = false;
  Trajectory proposed_;  ///< That waits for a confirmation.
  std::optional<Stamp> shown_;
};

Result<void> Ros1Executor::connect() {
  const Deadline deadline = Deadline::after_s(options_.connect_wait_s);
  constexpr auto kPoll = std::chrono::milliseconds(2);
  std::optional<std::string> trouble;
  do {
    link_.serve();
    if (auto updated = ros1_node::update(time_, clock_); !updated) return updated;
    trouble = link_.trouble(ros_messages::to_stamp(::ros::Time::now()));
    const auto deaf = link_.deaf_controllers();
    if (!trouble && !deaf.empty()) trouble = "no controller listens on " + deaf.front();
    if (!trouble && measured()) {
      compare_held();
      return {};
    }
    std::this_thread::sleep_for(kPoll);
  } while (!deadline.expired());
  return fail(ErrorCode::kNotFound, trouble.value_or("the robot's state is not known"), kWhere,
              "is the robot up, and are the topics its own? (rostopic hz TOPIC)");
}

/// The robot's model has held joints where they are to be.
void Ros1Executor::compare_held() const {
  for (const HeldJoint& held : options_.hold) {
    const auto position = link_.feed().held_position(held.joint);
    if (position && std::abs(*position - held.position) <= options_.start_tolerance) continue;
    log_.warn("executor ros1: joint '" + held.joint + "' is to be at " + figure(held.position) +
              (position ? ", it is at " + figure(*position) : ", joint states do not tell of it") +
              (is_shadow() ? "" : "; the first command moves it there"));
  }
}

/// What the robot has been told to do at a time; nothing where it was told nothing yet, or its
/// stop.
std::optional<RobotState> Ros1Executor::told(Stamp now) const {
  if (followed_.size() == 0) return {};
  RobotState state{Eigen::VectorXd(followed_.dof), Eigen::VectorXd(followed_.dof)};
  const double at_s = since_start_s(now);
  const auto dof = static_cast<std::size_t>(followed_.dof);
  followed_.sample(at_s, {state.q.data(), dof}, {state.qdot.data(), dof});
  if (at_s < 0.0 || at_s > followed_.duration_s()) state.qdot.setZero();
  return state;
}

std::optional<Executor::Measured> Ros1Executor::measured() const {
  auto newest = link_.feed().newest();
  if (!newest) return {};
  return Measured{std::move(newest->state), time_.to_run(newest->stamp)};
}

std::optional<Executor::Measured> Ros1Executor::state_at(Stamp now) const {
  auto state = measured();
  auto pretended = state && is_shadow() ? told(now) : std::nullopt;
  if (pretended) return Measured{std::move(*pretended), now};
  return state;
}

Result<Eigen::VectorXd> Ros1Executor::attend() {
  const std::lock_guard lock(mutex_);
  link_.serve();
  if (auto updated = ros1_node::update(time_, clock_); !updated) {
    return tl::make_unexpected(std::move(updated.error()));
  }
  const Stamp now = clock_.now();
  auto state = state_at(now);
  if (!state) return fail(ErrorCode::kIo, "the robot's state is not known", kWhere);
  show(now, state->state.q);
  return std::move(state->state.q);
}

Result<Executor::Measured> Ros1Executor::current() {
  const std::lock_guard lock(mutex_);
  link_.serve();
  if (auto updated = ros1_node::update(time_, clock_); !updated) {
    return tl::make_unexpected(std::move(updated.error()));
  }
  const Stamp now = clock_.now();
  if (auto trouble = link_.trouble(time_.to_ros(now))) {
    return fail(ErrorCode::kIo, *trouble, kWhere);
  }
  const auto state = state_at(now);
  if (!state) return fail(ErrorCode::kIo, "the robot's state is not known", kWhere);
  motion_->record(state->state, state->stamp);
  if (is_following(now)) send(now);
  show(now, state->state.q);
  return *state;
}

Result<void> Ros1Executor::follow(const Trajectory& trajectory, Stamp start) {
  const std::lock_guard lock(mutex_);
  const auto sound = check_motion(trajectory, robot_->description(), options_.velocity_tolerance);
  if (!sound) return refuse(sound.error().message);
  if (auto updated = ros1_node::update(time_, clock_); !updated) return updated;
  const Stamp now = clock_.now();
  if (auto near = check_start(trajectory, start, now); !near) return near;
  if (auto inside = check_box(trajectory); !inside) return inside;
  if (auto confirmed = check_confirmed(trajectory, now); !confirmed) return confirmed;
  adopt(trajectory, start);
  send(now);
  return {};
}

/// A trajectory goes on from where the robot has been told to be, or else from where it is.
Result<void> Ros1Executor::check_start(const Trajectory& trajectory, Stamp start, Stamp now) const {
  const Stamp from = std::max(start, now);
  // Where a motion or a stop was to end, the robot need not have come to.
  auto expected = is_shadow() || is_following(from) ? told(from) : std::nullopt;
  const auto state = measured();
  if (!expected && state) expected = state->state;
  if (!expected) return refuse("where the robot is is not known");
  std::vector<double> begin(static_cast<std::size_t>(trajectory.dof));
  trajectory.sample(1e-9 * static_cast<double>(from.ns - start.ns), begin, {});
  for (std::size_t j = 0; j < begin.size(); ++j) {
    const double there = expected->q[static_cast<Eigen::Index>(j)];
    if (std::abs(begin[j] - there) <= options_.start_tolerance) continue;
    return refuse("the trajectory begins with joint '" + robot_->description().joints[j].name +
                  "' at " + figure(begin[j]) + ", it will be at " + figure(there));
  }
  return {};
}

Result<void> Ros1Executor::check_box(const Trajectory& trajectory) const {
  if (!options_.keep_in) return {};
  const std::string* const names[] = {&options_.odometry->x_joint, &options_.odometry->y_joint};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    const int joint = *robot_->description().joint_index(*names[axis]);
    const JointExtent extent = extent_of(trajectory, joint);
    const double lower = options_.keep_in->lower_m[axis];
    const double upper = options_.keep_in->upper_m[axis];
    if (extent.lowest >= lower && extent.highest <= upper) continue;
    return refuse("the trajectory takes the base out of keep_in: " + *names[axis] + " from " +
                      figure(extent.lowest) + " to " + figure(extent.highest) + " m, the box is " +
                      figure(lower) + " to " + figure(upper) + " m",
                  "another goal, or a larger box");
  }
  return {};
}

/// In mode `confirm`, a robot that stands is not moved without a yes to what is shown.
Result<void> Ros1Executor::check_confirmed(const Trajectory& trajectory, Stamp now) {
  const auto state = measured();
  const bool moves =
      is_following(now) || (state && state->state.qdot.cwiseAbs().maxCoeff() > kRest);
  if (options_.mode != "confirm" || moves) return {};
  const bool was_shown = proposed_.size() > 0;
  // A yes from before there was anything to say yes to is none.
  const bool is_confirmed = link_.take_confirmation() && was_shown;
  if (is_confirmed) {
    log_.info("executor ros1: the operator confirmed the motion");
    proposed_ = {};
    return {};
  }
  if (!was_shown) {
    log_.warn("executor ros1: a motion of " + figure(trajectory.duration_s()) +
              " s waits for a yes on " + options_.confirm_topic);
  }
  proposed_ = trajectory;
  return refuse("the motion waits for an operator's yes on " + options_.confirm_topic,
                "rostopic pub -1 " + options_.confirm_topic + " std_msgs/Bool true");
}

void Ros1Executor::adopt(Trajectory trajectory, Stamp start) {
  followed_ = std::move(trajectory);
  start_ = start;
  proposed_ = {};
  sent_whole_ = false;
  sent_.ns = std::numeric_limits<std::int64_t>::min() / 2;
  motion_->follow(followed_, start_);
}

/// The next stretch of what is followed, where the last command's is used up far enough.
void Ros1Executor::send(Stamp now) {
  const auto renewal_ns = Stamp::from_seconds(options_.command_renewal_s).ns;
  if (is_shadow() || sent_whole_ || now.ns - sent_.ns < renewal_ns) return;
  const Stamp from = std::max(now, start_);
  const double from_s = since_start_s(from);
  constexpr double kShortest_s = 1e-3;
  if (from_s + kShortest_s >= followed_.duration_s()) return;
  const double horizon_s = options_.command_horizon_s;
  sent_whole_ = horizon_s <= 0.0 || from_s + horizon_s >= followed_.duration_s();
  command(command_window(followed_, from_s, horizon_s, limits_), followed_, from_s,
          time_.to_ros(from));
  sent_ = now;
}

/// A window of a plan that begins at `from_s` of it.
void Ros1Executor::command(const Trajectory& window, const Trajectory& plan, double from_s,
                           Stamp ros_stamp) {
  std::vector<double> pans;
  if (gaze_) {
    const double pan_rad = link_.feed().held_position(options_.look->pan_joint).value_or(0.0);
    pans = gaze_->pans(plan, from_s, writer_.times(window), pan_rad);
  }
  link_.command(writer_.write(window, ros_stamp, pans));
}

/// From what the robot was told if it is there, or else from what it does: along the path, or
/// straight on.
Trajectory Ros1Executor::stopping(Stamp now) const {
  const auto plan = told(now);
  const auto state = measured();
  // The newest state may be of a while ago.
  const auto plan_then = state ? told(state->stamp) : std::nullopt;
  const bool is_off =
      plan_then && !is_shadow() &&
      (plan_then->q - state->state.q).cwiseAbs().maxCoeff() > options_.start_tolerance;
  if (is_following(now) && !is_off && since_start_s(now) >= 0.0) {
    if (auto along = brake(followed_, since_start_s(now), limits_)) return *along;
  }
  if (plan && !is_off) {
    if (auto straight = brake_straight(*plan, limits_)) return *straight;
  }
  if (!state) return {};
  const auto straight = brake_straight(state->state, limits_);
  return straight ? *straight : Trajectory{};
}

Result<void> Ros1Executor::stop() {
  const std::lock_guard lock(mutex_);
  const Stamp now = clock_.now();
  proposed_ = {};
  if (stands_by_itself()) return {};
  // Clocks that disagree say nothing of when: a stamp of zero is at once.
  const bool agree = ros1_node::update(time_, clock_).has_value();
  const Stamp ros_stamp = agree ? time_.to_ros(now) : Stamp{0};
  Trajectory motion = stopping(now);
  if (motion.size() < 2) {
    followed_ = {};
    motion_->follow({}, now);
    if (!is_shadow()) link_.command(writer_.write_hold(ros_stamp));
    return {};
  }
  // Sent whole: nobody may come to send the rest.
  if (!is_shadow()) command(motion, motion, 0.0, ros_stamp);
  adopt(std::move(motion), now);
  sent_whole_ = true;
  motion_->follow({}, now);
  return {};
}

void Ros1Executor::show(Stamp now, const Eigen::VectorXd& q) {
  if (options_.markers.rate_hz <= 0.0) return;
  const double period_s = 1.0 / options_.markers.rate_hz;
  if (shown_ && 1e-9 * static_cast<double>(now.ns - shown_->ns) < period_s) return;
  if (!link_.has_viewers()) return;
  shown_ = now;
  const bool waits = proposed_.size() > 0;
  link_.show(painter_.paint(
      q, waits ? proposed_ : followed_, waits ? 0.0 : std::max(0.0, since_start_s(now)),
      waits ? PlanState::kProposed : PlanState::kFollowed, time_.to_ros(now)));
}

/// One that goals come to while the robot runs.
class ErrandExecutor final : public Ros1Executor, public GoalSource {
 public:
  ErrandExecutor(const Options& options, const HostContext& context, Parts parts, GoalWishes wishes)
      : Ros1Executor(options, context, std::move(parts)),
        topics_(options, std::move(wishes), context.log) {}
  ~ErrandExecutor() override { std::this_thread::sleep_for(kFlush); }

  std::optional<GoalRequest> next_goal() override {
    const auto q_now = attend();
    return topics_.next(q_now, ros_messages::to_stamp(::ros::Time::now()));
  }
  void report(const GoalReport& report) override { topics_.report(report); }
  bool is_open() const override { return ::ros::ok(); }

 private:
  GoalTopics topics_;  ///< [planning] only.
};

Result<std::unique_ptr<Ros1Executor>> make_executor(const Options& options,
                                                    const HostContext& context, Parts parts) {
  if (!options.goals) return std::make_unique<Ros1Executor>(options, context, std::move(parts));
  auto wishes = GoalWishes::create(context.robot, options);
  if (!wishes) return tl::make_unexpected(std::move(wishes.error()));
  return std::make_unique<ErrandExecutor>(options, context, std::move(parts), std::move(*wishes));
}

}  // namespace

Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                  const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot to move", kWhere);
  }
  const RobotDescription& robot = context.robot->description();
  auto feed = JointFeed::create(robot, options);
  if (!feed) return tl::make_unexpected(std::move(feed.error()));
  auto writer = CommandWriter::create(robot, options);
  if (!writer) return tl::make_unexpected(std::move(writer.error()));
  auto painter =
      MarkerPainter::create(context.robot, options.markers.link.value_or(""), options.world_frame);
  if (!painter) return tl::make_unexpected(std::move(painter.error()));
  std::optional<Gaze> gaze;
  if (options.look) {
    auto made = Gaze::create(robot, *options.odometry, *options.look);
    if (!made) return tl::make_unexpected(std::move(made.error()));
    gaze = std::move(*made);
  }
  auto master = ros1_node::join_ros(options.connect_wait_s, kMasterPeriod_s);
  if (!master) return tl::make_unexpected(std::move(master.error()));
  auto executor = make_executor(options, context,
                                {std::move(*master), std::move(*feed), std::move(*writer),
                                 std::move(*painter), std::move(gaze)});
  if (!executor) return tl::make_unexpected(std::move(executor.error()));
  if (auto connected = (*executor)->connect(); !connected) {
    return tl::make_unexpected(std::move(connected.error()));
  }
  return std::unique_ptr<Executor>(std::move(*executor));
}

}  // namespace sidestep::ros1_executor
