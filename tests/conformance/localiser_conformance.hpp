#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <ostream>
#include <span>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include <sidestep/core/index.hpp>
#include <sidestep/mapping/localiser.hpp>
#include <sidestep/robot/base_joints.hpp>
#include <sidestep/robot/kinematic_tree.hpp>

/// What every Localiser must hold. In a test of your own:
///
///     INSTANTIATE_TEST_SUITE_P(mine, LocaliserConformance,
///                              testing::Values(LocaliserCase{"mine", [](auto) { return
///                              make_mine(); }}));
namespace sidestep::conformance {

struct LocaliserCase {
  std::string name;
  /// A new one for a robot; null: the sensor moves freely.
  std::function<std::shared_ptr<Localiser>(std::shared_ptr<const RobotModel>)> make;
  bool moves_freely = true;  ///< It takes a sensor without a robot.

  friend std::ostream& operator<<(std::ostream& out, const LocaliserCase& c) {
    return out << c.name;
  }
};

/// A disc that moves and turns in the plane: joints x, y, yaw, link "base".
[[nodiscard]] inline std::shared_ptr<const KinematicTree> turning_robot() {
  RobotDescription robot;
  robot.name = "turner";
  robot.joints = {{"x", Joint::Type::kPrismatic, -50.0, 50.0, 0.5, 1.0},
                  {"y", Joint::Type::kPrismatic, -50.0, 50.0, 0.5, 1.0},
                  {"yaw", Joint::Type::kContinuous, -kInfinity, kInfinity, 1.0, 2.0}};
  robot.links = {{"world", -1}, {"along_x", 0}, {"along_y", 1}, {"base", 2}};
  robot.spheres = {{3, {0.0, 0.0, 0.2}, 0.2}};
  using Motion = TreeJoint::Motion;
  std::vector<TreeJoint> joints{{"root"},
                                {"x", Motion::kTranslation},
                                {"y", Motion::kTranslation},
                                {"yaw", Motion::kRotation}};
  joints[1].axis = Eigen::Vector3d::UnitX();
  joints[2].axis = Eigen::Vector3d::UnitY();
  joints[3].axis = Eigen::Vector3d::UnitZ();
  for (std::size_t j = 0; j < 3; ++j) joints[j + 1].joint = static_cast<int>(j);
  auto tree = KinematicTree::create(std::move(robot), std::move(joints));
  if (!tree) throw std::runtime_error(tree.error().describe());
  return std::move(*tree);
}

/// Boxes along the axes, and the exact distance to them. All of it is known.
class BoxField final : public DistanceField {
 public:
  explicit BoxField(std::vector<Eigen::AlignedBox3d> boxes)
      : DistanceField(info_of()), boxes_(std::move(boxes)) {}

  void query(std::span<const Eigen::Vector3d> points_m, std::span<double> distances_m,
             std::span<Eigen::Vector3d> gradients,
             std::span<FieldStatus> statuses) const noexcept override {
    for (std::size_t i = 0; i < points_m.size(); ++i) {
      distances_m[i] = distance_m(points_m[i]);
      if (!statuses.empty()) statuses[i] = FieldStatus::kKnown;
      if (gradients.empty()) continue;
      for (int axis = 0; axis < 3; ++axis) {
        constexpr double kStep_m = 1e-6;
        const Eigen::Vector3d step_m = kStep_m * Eigen::Vector3d::Unit(axis);
        gradients[i][axis] =
            (distance_m(points_m[i] + step_m) - distance_m(points_m[i] - step_m)) / (2.0 * kStep_m);
      }
    }
  }

