#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

#include "felt_spheres.hpp"

namespace sidestep {
namespace {

/// Turns what a field says of a point that was never observed, or is outside, into what that counts
/// as.
void apply(const SpacePolicy& policy, const GridSpec& grid, const Eigen::Vector3d& p_m,
           FieldStatus status, double& distance_m, Eigen::Vector3d& gradient) noexcept {
  if (status == FieldStatus::kKnown || !p_m.allFinite()) return;
  if (status == FieldStatus::kUnknown) {
    if (policy.unknown == Space::kFree) return;
    if (!(distance_m <= 0.0)) distance_m = 0.0;
    if (!gradient.allFinite()) gradient.setZero();
  } else if (policy.outside == Space::kFree) {
    distance_m = std::numeric_limits<double>::infinity();
    gradient.setZero();
  } else {
    const Eigen::Vector3d inwards = p_m.cwiseMax(grid.origin_m).cwiseMin(grid.upper_m()) - p_m;
    const double outside_m = inwards.norm();
    distance_m = -outside_m;
    gradient.setZero();
    if (outside_m > 0.0) gradient = inwards / outside_m;
  }
}

class ObstacleCost final : public StateCost, public HasCostForm {
 public:
  ObstacleCost(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const DistanceField> field,
               SpacePolicy space, double epsilon_m, double sigma_m)
      : robot_(std::move(robot)),
        field_(std::move(field)),
        space_(std::move(space)),
        epsilon_m_(epsilon_m),
        weight_(1.0 / sigma_m),
        tree_(dynamic_cast<const KinematicTree*>(robot_.get())),
        spheres_(robot_->description().spheres.size()) {
    for (const CollisionSphere& sphere : robot_->description().spheres) {
      reach_m_.push_back(epsilon_m + sphere.radius_m);
      link_.push_back(sphere.link);
    }
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "obstacle"; }
  [[nodiscard]] int residual_count() const noexcept override { return static_cast<int>(spheres_); }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  [[nodiscard]] CostForm form() const override {
    return ObstacleForm{robot_, field_, space_, epsilon_m_, 1.0 / weight_};
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto dof = idx(states.dof);
    const std::size_t groups = float_groups(idx(states.count));
    const auto centres_m = scope.array<PointFloats>(groups * spheres_);
    const auto limits_m = scope.doubles(centres_m.size());
    const auto near = scope.array<FieldSample>(kFloatLanes * centres_m.size());
    for (std::size_t g = 0; g < groups; ++g) {
      std::ranges::copy(reach_m_, limits_m.begin() + static_cast<std::ptrdiff_t>(g * spheres_));
    }
    const auto axes =
        scope.array<float>(tree_ != nullptr ? tree_->axes_size(idx(states.count)) : 0);
    if (tree_ != nullptr) {
      tree_->sphere_centre_lanes(states.q, centres_m, axes, scratch);
    } else {
      find_centres(states, centres_m, scratch);
    }
    const std::size_t found = query_below_with_policy(*field_, space_, centres_m, limits_m, near);

    // Each is written once below, so that none need be constructed before.
    static_assert(sizeof(LinkForce) % sizeof(double) == 0);
    const auto room = scope.doubles(found * sizeof(LinkForce) / sizeof(double));
    const std::span forces(reinterpret_cast<LinkForce*>(room.data()), found);
    const auto residuals = scope.doubles(found);
    std::size_t count = 0;
    double sum = 0.0;
    for (std::size_t begin = 0, end = 0, group = 0; begin < found; begin = end, ++group) {
      // Sorted by lane, which is the state.
      std::array<std::size_t, kFloatLanes> at{};
      const std::size_t last = (group + 1) * kFloatLanes * spheres_;
      for (; end < found && near[end].point < last; ++end) ++at[near[end].point % kFloatLanes];
      const std::size_t real = idx(states.count) - group * kFloatLanes;
      for (std::size_t lane = 0; lane < kFloatLanes; ++lane) {
        const std::size_t in_lane = at[lane];
        at[lane] = count;
        if (lane < real) count += in_lane;
      }
      for (const FieldSample& sample : near.subspan(begin, end - begin)) {
        const std::size_t lane = sample.point % kFloatLanes;
        if (lane >= real) continue;
        const PointFloats& in_m = centres_m[sample.point / kFloatLanes];
        const std::size_t sphere = sample.point / kFloatLanes - group * spheres_;
        const Eigen::Vector3d centre_m =
            Eigen::Vector3f(in_m.x[lane], in_m.y[lane], in_m.z[lane]).cast<double>();
        const Eigen::Vector3d force = -weight_ * sample.gradient;
        const std::size_t k = at[lane]++;
        const double residual = weight_ * (reach_m_[sphere] - sample.distance_m);
        std::construct_at(&forces[k], static_cast<int>(group * kFloatLanes + lane), link_[sphere],
                          force, centre_m.cross(force));
        residuals[k] = residual;
        sum += residual * residual;
      }
    }
    if (0.5 * sum > out.rows_wanted_below()) return 0.5 * sum;
    const auto rows = scope.doubles(count * dof + kLanes);
    if (tree_ != nullptr) {
      tree_->pull_back_along(axes, forces.first(count), rows, scratch);
    } else {
      robot_->pull_back(states.q, forces.first(count), rows, scratch);
    }
    for (std::size_t begin = 0, end = 0; begin < count; begin = end) {
      while (end < count && forces[end].row == forces[begin].row) ++end;
      out.add_rows(range[idx(forces[begin].row)], rows.subspan(begin * dof, (end - begin) * dof),
                   residuals.subspan(begin, end - begin));
    }
    return 0.5 * sum;
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const std::size_t points = n * spheres_;
    const bool want_jacobian = !out.jacobian_q.empty();
    const auto centres_m = scope.array<Eigen::Vector3d>(points);
    const auto distances_m = scope.doubles(points);
    const auto statuses = scope.array<FieldStatus>(points);
    const auto gradients = scope.array<Eigen::Vector3d>(want_jacobian ? points : 0);

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
  /// For robots of other kinds.
  void find_centres(const StateBatch& states, std::span<PointFloats> centres_m,
                    Scratch& scratch) const {
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const auto in_lanes_m = scope.array<PointLanes>(padded(n) / kLanes * spheres_);
    robot_->sphere_centre_lanes(states.q, in_lanes_m, scratch);
    for (std::size_t i = 0; i < float_groups(n) * kFloatLanes; ++i) {
      const std::size_t state = std::min(i, n - 1);
      for (std::size_t s = 0; s < spheres_; ++s) {
        const PointLanes& from_m = in_lanes_m[state / kLanes * spheres_ + s];
        PointFloats& to_m = centres_m[i / kFloatLanes * spheres_ + s];
        to_m.x[i % kFloatLanes] = static_cast<float>(from_m.x[state % kLanes]);
        to_m.y[i % kFloatLanes] = static_cast<float>(from_m.y[state % kLanes]);
        to_m.z[i % kFloatLanes] = static_cast<float>(from_m.z[state % kLanes]);
      }
    }
  }

  /// Jacobians of the spheres are formed only for the states in which one is within reach.
  void differentiate(const StateBatch& states, std::span<const double> residuals,
                     std::span<const Eigen::Vector3d> gradients, std::span<double> jacobian,
                     Scratch& scratch) const {
    std::ranges::fill(jacobian, 0.0);
    Scratch::Scope scope(scratch);
    const auto n = idx(states.count);
    const auto dof = idx(states.dof);
    const auto active = scope.array<std::size_t>(n);
    const auto q_active = scope.doubles(n * dof);
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto row = residuals.subspan(i * spheres_, spheres_);
      if (std::ranges::all_of(row, [](double residual) { return residual == 0.0; })) continue;
      std::ranges::copy(states.q.subspan(i * dof, dof), q_active.begin() + count * dof);
      active[count++] = i;
    }
    if (count == 0) return;

    const auto centres_m = scope.array<Eigen::Vector3d>(count * spheres_);
    const auto columns = scope.array<Eigen::Vector3d>(count * spheres_ * dof);
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
  double epsilon_m_;
  double weight_;
  const KinematicTree* tree_;  ///< The robot, if it is one: its bodies are placed only once.
  std::size_t spheres_;
  std::vector<int> link_;        ///< Of each sphere.
  std::vector<double> reach_m_;  ///< Distance at which the cost of each sphere's centre begins.
};

class FloorCost final : public StateCost, public HasCostForm {
 public:
  FloorCost(std::shared_ptr<const RobotModel> robot, const Floor& floor, double epsilon_m,
            double sigma_m)
      : robot_(std::move(robot)),
        floor_(floor),
        epsilon_m_(epsilon_m),
        weight_(1.0 / sigma_m),
        all_spheres_(robot_->description().spheres.size()) {
    for (const int sphere : spheres_above(floor, robot_->description())) {
      const CollisionSphere& of = robot_->description().spheres[idx(sphere)];
      spheres_.push_back({idx(sphere), of.link, floor.height_m + epsilon_m + of.radius_m});
    }
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "floor"; }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(spheres_.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }
  [[nodiscard]] CostForm form() const override {
    return FloorForm{robot_, floor_, epsilon_m_, 1.0 / weight_};
  }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    return linearise_felt(*robot_, states, find_low(states, scope, scratch), range, out, scratch);
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    evaluate_felt(*robot_, states, find_low(states, scope, scratch), out, scratch);
  }

