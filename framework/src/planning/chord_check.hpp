#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include <sidestep/trajectory/trajectory.hpp>

#include "edge_prover.hpp"

namespace sidestep {

/// Shows trajectories clear of exact shapes along chords: where several cubic pieces in a row keep
/// close to the straight line between their ends, as all of a sampled path between two corners
/// does, they are clear if that line is, by as much more as they are away from it. Says nothing of
/// trajectories that it cannot show clear: ClearanceProver tells what is wrong with them.
///
/// A piece lies within the convex hull of its Bezier control points, and so within the largest of
/// their distances from the chord; a configuration that is away from the chord by v_j in each joint
/// moves no sphere by more than the sum of lever_j v_j.
class ChordCheck {
 public:
  /// `levers`: by joint, at least those of every sphere and pair (motion_bounds.hpp).
  ChordCheck(std::shared_ptr<const RobotModel> robot, std::shared_ptr<const MotionBounds> bounds,
             std::span<const double> levers, std::shared_ptr<const SceneField> field,
             const SpacePolicy& space, double margin_m);

  /// Whether all of the trajectory from one of its states on is shown clear; chords that are not
  /// before no sphere moves more than `resolution_m` between looks end it. [any]
  [[nodiscard]] bool shows_clear(const Trajectory& trajectory, int from_state, double resolution_m,
                                 const Deadline& deadline) const;

 private:
  /// The last state that a chord from `first` may reach.
  [[nodiscard]] int chord_end(const Trajectory& trajectory, int first, double most_m) const;
  /// The largest distance of pieces from the chord between their ends, as motion of spheres.
  [[nodiscard]] double beside_m(const Trajectory& trajectory, int first, int last) const;

  std::vector<double> levers_;
  mutable std::mutex mutex_;  ///< Of what follows.
  mutable EdgeProver prover_;
};

}  // namespace sidestep