  /// How far a ray from outside goes; infinity where it meets nothing.
  [[nodiscard]] double along_ray_m(const Eigen::Vector3d& from_m,
                                   const Eigen::Vector3d& direction) const {
    double nearest_m = kInfinity;
    for (const Eigen::AlignedBox3d& box : boxes_) {
      const Eigen::Array3d a = (box.min() - from_m).array() / direction.array();
      const Eigen::Array3d b = (box.max() - from_m).array() / direction.array();
      const double enter_m = a.min(b).maxCoeff(), leave_m = a.max(b).minCoeff();
      if (enter_m > 0.0 && enter_m <= leave_m) nearest_m = std::min(nearest_m, enter_m);
    }
    return nearest_m;
  }

 private:
  static FieldInfo info_of() {
    FieldInfo info;
    info.grid = {{-10.0, -10.0, -1.0}, 0.05, {400, 400, 100}};
    info.is_signed = true;
    info.lipschitz = 1.0;
    info.is_exact = true;
    return info;
  }
  [[nodiscard]] double distance_m(const Eigen::Vector3d& p) const {
    double least_m = kInfinity;
    for (const Eigen::AlignedBox3d& box : boxes_) {
      const double outside_m = box.exteriorDistance(p);
      const double inside_m = std::min((p - box.min()).minCoeff(), (box.max() - p).minCoeff());
      least_m = std::min(least_m, outside_m > 0.0 ? outside_m : -inside_m);
    }
    return least_m;
  }

  std::vector<Eigen::AlignedBox3d> boxes_;
};

[[nodiscard]] inline Eigen::AlignedBox3d box(Eigen::Vector3d lower_m, Eigen::Vector3d upper_m) {
  return {lower_m, upper_m};
}

/// A camera 1 m above the floor that looks along x and down, moved by its carrier.
class LocaliserConformance : public testing::TestWithParam<LocaliserCase> {
 protected:
  /// Four walls 6 m x 5 m, a floor, a column and a chest.
  static std::vector<Eigen::AlignedBox3d> room() {
    return {box({-3.2, -2.7, -0.2}, {3.2, 2.7, 0.0}), box({3.0, -2.7, 0.0}, {3.2, 2.7, 2.5}),
            box({-3.2, -2.7, 0.0}, {-3.0, 2.7, 2.5}), box({-3.0, 2.5, 0.0}, {3.0, 2.7, 2.5}),
            box({-3.0, -2.7, 0.0}, {3.0, -2.5, 2.5}), box({1.8, 0.9, 0.0}, {2.1, 1.2, 2.0}),
            box({1.2, -2.5, 0.0}, {2.2, -1.9, 0.8})};
  }
  [[nodiscard]] static Transform planar(double x_m, double y_m, double yaw_rad) {
    return transform_from_xyz_rpy({x_m, y_m, 0.0}, {0.0, 0.0, yaw_rad});
  }

  /// What the camera sees from where its carrier truly is, said to be from elsewhere.
  [[nodiscard]] Frame frame(const BoxField& scene, const Transform& T_world_base,
                            const Transform& T_odom_base) {
    const Transform T_base_camera =
        transform_from_xyz_rpy({0.0, 0.0, 1.0}, {0.0, 0.35, 0.0}) * T_forward_optical();
    DepthImage image;
    image.camera = {80, 60, 69.3, 69.3, 39.5, 29.5};
    const Transform T_world_camera = T_world_base * T_base_camera;
    for (int v = 0; v < image.camera.height_px; ++v) {
      for (int u = 0; u < image.camera.width_px; ++u) {
        const Eigen::Vector3d ray = image.camera.unproject(u, v, 1.0);
        const Eigen::Vector3d direction = T_world_camera.linear() * ray.normalized();
        const double far_m = scene.along_ray_m(T_world_camera.translation(), direction);
        const double depth_m = far_m / ray.norm();
        image.depth_m.push_back(depth_m < 5.0 ? static_cast<float>(depth_m) : 0.0F);
      }
    }
    Frame frame;
    frame.sequence = sequence_++;
    frame.stamp = {frame.sequence * 100'000'000};
    frame.T_world_camera = T_odom_base * T_base_camera;
    frame.measurement = std::move(image);
    const Eigen::Vector3d& p = T_odom_base.translation();
    if (robot_) frame.joint_positions = Eigen::Vector3d(p.x(), p.y(), yaw_of(T_odom_base));
    return frame;
  }

