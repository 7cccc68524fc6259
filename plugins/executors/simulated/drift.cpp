#include "drift.hpp"

#include <cmath>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>

namespace sidestep::simulated {

std::uint64_t mix(std::uint64_t value) {
  value += 0x9e3779b97f4a7c15ULL;
  value = (value ^ (value >> 30)) * 0xbf58476d1ce4e5b9ULL;
  value = (value ^ (value >> 27)) * 0x94d049bb133111ebULL;
  return value ^ (value >> 31);
}

double uniform(std::uint64_t& state) {
  state = mix(state);
  return (static_cast<double>(state >> 11) + 0.5) * 0x1p-53;
}

Result<Drift> Drift::create(double share, double rad_per_m, const RobotModel& robot,
                            std::uint64_t seed) {
  Drift drift;
  if (share == 0.0 && rad_per_m == 0.0) return drift;
  drift.base_ = SIDESTEP_TRY(BaseJoints::of(robot));
  drift.share_ = std::copysign(share, uniform(seed) - 0.5);
  drift.rad_per_m_ = std::copysign(rad_per_m, uniform(seed) - 0.5);
  return drift;
}

void Drift::step(const Eigen::VectorXd& from, const Eigen::VectorXd& to) {
  if (!base_) return;
  const Eigen::Vector3d p(from[base_->x()], from[base_->y()], 0.0);
  const Eigen::Vector3d way = Eigen::Vector3d(to[base_->x()], to[base_->y()], 0.0) - p;
  const double yaw_rad = rad_per_m_ * way.norm() + share_ * (to[base_->yaw()] - from[base_->yaw()]);
  // Where it measures `to`, it truly is at T_world_odom_ of that.
  const Eigen::Vector3d truly = T_world_odom_ * p + T_world_odom_.linear() * way * (1.0 + share_);
  T_world_odom_.linear() =
      Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) * T_world_odom_.linear();
  T_world_odom_.translation() = truly - T_world_odom_.linear() * (p + way);
}

RobotState Drift::truth(RobotState measured) const {
  if (!base_) return measured;
  base_->move(T_world_odom_, as_span(measured.q));
  base_->turn(T_world_odom_, as_span(measured.qdot));
  return measured;
}

}  // namespace sidestep::simulated