 private:
  struct Sphere {
    std::size_t index;  ///< Among all of the robot's.
    int link;
    double begins_m;  ///< Height of its centre at which its cost begins.
  };

  /// Calls visit(state, lane, sphere, centre) for each sphere that is too low, or whose height is
  /// not a number.
  template <class Visit>
  void each_low(int count, std::span<const PointLanes> centres_m, Visit visit) const {
    const auto states = idx(count);
    for (std::size_t first = 0; first < states; first += kLanes) {
      const PointLanes* group_m = &centres_m[first / kLanes * all_spheres_];
      bool any = false;  // seldom: the usual case is told from whole lanes
      for (const Sphere& sphere : spheres_) {
        for (const double z : group_m[sphere.index].z) any |= !(z >= sphere.begins_m);
      }
      for (std::size_t lane = 0; any && lane < std::min(kLanes, states - first); ++lane) {
        for (std::size_t s = 0; s < spheres_.size(); ++s) {
          const PointLanes& at_m = group_m[spheres_[s].index];
          if (at_m.z[lane] >= spheres_[s].begins_m) continue;
          visit(first + lane, s, Eigen::Vector3d(at_m.x[lane], at_m.y[lane], at_m.z[lane]));
        }
      }
    }
  }

  FeltSpheres find_low(const StateBatch& states, Scratch::Scope& scope, Scratch& scratch) const {
    const std::size_t groups = padded(idx(states.count)) / kLanes;
    const auto centres_m = scope.array<PointLanes>(groups * all_spheres_);
    robot_->sphere_centre_lanes(states.q, centres_m, scratch);
    std::size_t count = 0;
    each_low(states.count, centres_m,
             [&](std::size_t, std::size_t, const Eigen::Vector3d&) { ++count; });
    const FeltSpheres low = felt_spheres(count, scope);
    std::size_t k = 0;
    const Eigen::Vector3d force(0.0, 0.0, -weight_);
    each_low(
        states.count, centres_m,
        [&](std::size_t state, std::size_t s, const Eigen::Vector3d& centre_m) {
          low.residuals[k] = weight_ * (spheres_[s].begins_m - centre_m.z());
          low.forces[k] = {static_cast<int>(state), spheres_[s].link, force, centre_m.cross(force)};
          low.at[k++] = state * spheres_.size() + s;
        });
    return low;
  }

