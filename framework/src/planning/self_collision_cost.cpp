#ifndef SIDESTEP_KERNELS
#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include <sidestep/core/lanes.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {
namespace {

struct SpherePair {
  std::size_t a, b;
  double reach_m;  ///< Between the centres, where the cost begins.
};

}  // namespace

}  // namespace sidestep

#define SIDESTEP_KERNELS "self_collision_cost.cpp"
#include <sidestep/core/each_target.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {

namespace {

class SelfCollisionCost final : public StateCost, public HasCostForm {
 public:
  SelfCollisionCost(std::shared_ptr<const RobotModel> robot, double epsilon_m, double sigma_m)
      : robot_(std::move(robot)),
        epsilon_m_(epsilon_m),
        weight_(1.0 / sigma_m),
        spheres_(robot_->description().spheres.size()) {
    const RobotDescription& description = robot_->description();
    for (const CollisionSphere& sphere : description.spheres) link_.push_back(sphere.link);
    for (const auto& [first, second] : description.self_collision_pairs) {
      pair_ends_.push_back(sphere_pairs_.size());
      for (std::size_t a = 0; a < spheres_; ++a) {
        if (description.spheres[a].link != first) continue;
        for (std::size_t b = 0; b < spheres_; ++b) {
          if (description.spheres[b].link != second) continue;
          const double radii_m = description.spheres[a].radius_m + description.spheres[b].radius_m;
          sphere_pairs_.push_back({a, b, epsilon_m + radii_m});
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
  [[nodiscard]] CostForm form() const override {
    return SelfCollisionForm{robot_, epsilon_m_, 1.0 / weight_};
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const auto dof = idx(states.dof);
    const std::size_t pairs = pair_ends_.size();
    const std::size_t groups = padded(n) / kLanes;
    const auto in_lanes_m = scope.array<PointLanes>(groups * spheres_);
    const auto is_near = scope.array<bool>(groups * kLanes);
    robot_->sphere_centre_lanes(states.q, in_lanes_m, scratch);
    for (std::size_t g = 0; g < groups; ++g) {
      SIDESTEP_DISPATCH(find_near)
      (in_lanes_m.data() + g * spheres_, sphere_pairs_, &is_near[g * kLanes]);
    }
    const auto near_count = idx(std::ranges::count(is_near.first(n), true));
    if (near_count == 0) return 0.0;

    const auto centres_m = scope.array<Eigen::Vector3d>(spheres_);
    const auto closest = scope.array<Closest>(pairs);
    const auto forces =
        scope.array<LinkForce>(2 * near_count * pairs);  // on both spheres of a pair
    const auto residuals = scope.doubles(near_count * pairs);
    std::size_t count = 0;
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      if (!is_near[i]) continue;
      for (std::size_t s = 0; s < spheres_; ++s) {
        const PointLanes& in_m = in_lanes_m[i / kLanes * spheres_ + s];
        centres_m[s] = {in_m.x[i % kLanes], in_m.y[i % kLanes], in_m.z[i % kLanes]};
      }
      find_closest(centres_m, closest);
      for (const Closest& close : closest) {
        if (close.pair == nullptr) continue;
        const Eigen::Vector3d& a_m = centres_m[close.pair->a];
        const Eigen::Vector3d& b_m = centres_m[close.pair->b];
        const Eigen::Vector3d force = -weight_ * (a_m - b_m).normalized();
        const int row = static_cast<int>(i);
        forces[2 * count] = {row, link_[close.pair->a], force, a_m.cross(force)};
        forces[2 * count + 1] = {row, link_[close.pair->b], -force, -b_m.cross(force)};
        residuals[count] = weight_ * close.hinge_m;
        sum += residuals[count] * residuals[count];
        ++count;
      }
    }
    const auto rows = scope.doubles(2 * count * dof);
    robot_->pull_back(states.q, forces.first(2 * count), rows, scratch);
    for (std::size_t k = 0; k < count; ++k) {
      const auto first = rows.subspan(2 * k * dof, dof),
                 second = rows.subspan((2 * k + 1) * dof, dof);
      std::ranges::transform(first, second, first.begin(), std::plus<>{});
      out.add_rows(range[idx(forces[2 * k].row)], first, residuals.subspan(k, 1));
    }
    return 0.5 * sum;
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const auto centres_m = scope.array<Eigen::Vector3d>(n * spheres_);
    const auto closest = scope.array<Closest>(n * pair_ends_.size());
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
        const double reach_m = pair.reach_m;
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
    const auto dof = idx(states.dof);
    const std::size_t pairs = pair_ends_.size();
    const auto unused_m = scope.array<Eigen::Vector3d>(spheres_);
    const auto columns = scope.array<Eigen::Vector3d>(spheres_ * dof);
    for (std::size_t i = 0; i < idx(states.count); ++i) {
      const auto row = closest.subspan(i * pairs, pairs);
      if (std::ranges::none_of(row, [](const Closest& c) { return c.pair != nullptr; })) continue;
      robot_->sphere_jacobians(states.q.subspan(i * dof, dof), unused_m, columns, scratch);
      for (std::size_t p = 0; p < pairs; ++p) {
        if (row[p].pair == nullptr) continue;
        const auto [a, b, reach_m] = *row[p].pair;
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
  std::vector<int> link_;                 ///< Of each sphere.
  std::vector<SpherePair> sphere_pairs_;  ///< Grouped by pair of links.
  std::vector<std::size_t> pair_ends_;    ///< End of each group.
};

}  // namespace

std::unique_ptr<StateCost> make_self_collision_cost(std::shared_ptr<const RobotModel> robot,
                                                    double epsilon_m, double sigma_m) {
  return std::make_unique<SelfCollisionCost>(std::move(robot), epsilon_m, sigma_m);
}

}  // namespace sidestep

#else

namespace {

/// In which of kLanes states two spheres of a pair are within reach, or are nowhere.
void find_near(const PointLanes* centres_m, std::span<const SpherePair> pairs, bool* is_near) {
  Lanes deepest = {};
  Lanes any = {};
  for (const SpherePair& pair : pairs) {
    const PointLanes& a = centres_m[pair.a];
    const PointLanes& b = centres_m[pair.b];
    const Lanes x = lanes(a.x) - lanes(b.x), y = lanes(a.y) - lanes(b.y),
                z = lanes(a.z) - lanes(b.z);
    const Lanes squared = x * x + y * y + z * z;
    const Lanes depth = pair.reach_m * pair.reach_m - squared;
    deepest = greater(depth, deepest);
    any += squared;
  }
  for (std::size_t lane = 0; lane < kLanes; ++lane) {
    is_near[lane] = deepest[lane] > 0.0 || !std::isfinite(any[lane]);
  }
}

}  // namespace

#endif
