#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include <sidestep/field/dense_field.hpp>
#include <sidestep/planning/problem.hpp>

#include "support/hsr.hpp"
#include "support/sampled_field.hpp"

namespace sidestep::testing_support {

/// A room of 6 x 6 m, as a perfect map would hold it: a table on four legs, a cupboard, a wall
/// with a door between the robot and the table.
class HsrRoom {
 public:
  explicit HsrRoom(double resolution_m) {
    grid_.origin_m = {-3.0, -3.0, 0.0};
    grid_.resolution_m = resolution_m;
    grid_.size_vox = (Eigen::Vector3d(6.0, 6.0, 2.0) / resolution_m).array().round().cast<int>();
    add({0.7, -0.6, 0.65}, {1.5, 0.6, 0.7});
    for (const double x : {0.7, 1.4}) {
      for (const double y : {-0.6, 0.5}) add({x, y, 0.0}, {x + 0.1, y + 0.1, 0.65});
    }
    add({-0.6, 1.6, 0.0}, {0.4, 2.0, 1.8});
    add({-1.0, -3.0, 0.0}, {-0.9, -0.5, 2.0});
    add({-1.0, 0.7, 0.0}, {-0.9, 3.0, 2.0});
  }

  [[nodiscard]] std::shared_ptr<const DistanceField> field() const {
    return sampled_field(grid_, [this](const Eigen::Vector3d& p) {
      // The nearest centre of a block of voxels to a voxel's centre is that of a box of centres.
      double least_m = 0.8;
      for (const auto& box : centres_) least_m = std::min(least_m, box.exteriorDistance(p));
      return least_m;
    });
  }

  /// Centres of the occupied voxels on the surfaces, leaving out about `holes` of them.
  [[nodiscard]] std::vector<Eigen::Vector3d> surface_centres(double holes) const {
    std::vector<Eigen::Vector3d> centres;
    unsigned state = 1;
    for (const auto& box : centres_) {
      const Eigen::Vector3i counts =
          (box.sizes() / grid_.resolution_m).array().round().cast<int>() + 1;
      for (int v = 0; v < counts.prod(); ++v) {
        const Eigen::Vector3i at(v % counts.x(), v / counts.x() % counts.y(),
                                 v / (counts.x() * counts.y()));
        state = state * 1664525u + 1013904223u;
        const bool is_inside = (at.array() > 0).all() && (at.array() < counts.array() - 1).all();
        if (is_inside || (state >> 8) < holes * (1u << 24)) continue;
        centres.push_back(box.min() + grid_.resolution_m * at.cast<double>());
      }
    }
    return centres;
  }

  /// From beside the wall, arm folded, through the door to reaching over the table.
  [[nodiscard]] Problem problem() const {
    Problem problem;
    problem.robot = load_hsr();
    problem.field = field();
    problem.space = {Space::kOccupied, Space::kOccupied};
    problem.collision_margin_m = 0.02;
    const int d = problem.robot->description().dof();
    problem.start = {Eigen::VectorXd::Zero(d), Eigen::VectorXd::Zero(d)};
    problem.goal = problem.start;
    problem.start.q << -2.0, -1.4, 1.2, 0.0, 0.0, -1.57, -1.57, 0.0;
    problem.goal.q << 0.3, 0.1, 0.0, 0.34, -0.9, 0.0, -0.67, 0.0;
    problem.support_states = 20;
    problem.dt_s = 0.5;
    problem.qc = Eigen::VectorXd::Ones(d);
    return problem;
  }

  [[nodiscard]] double resolution_m() const noexcept { return grid_.resolution_m; }

 private:
  /// A block of voxels by its corners, which lie on the grid.
  void add(const Eigen::Vector3d& lower, const Eigen::Vector3d& upper) {
    const double half = 0.5 * grid_.resolution_m;
    centres_.emplace_back(Eigen::Vector3d(lower.array() + half),
                          Eigen::Vector3d(upper.array() - half));
  }

  GridSpec grid_;
  std::vector<Eigen::AlignedBox3d> centres_;
};

}  // namespace sidestep::testing_support
