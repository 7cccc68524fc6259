#include "base_drive.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdlib>
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
/// Of the top speed: slower than this, errors across are steered away by less.
constexpr double kLeastSpeedShare = 0.2;

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
  Eigen::Vector3d error = told.pose - measured.pose;
  error.z() = std::remainder(error.z(), 2.0 * std::numbers::pi);
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

Result<std::unique_ptr<BaseDrive>> BaseDrive::create(const RobotDescription& robot,
                                                     const Options& options) {
  std::array<int, 3> joints{};
  BaseTracking tracking{robot.rolling.has_value(), options.twist->gain_per_s, {}};
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const OdometryOptions& base = *options.odometry;
    const std::string& name = i == 0 ? base.x_joint : i == 1 ? base.y_joint : base.yaw_joint;
    const auto index = robot.joint_index(name);
    const double fastest = index ? robot.joints[idx(*index)].max_velocity : 0.0;
    if (!(fastest > 0.0) || !std::isfinite(fastest)) {
      return fail(ErrorCode::kConfig,
                  "robot '" + robot.name + "' has no joint '" + name + "' with a velocity limit",
                  "executor.twist");
    }
    joints[i] = *index;
    tracking.fastest[static_cast<Eigen::Index>(i)] = fastest;
  }
  return std::unique_ptr<BaseDrive>(new BaseDrive(options, joints, tracking));
}

BaseDrive::BaseDrive(const Options& options, std::array<int, 3> joints,
                     const BaseTracking& tracking)
    : joints_(joints),
      tracking_(tracking),
      rate_hz_(options.twist->rate_hz),
      max_age_s_(options.watch.max_odometry_age_s),
      tolerance_(options.start_tolerance) {
  node_.setCallbackQueue(&queue_);
  twist_ = node_.advertise<ros_messages::Twist>(options.twist->topic, 1);
  using Pointer = boost::shared_ptr<const ros_messages::Odometry>;
  const boost::function<void(const Pointer&)> call(
      [this, is_twist_in_base = options.odometry->twist_in == "base"](const Pointer& message) {
        const auto motion = planar_motion_of(*message, is_twist_in_base);
        if (!motion) return;
        odometry_ = motion;
        measured_ = ros_messages::to_stamp(message->header.stamp);
      });
  subscriber_ = node_.subscribe<ros_messages::Odometry>(options.odometry->topic, 1, call,
                                                        ::ros::VoidConstPtr(),
                                                        ::ros::TransportHints().tcpNoDelay());
  thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

BaseDrive::~BaseDrive() = default;  // Joins.

void BaseDrive::follow(Trajectory motion, Stamp start) {
  const Stamp now = ros1_node::ros_now();
  const std::lock_guard lock(mutex_);
  next_.set(std::move(motion), start.ns == 0 ? now : start);
}

void BaseDrive::hold() {
  const std::lock_guard lock(mutex_);
  holds_ = true;
  told_.clear();
  next_.clear();
}

std::optional<std::string> BaseDrive::deaf_topic() const {
  if (twist_.getNumSubscribers() > 0) return {};
  return twist_.getTopic();
}

std::optional<BaseSpeeds> BaseDrive::speeds_at(Stamp now) {
  std::optional<RobotState> state;
  {
    const std::lock_guard lock(mutex_);
    if (!next_.is_empty() && now >= next_.start()) {
      told_ = std::exchange(next_, {});
    }
    // Before its start, a clock was set back: it is not driven back to where that was.
    const bool is_over =
        told_.is_empty() || !told_.is_under_way(now) || told_.since_start_s(now) < 0.0;
    if (holds_ || !is_over) ended_ = now;
    holds_ = false;
    if (is_over) {
      if (std::abs(now.ns - ended_.ns) > kStanding_ns) return {};
      return BaseSpeeds::Zero();
    }
    state = told_.at(now);
  }
  PlanarMotion told;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const int joint = joints_[static_cast<std::size_t>(i)];
    told.pose[i] = state->q[joint];
    told.velocity[i] = state->qdot[joint];
  }
  const double age_s = odometry_ ? 1e-9 * static_cast<double>(now.ns - measured_.ns) : max_age_s_;
  if (!(std::abs(age_s) < max_age_s_)) return tracking_speeds(told, told, tracking_);
  PlanarMotion measured = *odometry_;
  measured.pose += std::max(0.0, age_s) * measured.velocity;
  Eigen::Vector3d error = told.pose - measured.pose;
  error.z() = std::remainder(error.z(), 2.0 * std::numbers::pi);
  if (!(error.cwiseAbs().maxCoeff() < tolerance_)) return tracking_speeds(told, told, tracking_);
  return tracking_speeds(told, measured, tracking_);
}

void BaseDrive::run(const std::stop_token& stop) {
  using Clock = std::chrono::steady_clock;
  const auto period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(1.0 / rate_hz_));
  auto next = Clock::now();
  for (bool is_sending = false; is_sending || !stop.stop_requested();) {
    next = std::max(next + period, Clock::now());
    queue_.callAvailable(::ros::WallDuration(0.0));
    for (auto left = next - Clock::now(); left.count() > 0; left = next - Clock::now()) {
      queue_.callAvailable(::ros::WallDuration(std::chrono::duration<double>(left).count()));
    }
    const auto speeds = speeds_at(ros1_node::ros_now());
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
