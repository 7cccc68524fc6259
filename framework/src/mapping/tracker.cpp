#include <sidestep/mapping/tracker.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <utility>

#include <Eigen/LU>

#include <sidestep/core/index.hpp>
#include "surface_points.hpp"

namespace sidestep {
namespace {

/// A thing that nothing is known of yet.
constexpr double kUsualRadius_m = 0.25;
constexpr double kLeastRadius_m = 0.05, kGreatestRadius_m = 0.45;
/// Points so far outside of where a thing is expected may be its own.
constexpr double kBeside_m = 0.15;
constexpr double kFarthestSearch_m = 0.6;
/// By as many rays it is seen whether a thing ends, across and down.
constexpr int kRays = 3;
/// So much space behind a stray has been seen free, too.
constexpr double kOpen_m = 0.3;
/// Points of one cell are one stray.
constexpr double kCell_m = 0.25;
constexpr double kAboveAndBelow_m = 0.2;
/// Fewer points show nothing, and fewer voxels are nothing that stands.
constexpr std::size_t kLeastPoints = 4;
constexpr int kLeastVoxels = 5;
/// Things that are slower stand.
constexpr double kStanding_mps = 0.15;
/// What never got so far from its place, and has stopped, was flicker.
constexpr double kLeastWay_m = 0.15;
constexpr double kFlicker_s = 2.0;
constexpr double kLeastSurvival_s = 0.3;
/// Share of the points on either side that may be noise of the edges.
constexpr double kTrimmed = 0.02;
/// A thing that shows less of its width is partly hidden.
constexpr double kShownWhole = 0.75;
/// Shares of the difference by which a radius follows what is seen: edges may be hidden.
constexpr double kWiden = 0.3, kNarrow = 0.03;
/// Chi-squared of two degrees of freedom, far beyond 99.9 %.
constexpr double kGate = 25.0;

double quantile(std::vector<double>& values, double share) {
  const auto at = std::lround(share * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, values.begin() + at);
  return values[idx(at)];
}

/// Distance of a place to a thing's side, negative inside.
double beside_m(const Track& track, const Eigen::Vector2d& p) {
  return (p - track.position_m).norm() - track.radius_m;
}

}  // namespace

std::shared_ptr<const Tracks> Tracker::update(const OccupancyView& map,
                                              const MovingObstacles& moving, const Frame& frame) {
  const Stamp stamp = frame.stamp;
  if (stamp < stamp_) things_.clear();
  // The mapper has refused frames whose joints are not the robot's.
  (void)self_.pose(frame);
  mask_.begin(map, stamp);
  for (Thing& thing : things_) predict(thing, stamp.seconds() - stamp_.seconds());
  stamp_ = stamp;
  // All are measured before any is corrected: points go to the nearest of where all should be.
  std::vector<std::optional<Sighting>> sightings;
  sightings.reserve(things_.size());
  for (const Thing& thing : things_) sightings.push_back(look_for(thing, frame));
  for (std::size_t i = 0; i < things_.size(); ++i) {
    if (sightings[i]) correct(things_[i], *sightings[i], stamp);
  }
  remove_doubles(stamp);
  find_strays(map, frame);
  note_motion(moving, stamp);
  find_new(moving.balls, frame);
  find_new(strays_, frame);
  end_lost(stamp);
  auto tracks = claim(frame);
  for (const SelfFilter::Ball& ball : self_.balls()) {
    mask_.claim_ball(ball.centre_m, ball.radius_m);
  }
  mask_.end(frame);
  return tracks;
}

void Tracker::predict(Thing& thing, double dt_s) const {
  if (thing.is_held) return;
  Track& track = thing.track;
  if (track.last_seen < stamp_ && track.velocity_mps.norm() < kStanding_mps) {
    track.velocity_mps.setZero();
  }
  track.position_m += dt_s * track.velocity_mps;
  Eigen::Matrix4d step = Eigen::Matrix4d::Identity();
  step.topRightCorner<2, 2>().diagonal().setConstant(dt_s);
  const double a2 = settings_.acceleration_mps2 * settings_.acceleration_mps2;
  Eigen::Matrix4d noise = Eigen::Matrix4d::Zero();
  noise.topLeftCorner<2, 2>().diagonal().setConstant(0.25 * a2 * std::pow(dt_s, 4));
  noise.topRightCorner<2, 2>().diagonal().setConstant(0.5 * a2 * std::pow(dt_s, 3));
  noise.bottomLeftCorner<2, 2>() = noise.topRightCorner<2, 2>();
  noise.bottomRightCorner<2, 2>().diagonal().setConstant(a2 * dt_s * dt_s);
  track.covariance = (step * track.covariance * step.transpose() + noise).eval();
}

std::optional<Tracker::Sighting> Tracker::look_for(const Thing& thing, const Frame& frame) {
  const Track& track = thing.track;
  const double sigma_m = std::sqrt(track.covariance.topLeftCorner<2, 2>().diagonal().maxCoeff());
  const SearchCylinder where{
      track.position_m, track.radius_m + kBeside_m + std::min(2.0 * sigma_m, kFarthestSearch_m),
      std::max(settings_.floor_m, track.bottom_m - kAboveAndBelow_m),
      track.top_m + kAboveAndBelow_m};
  rivals_.clear();
  for (const Thing& other : things_) {
    // A point there may be nearer to its side than to this one's.
    const double apart_m = (other.track.position_m - track.position_m).norm();
    const double reach_m = 2.0 * where.radius_m + other.track.radius_m - track.radius_m;
    if (&other != &thing && apart_m < reach_m) rivals_.push_back(other.track);
  }
  const double spacing_m = find_surface_points(frame, where, points_);
  const Eigen::Vector3d eye_m = frame.T_world_camera.translation();
  std::erase_if(points_, [&](const Eigen::Vector3d& p) {
    const double its_m = beside_m(track, p.head<2>());
    return std::ranges::any_of(
               rivals_, [&](const Track& rival) { return beside_m(rival, p.head<2>()) < its_m; }) ||
           may_be_settled(p, eye_m) || self_.contains(p);
  });
  return fit(thing, eye_m.head<2>(), spacing_m);
}

/// Whether a point is on something that stands, as far as the camera's noise can tell.
bool Tracker::may_be_settled(const Eigen::Vector3d& p, const Eigen::Vector3d& eye_m) const {
  const double edge_m = mask_.resolution_m();
  const double distance_m = (p - eye_m).norm();
  const Eigen::Vector3d step_m = (p - eye_m) * (2.0 * edge_m / distance_m);
  const int steps = static_cast<int>(std::round(0.5 * depth_noise_m(distance_m) / edge_m));
  for (int step = -steps; step <= steps; ++step) {
    if (mask_.is_settled_near(p + step * step_m)) return true;
  }
  return false;
}

std::optional<Tracker::Sighting> Tracker::fit(const Thing& thing, const Eigen::Vector2d& eye_m,
                                              double spacing_m) {
  const Track& track = thing.track;
  const double radius_m = track.radius_m;
  const double within_m = radius_m + kBeside_m;
  if (points_.size() < kLeastPoints) return std::nullopt;
  Sighting sighting;
  sighting.position_m = track.position_m;
  const auto distance2 = [&](const Eigen::Vector3d& p) {
    return (p.head<2>() - track.position_m).squaredNorm();
  };
  const Eigen::Vector3d nearest = *std::ranges::min_element(points_, {}, distance2);
  if (distance2(nearest) > within_m * within_m) {
    sighting.position_m = nearest.head<2>() + radius_m * (nearest.head<2>() - eye_m).normalized();
  }
  for (int round = 0; round < 2; ++round) {
    chosen_.clear();
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const Eigen::Vector3d& p : points_) {
      if ((p.head<2>() - sighting.position_m).squaredNorm() > within_m * within_m) continue;
      chosen_.emplace_back(p.head<2>());
      sum += p.head<2>();
    }
    if (chosen_.size() < kLeastPoints) return std::nullopt;
    const Eigen::Vector2d sight = (sum / static_cast<double>(chosen_.size()) - eye_m).normalized();
    const Eigen::Vector2d side(-sight.y(), sight.x());
    across_m_.clear();
    for (const Eigen::Vector2d& p : chosen_) across_m_.push_back(side.dot(p - eye_m));
    const double low = quantile(across_m_, kTrimmed), high = quantile(across_m_, 1.0 - kTrimmed);
    sighting.half_width_m = 0.5 * (high - low + spacing_m);
    double across = 0.5 * (low + high), hidden_m = 0.0;
    if (sighting.half_width_m < kShownWhole * radius_m) {
      // One of the edges is hidden, or both: which, the thing's motion tells best.
      hidden_m = radius_m - sighting.half_width_m;
      const double expected = side.dot(track.position_m - eye_m);
      across = std::clamp(expected, across - hidden_m, across + hidden_m);
    }
    along_m_.clear();
    for (const Eigen::Vector2d& p : chosen_) {
      const double beside = side.dot(p - eye_m) - across;
      along_m_.push_back(sight.dot(p - eye_m) +
                         std::sqrt(std::max(0.0, radius_m * radius_m - beside * beside)));
    }
    sighting.position_m = eye_m + quantile(along_m_, 0.5) * sight + across * side;
    const double sigma2 = settings_.measurement_m * settings_.measurement_m;
    sighting.covariance =
        sigma2 * Eigen::Matrix2d::Identity() + hidden_m * hidden_m * side * side.transpose();
  }
  return sighting;
}

