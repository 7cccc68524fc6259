#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/residual_names.hpp>

namespace sidestep {
namespace {

constexpr double kOrthonormalTolerance = 1e-6;

/// A cost of where one link is: residuals that are functions of the link's pose alone.
class LinkCost : public StateCost, public NamesResiduals {
 public:
  [[nodiscard]] std::string_view name() const noexcept final { return name_; }
  [[nodiscard]] bool depends_on_velocity() const noexcept final { return false; }
  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const final {
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const auto dof = idx(states.dof);
    const auto m = idx(residual_count());
    const auto poses = scope.array<Transform>(robot_->description().links.size());
    const auto residuals = scope.doubles(n * m);
    const auto derivatives = scope.array<LinkForce>(n * m);
    for (std::size_t i = 0; i < n; ++i) {
      robot_->link_poses(states.q.subspan(i * dof, dof), poses, scratch);
      const auto of_state = derivatives.subspan(i * m, m);
      measure(poses[idx(link_)], residuals.subspan(i * m, m), of_state);
      for (LinkForce& derivative : of_state) {
        derivative.row = static_cast<int>(i);
        derivative.link = link_;
      }
    }
    if (!out.residuals.empty()) std::ranges::copy(residuals, out.residuals.begin());
    if (!out.jacobian_q.empty()) {
      robot_->pull_back(states.q, derivatives, out.jacobian_q, scratch);
    }
    std::ranges::fill(out.jacobian_qdot, 0.0);
  }

 protected:
  LinkCost(std::string name, std::shared_ptr<const RobotModel> robot, int link)
      : name_(std::move(name)), robot_(std::move(robot)), link_(link) {}

  [[nodiscard]] const std::shared_ptr<const RobotModel>& robot() const noexcept { return robot_; }
  [[nodiscard]] int link() const noexcept { return link_; }
  [[nodiscard]] const std::string& link_name() const noexcept {
    return robot_->description().links[idx(link_)].name;
  }

  /// Residuals at a pose and, of each, the derivative by the link's motion: `force` by the velocity
  /// of the link's point that is at the world's origin, `moment` by its angular velocity.
  virtual void measure(const Transform& T_world_link, std::span<double> residuals,
                       std::span<LinkForce> derivatives) const noexcept = 0;

 private:
  std::string name_;
  std::shared_ptr<const RobotModel> robot_;
  int link_;
};

/// (1 - (angle / 2) cot(angle / 2)) / angle^2, of the inverse of SO(3)'s left Jacobian.
double inverse_jacobian_factor(double angle) {
  const double square = angle * angle;
  if (angle < 1e-2) return 1.0 / 12.0 + square / 720.0;
  return (1.0 - 0.5 * angle / std::tan(0.5 * angle)) / square;
}

/// Position, rotation, or both, of a link against the nearest of some targets.
class PoseCost final : public LinkCost, public HasCostForm {
 public:
  PoseCost(std::string name, std::shared_ptr<const RobotModel> robot, int link,
           const Transform& target, const PoseFreedom& freedom,
           std::optional<double> sigma_position, std::optional<double> sigma_rotation)
      : LinkCost(std::move(name), std::move(robot), link),
        targets_(freedom.alternatives),
        within_m_(freedom.within_m) {
    targets_.insert(targets_.begin(), target);
    if (sigma_position) position_weight_ = 1.0 / *sigma_position;
    if (sigma_rotation) rotation_weight_ = 1.0 / *sigma_rotation;
  }

  [[nodiscard]] int residual_count() const noexcept override {
    return (position_weight_ ? 3 : 0) + (rotation_weight_ ? 3 : 0);
  }
  [[nodiscard]] CostForm form() const override {
    return LinkPoseForm{robot(),
                        link(),
                        targets_,
                        within_m_,
                        position_weight_.value_or(0.0),
                        rotation_weight_.value_or(0.0)};
  }

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    const std::string axis(1, "xyz"[residual % 3]);
    const std::string target = targets_.size() == 1 ? "its target" : "the nearest of its targets";
    if (position_weight_ && residual < 3) {
      return {"position of " + link_name(), "along " + axis, target, "m", 1.0 / *position_weight_};
    }
    return {"orientation of " + link_name(), "about the target's " + axis, target, "rad",
            1.0 / *rotation_weight_};
  }

 private:
  void measure(const Transform& T_world_link, std::span<double> residuals,
               std::span<LinkForce> derivatives) const noexcept override {
    const Transform* nearest = &targets_.front();
    if (targets_.size() > 1) {
      nearest = &*std::ranges::min_element(
          targets_, {}, [&](const Transform& target) { return squares(T_world_link, target); });
    }
    if (position_weight_) {
      const Eigen::Vector3d p = T_world_link.translation();
      const Eigen::Vector3d off = beyond_m(T_world_link, *nearest);
      for (int k = 0; k < 3; ++k) {
        const auto row = idx(k);
        const bool is_inside = off[k] == 0.0 && within_m_[k] > 0.0;
        residuals[row] = *position_weight_ * off[k];
        derivatives[row].force = (is_inside ? 0.0 : *position_weight_) * Eigen::Vector3d::Unit(k);
        derivatives[row].moment = p.cross(derivatives[row].force);
      }
    }
    if (rotation_weight_) {
      const std::size_t first = position_weight_ ? 3 : 0;
      measure_rotation(T_world_link.linear(), nearest->linear(), residuals.subspan(first),
                       derivatives.subspan(first));
    }
  }

