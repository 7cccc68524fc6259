// A localiser for robots that move in the plane: the points of a frame are to be where the map's
// distance is 0. What they do not tell is left to odometry, by a Kalman filter. What was mapped a
// moment ago agrees with where the robot thinks it is: drift becomes slower, it does not end.
// People who walk by are mapped, too, and pull at it.

#include "planar_match.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/mapping/frame_check.hpp>
#include <sidestep/robot/base_joints.hpp>

namespace planar_match {
namespace {

using namespace sidestep;

constexpr double kSurface_m = 0.02;  ///< A point's standard deviation; farther off it counts less.
constexpr double kFarthest_m = 0.2;  ///< Such points are of something that is not in the map.
constexpr double kIndependent = 10.0;  ///< A frame is believed as if it had no more points.
constexpr std::size_t kFewest = 30;

/// In the frame of the sensor; about so many, spread over the whole frame.
std::vector<Eigen::Vector3d> points_of(const Frame& frame, int wanted) {
  std::vector<Eigen::Vector3d> points_m;
  const auto stride = [&](std::size_t size) { return (size / idx(wanted)) | 1; };
  if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) {
    const std::size_t width = idx(image->camera.width_px);
    for (std::size_t i = 0; i < image->depth_m.size(); i += stride(image->depth_m.size())) {
      if (!(image->depth_m[i] > 0.0F)) continue;  // 0 and NaN are no measurement
      points_m.push_back(image->camera.unproject(static_cast<double>(i % width),
                                                 static_cast<double>(i / width),
                                                 static_cast<double>(image->depth_m[i])));
    }
    return points_m;
  }
  const auto& cloud = std::get<PointCloud>(frame.measurement).points_m;
  for (std::size_t i = 0; i < cloud.size(); i += stride(cloud.size())) {
    if (cloud[i].allFinite()) points_m.push_back(cloud[i].cast<double>());
  }
  return points_m;
}

class PlanarMatch final : public Localiser {
 public:
  explicit PlanarMatch(const Options& options) : options_(options) {}

  Result<Localisation> localise(const Frame& frame, const DistanceField* field) override {
    SIDESTEP_TRY(check_frame(frame));
    move_on(frame.T_world_camera.translation());
    if (field != nullptr) {
      auto points_m = points_of(frame, options_.points);
      for (Eigen::Vector3d& p : points_m) p = T_map_odom_ * (frame.T_world_camera * p);
      match(*field, points_m);
    }
    Localisation found{T_map_odom_, 0.0, std::sqrt(covariance_(2, 2)), ""};
    const Eigen::Matrix2d of_position = covariance_.topLeftCorner<2, 2>();
    found.sigma_m = std::sqrt(of_position.selfadjointView<Eigen::Lower>().eigenvalues()[1]);
    if (found.sigma_m > options_.lost_m) {
      found.lost = "its position is known to " + format("%.2g", found.sigma_m) + " m only";
    }
    return found;
  }

 private:
  /// How far the sensor's x, y and yaw in the map may be off after a stretch of odometry.
  void move_on(const Eigen::Vector3d& p_odom) {
    const Eigen::Vector3d way = T_map_odom_.linear() * (p_odom - p_odom_.value_or(p_odom));
    p_odom_ = p_odom;
    sensor_m_ = T_map_odom_ * p_odom;
    Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
    F(0, 2) = -way.y();  // who was turned wrongly has gone wrongly
    F(1, 2) = way.x();
    covariance_ = F * covariance_ * F.transpose();
    const double way_m = way.head<2>().norm(), share = options_.drift_share;
    covariance_.diagonal() += way_m * Eigen::Vector3d(share * share, share * share,
                                                      std::pow(options_.drift_rad_per_m, 2));
  }

  /// Turns points and map onto each other: a Gauss-Newton step after the other, each with what was
  /// known before the frame.
  void match(const DistanceField& field, std::vector<Eigen::Vector3d>& points_m) {
    const Eigen::Matrix3d known = (covariance_ + 1e-10 * Eigen::Matrix3d::Identity()).inverse();
    std::vector<double> distances_m(points_m.size());
    std::vector<Eigen::Vector3d> gradients(points_m.size());
    std::vector<FieldStatus> statuses(points_m.size());
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();  // x, y and yaw so far
    for (int step = 0; step < 8; ++step) {
      field.query(points_m, distances_m, gradients, statuses);
      Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
      Eigen::Vector3d pull = Eigen::Vector3d::Zero();
      std::size_t count = 0;
      for (std::size_t i = 0; i < points_m.size(); ++i) {
        const double off = distances_m[i] / kSurface_m;
        if (statuses[i] != FieldStatus::kKnown || !(std::abs(distances_m[i]) < kFarthest_m))
          continue;
        ++count;
        const Eigen::Vector3d &g = gradients[i], arm = points_m[i] - sensor_m_;
        const Eigen::Vector3d row(g.x(), g.y(), arm.x() * g.y() - arm.y() * g.x());
        const double weight = std::pow(1.0 + off * off, -2);  // Geman and McClure
        information += weight / (kSurface_m * kSurface_m) * row * row.transpose();
        pull += weight / kSurface_m * off * row;
      }
      if (count < kFewest) return;
      const double trust = std::min(1.0, kIndependent / static_cast<double>(count));
      const Eigen::Matrix3d sum = known + trust * information;
      const Eigen::Vector3d change = -sum.ldlt().solve(known * moved + trust * pull);
      if (!change.allFinite()) return;
      turn(change, points_m);
      moved += change;
      covariance_ = sum.inverse();
    }
  }

  /// By x and y, and by yaw about the sensor.
  void turn(const Eigen::Vector3d& change, std::vector<Eigen::Vector3d>& points_m) {
    const Eigen::Vector3d shift(change.x(), change.y(), 0.0);
    const Transform T = Eigen::Translation3d(sensor_m_ + shift) *
                        Eigen::AngleAxisd(change.z(), Eigen::Vector3d::UnitZ()) *
                        Eigen::Translation3d(-sensor_m_);
    for (Eigen::Vector3d& p : points_m) p = T * p;
    T_map_odom_ = T * T_map_odom_;
    sensor_m_ += shift;
  }

  Options options_;
  Transform T_map_odom_ = Transform::Identity();
  Eigen::Matrix3d covariance_ = Eigen::Matrix3d::Zero();
  std::optional<Eigen::Vector3d> p_odom_;  ///< Of the sensor, at the last frame.
  Eigen::Vector3d sensor_m_ = Eigen::Vector3d::Zero();
};

}  // namespace

Result<std::unique_ptr<Localiser>> create(const Options& options, const HostContext& context) {
  if (context.robot == nullptr) {
    return fail(ErrorCode::kUnsupported, "nothing says that the sensor moves in the plane");
  }
  SIDESTEP_TRY(BaseJoints::of(*context.robot));
  return std::make_unique<PlanarMatch>(options);
}

}  // namespace planar_match

SIDESTEP_PLUGIN(sidestep::Localiser, planar_match::Options, planar_match::create, "planar_match",
                "0.1.0", "Turns points onto the surfaces of the map: an example of a plugin")
