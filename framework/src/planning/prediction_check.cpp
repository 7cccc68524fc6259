#include <sidestep/planning/prediction_check.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>

#include "cubic_motion.hpp"
#include "motion_bounds.hpp"

namespace sidestep {
namespace {

/// What is nearer to the margin than this is in conflict: advancing would take for ever.
constexpr double kClose_m = 1e-3;

/// At least the speed of every sphere's centre on a piece.
double fastest_mps(const CubicMotion& piece, std::span<const double> levers) {
  double sum_mps = 0.0;
  for (std::size_t j = 0; j < levers.size(); ++j) {
    const Cubic& cubic = piece.joints()[j];
    double speed = std::max(std::abs(cubic.v0), std::abs(cubic.velocity(piece.duration_s())));
    const double s = cubic.inflection();
    if (s > 0.0 && s < piece.duration_s()) speed = std::max(speed, std::abs(cubic.velocity(s)));
    sum_mps += levers[j] * speed;
  }
  return sum_mps;
}

}  // namespace

PredictionCheck::PredictionCheck(std::shared_ptr<const RobotModel> robot, double margin_m)
    : robot_(std::move(robot)),
      margin_m_(margin_m),
      levers_(idx(robot_->description().dof()), 0.0) {
  const MotionBounds bounds(*robot_);
  for (int s = 0; s < static_cast<int>(robot_->description().spheres.size()); ++s) {
    const auto levers = bounds.sphere_levers(s);
    for (std::size_t j = 0; j < levers_.size(); ++j) levers_[j] = std::max(levers_[j], levers[j]);
  }
}

std::optional<PredictedConflict> PredictionCheck::first_conflict(
    const Trajectory& trajectory, double from_s, const PredictionOnClock& predicted) const {
  const Prediction& prediction = *predicted.prediction;
  const double end_s = std::min(trajectory.duration_s(), prediction.end_s() - predicted.from_s);
  if (prediction.sets().empty() || from_s > end_s) return std::nullopt;
  const auto& spheres = robot_->description().spheres;
  std::vector<double> q(levers_.size()), distances_m(spheres.size());
  std::vector<Eigen::Vector3d> centres_m(spheres.size());
  Scratch scratch;
  std::optional<double> required_m;
  int state = 0;
  CubicMotion piece;
  double speed_mps = -1.0;  // of the piece; negative: not known yet
  for (double time_s = std::max(from_s, 0.0); time_s <= end_s;) {
    while (state + 2 < trajectory.size() && trajectory.times_s[idx(state) + 1] <= time_s) {
      ++state;
      speed_mps = -1.0;
    }
    if (speed_mps < 0.0) {
      speed_mps = 0.0;
      if (trajectory.size() > 1) {
        piece.take(trajectory, state);
        speed_mps = fastest_mps(piece, levers_);
      }
    }
    trajectory.sample(time_s, q, {});
    robot_->sphere_centres(q, centres_m, scratch);
    prediction.query(predicted.from_s + time_s, centres_m, distances_m, {});
    std::size_t nearest = 0;
    for (std::size_t s = 0; s < spheres.size(); ++s) {
      distances_m[s] -= spheres[s].radius_m;
      if (distances_m[s] < distances_m[nearest]) nearest = s;
    }
    const double clear_m = distances_m[nearest];
    if (!required_m) required_m = std::min(margin_m_, clear_m - 2.0 * kClose_m);
    if (!(clear_m > *required_m + kClose_m)) {
      return PredictedConflict{
          time_s, clear_m, spheres[nearest].link,
          prediction.nearest_track(predicted.from_s + time_s, centres_m[nearest])};
    }
    const double closing_mps = speed_mps + prediction.speed_mps();
    double step_s = closing_mps > 0.0 ? (clear_m - *required_m) / closing_mps
                                      : std::numeric_limits<double>::infinity();
    // Faster or slower pieces follow.
    const double piece_end_s = trajectory.times_s[idx(std::min(state + 1, trajectory.size() - 1))];
    if (piece_end_s > time_s) step_s = std::min(step_s, piece_end_s - time_s);
    if (time_s == end_s) break;
    time_s = std::min(time_s + step_s, end_s);
  }
  return std::nullopt;
}

}  // namespace sidestep
