#pragma once

#include <memory>
#include <string>
#include <vector>

#include <sidestep/core/scratch.hpp>
#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/optimiser.hpp>
#include <sidestep/plugin/parameters.hpp>

#include "waypoints.hpp"

namespace sidestep {

/// CHOMP's cost of a clearance and its derivative (Ratliff 2009, eq. 21): 0 beyond epsilon, then a
/// parabola down to contact, then a straight line.
struct ClearanceCost {
  double value;
  double slope;
};
[[nodiscard]] ClearanceCost clearance_cost(double clearance_m, double epsilon_m) noexcept;

/// CHOMP's obstacle functional (Zucker 2013, eq. 6): the sum over the robot's spheres of the
/// integral of their clearance's cost along the way of their centres, in m^2,
///
///     F = sum_b sum_s c(d_b(s)) |x_b(s + 1) - x_b(s - 1)| / 2
///
/// over all states s between the ends. It depends on where a sphere goes, not on how fast. Its
/// gradient is exact; with ever shorter steps it becomes the paper's functional gradient,
/// |x'| ((I - x' x'^T / |x'|^2) grad c - c kappa), which never hurries a sphere along its own way.
/// Clearances are those of the problem's field under its space policy, and of its floor, whichever
/// is less. One thread at a time.
class ObstacleFunctional {
 public:
  /// The problem, which must outlive the object, needs a field or a floor for this not to be 0.
  ObstacleFunctional(const Problem& problem, double epsilon_m);

  /// F; adds `weight` times its gradient by all waypoints.
  [[nodiscard]] double add_gradient(const WaypointStates& states, double weight,
                                    Waypoints& gradient);

 private:
  void find_costs(const WaypointStates& states);
  [[nodiscard]] double push_centres();
  void pull_back(const WaypointStates& states, double weight, Waypoints& gradient);

  const Problem* problem_;
  double epsilon_m_;
  FloorClearance floor_;
  std::size_t spheres_;
  std::vector<Eigen::Vector3d> centres_m_;  ///< State by state.
  std::vector<double> clearance_m_;
  std::vector<Eigen::Vector3d> gradients_;  ///< Of the clearances.
  std::vector<FieldStatus> statuses_;
  std::vector<Eigen::Vector3d> pushes_;  ///< dF / dx.
  std::vector<LinkForce> forces_;
  std::vector<double> joint_forces_;
  Eigen::MatrixXd by_q_, by_qdot_;
  Scratch scratch_;
};

/// Weights, step lengths and stopping rule.
struct ChompSettings {
  std::string smoothness = "acceleration";  ///< Or "velocity": what the metric A is made of.
  double smoothness_weight = 1.0;
  double obstacle_weight = 1e4;  ///< 1/m^2
  double epsilon_m = 0.05;       ///< Obstacles are felt this far from a sphere.
  double learning_rate = 0.2;    ///< The longest step: 1 / eta.
  double limit_margin = 0.01;    ///< m, rad
  double relative_tolerance = 1e-3;
  int patience = 10;  ///< Iterations over which the tolerance applies.
  int max_iterations = 2000;

  static Parameters<ChompSettings> parameters();
};

/// Covariant gradient descent between fixed ends: see README.md.
[[nodiscard]] std::unique_ptr<Optimiser> make_chomp(const ChompSettings& settings);

}  // namespace sidestep
