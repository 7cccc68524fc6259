#include "ros1_executor.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include <ros/init.h>

#include <sidestep/planning/goal_source.hpp>
#include <sidestep/planning/map_display.hpp>
#include <sidestep/trajectory/robot_motion.hpp>

#include "base_drive.hpp"
#include "commands.hpp"
#include "conversions.hpp"
#include "goals.hpp"
#include "markers.hpp"
#include "motion_checks.hpp"
#include "node.hpp"
#include "robot_link.hpp"

namespace sidestep::ros1_executor {
namespace {

/// What an executor consists of, made before it.
struct Parts {
  ros1_node::MasterProbe master;
  JointFeed feed;
  CommandWriter writer;
  MarkerPainter painter;
  std::unique_ptr<BaseDrive> drive;  ///< Null: there is none.
};

/// A robot behind ROS 1: its state as topics tell it, motions to its controllers, what RViz shows.
class RobotExecutor : public Executor, public HeadTurner, public MapDisplay {
 public:
  RobotExecutor(const Options& options, const HostContext& context, Parts parts);
  /// A robot is not left moving.
  ~RobotExecutor() override;

  /// Waits until the robot's state is known and its controllers listen. Fails with kNotFound.
  [[nodiscard]] Result<void> connect();
  Result<Measured> current() override;
  Result<void> follow(const Trajectory& trajectory, Stamp start) override;
  Result<void> stop() override;
  Result<void> turn_head(const HeadAngles& to) override;
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
  [[nodiscard]] std::optional<Measured> measured() const;
  /// Measured, or in shadow what it would be.
  [[nodiscard]] std::optional<Measured> state_at(Stamp now) const;
  /// Where it will be; nothing where that is not known.
  [[nodiscard]] std::optional<RobotState> expected_at(Stamp then) const;
  [[nodiscard]] bool moves(Stamp now) const;
  /// Nothing was commanded yet, and nothing moves.
  [[nodiscard]] bool stands_by_itself() const;
  void adopt(Trajectory trajectory, Stamp start);
  void compare_held() const;
  /// Where joint states have the head; nothing where they do not, and where there is none.
  [[nodiscard]] std::optional<HeadAngles> head() const;
  void show(Stamp now, const Eigen::VectorXd& q);

