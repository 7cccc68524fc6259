#include <algorithm>
#include <cmath>
#include <utility>

#include <sidestep/planning/costs.hpp>

#include "batch_arrays.hpp"

namespace sidestep {
namespace {

using detail::scratch_array;

class SelfCollisionCost final : public StateCost {
 public:
  SelfCollisionCost(std::shared_ptr<const RobotModel> robot, double epsilon_m, double sigma_m)
      : robot_(std::move(robot)),
        epsilon_m_(epsilon_m),
        weight_(1.0 / sigma_m),
        spheres_(robot_->description().spheres.size()) {
    const RobotDescription& description = robot_->description();
    for (const auto& [first, second] : description.self_collision_pairs) {
      pair_ends_.push_back(sphere_pairs_.size());
      for (std::size_t a = 0; a < spheres_; ++a) {
        if (description.spheres[a].link != first) continue;
        for (std::size_t b = 0; b < spheres_; ++b) {
          if (description.spheres[b].link != second) continue;
          const double radii_m = description.spheres[a].radius_m + description.spheres[b].radius_m;
          sphere_pairs_.push_back({a, b, radii_m});
        }
      }
      pair_ends_.back() = sphere_pairs_.size();
    }
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "self_collision"; }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(pair_ends_.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto n = static_cast<std::size_t>(states.count);
    const auto centres_m = scratch_array<Eigen::Vector3d>(scope, n * spheres_);
    const auto closest = scratch_array<Closest>(scope, n * pair_ends_.size());
    robot_->sphere_centres(states.q, centres_m, scratch);
    for (std::size_t i = 0; i < n; ++i) {
      find_closest(centres_m.subspan(i * spheres_, spheres_),
                   closest.subspan(i * pair_ends_.size(), pair_ends_.size()));
    }
    for (std::size_t i = 0; i < out.residuals.size(); ++i) {
      out.residuals[i] = weight_ * closest[i].hinge_m;
    }
    std::ranges::fill(out.jacobian_qdot, 0.0);
    if (!out.jacobian_q.empty()) {
      differentiate(states, centres_m, closest, out.jacobian_q, scratch);
    }
  }

 private:
  struct SpherePair {
    std::size_t a, b;
    double radii_m;  ///< Sum of both.
  };
  struct Closest {
    const SpherePair* pair;
    double hinge_m;  ///< 0 where the links are further apart than epsilon.
  };

  /// The closest spheres of each pair of links, in one state.
  void find_closest(std::span<const Eigen::Vector3d> centres_m, std::span<Closest> out) const {
    std::size_t begin = 0;
    for (std::size_t p = 0; p < pair_ends_.size(); ++p) {
      out[p] = {nullptr, 0.0};
      for (std::size_t k = begin; k < pair_ends_[p]; ++k) {
        const SpherePair& pair = sphere_pairs_[k];
        const double reach_m = epsilon_m_ + pair.radii_m;
        const double squared = (centres_m[pair.a] - centres_m[pair.b]).squaredNorm();
        if (squared >= reach_m * reach_m) continue;
        const double hinge_m = reach_m - std::sqrt(squared);
        if (!(hinge_m <= out[p].hinge_m)) out[p] = {&pair, hinge_m};  // keeps NaN
      }
      begin = pair_ends_[p];
    }
  }

  void differentiate(const StateBatch& states, std::span<const Eigen::Vector3d> centres_m,
                     std::span<const Closest> closest, std::span<double> jacobian,
                     Scratch& scratch) const {
    std::ranges::fill(jacobian, 0.0);
    Scratch::Scope scope(scratch);
    const auto dof = static_cast<std::size_t>(states.dof);
    const std::size_t pairs = pair_ends_.size();
    const auto unused_m = scratch_array<Eigen::Vector3d>(scope, spheres_);
    const auto columns = scratch_array<Eigen::Vector3d>(scope, spheres_ * dof);
    for (std::size_t i = 0; i < static_cast<std::size_t>(states.count); ++i) {
      const auto row = closest.subspan(i * pairs, pairs);
      if (std::ranges::none_of(row, [](const Closest& c) { return c.pair != nullptr; })) continue;
      robot_->sphere_jacobians(states.q.subspan(i * dof, dof), unused_m, columns, scratch);
      for (std::size_t p = 0; p < pairs; ++p) {
        if (row[p].pair == nullptr) continue;
        const auto [a, b, radii_m] = *row[p].pair;
        const Eigen::Vector3d apart =
            (centres_m[i * spheres_ + a] - centres_m[i * spheres_ + b]).normalized();
        for (std::size_t j = 0; j < dof; ++j) {
          jacobian[(i * pairs + p) * dof + j] =
              -weight_ * apart.dot(columns[a * dof + j] - columns[b * dof + j]);
        }
      }
    }
  }

  std::shared_ptr<const RobotModel> robot_;
  double epsilon_m_;
  double weight_;
  std::size_t spheres_;
  std::vector<SpherePair> sphere_pairs_;  ///< Grouped by pair of links.
  std::vector<std::size_t> pair_ends_;    ///< End of each group.
};

}  // namespace

std::unique_ptr<StateCost> make_self_collision_cost(std::shared_ptr<const RobotModel> robot,
                                                    double epsilon_m, double sigma_m) {
  return std::make_unique<SelfCollisionCost>(std::move(robot), epsilon_m, sigma_m);
}

}  // namespace sidestep