void Tracker::correct(Thing& thing, const Sighting& sighting, Stamp stamp) const {
  Track& track = thing.track;
  const Eigen::Vector2d innovation = sighting.position_m - track.position_m;
  const Eigen::Matrix2d spread = track.covariance.topLeftCorner<2, 2>() + sighting.covariance;
  const Eigen::Matrix2d inverse = spread.inverse();
  if (innovation.dot(inverse * innovation) > kGate) return;
  const Eigen::Matrix<double, 4, 2> gain = track.covariance.leftCols<2>() * inverse;
  const Eigen::Vector4d change = gain * innovation;
  track.position_m += change.head<2>();
  track.velocity_mps += change.tail<2>();
  track.covariance = (track.covariance - gain * spread * gain.transpose()).eval();
  const double wider_m = sighting.half_width_m - track.radius_m;
  track.radius_m += (wider_m > 0.0 ? kWiden : kNarrow) * wider_m;
  track.radius_m = std::clamp(track.radius_m, kLeastRadius_m, kGreatestRadius_m);
  track.last_seen = stamp;
  thing.farthest_m = std::max(thing.farthest_m, (track.position_m - thing.first_m).norm());
}

/// Points in voxels that are free: voxels are occupied some frames later, and what comes straight
/// at the camera at 1.6 m/s, seen at 10 Hz, has left each of them before.
void Tracker::find_strays(const OccupancyView& map, const Frame& frame) {
  const GridSpec& grid = map.occupancy_grid();
  const VoxelBits known = map.known(), occupied = map.occupied();
  const Eigen::Vector3d eye_m = frame.T_world_camera.translation();
  const auto is_free = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector3i voxel = grid.voxel_at(p);
    return grid.contains(voxel) && known.at(grid, voxel) && !occupied.at(grid, voxel);
  };
  // What stands is measured too near by its noise, and what comes into range has unseen space
  // behind it.
  const auto is_in_the_open = [&](const Eigen::Vector3d& p) {
    const double distance_m = (p - eye_m).norm();
    const double behind_m = std::max(kOpen_m, depth_noise_m(distance_m));
    const Eigen::Vector3d voxel_on = (p - eye_m) * (grid.resolution_m / distance_m);
    const int steps = static_cast<int>(std::ceil(behind_m / grid.resolution_m));
    for (int step = 0; step <= steps; ++step) {
      const Eigen::Vector3d at = p + step * voxel_on;
      if (!is_free(at) || mask_.is_occupied_near(at)) return false;
    }
    return true;
  };
  sample_points(frame, points_);
  std::erase_if(points_, [&](const Eigen::Vector3d& p) {
    return p.z() < settings_.floor_m || !is_in_the_open(p) || self_.contains(p);
  });
  struct Cell {
    Eigen::Vector3d sum_m = Eigen::Vector3d::Zero();
    std::size_t count = 0;
  };
  std::map<std::array<double, 2>, Cell> cells;
  for (const Eigen::Vector3d& p : points_) {
    Cell& cell = cells[{std::floor(p.x() / kCell_m), std::floor(p.y() / kCell_m)}];
    cell.sum_m += p;
    ++cell.count;
  }
  strays_.clear();
  for (const auto& [key, cell] : cells) {
    if (cell.count < kLeastPoints) continue;
    strays_.push_back({cell.sum_m / static_cast<double>(cell.count), 0.5 * kCell_m});
  }
}

