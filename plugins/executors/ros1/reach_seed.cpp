#include "reach_seed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

namespace sidestep::ros1_executor {
namespace {

/// What is as bad as a metre off: a link that is turned wrong by three radians, a base that goes
/// twenty metres, or turns by thirty radians.
constexpr double kTurned_m_per_rad = 0.3;
constexpr double kTravelled = 0.05;
constexpr double kTurning_m_per_rad = 0.03;
constexpr double kOutside_m = 100.0;
/// For a link whose rotation does not count.
constexpr int kHeadings = 16;

struct BaseIndices {
  int x, y, yaw;
};

/// The turn about z that brings `R` nearest to `R_target`: it maximises the trace of
/// R_target^T Rz(yaw) R.
double best_turn(const Eigen::Matrix3d& R, const Eigen::Matrix3d& R_target) {
  const Eigen::Matrix3d M = R * R_target.transpose();
  return std::atan2(M(0, 1) - M(1, 0), M(0, 0) + M(1, 1));
}

class SeedSearch {
 public:
  SeedSearch(const RobotModel& robot, const Reach& reach, const std::optional<KeepInBox>& keep_in,
             std::optional<BaseIndices> base, const Eigen::VectorXd& q_now)
      : robot_(robot),
        reach_(reach),
        keep_in_(keep_in),
        base_(base),
        q_now_(q_now),
        best_(q_now),
        T_world_link_(robot.description().links.size()) {}

  /// With the base wherever it suits the posture.
  void consider(Eigen::VectorXd q) {
    if (!base_) return weigh(std::move(q));
    q[base_->yaw] = q_now_[base_->yaw];
    if (reach_.turns) {
      return place(q, best_turn(link_at(q).linear(), reach_.T_world_target.linear()));
    }
    for (int i = 0; i < kHeadings; ++i) place(q, 2.0 * std::numbers::pi * i / kHeadings);
  }
  [[nodiscard]] const Eigen::VectorXd& best() const noexcept { return best_; }

 private:
  [[nodiscard]] const Transform& link_at(const Eigen::VectorXd& q) {
    robot_.link_poses({q.data(), static_cast<std::size_t>(q.size())}, T_world_link_, scratch_);
    return T_world_link_[static_cast<std::size_t>(reach_.link)];
  }

  /// Turned on by an angle, and moved until the link is above or below its target.
  void place(Eigen::VectorXd q, double turn_rad) {
    q[base_->yaw] += std::remainder(turn_rad, 2.0 * std::numbers::pi);
    const Eigen::Vector3d off_m =
        reach_.T_world_target.translation() - Eigen::Vector3d(link_at(q).translation());
    q[base_->x] += off_m.x();
    q[base_->y] += off_m.y();
    weigh(std::move(q));
  }

  void weigh(Eigen::VectorXd q) {
    // What is measured may be a little beyond a limit.
    const auto& joints = robot_.description().joints;
    for (std::size_t j = 0; j < joints.size(); ++j) {
      double& position = q[static_cast<Eigen::Index>(j)];
      position = std::clamp(position, joints[j].lower, joints[j].upper);
    }
    const Transform off = reach_.T_world_target.inverse() * link_at(q);
    double cost_m = off.translation().norm();
    if (reach_.turns) cost_m += kTurned_m_per_rad * Eigen::AngleAxisd(off.linear()).angle();
    if (base_) cost_m += cost_of_base(q);
    if (cost_m >= least_m_) return;
    least_m_ = cost_m;
    best_ = std::move(q);
  }

  [[nodiscard]] double cost_of_base(const Eigen::VectorXd& q) const {
    const double travel_m =
        std::hypot(q[base_->x] - q_now_[base_->x], q[base_->y] - q_now_[base_->y]);
    const double turn_rad = std::abs(q[base_->yaw] - q_now_[base_->yaw]);
    const auto is_inside = [&](int joint, std::size_t axis) {
      return q[joint] >= keep_in_->lower_m[axis] && q[joint] <= keep_in_->upper_m[axis];
    };
    const bool stays = !keep_in_ || (is_inside(base_->x, 0) && is_inside(base_->y, 1));
    return kTravelled * travel_m + kTurning_m_per_rad * turn_rad + (stays ? 0.0 : kOutside_m);
  }

  const RobotModel& robot_;
  const Reach& reach_;
  const std::optional<KeepInBox>& keep_in_;
  std::optional<BaseIndices> base_;
  const Eigen::VectorXd& q_now_;
  Eigen::VectorXd best_;
  double least_m_ = std::numeric_limits<double>::infinity();
  std::vector<Transform> T_world_link_;
  Scratch scratch_;
};

}  // namespace

Eigen::VectorXd reach_seed(const RobotModel& robot, const Reach& reach,
                           const std::optional<OdometryOptions>& base,
                           const std::optional<KeepInBox>& keep_in, const Eigen::VectorXd& q_now) {
  const RobotDescription& description = robot.description();
  std::optional<BaseIndices> indices;
  if (base) {
    indices = {description.joint_index(base->x_joint).value(),
               description.joint_index(base->y_joint).value(),
               description.joint_index(base->yaw_joint).value()};
  }
  SeedSearch search(robot, reach, keep_in, indices, q_now);
  search.consider(q_now);
  for (const NamedPose& pose : description.poses) {
    Eigen::VectorXd q = q_now;
    for (std::size_t j = 0; j < pose.positions.size(); ++j) {
      if (pose.positions[j]) q[static_cast<Eigen::Index>(j)] = *pose.positions[j];
    }
    search.consider(std::move(q));
  }
  return search.best();
}

}  // namespace sidestep::ros1_executor
