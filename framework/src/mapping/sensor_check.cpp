#include <sidestep/mapping/sensor_check.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/mapping/frame_check.hpp>

namespace sidestep {
namespace {

constexpr int kAcross = 64, kDown = 48;  // samples of an image
constexpr std::size_t kBeams = 1024;     // of a scan, at most
constexpr int kTiles = 3;                // along each side, of which noise changes each
constexpr double kStill_m = 1e-4, kStill_rad = 1e-4;
constexpr double kTurned_rad = 0.05;
constexpr int kNoisyPairs = 3;
/// Returns that are not of the floor, of all samples: bare floor looks the same from everywhere.
constexpr double kOther = 0.05;

/// Rays that meet the floor nearer than this return something, whatever stands on it.
constexpr double kFloorInReach_m = 2.5;
constexpr double kExpected = 0.1, kReturned = 0.01, kManyReturned = 0.3;  // of all samples

constexpr double kFloor_m = 0.02;    // its points lie this near to a plane
constexpr double kFarthest_m = 2.5;  // horizontally: farther off, noise tilts it
constexpr double kSteepest = 0.176;  // 10 degrees: more is no floor
constexpr double kOffset_m = 0.02,
                 kOffset = 0.1;  // of a tilted floor below the camera, of its height
constexpr double kLifted_m = 0.03, kTiltOfLifted_rad = 0.021;  // 1.2 degrees
constexpr std::size_t kFewest = 200;
constexpr int kTries = 80;
constexpr double kSpread_m = 0.15;  // of its points, a standard deviation, in each direction

/// What hangs on a robot is so near to its laser, and stays there to within kSame_m while the laser
/// goes this way and takes it along by more; what is beside it is farther off by kApart_m.
constexpr double kHanging_m = 0.5;
constexpr double kWay_m = 0.04, kWay_rad = 0.14;
constexpr std::size_t kMostScans = 16;
constexpr double kStep = 0.2;  // share of it from one scan that is kept to the next
constexpr double kSame_m = 0.02, kApart_m = 0.15;
constexpr std::size_t kFewestBeams = 3;
constexpr double kNoReturn_m = 1e3;

double angle_between(const Transform& a, const Transform& b) {
  return std::abs(Eigen::AngleAxisd(a.linear().transpose() * b.linear()).angle());
}

}  // namespace

bool SensorCheck::Plane::holds(const Eigen::Vector3d& p) const {
  return std::abs(p.z() - slope.dot(p.head<2>()) - offset_m) < kFloor_m;
}

Result<void> SensorCheck::check(const Frame& frame) {
  if (!check_frame(frame)) return {};
  const auto* image = std::get_if<DepthImage>(&frame.measurement);
  if (image != nullptr) {
    take_samples(frame, *image);
  } else {
    const PointCloud& scan = std::get<PointCloud>(frame.measurement);
    if (!is_planar_scan(scan)) return {};
    take_samples(frame, scan);
    obstructed_.hear(sees_robot(frame), frame.stamp);
  }
  frozen_.hear(is_frozen(frame), frame.stamp);
  if (floor_z_m_ && image != nullptr) {
    blind_.hear(is_blind(frame, *image), frame.stamp);
    tilted_.hear(is_tilted(frame.T_world_camera.translation().z() - *floor_z_m_), frame.stamp);
  }
  const std::string it = image != nullptr ? "the camera" : "the laser";
  if (frozen_.is_fault) {
    return fail(ErrorCode::kBadFrame, it + " is frozen: what it measures stays the same");
  }
  if (blind_.is_fault) {
    return fail(ErrorCode::kBadFrame,
                "the camera is blind: nothing returns from where the floor would");
  }
  if (obstructed_.is_fault) {
    return fail(
        ErrorCode::kBadFrame,
        format("the laser sees its own robot: something %.2f m before it goes with it", hanging_m_),
        {}, "is anything in its way that the robot's profile does not have?");
  }
  if (tilted_.is_fault) {
    return fail(
        ErrorCode::kBadFrame,
        format(
            "the camera sees the floor tilted by %.1f degrees: it is not mounted, or its lens is "
            "not, as they are said to be",
            tilt_rad_ * 180.0 / std::numbers::pi),
        {}, "see extrinsics, head joints and intrinsics");
  }
  return {};
}

void SensorCheck::take_samples(const Frame& frame, const DepthImage& image) {
  std::swap(samples_, last_);
  samples_.clear();
  const CameraIntrinsics& camera = image.camera;
  Eigen::Vector3d below = frame.T_world_camera.translation();
  below.z() = floor_z_m_.value_or(0.0);
  for (int j = 0; j < kDown; ++j) {
    for (int i = 0; i < kAcross; ++i) {
      const int u = (2 * i + 1) * camera.width_px / (2 * kAcross);
      const int v = (2 * j + 1) * camera.height_px / (2 * kDown);
      const float depth_m = image.at(u, v);
      Sample sample{u, v, i * kTiles / kAcross + j * kTiles / kDown * kTiles,
                    std::isfinite(depth_m) && depth_m > 0.0F ? depth_m : 0.0F,
                    Eigen::Vector3d::Zero()};
      if (sample.depth_m > 0.0F) {
        sample.p_m = frame.T_world_camera * camera.unproject(u, v, sample.depth_m) - below;
      }
      samples_.push_back(sample);
    }
  }
}

void SensorCheck::take_samples(const Frame& frame, const PointCloud& scan) {
  std::swap(samples_, last_);
  samples_.clear();
  Eigen::Vector3d below = frame.T_world_camera.translation();
  below.z() = floor_z_m_.value_or(0.0);
  const std::size_t beams = scan.points_m.size();
  const std::size_t step = 1 + beams / kBeams;
  for (std::size_t i = 0; i < beams; i += step) {
    const Eigen::Vector3f& p = scan.points_m[i];
    const auto tile = static_cast<int>(i * idx(kTiles * kTiles) / beams);
    Sample sample{static_cast<int>(i), 0, tile, 0.0F, Eigen::Vector3d::Zero()};
    if (p.allFinite() && !p.isZero()) {
      sample.depth_m = p.norm();
      sample.p_m = frame.T_world_camera * p.cast<double>() - below;
    }
    samples_.push_back(sample);
  }
}

/// The same image again means nothing where noise has not been seen and the camera has not turned.
FaultSign SensorCheck::is_frozen(const Frame& frame) {
  const Transform T_world_last = T_world_last_;
  T_world_last_ = frame.T_world_camera;
  if (last_.empty()) {
    T_world_first_ = frame.T_world_camera;
    return FaultSign::kNothing;
  }
  const bool is_same = std::ranges::equal(samples_, last_, {}, &Sample::depth_m, &Sample::depth_m);
  if (!is_same) {
    const bool is_still =
        (T_world_last.translation() - frame.T_world_camera.translation()).norm() < kStill_m &&
        angle_between(T_world_last, frame.T_world_camera) < kStill_rad;
    if (is_still && is_noise()) ++noisy_pairs_;
    T_world_first_ = frame.T_world_camera;
    return FaultSign::kSound;
  }
  const auto returns = [](const Sample& sample) { return sample.depth_m > 0.0F; };
  const auto is_other = [&](const Sample& sample) {
    return returns(sample) && (!floor_z_m_ || std::abs(sample.p_m.z()) > kFloor_m);
  };
  const auto has_many = [&](const auto& are) {
    return static_cast<double>(std::ranges::count_if(samples_, are)) >
           kOther * static_cast<double>(samples_.size());
  };
  if (noisy_pairs_ >= kNoisyPairs)
    return has_many(returns) ? FaultSign::kFault : FaultSign::kNothing;
  const bool has_turned = angle_between(T_world_first_, frame.T_world_camera) > kTurned_rad;
  return has_turned && has_many(is_other) ? FaultSign::kFault : FaultSign::kNothing;
}

/// Whether all over the image something differs from the last one.
bool SensorCheck::is_noise() const {
  std::array<int, kTiles * kTiles> returns{}, differ{};
  if (samples_.size() != last_.size()) return false;
  for (std::size_t i = 0; i < samples_.size(); ++i) {
    const std::size_t tile = idx(samples_[i].tile);
    if (samples_[i].depth_m == 0.0F || last_[i].depth_m == 0.0F) continue;
    ++returns[tile];
    if (samples_[i].depth_m != last_[i].depth_m) ++differ[tile];
  }
  int told = 0;
  for (std::size_t tile = 0; tile < returns.size(); ++tile) {
    if (returns[tile] < 20) continue;
    if (differ[tile] == 0) return false;
    ++told;
  }
  return 2 * told > kTiles * kTiles;
}

/// What comes nearer than a camera measures, its own robot's links too, fades from the image over
/// frames; a camera that fails goes blind from one to the next, or was so from the beginning.
FaultSign SensorCheck::is_blind(const Frame& frame, const DepthImage& image) {
  const auto samples = static_cast<double>(std::max<std::size_t>(samples_.size(), 1));
  const auto share = [&](const auto& are) {
    return static_cast<double>(std::ranges::count_if(samples_, are)) / samples;
  };
  const double returned = share([](const Sample& sample) { return sample.depth_m > 0.0F; });
  const std::optional<double> before = std::exchange(returned_, returned);
  if (returned > kReturned) {
    has_failed_ = false;
    return FaultSign::kSound;
  }
  if (!before) {
    const double height_m = frame.T_world_camera.translation().z() - *floor_z_m_;
    has_failed_ = share([&](const Sample& sample) {
                    const Eigen::Vector3d ray = frame.T_world_camera.linear() *
                                                image.camera.unproject(sample.u, sample.v, 1.0);
                    return -ray.z() * kFloorInReach_m > height_m * ray.norm();
                  }) > kExpected;
  } else if (*before > kManyReturned) {
    has_failed_ = true;
  }
  return has_failed_ ? FaultSign::kFault : FaultSign::kNothing;
}

/// What stands in the world comes nearer, goes farther or to a side as the laser moves. A wall
/// along its way stays where it is, but reaches on to both sides.
FaultSign SensorCheck::sees_robot(const Frame& frame) {
  // Where the robot stands is not known: nor is what is its own.
  if (has_robot_ && !frame.joint_positions) return FaultSign::kNothing;
  Scan now{frame.T_world_camera, {}};
  for (const Sample& sample : samples_) {
    now.beams_m.push_back(sample.depth_m > 0.0F ? static_cast<double>(sample.depth_m)
                                                : kNoReturn_m);
  }
  const auto is_far = [&](const Scan& then, double way_m, double way_rad) {
    return (then.T_world_laser.translation() - now.T_world_laser.translation()).norm() >= way_m ||
           angle_between(then.T_world_laser, now.T_world_laser) >= way_rad;
  };
  if (!scans_.empty() && scans_.back().beams_m.size() != now.beams_m.size()) scans_.clear();
  // The newest that was taken far enough away.
  while (scans_.size() > 1 && is_far(scans_[1], kWay_m, kWay_rad)) scans_.pop_front();
  FaultSign says = FaultSign::kNothing;
  if (!scans_.empty() && is_far(scans_.front(), kWay_m, kWay_rad)) {
    const auto near_m = hangs_in_both(scans_.front(), now, frame);
    says = near_m ? FaultSign::kFault : FaultSign::kSound;
    hanging_m_ = near_m.value_or(hanging_m_);
  }
  if (scans_.empty() || is_far(scans_.back(), kStep * kWay_m, kStep * kWay_rad)) {
    scans_.push_back(std::move(now));
    if (scans_.size() > kMostScans) scans_.pop_front();
  }
  return says;
}

/// How near the thing is that the same beams end at in two scans and that the robot is not known to
/// have; nothing where there is none.
std::optional<double> SensorCheck::hangs_in_both(const Scan& then, const Scan& now,
                                                 const Frame& frame) {
  const std::vector<double>&then_m = then.beams_m, &now_m = now.beams_m;
  const bool knows_itself = static_cast<bool>(self_.pose(frame));
  Eigen::Vector3d below = frame.T_world_camera.translation();
  below.z() = floor_z_m_.value_or(0.0);
  for (std::size_t first = 0, end = 0; first < now_m.size(); first = end) {
    bool is_known = false;
    for (end = first; end < now_m.size(); ++end) {
      if (end > first && std::abs(now_m[end] - now_m[end - 1]) > kApart_m) break;
      is_known |= knows_itself && self_.contains(samples_[end].p_m + below);
    }
    const auto near_m = nearness_of(now_m, first, end), before_m = nearness_of(then_m, first, end);
    if (is_known || !near_m || !before_m || std::abs(*near_m - *before_m) > kSame_m) continue;
    // A laser that goes around a thing and turns with it has it where it was, too.
    const Eigen::Vector3d p_now = samples_[(first + end) / 2].p_m + below;
    const Eigen::Vector3d p_then = then.T_world_laser * (now.T_world_laser.inverse() * p_now);
    if ((p_now - p_then).norm() >= kSame_m) return near_m;
  }
  return std::nullopt;
}

/// How near the thing is that just these beams of a scan end at; nothing where they do not.
std::optional<double> SensorCheck::nearness_of(const std::vector<double>& scan_m, std::size_t first,
                                               std::size_t end) {
  if (end - first < kFewestBeams || first == 0 || end == scan_m.size()) return std::nullopt;
  double sum_m = 0.0;
  for (std::size_t beam = first; beam < end; ++beam) {
    if (beam > first && std::abs(scan_m[beam] - scan_m[beam - 1]) > kApart_m) return std::nullopt;
    sum_m += scan_m[beam];
  }
  const double mean_m = sum_m / static_cast<double>(end - first);
  const bool is_apart =
      scan_m[first - 1] > scan_m[first] + kApart_m && scan_m[end] > scan_m[end - 1] + kApart_m;
  return is_apart && mean_m < kHanging_m ? std::optional(mean_m) : std::nullopt;
}

/// Whether far more points lie on a tilted plane through where the floor below the camera is than
/// on the floor.
FaultSign SensorCheck::is_tilted(double camera_height_m) {
  candidates_m_.clear();
  for (const Sample& sample : samples_) {
    const double far_m = sample.p_m.head<2>().norm();
    if (sample.depth_m > 0.0F && far_m < kFarthest_m &&
        std::abs(sample.p_m.z()) < 2.0 * kFloor_m + kSteepest * far_m) {
      candidates_m_.push_back(sample.p_m);
    }
  }
  if (candidates_m_.size() < kFewest) return FaultSign::kNothing;
  const std::size_t on_floor = count({});
  if (on_floor >= kFewest && 10 * on_floor >= 8 * candidates_m_.size()) return FaultSign::kSound;
  Plane best;
  std::size_t most = on_floor;
  std::uint64_t random = 1;
  const auto draw = [&] {
    random = random * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<std::size_t>(random >> 33) % candidates_m_.size();
  };
  for (int i = 0; i < kTries; ++i) {
    const auto plane = plane_through(draw(), draw(), draw());
    if (!plane || plane->slope.norm() > kSteepest ||
        std::abs(plane->offset_m) > kOffset_m + kOffset * camera_height_m) {
      continue;
    }
    const std::size_t on_plane = count(*plane);
    if (on_plane <= most) continue;
    most = on_plane;
    best = *plane;
  }
  if (4 * most < 3 * candidates_m_.size() || most < kFewest) return FaultSign::kNothing;
  const auto plane = refined(best);
  if (!plane) return FaultSign::kNothing;
  const double tilt_rad = std::atan(plane->slope.norm());
  // A lens that lies tilts the floor little where it looks far ahead, but lifts it then; a step
  // lies as level as the floor.
  const bool is_lifted = std::abs(plane->offset_m) > kLifted_m && tilt_rad > kTiltOfLifted_rad;
  if (tilt_rad <= kMaxTilt_rad && !is_lifted) return FaultSign::kSound;
  if (10 * count(*plane) < 15 * on_floor) return FaultSign::kNothing;
  if (!tilted_.is_fault) tilt_rad_ = tilt_rad;
  return FaultSign::kFault;
}

std::optional<SensorCheck::Plane> SensorCheck::plane_through(std::size_t i, std::size_t j,
                                                             std::size_t k) const {
  const Eigen::Vector3d a = candidates_m_[j] - candidates_m_[i];
  const Eigen::Vector3d b = candidates_m_[k] - candidates_m_[i];
  const Eigen::Vector3d normal = a.cross(b);
  if (std::abs(normal.z()) < kSpread_m * kSpread_m) return std::nullopt;
  Plane plane;
  plane.slope = -normal.head<2>() / normal.z();
  plane.offset_m = candidates_m_[i].z() - plane.slope.dot(candidates_m_[i].head<2>());
  return plane;
}

std::size_t SensorCheck::count(const Plane& plane) const {
  return static_cast<std::size_t>(
      std::ranges::count_if(candidates_m_, [&](const auto& p) { return plane.holds(p); }));
}

/// By least squares over the points that it holds; nothing where these do not determine it.
std::optional<SensorCheck::Plane> SensorCheck::refined(const Plane& plane) const {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double n = 0.0;
  for (const Eigen::Vector3d& p : candidates_m_) {
    if (!plane.holds(p)) continue;
    mean += p;
    ++n;
  }
  if (n < 3.0) return std::nullopt;
  mean /= n;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : candidates_m_) {
    if (plane.holds(p)) scatter += (p - mean) * (p - mean).transpose() / n;
  }
  const Eigen::Matrix2d across = scatter.topLeftCorner<2, 2>();
  if (Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(across).eigenvalues().minCoeff() <
      kSpread_m * kSpread_m) {
    return std::nullopt;
  }
  Plane better;
  better.slope = across.ldlt().solve(scatter.topRightCorner<2, 1>());
  better.offset_m = mean.z() - better.slope.dot(mean.head<2>());
  return better;
}

}  // namespace sidestep
