#include <algorithm>
#include <limits>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/cost_form.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/state_normals.hpp>

namespace sidestep {
namespace {

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
      spheres_.push_back(
          {static_cast<std::size_t>(sphere), of.link, floor.height_m + epsilon_m + of.radius_m});
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
    const Low low = find_low(states, scope, scratch);
    const auto dof = static_cast<std::size_t>(states.dof);
    const auto rows = scope.doubles(low.forces.size() * dof);
    robot_->pull_back(states.q, low.forces, rows, scratch);
    double sum = 0.0;
    for (std::size_t begin = 0, end = 0; begin < low.forces.size(); begin = end) {
      for (; end < low.forces.size() && low.forces[end].row == low.forces[begin].row; ++end) {
        sum += low.residuals[end] * low.residuals[end];
      }
      out.add_rows(range[idx(low.forces[begin].row)],
                   rows.subspan(begin * dof, (end - begin) * dof),
                   low.residuals.subspan(begin, end - begin));
    }
    return 0.5 * sum;
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    const Low low = find_low(states, scope, scratch);
    std::ranges::fill(out.residuals, 0.0);
    std::ranges::fill(out.jacobian_q, 0.0);
    std::ranges::fill(out.jacobian_qdot, 0.0);
    if (!out.residuals.empty()) {
      for (std::size_t k = 0; k < low.at.size(); ++k) out.residuals[low.at[k]] = low.residuals[k];
    }
    if (out.jacobian_q.empty()) return;
    const auto dof = static_cast<std::size_t>(states.dof);
    const auto rows = scope.doubles(low.forces.size() * dof);
    robot_->pull_back(states.q, low.forces, rows, scratch);
    for (std::size_t k = 0; k < low.at.size(); ++k) {
      std::ranges::copy(rows.subspan(k * dof, dof),
                        out.jacobian_q.begin() + static_cast<std::ptrdiff_t>(low.at[k] * dof));
    }
  }

 private:
  struct Sphere {
    std::size_t index;  ///< Among all of the robot's.
    int link;
    double begins_m;  ///< Height of its centre at which its cost begins.
  };

  /// The residuals that are not zero, in order of states.
  struct Low {
    std::span<double> residuals;
    std::span<LinkForce> forces;  ///< Their gradients by the spheres' centres.
    std::span<std::size_t> at;    ///< Their places among all residuals of the batch.
  };

  /// Calls visit(state, lane, sphere, centre) for each sphere that is too low, or whose height is
  /// not a number.
  template <class Visit>
  void each_low(int count, std::span<const PointLanes> centres_m, Visit visit) const {
    const auto states = static_cast<std::size_t>(count);
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

  Low find_low(const StateBatch& states, Scratch::Scope& scope, Scratch& scratch) const {
    const std::size_t groups = padded(static_cast<std::size_t>(states.count)) / kLanes;
    const auto centres_m = scope.array<PointLanes>(groups * all_spheres_);
    robot_->sphere_centre_lanes(states.q, centres_m, scratch);
    std::size_t count = 0;
    each_low(states.count, centres_m,
             [&](std::size_t, std::size_t, const Eigen::Vector3d&) { ++count; });
    const Low low{scope.doubles(count), scope.array<LinkForce>(count),
                  scope.array<std::size_t>(count)};
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

std::vector<int> spheres_above(const Floor& floor, const RobotDescription& robot) {
  std::vector<int> above;
  for (std::size_t s = 0; s < robot.spheres.size(); ++s) {
    const std::string& link = robot.links[idx(robot.spheres[s].link)].name;
    if (std::ranges::find(floor.except_links, link) != floor.except_links.end()) continue;
    above.push_back(static_cast<int>(s));
  }
  return above;
}

FloorClearance::FloorClearance(const SpacePolicy& space, const RobotDescription& robot)
    : touching_m_(robot.spheres.size(), -std::numeric_limits<double>::infinity()) {
  if (!space.floor) return;
  for (const int sphere : spheres_above(*space.floor, robot)) {
    const auto s = static_cast<std::size_t>(sphere);
    touching_m_[s] = space.floor->height_m + robot.spheres[s].radius_m;
  }
}

std::unique_ptr<StateCost> make_floor_cost(std::shared_ptr<const RobotModel> robot,
                                           const Floor& floor, double epsilon_m, double sigma_m) {
  return std::make_unique<FloorCost>(std::move(robot), floor, epsilon_m, sigma_m);
}

}  // namespace sidestep