/// What is seen to move, and a frame shows, is hit; often enough, it is confirmed. Strays alone may
/// be flicker, which stays where it is.
void Tracker::note_motion(const MovingObstacles& moving, Stamp stamp) {
  for (Thing& thing : things_) {
    const auto is_at = [&](const MovingBall& ball) {
      return beside_m(thing.track, ball.centre_m.head<2>()) < kBeside_m;
    };
    const bool moves = (thing.is_confirmed && thing.track.velocity_mps.norm() > kStanding_mps) ||
                       std::ranges::any_of(moving.balls, is_at) ||
                       (thing.farthest_m > kLeastWay_m && std::ranges::any_of(strays_, is_at));
    if (!moves || thing.track.last_seen != stamp) continue;
    thing.moved = stamp;
    if (thing.is_confirmed || ++thing.hits < settings_.confirming_hits) continue;
    thing.is_confirmed = true;
    thing.track.id = next_id_++;
  }
}

void Tracker::find_new(const std::vector<MovingBall>& balls, const Frame& frame) {
  for (const MovingBall& ball : balls) {
    const bool is_known = std::ranges::any_of(things_, [&](const Thing& thing) {
      return beside_m(thing.track, ball.centre_m.head<2>()) < 2.0 * kBeside_m;
    });
    if (is_known) continue;
    Thing thing;
    Track& track = thing.track;
    track.position_m = ball.centre_m.head<2>();
    track.covariance.setZero();
    track.covariance.topLeftCorner<2, 2>().diagonal().setConstant(kBeside_m * kBeside_m);
    track.radius_m = kUsualRadius_m;
    track.bottom_m = settings_.floor_m;  // it stands on the floor until that is seen otherwise
    track.top_m = std::max(ball.centre_m.z() + ball.radius_m, settings_.floor_m);
    const auto sighting = look_for(thing, frame);
    if (!sighting) continue;
    track.position_m = thing.first_m = sighting->position_m;
    track.covariance.topLeftCorner<2, 2>() = sighting->covariance;
    track.covariance.bottomRightCorner<2, 2>().diagonal().setConstant(settings_.start_speed_mps *
                                                                      settings_.start_speed_mps);
    track.radius_m = std::clamp(sighting->half_width_m, kLeastRadius_m, kGreatestRadius_m);
    track.first_seen = track.last_seen = thing.moved = frame.stamp;
    thing.hits = 1;
    things_.push_back(std::move(thing));
  }
}

