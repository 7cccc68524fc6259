#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <variant>
#include <vector>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/base_joints.hpp>

namespace {

using namespace sidestep;

struct Options {
  int points = 800;
  double max_range_m = 4.5;
  double drift_share = 0.01;
  double drift_rad_per_m = 0.0175;
  double lost_m = 0.15;
  double lost_rad = 0.15;

  static Parameters<Options> parameters() {
    using O = Options;
    return Parameters<O>()
        .add("points", &O::points, "At most so many measured points of a frame are aligned.",
             {.min = 50, .max = 20000})
        .add("max_range_m", &O::max_range_m, "Points farther away are not.",
             {.unit = "m", .min = 0.1})
        .add("drift_share", &O::drift_share,
             "What odometry may drift by, as a share of the way, and of the angle turned.",
             {.min = 0.0, .max = 1.0})
        .add("drift_rad_per_m", &O::drift_rad_per_m, "By which it may turn as it moves.",
             {.unit = "rad/m", .min = 0.0, .max = 10.0})
        .add("lost_m", &O::lost_m,
             "The robot is lost, and a loop stops, where its position's standard deviation is "
             "larger.",
             {.unit = "m", .min = 1e-3})
        .add("lost_rad", &O::lost_rad, "The same for its heading.", {.unit = "rad", .min = 1e-3});
  }
};

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// Rotation and translation about a point, by a small step: (rotation vector, translation).
Transform step_about(const Eigen::Vector3d& centre_m, const Vector6& step) {
  const Eigen::Vector3d turn = step.head<3>();
  Transform T = Transform::Identity();
  T.translate(centre_m + step.tail<3>());
  if (turn.norm() > 0.0) T.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
  T.translate(-centre_m);
  return T;
}

double angle_of(const Eigen::Matrix3d& rotation) {
  return std::abs(Eigen::AngleAxisd(rotation).angle());
}

/// Aligns a frame's points with what has been measured before of the map's surfaces (point to
/// plane, Gauss-Newton steps), in a Kalman filter that has odometry as its motion: what the scene
/// does not determine stays as odometry has it. What counts as a surface, the map's distance field
/// says; where it is within its voxels, a cell's mean and normal do.
class FieldAlignment final : public Localiser {
 public:
  FieldAlignment(const Options& options, std::optional<BaseJoints> base)
      : options_(options), base_(base) {}

  [[nodiscard]] Result<Localisation> localise(const Frame& frame,
                                              const DistanceField* field) override {
    now_ = frame.stamp;
    if (!begin_) begin_ = now_;
    move_on(frame);
    take_points(frame);
    if (field != nullptr) align(*field);
    remember(field);
    return localisation();
  }

