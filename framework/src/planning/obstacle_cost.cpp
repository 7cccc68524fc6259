#include <algorithm>
#include <utility>

#include <sidestep/planning/costs.hpp>

#include "batch_arrays.hpp"

namespace sidestep {
namespace {

using detail::scratch_array;

class ObstacleCost final : public StateCost {
 public:
  ObstacleCost(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
               SpacePolicy space, double epsilon_m, double sigma_m)
      : robot_(std::move(robot)),
        field_(std::move(field)),
        space_(space),
        weight_(1.0 / sigma_m),
        spheres_(robot_->description().spheres.size()) {
    for (const CollisionSphere& sphere : robot_->description().spheres) {
      reach_m_.push_back(epsilon_m + sphere.radius_m);
    }
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "obstacle"; }
  [[nodiscard]] int residual_count() const noexcept override { return static_cast<int>(spheres_); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto n = static_cast<std::size_t>(states.count);
    const std::size_t points = n * spheres_;
    const bool want_jacobian = !out.jacobian_q.empty();
    const auto centres_m = scratch_array<Eigen::Vector3d>(scope, points);
    const auto distances_m = scope.doubles(points);
    const auto statuses = scratch_array<FieldStatus>(scope, points);
    const auto gradients = scratch_array<Eigen::Vector3d>(scope, want_jacobian ? points : 0);

    robot_->sphere_centres(states.q, centres_m, scratch);
    query_with_policy(*field_, space_, centres_m, distances_m, gradients, statuses);

    for (std::size_t i = 0; i < points; ++i) {
      const double hinge_m = reach_m_[i % spheres_] - distances_m[i];
      distances_m[i] = hinge_m <= 0.0 ? 0.0 : weight_ * hinge_m;  // keeps NaN
    }
    if (!out.residuals.empty()) std::ranges::copy(distances_m, out.residuals.begin());
    std::ranges::fill(out.jacobian_qdot, 0.0);
    if (want_jacobian) differentiate(states, distances_m, gradients, out.jacobian_q, scratch);
  }

 private:
  /// Jacobians of the spheres are formed only for the states in which one is within reach.
  void differentiate(const StateBatch& states, std::span<const double> residuals,
                     std::span<const Eigen::Vector3d> gradients, std::span<double> jacobian,
                     Scratch& scratch) const {
    std::ranges::fill(jacobian, 0.0);
    Scratch::Scope scope(scratch);
    const auto n = static_cast<std::size_t>(states.count);
    const auto dof = static_cast<std::size_t>(states.dof);
    const auto active = scratch_array<std::size_t>(scope, n);
    const auto q_active = scope.doubles(n * dof);
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = residuals.subspan(i * spheres_, spheres_);
      if (std::ranges::all_of(row, [](double residual) { return residual == 0.0; })) continue;
      std::ranges::copy(states.q.subspan(i * dof, dof), q_active.begin() + count * dof);
      active[count++] = i;
    }
    if (count == 0) return;

    const auto centres_m = scratch_array<Eigen::Vector3d>(scope, count * spheres_);
    const auto columns = scratch_array<Eigen::Vector3d>(scope, count * spheres_ * dof);
    robot_->sphere_jacobians(q_active.first(count * dof), centres_m, columns, scratch);
    for (std::size_t a = 0; a < count; ++a) {
      for (std::size_t s = 0; s < spheres_; ++s) {
        const std::size_t at = active[a] * spheres_ + s;
        if (residuals[at] == 0.0) continue;
        for (std::size_t j = 0; j < dof; ++j) {
          jacobian[at * dof + j] =
              -weight_ * gradients[at].dot(columns[(a * spheres_ + s) * dof + j]);
        }
      }
    }
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const DistanceField> field_;
  SpacePolicy space_;
  double weight_;
  std::size_t spheres_;
  std::vector<double> reach_m_;  ///< Distance at which the cost of each sphere's centre begins.
};

}  // namespace

std::unique_ptr<StateCost> make_obstacle_cost(std::shared_ptr<const RobotModel> robot,
                                              std::shared_ptr<const DistanceField> field,
                                              SpacePolicy space, double epsilon_m, double sigma_m) {
  return std::make_unique<ObstacleCost>(std::move(robot), std::move(field), space, epsilon_m,
                                        sigma_m);
}

}  // namespace sidestep