/// Two cylinders of solid things do not hold each other's axes: the later one is the same thing, as
/// is one that overlaps another and is not confirmed.
void Tracker::remove_doubles(Stamp stamp) {
  const auto is_double = [&](const Thing& thing) {
    return std::ranges::any_of(things_, [&](const Thing& other) {
      if (&other == &thing || thing.track.last_seen != stamp || other.track.last_seen != stamp) {
        return false;
      }
      const bool is_later =
          thing.is_confirmed != other.is_confirmed
              ? other.is_confirmed
              : thing.track.first_seen > other.track.first_seen ||
                    (thing.track.first_seen == other.track.first_seen && &thing > &other);
      const double overlap_m = thing.is_confirmed ? 0.0 : thing.track.radius_m;
      return is_later && beside_m(other.track, thing.track.position_m) < overlap_m;
    });
  };
  std::vector<Thing> kept;
  std::ranges::copy_if(things_, std::back_inserter(kept), std::not_fn(is_double));
  things_ = std::move(kept);
}

std::shared_ptr<const Tracks> Tracker::claim(const Frame& frame) {
  const SeeThrough see_through(frame);
  auto tracks = std::make_shared<Tracks>();
  tracks->stamp = frame.stamp;
  for (Thing& thing : things_) {
    Track& track = thing.track;
    const TrackMask::Extent extent = mask_.claim(track, thing.is_confirmed);
    thing.voxels = extent.voxels;
    if (extent.voxels > 0) {
      track.bottom_m = std::min(track.bottom_m, extent.bottom_m);
      track.top_m = std::max(track.top_m, extent.top_m);
    }
    // Nothing is taken out of the map that is not in a track.
    if (thing.is_confirmed) {
      tracks->tracks.emplace_back(track).radius_m = mask_.reach_m(track);
    }
    if (extent.voxels < kLeastVoxels) continue;
    // What is not seen of a thing may be there: feet below the image, legs behind a table.
    const auto shorten = [&](double& end_m, double seen_m) {
      const Eigen::Vector3d between(track.position_m.x(), track.position_m.y(),
                                    0.5 * (end_m + seen_m));
      if (end_m != seen_m &&
          see_through(between, std::abs(end_m - seen_m), kRays) == SeeThrough::Answer::kYes) {
        end_m = seen_m;
      }
    };
    shorten(track.bottom_m, extent.bottom_m);
    shorten(track.top_m, extent.top_m);
  }
  std::ranges::sort(tracks->tracks, {}, &Track::id);
  return tracks;
}

