#include <limits>
#include <memory>
#include <utility>
#include <vector>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/prediction.hpp>
#include <sidestep/planning/residual_names.hpp>

#include "felt_spheres.hpp"

namespace sidestep {
namespace {

class MovingObstacleCost final : public StateCost, public NamesResiduals {
 public:
  MovingObstacleCost(std::shared_ptr<const RobotModel> robot,
                     std::shared_ptr<const Prediction> prediction, double prediction_from_s,
                     double epsilon_m, double sigma_m)
      : robot_(std::move(robot)),
        prediction_(std::move(prediction)),
        from_s_(prediction_from_s),
        weight_(1.0 / sigma_m) {
    for (const CollisionSphere& sphere : robot_->description().spheres) {
      reach_m_.push_back(epsilon_m + sphere.radius_m);
    }
  }

  [[nodiscard]] std::string_view name() const noexcept override { return "moving"; }
  [[nodiscard]] int residual_count() const noexcept override {
    return static_cast<int>(reach_m_.size());
  }
  [[nodiscard]] bool depends_on_velocity() const noexcept override { return false; }

  double linearise(const StateBatch& states, const StateRange& range, StateNormals& out,
                   Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    return linearise_felt(*robot_, states, find_near(states, scope, scratch), range, out, scratch);
  }

  void evaluate(const StateBatch& states, const CostBatch& out, Scratch& scratch) const override {
    Scratch::Scope scope(scratch);
    evaluate_felt(*robot_, states, find_near(states, scope, scratch), out, scratch);
  }

  [[nodiscard]] ResidualName residual_name(int residual) const override {
    const RobotDescription& robot = robot_->description();
    const int link = robot.spheres[idx(residual)].link;
    return {robot.links[idx(link)].name, "", "its distance to what moves", "m", 1.0 / weight_};
  }

 private:
  FeltSpheres find_near(const StateBatch& states, Scratch::Scope& scope, Scratch& scratch) const {
    const auto n = idx(states.count);
    const std::size_t spheres = reach_m_.size(), points = n * spheres;
    const auto centres_m = scope.array<Eigen::Vector3d>(points);
    const auto distances_m = scope.doubles(points);
    const auto gradients = scope.array<Eigen::Vector3d>(points);
    robot_->sphere_centres(states.q, centres_m, scratch);
    std::size_t count = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t first = i * spheres;
      prediction_->query(from_s_ + states.times_s[i], centres_m.subspan(first, spheres),
                         distances_m.subspan(first, spheres), gradients.subspan(first, spheres));
      for (std::size_t s = 0; s < spheres; ++s) {
        double& distance_m = distances_m[first + s];
        if (!centres_m[first + s].allFinite()) {
          distance_m = std::numeric_limits<double>::quiet_NaN();
        }
        if (!(distance_m >= reach_m_[s])) ++count;
      }
    }
    const FeltSpheres near = felt_spheres(count, scope);
    for (std::size_t at = 0, k = 0; k < count; ++at) {
      const std::size_t s = at % spheres;
      if (distances_m[at] >= reach_m_[s]) continue;
      const Eigen::Vector3d force = -weight_ * gradients[at];
      near.residuals[k] = weight_ * (reach_m_[s] - distances_m[at]);
      near.forces[k] = {static_cast<int>(at / spheres), robot_->description().spheres[s].link,
                        force, centres_m[at].cross(force)};
      near.at[k++] = at;
    }
    return near;
  }

  std::shared_ptr<const RobotModel> robot_;
  std::shared_ptr<const Prediction> prediction_;
  double from_s_;
  double weight_;
  std::vector<double> reach_m_;  ///< Distance at which the cost of each sphere's centre begins.
};

}  // namespace

std::unique_ptr<StateCost> make_moving_obstacle_cost(std::shared_ptr<const RobotModel> robot,
                                                     std::shared_ptr<const Prediction> prediction,
                                                     double prediction_from_s, double epsilon_m,
                                                     double sigma_m) {
  return std::make_unique<MovingObstacleCost>(std::move(robot), std::move(prediction),
                                              prediction_from_s, epsilon_m, sigma_m);
}

}  // namespace sidestep
