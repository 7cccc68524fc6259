#include <sidestep/planning/prediction.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include <Eigen/Geometry>

#include <sidestep/core/index.hpp>
#include <sidestep/core/scratch.hpp>

namespace sidestep {
namespace {

/// A set at one time.
struct Disc {
  Eigen::Vector2d centre_m;
  double radius_m;
};

/// Where a set is between the knot that `next` points at and the one before.
Disc between(const PredictedSet::Knot& before, const PredictedSet::Knot& next, double time_s) {
  const double share = (time_s - before.time_s) / (next.time_s - before.time_s);
  return {before.centre_m + share * (next.centre_m - before.centre_m),
          before.radius_m + share * (next.radius_m - before.radius_m)};
}

/// False where the set is nowhere at that time.
bool at(const PredictedSet& set, double time_s, Disc& disc) {
  const auto& knots = set.knots;
  if (!(time_s >= knots.front().time_s) || !(time_s <= knots.back().time_s)) return false;
  const auto next = std::ranges::upper_bound(knots, time_s, {}, &PredictedSet::Knot::time_s);
  if (next == knots.end()) {
    disc = {knots.back().centre_m, knots.back().radius_m};
  } else {
    disc = between(*(next - 1), *next, time_s);
  }
  return true;
}

/// Signed distance to an upright cylinder, and its gradient.
double distance_to(const Disc& disc, double bottom_m, double top_m, const Eigen::Vector3d& p,
                   Eigen::Vector3d& gradient) {
  const Eigen::Vector2d out = p.head<2>() - disc.centre_m;
  const double axis_m = out.norm();
  const Eigen::Vector2d outward =
      axis_m > 0.0 ? Eigen::Vector2d(out / axis_m) : Eigen::Vector2d::UnitX();
  const double beside_m = axis_m - disc.radius_m;
  const bool is_nearer_top = p.z() - bottom_m > top_m - p.z();
  const double above_m = is_nearer_top ? p.z() - top_m : bottom_m - p.z();
  const double up = is_nearer_top ? 1.0 : -1.0;
  if (beside_m > 0.0 && above_m > 0.0) {
    const double distance_m = std::hypot(beside_m, above_m);
    gradient << beside_m / distance_m * outward, up * above_m / distance_m;
    return distance_m;
  }
  if (beside_m >= above_m) {
    gradient << outward, 0.0;
    return beside_m;
  }
  gradient = up * Eigen::Vector3d::UnitZ();
  return above_m;
}

/// What is wrong with a set; empty if nothing is.
std::string mistake_in(const PredictedSet& set) {
  if (!(set.likelihood > 0.0) || !(set.likelihood <= 1.0)) return "a likelihood outside (0, 1]";
  if (!std::isfinite(set.bottom_m) || !std::isfinite(set.top_m) || set.top_m < set.bottom_m) {
    return "no height";
  }
  if (set.knots.empty()) return "no knots";
  double last_s = -std::numeric_limits<double>::infinity();
  for (const PredictedSet::Knot& knot : set.knots) {
    if (!std::isfinite(knot.time_s) || !knot.centre_m.allFinite() ||
        !std::isfinite(knot.radius_m)) {
      return "a number that is not finite";
    }
    if (knot.radius_m < 0.0) return "a negative radius";
    if (knot.time_s <= last_s) return "knots that are out of order";
    last_s = knot.time_s;
  }
  return {};
}

}  // namespace

Result<Prediction> Prediction::create(Stamp stamp, std::vector<PredictedSet> sets) {
  Prediction prediction;
  for (const PredictedSet& set : sets) {
    if (const std::string mistake = mistake_in(set); !mistake.empty()) {
      return fail(ErrorCode::kInvalidArgument,
                  "the predicted set of track " + std::to_string(set.track) + " has " + mistake);
    }
    prediction.end_s_ = std::max(prediction.end_s_, set.knots.back().time_s);
    for (std::size_t k = 1; k < set.knots.size(); ++k) {
      const PredictedSet::Knot &a = set.knots[k - 1], &b = set.knots[k];
      const double approach_m =
          (b.centre_m - a.centre_m).norm() + std::max(0.0, b.radius_m - a.radius_m);
      prediction.speed_mps_ = std::max(prediction.speed_mps_, approach_m / (b.time_s - a.time_s));
    }
  }
  prediction.stamp_ = stamp;
  prediction.sets_ = std::move(sets);
  return prediction;
}

void Prediction::query(double time_s, std::span<const Eigen::Vector3d> points_m,
                       std::span<double> distances_m,
                       std::span<Eigen::Vector3d> gradients) const noexcept {
  std::ranges::fill(distances_m, std::numeric_limits<double>::infinity());
  std::ranges::fill(gradients, Eigen::Vector3d::Zero());
  Disc disc;
  Eigen::Vector3d gradient;
  for (const PredictedSet& set : sets_) {
    if (!at(set, time_s, disc)) continue;
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      // Most sets are farther off than one that has been seen: told without a root.
      constexpr double kRounding = 1.0 + 1e-12;
      const double nearer_m = disc.radius_m + std::max(0.0, distances_m[i]);
      const double off_m2 = (points_m[i].head<2>() - disc.centre_m).squaredNorm();
      if (off_m2 > kRounding * nearer_m * nearer_m) continue;
      const double distance_m = distance_to(disc, set.bottom_m, set.top_m, points_m[i], gradient);
      if (!(distance_m < distances_m[i])) continue;
      distances_m[i] = distance_m;
      if (!gradients.empty()) gradients[i] = gradient;
    }
  }
}