void Tracker::end_lost(Stamp stamp) {
  for (Thing& thing : things_) {
    thing.is_held = thing.is_confirmed && thing.voxels >= kLeastVoxels &&
                    thing.track.velocity_mps.norm() < kStanding_mps &&
                    stamp.seconds() - thing.track.last_seen.seconds() > settings_.survival_s;
    if (thing.is_held) thing.track.velocity_mps.setZero();
  }
  std::erase_if(things_, [&](const Thing& thing) { return is_lost(thing, stamp); });
}

bool Tracker::is_lost(const Thing& thing, Stamp stamp) const {
  const auto since_s = [&](Stamp then) { return stamp.seconds() - then.seconds(); };
  const double unseen_s = since_s(thing.track.last_seen);
  if (!thing.is_confirmed) {
    return unseen_s > 0.5 * settings_.survival_s || since_s(thing.moved) > settings_.survival_s;
  }
  if (since_s(thing.moved) > kFlicker_s && thing.farthest_m < kLeastWay_m) return true;
  if (since_s(thing.moved) > settings_.stay_s) return true;
  // What was seen for an instant may have been a part of another.
  const double seen_s = thing.track.last_seen.seconds() - thing.track.first_seen.seconds();
  return unseen_s > std::clamp(2.0 * seen_s, kLeastSurvival_s, settings_.survival_s) &&
         !thing.is_held;
}

}  // namespace sidestep