  Options options_;
  std::shared_ptr<const RobotModel> robot_;
  const Clock& clock_;
  Log& log_;
  std::shared_ptr<RobotMotion> motion_;
  MotionLimits limits_;
  std::mutex mutex_;
  ros1_node::RunTime time_;
  MarkerPainter painter_;
  RobotLink link_;
  CommandStream commands_;
  MapView map_view_;
  Confirmation confirmation_;
  CommandedMotion told_;
  std::optional<Stamp> shown_;
};

/// Within which a robot that is not told to move counts as standing, m/s or rad/s.
constexpr double kRest = 0.01;

RobotExecutor::RobotExecutor(const Options& options, const HostContext& context, Parts parts)
    : options_(options),
      robot_(context.robot),
      clock_(context.clock),
      log_(context.log),
      motion_(context.motion ? context.motion : std::make_shared<RobotMotion>()),
      limits_(motion_limits(robot_->description(),
                            {1.0, options.acceleration_fraction, options.assumed_ramp_s})),
      time_(options.watch.clock_tolerance_s),
      painter_(std::move(parts.painter)),
      link_(options, std::move(parts.feed), std::move(parts.master)),
      commands_(options, limits_, std::move(parts.writer), link_, std::move(parts.drive)),
      map_view_(options.markers.map, options.world_frame),
      confirmation_(options, context.log) {}

RobotExecutor::~RobotExecutor() {
  if (!told_.is_under_way(clock_.now())) return;
  (void)RobotExecutor::stop();
  std::this_thread::sleep_for(kFlush);
}

Result<void> RobotExecutor::connect() {
  const Deadline deadline = Deadline::after_s(options_.connect_wait_s);
  constexpr auto kPoll = std::chrono::milliseconds(2);
  std::optional<std::string> trouble;
  do {
    link_.serve();
    SIDESTEP_TRY(ros1_node::update(time_, clock_));
    trouble = link_.trouble(ros1_node::ros_now());
    const auto deaf = commands_.deaf_topics();
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
void RobotExecutor::compare_held() const {
  for (const HeldJoint& held : options_.hold) {
    const auto position = link_.feed().held_position(held.joint);
    if (position && std::abs(*position - held.position) <= options_.start_tolerance) continue;
    log_.warn("executor ros1: joint '" + held.joint + "' is to be at " + figure(held.position) +
              (position ? ", it is at " + figure(*position) : ", joint states do not tell of it") +
              (is_shadow() ? "" : "; the first command moves it there"));
  }
}

std::optional<HeadAngles> RobotExecutor::head() const {
  const auto& head = robot_->description().head;
  if (!head) return {};
  const auto pan_rad = link_.feed().held_position(head->pan.joint.name);
  const auto tilt_rad = link_.feed().held_position(head->tilt.joint.name);
  if (!pan_rad || !tilt_rad) return {};
  return HeadAngles{*pan_rad, *tilt_rad};
}

Result<void> RobotExecutor::turn_head(const HeadAngles& to) {
  const std::lock_guard lock(mutex_);
  if (options_.mode == "confirm" && told_.is_empty()) return {};  // nobody has said yes yet
  const auto from = head();
  if (!from) return fail(ErrorCode::kIo, "where the head is, is not known", kWhere);
  SIDESTEP_TRY(ros1_node::update(time_, clock_));
  return commands_.turn_head(*robot_->description().head, *from, to, time_.to_ros(clock_.now()));
}

std::optional<Executor::Measured> RobotExecutor::measured() const {
  auto newest = link_.feed().newest();
  if (!newest) return {};
  return Measured{std::move(newest->state), time_.to_run(newest->stamp)};
}

std::optional<Executor::Measured> RobotExecutor::state_at(Stamp now) const {
  auto state = measured();
  auto pretended = state && is_shadow() ? told_.at(now) : std::nullopt;
  if (pretended) return Measured{std::move(*pretended), now};
  return state;
}

std::optional<RobotState> RobotExecutor::expected_at(Stamp then) const {
  // Where a motion or a stop was to end, the robot need not have come to.
  auto expected = is_shadow() || told_.is_under_way(then) ? told_.at(then) : std::nullopt;
  if (expected) return expected;
  auto state = measured();
  return state ? std::optional(std::move(state->state)) : std::nullopt;
}

bool RobotExecutor::moves(Stamp now) const {
  if (told_.is_under_way(now)) return true;
  const auto state = measured();
  return state && state->state.qdot.cwiseAbs().maxCoeff() > kRest;
}

bool RobotExecutor::stands_by_itself() const {
  const auto state = measured();
  return told_.is_empty() && state && state->state.qdot.cwiseAbs().maxCoeff() <= kRest;
}

Result<Eigen::VectorXd> RobotExecutor::attend() {
  const std::lock_guard lock(mutex_);
  link_.serve();
  SIDESTEP_TRY(ros1_node::update(time_, clock_));
  const Stamp now = clock_.now();
  auto state = state_at(now);
  if (!state) return fail(ErrorCode::kIo, "the robot's state is not known", kWhere);
  show(now, state->state.q);
  return std::move(state->state.q);
}

Result<Executor::Measured> RobotExecutor::current() {
  const std::lock_guard lock(mutex_);
  link_.serve();
  SIDESTEP_TRY(ros1_node::update(time_, clock_));
  const Stamp now = clock_.now();
  if (auto trouble = link_.trouble(time_.to_ros(now))) {
    return fail(ErrorCode::kIo, *trouble, kWhere);
  }
  const auto state = state_at(now);
  if (!state) return fail(ErrorCode::kIo, "the robot's state is not known", kWhere);
  motion_->record(state->state, state->stamp);
  if (const auto angles = head()) motion_->record_head(*angles, now);
  if (told_.is_under_way(now)) commands_.send(told_, now, time_);
  show(now, state->state.q);
  return *state;
}

Result<void> RobotExecutor::follow(const Trajectory& trajectory, Stamp start) {
  const std::lock_guard lock(mutex_);
  const RobotDescription& robot = robot_->description();
  const auto sound = check_motion(trajectory, robot, options_.velocity_tolerance);
  if (!sound) return refuse(sound.error().message);
  SIDESTEP_TRY(ros1_node::update(time_, clock_));
  const Stamp now = clock_.now(), from = std::max(start, now);
  SIDESTEP_TRY(check_start(trajectory, 1e-9 * static_cast<double>(from.ns - start.ns),
                           expected_at(from), robot, options_.start_tolerance));
  SIDESTEP_TRY(check_box(trajectory, robot, options_));
  SIDESTEP_TRY(confirmation_.check(trajectory, moves(now), link_));
  adopt(trajectory, start);
  commands_.send(told_, now, time_);
  return {};
}

void RobotExecutor::adopt(Trajectory trajectory, Stamp start) {
  told_.set(std::move(trajectory), start);
  confirmation_.drop();
  commands_.begin();
  motion_->follow(told_.trajectory(), start);
}

Result<void> RobotExecutor::stop() {
  const std::lock_guard lock(mutex_);
  const Stamp now = clock_.now();
  confirmation_.drop();
  if (stands_by_itself()) return {};
  // Clocks that disagree say nothing of when: a stamp of zero is at once.
  const bool agree = ros1_node::update(time_, clock_).has_value();
  const Stamp ros_stamp = agree ? time_.to_ros(now) : Stamp{0};
  // A shadow is where it was told to be, wherever the robot is.
  constexpr double kAnywhere = std::numeric_limits<double>::infinity();
  const double tolerance = is_shadow() ? kAnywhere : options_.start_tolerance;
  Trajectory motion = stopping(told_, measured(), tolerance, limits_, now);
  if (motion.size() < 2) {
    told_.clear();
    commands_.hold(ros_stamp);
  } else {
    adopt(std::move(motion), now);
    commands_.send_whole(told_.trajectory(), ros_stamp);  // nobody may come to send the rest
  }
  motion_->follow({}, now);
  return {};
}

void RobotExecutor::show(Stamp now, const Eigen::VectorXd& q) {
  if (options_.markers.rate_hz <= 0.0) return;
  const double period_s = 1.0 / options_.markers.rate_hz;
  if (shown_ && 1e-9 * static_cast<double>(now.ns - shown_->ns) < period_s) return;
  if (!link_.has_viewers()) return;
  shown_ = now;
  const Trajectory& proposed = confirmation_.proposed();
  const bool waits = proposed.size() > 0;
  link_.show(painter_.paint(q, waits ? proposed : told_.trajectory(),
                            waits ? 0.0 : std::max(0.0, told_.since_start_s(now)),
                            waits ? PlanState::kProposed : PlanState::kFollowed,
                            time_.to_ros(now)));
}

constexpr double kMasterPeriod_s = 0.5;

/// One that goals come to while the robot runs.
class ErrandExecutor final : public RobotExecutor, public GoalSource {
 public:
  ErrandExecutor(const Options& options, const HostContext& context, Parts parts,
                 GoalMessageParser wishes)
      : RobotExecutor(options, context, std::move(parts)),
        topics_(options, std::move(wishes), context.log) {}
  ~ErrandExecutor() override { std::this_thread::sleep_for(kFlush); }

  std::optional<GoalRequest> next_goal() override {
    const auto q_now = attend();
    return topics_.next(q_now, ros1_node::ros_now());
  }
  void report(const GoalReport& report) override { topics_.report(report); }
  bool is_open() const override { return ::ros::ok(); }

 private:
  GoalTopics topics_;  ///< [planning] only.
};

Result<std::unique_ptr<RobotExecutor>> make_executor(const Options& options,
                                                     const HostContext& context, Parts parts) {
  if (!options.goals) return std::make_unique<RobotExecutor>(options, context, std::move(parts));
  auto wishes = SIDESTEP_TRY(GoalMessageParser::create(context.robot, options));
  return std::make_unique<ErrandExecutor>(options, context, std::move(parts), std::move(wishes));
}

}  // namespace

Result<std::unique_ptr<Executor>> create_executor(const Options& options,
                                                  const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "there is no robot to move", kWhere);
  }
  const RobotDescription& robot = context.robot->description();
  auto feed = SIDESTEP_TRY(JointFeed::create(robot, options));
  auto writer = SIDESTEP_TRY(CommandWriter::create(robot, options));
  auto painter = SIDESTEP_TRY(
      MarkerPainter::create(context.robot, options.markers.link.value_or(""), options.world_frame));
  auto master = SIDESTEP_TRY(ros1_node::join_ros(options.connect_wait_s, kMasterPeriod_s));
  std::unique_ptr<BaseDrive> drive;
  if (options.twist && options.mode != "shadow") {
    drive = SIDESTEP_TRY(BaseDrive::create(robot, options));
  }
  auto executor = SIDESTEP_TRY(make_executor(options, context,
                                             {std::move(master), std::move(feed), std::move(writer),
                                              std::move(painter), std::move(drive)}));
  SIDESTEP_TRY(executor->connect());
  return std::unique_ptr<Executor>(std::move(executor));
}

}  // namespace sidestep::ros1_executor
