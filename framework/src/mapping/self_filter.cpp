#include <sidestep/core/index.hpp>
#include <sidestep/mapping/self_filter.hpp>

#include <span>
#include <string>

#include <sidestep/mapping/frame_check.hpp>

namespace sidestep {

Result<void> SelfFilter::pose(const Frame& frame) {
  balls_.clear();
  if (!robot_ || !frame.joint_positions) return {};
  const RobotDescription& robot = robot_->description();
  const Eigen::VectorXd& q = *frame.joint_positions;
  if (q.size() != robot.dof()) {
    return tl::make_unexpected(
        bad_frame(frame, "it has " + std::to_string(q.size()) + " joint positions, but robot '" +
                             robot.name + "' has " + std::to_string(robot.dof()) + " joints"));
  }
  if (!q.allFinite()) {
    return tl::make_unexpected(bad_frame(frame, "a joint position is not finite"));
  }
  centres_m_.resize(robot.spheres.size());
  robot_->sphere_centres(as_span(q), centres_m_, scratch_);
  for (std::size_t s = 0; s < centres_m_.size(); ++s) {
    balls_.push_back({centres_m_[s], robot.spheres[s].radius_m + margin_m_});
    const Eigen::Vector3d reach = Eigen::Vector3d::Constant(balls_[s].radius_m);
    const Eigen::Vector3d lower = centres_m_[s] - reach;
    const Eigen::Vector3d upper = centres_m_[s] + reach;
    lower_m_ = s == 0 ? lower : Eigen::Vector3d(lower_m_.cwiseMin(lower));
    upper_m_ = s == 0 ? upper : Eigen::Vector3d(upper_m_.cwiseMax(upper));
  }
  return {};
}

bool SelfFilter::contains(const Eigen::Vector3d& p_world) const noexcept {
  if (balls_.empty() || (p_world.array() < lower_m_.array()).any() ||
      (p_world.array() > upper_m_.array()).any()) {
    return false;
  }
  for (const Ball& ball : balls_) {
    if ((p_world - ball.centre_m).squaredNorm() <= ball.radius_m * ball.radius_m) return true;
  }
  return false;
}

}  // namespace sidestep
