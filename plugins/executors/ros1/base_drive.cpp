#include "base_drive.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include <boost/function.hpp>

#include <sidestep/core/index.hpp>

#include "conversions.hpp"
#include "node.hpp"

namespace sidestep::ros1_executor {
namespace {

/// After the end of a motion, in which a base is told to stand.
constexpr std::int64_t kStanding_ns = 500'000'000;
/// Of the top speed: below it, the feedback of errors across is reduced.
constexpr double kLeastSpeedShare = 0.2;

using SteadyClock = std::chrono::steady_clock;

Stamp steady_now() {
  const auto since = SteadyClock::now().time_since_epoch();
  return {std::chrono::duration_cast<std::chrono::nanoseconds>(since).count()};
}
/// A time of ROS on the steady clock, as both stand now.
Stamp to_steady(Stamp ros) { return {steady_now().ns + (ros.ns - ros1_node::ros_now().ns)}; }

/// From one pose to another, the shorter way round.
Eigen::Vector3d way_between(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Eigen::Vector3d way = to - from;
  way.z() = std::remainder(way.z(), 2.0 * std::numbers::pi);
  return way;
}

Eigen::Vector2d in_base(const Eigen::Vector2d& v_world, double yaw_rad) {
  return Eigen::Rotation2Dd(-yaw_rad) * v_world;
}

}  // namespace

BaseSpeeds tracking_speeds(const PlanarMotion& told, const PlanarMotion& measured,
                           const BaseTracking& tracking) {
  const double gain = tracking.gain_per_s, yaw_rad = measured.pose.z();
  const auto reduced = [&](const Eigen::Vector3d& speeds) -> Eigen::Vector3d {
    return speeds / std::max(1.0, speeds.cwiseQuotient(tracking.fastest).cwiseAbs().maxCoeff());
  };
  const Eigen::Vector3d error = way_between(measured.pose, told.pose);
  if (!tracking.rolls) {  // its joints' limits are along the world's axes
    const Eigen::Vector3d world = reduced(told.velocity + gain * error);
    BaseSpeeds speeds = world;
    speeds.head<2>() = in_base(world.head<2>(), yaw_rad);
    return speeds;
  }
  const Eigen::Vector2d error_m = in_base(error.head<2>(), yaw_rad);
  const double ahead_mps = in_base(told.velocity.head<2>(), told.pose.z()).x();
  const double least_mps = kLeastSpeedShare * tracking.fastest.x();
  const double across_gain =
      gain * gain * ahead_mps / std::max(ahead_mps * ahead_mps, least_mps * least_mps);
  const double sinc = std::abs(error.z()) < 1e-6 ? 1.0 : std::sin(error.z()) / error.z();
  return reduced({ahead_mps * std::cos(error.z()) + gain * error_m.x(), 0.0,
                  told.velocity.z() + 2.0 * gain * error.z() + across_gain * sinc * error_m.y()});
}

BaseFollower::BaseFollower(std::array<int, 3> joints, const BaseTracking& tracking,
                           double max_age_s, double tolerance)
    : joints_(joints), tracking_(tracking), max_age_s_(max_age_s), tolerance_(tolerance) {}

void BaseFollower::follow(Trajectory motion, Stamp start) { next_.set(std::move(motion), start); }

void BaseFollower::hold() {
  told_.clear();
  next_.clear();
  was_driven_ = true;
}

void BaseFollower::measure(const PlanarMotion& base, Stamp when) {
  measured_ = base;
  measured_at_ = when;
}

std::optional<BaseSpeeds> BaseFollower::speeds_at(Stamp now) {
  if (!next_.is_empty() && now >= next_.start()) told_ = std::exchange(next_, {});
  const bool is_driven = !told_.is_empty() && told_.is_under_way(now);
  if (std::exchange(was_driven_, is_driven) && !is_driven) silent_from_ = {now.ns + kStanding_ns};
  if (!is_driven && now >= silent_from_) return {};
  if (!is_driven) return BaseSpeeds::Zero();

  const RobotState state = *told_.at(now);
  PlanarMotion told;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const int joint = joints_[static_cast<std::size_t>(i)];
    told.pose[i] = state.q[joint];
    told.velocity[i] = state.qdot[joint];
  }
  PlanarMotion measured = told;
  const double age_s = 1e-9 * static_cast<double>(now.ns - measured_at_.ns);
  if (measured_ && std::abs(age_s) < max_age_s_) {
    PlanarMotion since = *measured_;
    since.pose += age_s * since.velocity;
    const double off = way_between(since.pose, told.pose).cwiseAbs().maxCoeff();
    if (off < tolerance_) measured = since;
  }
  return tracking_speeds(told, measured, tracking_);
}