  std::shared_ptr<const RobotModel> robot_;
  Floor floor_;
  double epsilon_m_;
  double weight_;
  std::size_t all_spheres_;
  std::vector<Sphere> spheres_;
};

}  // namespace

void query_with_policy(const DistanceField& field, const SpacePolicy& policy,
                       std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients,
                       std::span<FieldStatus> statuses) noexcept {
  field.query(points_m, distances_m, gradients, statuses);
  Eigen::Vector3d unwanted = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    apply(policy, field.info().grid, points_m[i], statuses[i], distances_m[i],
          gradients.empty() ? unwanted : gradients[i]);
  }
}

std::size_t query_below_with_policy(const DistanceField& field, const SpacePolicy& policy,
                                    std::span<const PointFloats> points_m,
                                    std::span<const double> limits_m,
                                    std::span<FieldSample> samples) noexcept {
  const bool also_unknown = policy.unknown == Space::kOccupied;
  const std::size_t found = field.query_below(points_m, limits_m, also_unknown, samples);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < found; ++i) {
    FieldSample& sample = samples[i];
    const std::size_t block = sample.point / kFloatLanes, lane = sample.point % kFloatLanes;
    const PointFloats& in_m = points_m[block];
    apply(policy, field.info().grid, {in_m.x[lane], in_m.y[lane], in_m.z[lane]}, sample.status,
          sample.distance_m, sample.gradient);
    if (sample.distance_m >= limits_m[block]) continue;
    if (kept != i) samples[kept] = sample;
    ++kept;
  }
  return kept;
}

std::unique_ptr<StateCost> make_obstacle_cost(std::shared_ptr<const RobotModel> robot,
                                              std::shared_ptr<const DistanceField> field,
                                              SpacePolicy space, double epsilon_m, double sigma_m) {
  return std::make_unique<ObstacleCost>(std::move(robot), std::move(field), std::move(space),
                                        epsilon_m, sigma_m);
}

namespace {

bool is_of(const std::vector<std::string>& links, const RobotDescription& robot,
           std::size_t sphere) {
  const std::string& link = robot.links[idx(robot.spheres[sphere].link)].name;
  return std::ranges::find(links, link) != links.end();
}

}  // namespace

std::vector<int> spheres_above(const Floor& floor, const RobotDescription& robot) {
  std::vector<int> above;
  for (std::size_t s = 0; s < robot.spheres.size(); ++s) {
    const bool is_left_out =
        is_of(floor.except_links, robot, s) || is_of(floor.clear_links, robot, s);
    if (!is_left_out) above.push_back(static_cast<int>(s));
  }
  return above;
}

FloorClearance::FloorClearance(const SpacePolicy& space, const RobotDescription& robot)
    : touching_m_(robot.spheres.size(), -std::numeric_limits<double>::infinity()) {
  if (!space.floor) return;
  for (std::size_t s = 0; s < touching_m_.size(); ++s) {
    if (is_of(space.floor->except_links, robot, s)) continue;
    touching_m_[s] = space.floor->height_m + robot.spheres[s].radius_m;
  }
}

std::unique_ptr<StateCost> make_floor_cost(std::shared_ptr<const RobotModel> robot,
                                           const Floor& floor, double epsilon_m, double sigma_m) {
  return std::make_unique<FloorCost>(std::move(robot), floor, epsilon_m, sigma_m);
}

}  // namespace sidestep