  /// How far a link is outside the region about a target.
  [[nodiscard]] Eigen::Vector3d beyond_m(const Transform& T_world_link,
                                         const Transform& target) const noexcept {
    const Eigen::Vector3d off = T_world_link.translation() - target.translation();
    return off - off.cwiseMax(-within_m_).cwiseMin(within_m_);
  }

  [[nodiscard]] double squares(const Transform& T_world_link,
                               const Transform& target) const noexcept {
    double sum = 0.0;
    if (position_weight_) {
      sum += (*position_weight_ * beyond_m(T_world_link, target)).squaredNorm();
    }
    if (rotation_weight_) {
      const double v = turn_between(target.linear(), T_world_link.linear()).norm();
      sum += *rotation_weight_ * v * *rotation_weight_ * v;
    }
    return sum;
  }

  /// log(R_target^T R).
  [[nodiscard]] static Eigen::Vector3d turn_between(const Eigen::Matrix3d& R_target,
                                                    const Eigen::Matrix3d& R) noexcept {
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(R_target.transpose() * R).normalized());
    return turn.angle() * turn.axis();
  }

  /// With v = log(R_target^T R), turning the link by a small w (world frame) adds J^-1 R_target^T w
  /// to v, J the left Jacobian of SO(3) at v.
  void measure_rotation(const Eigen::Matrix3d& R, const Eigen::Matrix3d& R_target,
                        std::span<double> residuals,
                        std::span<LinkForce> derivatives) const noexcept {
    const Eigen::Vector3d v = turn_between(R_target, R);
    const double factor = inverse_jacobian_factor(v.norm());
    for (int k = 0; k < 3; ++k) {
      const auto row = idx(k);
      const Eigen::Vector3d unit = Eigen::Vector3d::Unit(k);
      const Eigen::Vector3d column = unit + 0.5 * v.cross(unit) + factor * v.cross(v.cross(unit));
      residuals[row] = *rotation_weight_ * v[k];
      derivatives[row].force.setZero();
      derivatives[row].moment = *rotation_weight_ * (R_target * column);
    }
  }

  std::vector<Transform> targets_;
  Eigen::Vector3d within_m_;
  std::optional<double> position_weight_, rotation_weight_;
};

/// The rotation vector that takes one direction to another, across the latter: two residuals.
class AxisCost final : public LinkCost, public HasCostForm {
 public:
  AxisCost(std::string name, std::shared_ptr<const RobotModel> robot, int link,
           const Eigen::Vector3d& axis_link, const Eigen::Vector3d& axis_world, double sigma)
      : LinkCost(std::move(name), std::move(robot), link),
        axis_link_(axis_link.normalized()),
        axis_world_(axis_world.normalized()),
        across_{axis_world_.unitOrthogonal(), {}},
        weight_(1.0 / sigma) {
    across_[1] = axis_world_.cross(across_[0]);
  }

  [[nodiscard]] int residual_count() const noexcept override { return 2; }
  [[nodiscard]] CostForm form() const override {
    return LinkAxisForm{robot(), link(), axis_link_, axis_world_, {across_[0], across_[1]},
                        weight_};
  }

  [[nodiscard]] ResidualName residual_name(int) const override {
    return {"axis of " + link_name(), "", "its direction", "rad", 1.0 / weight_};
  }

 private:
  static constexpr double kOpposite = 1e-9;  ///< A sine: less, and the way back has no direction.

  void measure(const Transform& T_world_link, std::span<double> residuals,
               std::span<LinkForce> derivatives) const noexcept override {
    const Eigen::Vector3d axis = T_world_link.linear() * axis_link_;
    const double c = axis.dot(axis_world_);
    const double s = axis.cross(axis_world_).norm();
    if (c < 0.0 && s < kOpposite) {
      residuals[0] = weight_ * std::numbers::pi;
      residuals[1] = 0.0;
      derivatives[0].moment = -weight_ * axis.cross(across_[0]);
      derivatives[0].force = derivatives[1].force = derivatives[1].moment = {0.0, 0.0, 0.0};
      return;
    }
    const double angle = std::atan2(s, c);
    const double square = angle * angle;
    const bool small = angle < 1e-2;
    // angle / sin(angle), and its derivative by cos(angle).
    const double ratio = small ? 1.0 + square / 6.0 + 7.0 * square * square / 360.0 : angle / s;
    const double slope = small ? -1.0 / 3.0 - 2.0 * square / 15.0 : (angle * c - s) / (s * s * s);
    for (std::size_t k = 0; k < 2; ++k) {
      const double along = axis.dot(across_[k]);
      residuals[k] = weight_ * ratio * along;
      derivatives[k].force.setZero();
      derivatives[k].moment =
          weight_ * (ratio * axis.cross(across_[k]) + slope * along * axis.cross(axis_world_));
    }
  }