std::int64_t Prediction::nearest_track(double time_s, const Eigen::Vector3d& p_m) const noexcept {
  std::int64_t track = 0;
  double nearest_m = std::numeric_limits<double>::infinity();
  Disc disc;
  Eigen::Vector3d gradient;
  for (const PredictedSet& set : sets_) {
    if (!at(set, time_s, disc)) continue;
    const double distance_m = distance_to(disc, set.bottom_m, set.top_m, p_m, gradient);
    if (!(distance_m < nearest_m)) continue;
    nearest_m = distance_m;
    track = set.track;
  }
  return track;
}

double position_deviation_m(const Track& track) noexcept {
  // The larger eigenvalue of a symmetric 2 x 2 matrix.
  const double xx = track.covariance(0, 0), yy = track.covariance(1, 1);
  const double xy = 0.5 * (track.covariance(0, 1) + track.covariance(1, 0));
  const double largest_m2 = 0.5 * (xx + yy) + std::hypot(0.5 * (xx - yy), xy);
  return std::sqrt(std::max(largest_m2, 0.0));  // keeps NaN
}

Result<void> check_tracks(const Tracks& tracks) {
  for (const Track& track : tracks.tracks) {
    const std::string name = "track " + std::to_string(track.id);
    if (!track.position_m.allFinite() || !track.velocity_mps.allFinite() ||
        !track.covariance.allFinite() || !std::isfinite(track.radius_m) ||
        !std::isfinite(track.bottom_m) || !std::isfinite(track.top_m)) {
      return invalid(name + " has a number that is not finite");
    }
    if (track.radius_m < 0.0) return invalid(name + " has a negative radius");
    if (track.top_m < track.bottom_m) return invalid(name + " has its top below its bottom");
  }
  return {};
}

Result<Prediction> worst_case_prediction(const Tracks& tracks, double speed_mps, double horizon_s,
                                         double sigmas) {
  SIDESTEP_TRY(check_tracks(tracks));
  std::vector<PredictedSet> sets;
  for (const Track& track : tracks.tracks) {
    // Where it is out of sight, its position is a guess: it went on as it went. Meanwhile it may
    // have turned.
    const double unseen_s = std::max(0.0, (tracks.stamp.ns - track.last_seen.ns) * 1e-9);
    const double radius_m = track.radius_m + sigmas * position_deviation_m(track) +
                            (speed_mps + track.velocity_mps.norm()) * unseen_s;
    PredictedSet& set = sets.emplace_back();
    set.track = track.id;
    set.bottom_m = track.bottom_m;
    set.top_m = track.top_m;
    set.knots = {{0.0, track.position_m, radius_m}};
    if (horizon_s > 0.0) {
      set.knots.push_back({horizon_s, track.position_m, radius_m + speed_mps * horizon_s});
    }
  }
  return Prediction::create(tracks.stamp, std::move(sets));
}

RobotFootprint footprint(const RobotModel& robot, const RobotState& state) {
  const auto& spheres = robot.description().spheres;
  const std::size_t count = spheres.size();
  std::vector<Eigen::Vector3d> centres_m(2 * count);
  constexpr double kStep_s = 1e-3;  // for the velocity
  const Eigen::VectorXd soon = state.q + kStep_s * state.qdot;
  Scratch scratch;
  robot.sphere_centres(as_span(state.q), std::span(centres_m).first(count), scratch);
  robot.sphere_centres(as_span(soon), std::span(centres_m).last(count), scratch);
  Eigen::AlignedBox2d box, later;
  for (std::size_t s = 0; s < count; ++s) {
    const Eigen::Vector2d reach = Eigen::Vector2d::Constant(spheres[s].radius_m);
    for (auto [into, at] : {std::pair(&box, s), std::pair(&later, count + s)}) {
      const Eigen::Vector2d p = centres_m[at].head<2>();
      into->extend(p - reach);
      into->extend(p + reach);
    }
  }
  RobotFootprint footprint;
  if (box.isEmpty()) return footprint;
  footprint.position_m = box.center();
  footprint.velocity_mps = (later.center() - box.center()) / kStep_s;
  footprint.radius_m = 0.5 * box.sizes().maxCoeff();
  return footprint;
}

Predictor::~Predictor() = default;
PredictionSubject Predictor::subject() const noexcept { return PredictionSubject::kTracks; }

}  // namespace sidestep