  /// An arc through the room, and what odometry makes of it: 2 % too long, 2 degrees a metre off.
  struct Drive {
    Transform T_world_base = planar(-1.5, -0.5, 0.0);
    Transform T_odom_base = T_world_base;
    double share = 0.02;
    double rad_per_m = 0.035;

    void step() {
      constexpr double kStep_m = 0.03, kTurn_rad = 0.005;
      T_world_base = T_world_base * planar(kStep_m, 0.0, kTurn_rad);
      T_odom_base =
          T_odom_base * planar(kStep_m * (1.0 + share), 0.0, kTurn_rad + rad_per_m * kStep_m);
    }
    /// How far from the truth a correction leaves the base.
    [[nodiscard]] double error_m(const Localisation& found) const {
      return (found.T_map_odom * T_odom_base.translation() - T_world_base.translation()).norm();
    }
    [[nodiscard]] double error_rad(const Localisation& found) const {
      return std::abs(Eigen::AngleAxisd((found.T_map_odom * T_odom_base).linear().transpose() *
                                        T_world_base.linear())
                          .angle());
    }
  };

  /// The last of 70 frames on the way; `spoil` may change each.
  Localisation drive(Localiser& localiser, Drive& along,
                     const std::function<void(Frame&)>& spoil = {}) {
    Localisation found =
        *localiser.localise(frame(room_, along.T_world_base, along.T_odom_base), nullptr);
    for (int i = 0; i < 70; ++i) {
      along.step();
      Frame seen = frame(room_, along.T_world_base, along.T_odom_base);
      if (spoil) spoil(seen);
      auto next = localiser.localise(seen, &room_);
      if (!next) throw std::runtime_error(next.error().describe());
      found = *next;
    }
    return found;
  }