  Eigen::Vector3d axis_link_, axis_world_;
  Eigen::Vector3d across_[2];
  double weight_;
};

Result<int> find_link(const RobotDescription& robot, const std::string& link) {
  if (const auto index = robot.link_index(link)) return *index;
  return invalid("robot '" + robot.name + "' has no link '" + link + "'");
}

Result<void> check_sigma(double sigma, const std::string& of) {
  if (sigma > 0.0 && std::isfinite(sigma)) return {};
  return invalid("the standard deviation of the " + of + " must be positive");
}

Result<void> check_rotation(const Eigen::Matrix3d& R, const std::string& link) {
  const double off = (R.transpose() * R - Eigen::Matrix3d::Identity()).norm();
  if (off <= kOrthonormalTolerance && R.determinant() > 0.0) return {};
  return invalid("the orientation wanted of link '" + link + "' is not a rotation");
}

Result<void> check_target(const Transform& target, const std::string& link, bool has_position,
                          bool has_rotation) {
  if (has_position && !target.translation().allFinite()) {
    return invalid("the position wanted of link '" + link + "' is not finite");
  }
  return has_rotation ? check_rotation(target.linear(), link) : Result<void>();
}

Result<std::unique_ptr<StateCost>> make_cost(const std::string& kind,
                                             std::shared_ptr<const RobotModel> robot,
                                             const std::string& link, const Transform& target,
                                             const PoseFreedom& freedom,
                                             std::optional<double> sigma_position,
                                             std::optional<double> sigma_rotation) {
  const auto index = SIDESTEP_TRY(find_link(robot->description(), link));
  if (sigma_position) SIDESTEP_TRY(check_sigma(*sigma_position, "position of link '" + link + "'"));
  if (sigma_rotation) SIDESTEP_TRY(check_sigma(*sigma_rotation, "rotation of link '" + link + "'"));
  SIDESTEP_TRY(check_target(target, link, sigma_position.has_value(), sigma_rotation.has_value()));
  for (const Transform& other : freedom.alternatives) {
    SIDESTEP_TRY(check_target(other, link, sigma_position.has_value(), sigma_rotation.has_value()));
  }
  if (!freedom.within_m.allFinite() || freedom.within_m.minCoeff() < 0.0) {
    return invalid("the region wanted of link '" + link +
                   "' has an edge that is negative or no "
                   "number");
  }
  return std::make_unique<PoseCost>(kind + "_" + link, std::move(robot), index, target, freedom,
                                    sigma_position, sigma_rotation);
}

}  // namespace

Result<std::unique_ptr<StateCost>> make_link_position_cost(std::shared_ptr<const RobotModel> robot,
                                                           const std::string& link,
                                                           const Eigen::Vector3d& p_world_m,
                                                           double sigma_m,
                                                           const PoseFreedom& freedom) {
  Transform target = Transform::Identity();
  target.translation() = p_world_m;
  return make_cost("position", std::move(robot), link, target, freedom, sigma_m, std::nullopt);
}

Result<std::unique_ptr<StateCost>> make_link_pose_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link, const Transform& T_world_link,
    double sigma_position_m, double sigma_rotation_rad, const PoseFreedom& freedom) {
  return make_cost("pose", std::move(robot), link, T_world_link, freedom, sigma_position_m,
                   sigma_rotation_rad);
}

Result<std::unique_ptr<StateCost>> make_link_orientation_cost(
    std::shared_ptr<const RobotModel> robot, const std::string& link,
    const Eigen::Matrix3d& R_world_link, double sigma_rad) {
  Transform target = Transform::Identity();
  target.linear() = R_world_link;
  return make_cost("orientation", std::move(robot), link, target, {}, std::nullopt, sigma_rad);
}

Result<std::unique_ptr<StateCost>> make_link_axis_cost(std::shared_ptr<const RobotModel> robot,
                                                       const std::string& link,
                                                       const Eigen::Vector3d& axis_link,
                                                       const Eigen::Vector3d& axis_world,
                                                       double sigma_rad) {
  const auto index = SIDESTEP_TRY(find_link(robot->description(), link));
  SIDESTEP_TRY(check_sigma(sigma_rad, "axis of link '" + link + "'"));
  for (const Eigen::Vector3d& axis : {axis_link, axis_world}) {
    if (axis.allFinite() && axis.norm() > 0.0) continue;
    return invalid("an axis given for link '" + link + "' has no direction");
  }
  return std::make_unique<AxisCost>("axis_" + link, std::move(robot), index, axis_link, axis_world,
                                    sigma_rad);
}

}  // namespace sidestep