 private:
  static constexpr int kSteps = 8;
  static constexpr std::size_t kFewest = 30;  ///< Points that say anything.
  /// How far a frame is believed.
  struct Trust {
    /// Points share the errors of whole walls: all of a frame count as no more than this many.
    double independent;
    /// Directions that are determined less than this share of the best are left to odometry.
    double weak;
    /// A surface counts so long after it was first measured: it may be somebody who walks, or comes
    /// to rest.
    std::int64_t settled_ns;
  };
  static constexpr Trust kPlanar{40.0, 0.01, 3'000'000'000};
  static constexpr Trust kFree{10.0, 0.1, 1'000'000'000};
  [[nodiscard]] const Trust& trust() const { return base_ ? kPlanar : kFree; }
  /// What was there in the first second counts after as long.
  static constexpr std::int64_t kBegin_ns = 1'000'000'000;
  static constexpr double kReach_m = 1.5;  ///< What a turn of 1 rad counts as.
  /// A step of odometry is never exact.
  static constexpr double kJitter_m = 1e-4;
  static constexpr double kJitter_rad = 1e-4;
  /// Surfaces are kept in cells of this side, as the mean of what was measured.
  static constexpr double kCell_m = 0.1;
  static constexpr int kFewestInCell = 2;
  static constexpr int kMostInCell = 500;
  static constexpr double kSurface_m = 0.01;  ///< How flat they are, a standard deviation.
  static constexpr double kRobust_m = 0.02;  ///< Points farther off count less (Geman and McClure).
  static constexpr double kWidest_m = 0.15;
  static constexpr double kLever_m = 2.0;  ///< How far off points are that turn with the robot.
  static constexpr double kSameWay = 0.8;  ///< Least product of normals of one surface.

  /// Where the sensor's carrier is by odometry: a base that moves in the plane, or the sensor.
  [[nodiscard]] Transform carrier(const Frame& frame) const {
    if (!base_ || !frame.joint_positions) return frame.T_world_camera;
    const Eigen::VectorXd& q = *frame.joint_positions;
    return transform_from_xyz_rpy({q[base_->x()], q[base_->y()], 0.0}, {0.0, 0.0, q[base_->yaw()]});
  }

  /// The same motion in the map as by odometry, and how far it may be wrong.
  void move_on(const Frame& frame) {
    const Transform T_odom_carrier = carrier(frame);
    const Transform before = T_odom_carrier_.value_or(T_odom_carrier);
    const Eigen::Vector3d way =
        T_map_odom_.linear() * (T_odom_carrier.translation() - before.translation());
    const double turn_rad = angle_of(before.linear().transpose() * T_odom_carrier.linear());
    // A turn of before moves where the carrier is now.
    Matrix6 F = Matrix6::Identity();
    F.bottomLeftCorner<3, 3>() << 0, way.z(), -way.y(), -way.z(), 0, way.x(), way.y(), -way.x(), 0;
    covariance_ = F * covariance_ * F.transpose();
    // A random walk that has come to the stated drift after a metre, or a radian.
    const double way_m = way.norm();
    const auto variance = [](double drift, double length, double jitter) {
      return length > 0.0 ? drift * drift * length + jitter * jitter : 0.0;
    };
    const double rad2 = variance(options_.drift_rad_per_m, way_m, kJitter_rad) +
                        variance(options_.drift_share, turn_rad, kJitter_rad);
    const double m2 = variance(options_.drift_share, way_m, kJitter_m);
    Vector6 more;
    more << rad2, rad2, rad2, m2, m2, m2;
    covariance_.diagonal() += is_planar().select(more, Vector6::Zero());
    T_odom_carrier_ = T_odom_carrier;
  }

  /// Which of the six a base that moves in the plane has.
  [[nodiscard]] Eigen::Array<bool, 6, 1> is_planar() const {
    Eigen::Array<bool, 6, 1> has;
    has << !base_, !base_, true, true, true, !base_;
    return has;
  }

  void take_points(const Frame& frame) {
    points_m_.clear();
    noises_m_.clear();
    normals_.clear();
    const auto take = [&](const Eigen::Vector3d& p_camera, const Eigen::Vector3d& normal) {
      const double range_m = p_camera.z();
      if (!(range_m > 0.0) || !(range_m < options_.max_range_m)) return;
      points_m_.push_back(frame.T_world_camera * p_camera);
      normals_.push_back(frame.T_world_camera.linear() * normal);
      // Nguyen, Izadi and Lovell 2012.
      noises_m_.push_back(0.0012 + 0.0019 * (range_m - 0.4) * (range_m - 0.4));
    };
    if (const auto* image = std::get_if<DepthImage>(&frame.measurement)) take_pixels(*image, take);
    moved_m_.resize(points_m_.size());
    distances_m_.resize(points_m_.size());
    statuses_.resize(points_m_.size());
  }

  template <class Take>
  void take_pixels(const DepthImage& image, const Take& take) const {
    const CameraIntrinsics& camera = image.camera;
    const double pixels = static_cast<double>(camera.width_px) * camera.height_px;
    const int step = std::max(1, static_cast<int>(std::ceil(std::sqrt(pixels / options_.points))));
    const int side = std::max(1, camera.width_px / 160);
    for (int v = step / 2; v + side < camera.height_px; v += step) {
      if (v < side) continue;
      for (int u = std::max(side, step / 2); u + side < camera.width_px; u += step) {
        const auto at = [&](int du, int dv) -> Eigen::Vector3d {
          return camera.unproject(u + du, v + dv, static_cast<double>(image.at(u + du, v + dv)));
        };
        const Eigen::Vector3d p = at(0, 0);
        const Eigen::Vector3d along_u = at(side, 0) - at(-side, 0);
        const Eigen::Vector3d along_v = at(0, side) - at(0, -side);
        // At an edge, a pixel may be of either side, or of neither.
        const double most_m = 0.06 * p.z();
        if (!(std::abs(along_u.z()) < most_m) || !(std::abs(along_v.z()) < most_m)) continue;
        take(p, along_v.cross(along_u).normalized());
      }
    }
  }

  /// Iterated update of the filter by the distances of all points to the nearest surface.
  void align(const DistanceField& field) {
    const Transform T_map_odom = T_map_odom_;
    const Eigen::Vector3d centre_m = T_map_odom * T_odom_carrier_->translation();
    Vector6 sum = Vector6::Zero();  // of all steps
    Matrix6 posterior = covariance_;
    // At first, points count that are as far off as the robot may be: surfaces that have not been
    // in view for a while.
    double scale_m = std::clamp(2.0 * (largest(covariance_.bottomRightCorner<3, 3>()) +
                                       kLever_m * largest(covariance_.topLeftCorner<3, 3>())),
                                kRobust_m, kWidest_m);
    for (int i = 0; i < kSteps; ++i) {
      const Transform T = step_about(centre_m, sum) * T_map_odom;
      const auto system = linearise(field, T, centre_m + sum.tail<3>(), scale_m);
      if (!system) return;
      // (P^-1 + H) step = -g - P^-1 sum, without P^-1: a carrier at rest has none.
      const Matrix6 I_PH = Matrix6::Identity() + covariance_ * system->information;
      const Eigen::PartialPivLU<Matrix6> lu(I_PH);
      const Vector6 step = -lu.solve(covariance_ * system->gradient + sum);
      if (!step.allFinite()) return;
      posterior = lu.solve(covariance_);
      sum += step;
      if (step.norm() < 1e-5 && scale_m == kRobust_m) break;
      scale_m = std::max(kRobust_m, 0.6 * scale_m);
    }
    T_map_odom_ = step_about(centre_m, sum) * T_map_odom;
    covariance_ = 0.5 * (posterior + posterior.transpose());
  }

  struct System {
    Matrix6 information = Matrix6::Zero();
    Vector6 gradient = Vector6::Zero();
  };

  /// Nothing where too few points are near any surface.
  [[nodiscard]] std::optional<System> linearise(const DistanceField& field, const Transform& T,
                                                const Eigen::Vector3d& centre_m, double scale_m) {
    place(T, &field);
    System system;
    std::size_t used = 0;
    for (std::size_t i = 0; i < points_m_.size(); ++i) {
      if (!is_mapped(i, field)) continue;
      const Surface* surface = nearest(moved_m_[i], T.linear() * normals_[i]);
      if (surface == nullptr) continue;
      ++used;
      const Eigen::Vector3d& along = surface->normal;
      const double r_m = along.dot(moved_m_[i] - surface->mean_m);
      const double sigma_m = std::hypot(noises_m_[i], kSurface_m);
      Vector6 J;
      J << (moved_m_[i] - centre_m).cross(along), along;
      J = is_planar().select(J, Vector6::Zero());
      const double share = r_m / scale_m;
      const double robust = 1.0 / ((1.0 + share * share) * (1.0 + share * share));
      const double weight = robust / (sigma_m * sigma_m);
      system.information += weight * J * J.transpose();
      system.gradient += weight * r_m * J;
    }
    if (used < kFewest) return std::nullopt;
    const double told = std::min(1.0, trust().independent / static_cast<double>(used));
    system.information *= told;
    system.gradient *= told;
    leave_to_odometry(system);
    return system;
  }

  /// Takes out what the scene hardly determines: there, errors that points share say more than
  /// they.
  void leave_to_odometry(System& system) const {
    // A turn moves points by what they are away.
    Vector6 scale = Vector6::Ones();
    scale.head<3>().setConstant(1.0 / kReach_m);
    const Matrix6 scaled = scale.asDiagonal() * system.information * scale.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Matrix6> solver(scaled);
    const Vector6 values = solver.eigenvalues().cwiseMax(0.0);
    const double t = trust().weak * values.maxCoeff();
    const Vector6 kept = values.array().square() / (values.array().square() + t * t + 1e-300);
    const Matrix6 keep =
        solver.eigenvectors() * kept.asDiagonal() * solver.eigenvectors().transpose();
    const Matrix6 unscale = scale.cwiseInverse().asDiagonal();
    system.information = unscale * keep * scaled * unscale;
    system.gradient = unscale * keep * scale.asDiagonal() * system.gradient;
  }

  /// Moves all points, and looks which of them are on surfaces of the map.
  void place(const Transform& T, const DistanceField* field) {
    for (std::size_t i = 0; i < points_m_.size(); ++i) moved_m_[i] = T * points_m_[i];
    if (field != nullptr) field->query(moved_m_, distances_m_, {}, statuses_);
  }
  [[nodiscard]] bool is_mapped(std::size_t point, const DistanceField& field) const {
    return statuses_[point] == FieldStatus::kKnown &&
           std::abs(distances_m_[point]) < 3.0 * field.info().grid.resolution_m;
  }

  /// What has been measured of a surface in one cell.
  struct Surface {
    Eigen::Vector3d mean_m = Eigen::Vector3d::Zero();
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();
    int count = 0;
    Stamp first;  ///< Measured then, and since.
  };
  [[nodiscard]] static std::int64_t key_of(const Eigen::Array<std::int64_t, 3, 1>& cell) {
    constexpr std::int64_t kHalf = 1 << 20;
    return ((cell.x() + kHalf) << 42) | ((cell.y() + kHalf) << 21) | (cell.z() + kHalf);
  }
  [[nodiscard]] Eigen::Array<std::int64_t, 3, 1> cell_of(const Eigen::Vector3d& p) const {
    return (p / kCell_m).array().floor().cast<std::int64_t>();
  }
  [[nodiscard]] bool has_settled(const Surface& surface) const {
    const bool is_of_begin = surface.first.ns - begin_->ns < kBegin_ns;
    return now_.ns - surface.first.ns >= (is_of_begin ? kBegin_ns : trust().settled_ns);
  }
  /// The nearest surface that faces the same way; null where there is none in the cell or beside
  /// it.
  [[nodiscard]] const Surface* nearest(const Eigen::Vector3d& p,
                                       const Eigen::Vector3d& normal) const {
    const auto cell = cell_of(p);
    const Surface* best = nullptr;
    double least_m2 = 2.25 * kCell_m * kCell_m;
    for (std::int64_t k = 0; k < 27; ++k) {
      const Eigen::Array<std::int64_t, 3, 1> there =
          cell + Eigen::Array<std::int64_t, 3, 1>(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1);
      const auto found = surfaces_.find(key_of(there));
      if (found == surfaces_.end() || found->second.count < kFewestInCell ||
          !has_settled(found->second)) {
        continue;
      }
      const double m2 = (found->second.mean_m - p).squaredNorm();
      if (m2 >= least_m2 || found->second.normal.dot(normal) < kSameWay) continue;
      least_m2 = m2;
      best = &found->second;
    }
    return best;
  }
  void remember(const DistanceField* field) {
    place(T_map_odom_, field);
    for (std::size_t i = 0; i < points_m_.size(); ++i) {
      if (field != nullptr && !is_mapped(i, *field)) continue;
      const Eigen::Vector3d normal = T_map_odom_.linear() * normals_[i];
      Surface& surface = surfaces_[key_of(cell_of(moved_m_[i]))];
      if (surface.count > 0 && surface.normal.dot(normal) < kSameWay) continue;
      if (surface.count == 0) surface.first = now_;
      surface.count = std::min(surface.count + 1, kMostInCell);
      surface.mean_m += (moved_m_[i] - surface.mean_m) / surface.count;
      surface.normal = (surface.normal + (normal - surface.normal) / surface.count).normalized();
    }
  }

  /// The largest standard deviation.
  [[nodiscard]] static double largest(const Eigen::Matrix3d& of) {
    return std::sqrt(std::max(0.0, of.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff()));
  }

  [[nodiscard]] Localisation localisation() const {
    Localisation found;
    found.T_map_odom = T_map_odom_;
    found.sigma_rad = largest(covariance_.topLeftCorner<3, 3>());
    found.sigma_m = largest(covariance_.bottomRightCorner<3, 3>());
    if (found.sigma_m > options_.lost_m) {
      found.lost = format("where the robot is, is known to %.2f m only", found.sigma_m) +
                   format(" (localiser.lost_m: %g)", options_.lost_m);
    } else if (found.sigma_rad > options_.lost_rad) {
      found.lost = format("how the robot is turned, is known to %.2f rad only", found.sigma_rad) +
                   format(" (localiser.lost_rad: %g)", options_.lost_rad);
    }
    return found;
  }

  Options options_;
  std::optional<BaseJoints> base_;  ///< Nothing: the sensor moves freely.
  Transform T_map_odom_ = Transform::Identity();
  /// Of small steps about the carrier, in the map's axes: rotation, translation.
  Matrix6 covariance_ = Matrix6::Zero();
  std::optional<Stamp> begin_;               ///< Of the first frame.
  Stamp now_;                                ///< Of the frame.
  std::optional<Transform> T_odom_carrier_;  ///< At the last frame.
  std::vector<Eigen::Vector3d> points_m_;    ///< By odometry.
  std::vector<Eigen::Vector3d> normals_;     ///< Of the surfaces that they are on.
  std::vector<double> noises_m_;             ///< Of their depths.
  std::vector<Eigen::Vector3d> moved_m_;
  std::vector<double> distances_m_;
  std::vector<FieldStatus> statuses_;
  std::unordered_map<std::int64_t, Surface> surfaces_;
};

Result<std::unique_ptr<Localiser>> create(const Options& options, const HostContext& context) {
  std::optional<BaseJoints> base;
  if (context.robot) {
    if (auto found = BaseJoints::of(*context.robot)) base = *found;
  }
  return std::make_unique<FieldAlignment>(options, base);
}

}  // namespace

SIDESTEP_PLUGIN(Localiser, Options, create, "field_alignment", "0.1.0",
                "Aligns each frame with what was measured before of the surfaces in the map")