  std::shared_ptr<const RobotModel> robot_ = turning_robot();
  BoxField room_{room()};
  std::int64_t sequence_ = 0;
};

GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(LocaliserConformance);

TEST_P(LocaliserConformance, TheFirstFrameIsWhereItSays) {
  const auto localiser = GetParam().make(robot_);
  const auto found = localiser->localise(frame(room_, planar(0, 0, 0), planar(1, 2, 0.3)), nullptr);
  ASSERT_TRUE(found) << found.error().describe();
  EXPECT_TRUE(found->T_map_odom.isApprox(Transform::Identity()));
  EXPECT_EQ(found->lost, "");
}

TEST_P(LocaliserConformance, LeavesOdometryThatIsRight) {
  const auto localiser = GetParam().make(robot_);
  Drive right;
  right.share = right.rad_per_m = 0.0;
  const Localisation found = drive(*localiser, right);
  EXPECT_LT(right.error_m(found), 0.005);
  EXPECT_LT(right.error_rad(found), 0.005);
}

TEST_P(LocaliserConformance, MakesUpForDrift) {
  const auto localiser = GetParam().make(robot_);
  Drive drifting;
  const Localisation found = drive(*localiser, drifting);
  EXPECT_LT(drifting.error_m(found), 0.25 * drifting.error_m({}));
  EXPECT_LT(drifting.error_rad(found), 0.25 * drifting.error_rad({}));
  EXPECT_LT(found.sigma_m, 0.03);
  EXPECT_EQ(found.lost, "");
}

TEST_P(LocaliserConformance, MovesTheBaseOfARobotInThePlaneAlone) {
  const auto localiser = GetParam().make(robot_);
  Drive drifting;
  const Transform T = drive(*localiser, drifting).T_map_odom;
  EXPECT_NEAR(T.translation().z(), 0.0, 1e-9);
  EXPECT_NEAR((T.linear() * Eigen::Vector3d::UnitZ() - Eigen::Vector3d::UnitZ()).norm(), 0.0, 1e-9);
}

TEST_P(LocaliserConformance, MakesUpForTheDriftOfASensorThatMovesFreely) {
  if (!GetParam().moves_freely) GTEST_SKIP() << "it is for robots";
  robot_ = nullptr;
  const auto localiser = GetParam().make(nullptr);
  Drive drifting;
  const Localisation found = drive(*localiser, drifting);
  EXPECT_LT(drifting.error_m(found), 0.3 * drifting.error_m({}));
}

TEST_P(LocaliserConformance, PassesOverSomebodyWhoIsNotInTheMap) {
  const auto localiser = GetParam().make(robot_);
  Drive drifting;
  const Localisation found = drive(*localiser, drifting, [](Frame& seen) {
    auto& image = std::get<DepthImage>(seen.measurement);
    for (int v = 0; v < 60; ++v) {
      for (int u = 10; u < 35; ++u) image.depth_m[idx(v * 80 + u)] = 0.9F;
    }
  });
  EXPECT_LT(drifting.error_m(found), 0.3 * drifting.error_m({}));
}

/// Along a wall that has no end, only odometry tells how far it went.
TEST_P(LocaliserConformance, KnowsWhatTheSceneDoesNotDetermine) {
  const BoxField wall({box({1.5, -50.0, -1.0}, {1.7, 50.0, 5.0})});
  const auto localiser = GetParam().make(robot_);
  (void)localiser->localise(frame(wall, planar(0, 0, 0), planar(0, 0, 0)), nullptr);
  Localisation found;
  double before_m = 0.0;
  for (int i = 1; i <= 120; ++i) {
    const double along_m = 0.025 * i;
    found = *localiser->localise(
        frame(wall, planar(0, along_m, 0), planar(0.01 * along_m, along_m, 0)), &wall);
    if (i == 60) before_m = found.sigma_m;
  }
  const Eigen::Vector3d p = found.T_map_odom * Eigen::Vector3d(0.03, 3.0, 0.0);
  EXPECT_NEAR(p.x(), 0.0, 0.01);
  EXPECT_NEAR(p.y(), 3.0, 0.05);
  EXPECT_GT(found.sigma_m, 1.2 * before_m);
  EXPECT_GT(found.sigma_m, 0.01);
}

TEST_P(LocaliserConformance, GoesByOdometryWhereNothingIsMeasured) {
  const auto localiser = GetParam().make(robot_);
  Drive drifting;
  const double nothing = std::numeric_limits<double>::quiet_NaN();
  for (const double depth_m : {0.0, nothing}) {
    const Localisation found = drive(*localiser, drifting, [depth_m](Frame& seen) {
      std::ranges::fill(std::get<DepthImage>(seen.measurement).depth_m,
                        static_cast<float>(depth_m));
    });
    EXPECT_TRUE(found.T_map_odom.isApprox(Transform::Identity()));
    EXPECT_GT(found.sigma_m, 0.0);
  }
}

TEST_P(LocaliserConformance, SaysThatItIsLost) {
  const auto localiser = GetParam().make(robot_);
  const BoxField nothing(std::vector<Eigen::AlignedBox3d>{});
  Localisation found;
  for (int i = 0; i < 20000 && found.lost.empty(); ++i) {
    const Transform T = planar(0.5 * i, 0, 0);
    found = *localiser->localise(frame(nothing, T, T), &nothing);
  }
  EXPECT_NE(found.lost, "");
}

TEST_P(LocaliserConformance, SaysTheSameOfTheSameFrames) {
  const auto say = [&] {
    sequence_ = 0;
    Drive drifting;
    return drive(*GetParam().make(robot_), drifting);
  };
  EXPECT_EQ(say().T_map_odom.matrix(), say().T_map_odom.matrix());
}

}  // namespace sidestep::conformance