Result<std::unique_ptr<BaseDrive>> BaseDrive::create(const RobotDescription& robot,
                                                     const Options& options) {
  const OdometryOptions& base = *options.odometry;
  const std::array names{&base.x_joint, &base.y_joint, &base.yaw_joint};
  std::array<int, 3> joints{};
  BaseTracking tracking{robot.rolling.has_value(), options.twist->gain_per_s, {}};
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto index = robot.joint_index(*names[i]);
    const double fastest = index ? robot.joints[idx(*index)].max_velocity : 0.0;
    if (!(fastest > 0.0) || !std::isfinite(fastest)) {
      return fail(
          ErrorCode::kConfig,
          "robot '" + robot.name + "' has no joint '" + *names[i] + "' with a velocity limit",
          "executor.twist");
    }
    joints[i] = *index;
    tracking.fastest[static_cast<Eigen::Index>(i)] = fastest;
  }
  return std::unique_ptr<BaseDrive>(new BaseDrive(
      options, {joints, tracking, options.watch.max_odometry_age_s, options.start_tolerance}));
}

BaseDrive::BaseDrive(const Options& options, BaseFollower follower)
    : rate_hz_(options.twist->rate_hz), follower_(std::move(follower)) {
  node_.setCallbackQueue(&queue_);
  twist_ = node_.advertise<ros_messages::Twist>(options.twist->topic, 1);
  using Pointer = boost::shared_ptr<const ros_messages::Odometry>;
  const boost::function<void(const Pointer&)> call(
      [this, is_twist_in_base = options.odometry->twist_in == "base"](const Pointer& message) {
        const auto motion = planar_motion_of(*message, is_twist_in_base);
        if (!motion) return;
        const Stamp when = to_steady(ros_messages::to_stamp(message->header.stamp));
        const std::lock_guard lock(mutex_);
        follower_.measure(*motion, when);
      });
  subscriber_ = node_.subscribe<ros_messages::Odometry>(options.odometry->topic, 1, call,
                                                        ::ros::VoidConstPtr(),
                                                        ::ros::TransportHints().tcpNoDelay());
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

BaseDrive::~BaseDrive() = default;  // Joins.

void BaseDrive::follow(Trajectory motion, Stamp start) {
  const Stamp when = start.ns == 0 ? steady_now() : to_steady(start);
  const std::lock_guard lock(mutex_);
  follower_.follow(std::move(motion), when);
}

void BaseDrive::hold() {
  const std::lock_guard lock(mutex_);
  follower_.hold();
}

std::optional<std::string> BaseDrive::deaf_topic() const {
  if (twist_.getNumSubscribers() > 0) return {};
  return twist_.getTopic();
}

void BaseDrive::run(const std::stop_token& stop) {
  const auto period = std::chrono::duration_cast<SteadyClock::duration>(
      std::chrono::duration<double>(1.0 / rate_hz_));
  auto next = SteadyClock::now();
  for (bool is_sending = false; is_sending || !stop.stop_requested();) {
    next = std::max(next + period, SteadyClock::now());
    queue_.callAvailable(::ros::WallDuration(0.0));
    for (auto left = next - SteadyClock::now(); left.count() > 0;
         left = next - SteadyClock::now()) {
      queue_.callAvailable(::ros::WallDuration(std::chrono::duration<double>(left).count()));
    }
    std::optional<BaseSpeeds> speeds;
    {
      const std::lock_guard lock(mutex_);
      speeds = follower_.speeds_at(steady_now());
    }
    is_sending = speeds.has_value();
    if (!speeds) continue;
    ros_messages::Twist message;
    message.linear.x = speeds->x();
    message.linear.y = speeds->y();
    message.angular.z = speeds->z();
    twist_.publish(message);
  }
}

}  // namespace sidestep::ros1_executor
