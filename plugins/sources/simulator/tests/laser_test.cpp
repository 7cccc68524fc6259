#include <cmath>
#include <filesystem>
#include <fstream>
#include <memory>
#include <stdexcept>

#include <gtest/gtest.h>

#include "hsr_on_its_way.hpp"

namespace sidestep::simulator {
namespace {

constexpr double kAcross_rad = 4.71238;

/// The laser on the HSR's base, and a room of 6 x 4 m around the robot.
class LaserOnTheHsr : public ::testing::Test {
 protected:
  LaserOnTheHsr() {
    scene_ =
        std::filesystem::path(::testing::TempDir()) /
        ("sidestep_laser_" +
         std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".yaml");
    std::ofstream(scene_) << "objects:\n"
                             "  - {name: floor, shape: half_space}\n"
                             "  - {name: ahead, shape: {box: {size_m: [0.2, 8, 3]}},"
                             " pose: {xyz_m: [3.1, 0, 1.5]}}\n"
                             "  - {name: left, shape: {box: {size_m: [9, 0.2, 3]}},"
                             " pose: {xyz_m: [0, 2.1, 1.5]}}\n"
                             "  - {name: right, shape: {box: {size_m: [9, 0.2, 3]}},"
                             " pose: {xyz_m: [0, -2.1, 1.5]}}\n";
    options_ = testing::HsrOnItsWay::options(scene_);
    options_.mount = MountOptions{.link = "base_range_sensor_link"};
    options_.range_min_m = 0.05;
    options_.range_max_m = 20.0;
    options_.laser.emplace();
    options_.laser->dropout = 0.0;
  }
  ~LaserOnTheHsr() override { std::filesystem::remove(scene_); }

  Frame next() { return next(options_, hsr_.context()); }
  static Frame next(const Options& options, const HostContext& context) {
    auto made = create_source(options, context);
    if (!made) throw std::runtime_error(made.error().describe());
    auto frame = (*made)->next(Deadline());
    if (!frame || !*frame) throw std::runtime_error("no frame");
    return std::move(**frame);
  }
  void stand(double yaw_rad) {
    q_ = hsr_.pose("drive");
    q_[2] = yaw_rad;
    hsr_.move(q_, Eigen::VectorXd::Zero(8), 0.0, 1.0);
  }
  static double angle_rad(std::size_t beam) {
    return -0.5 * kAcross_rad + kAcross_rad * static_cast<double>(beam) / 720.0;
  }
  static const std::vector<Eigen::Vector3f>& points(const Frame& frame) {
    return std::get<PointCloud>(frame.measurement).points_m;
  }
  /// By the formulas of ray and plane, from where the URDF has the laser.
  [[nodiscard]] double to_wall_m(double yaw_rad, double angle) const {
    const Eigen::Vector2d eye(0.1675 * std::cos(yaw_rad), 0.1675 * std::sin(yaw_rad));
    const Eigen::Vector2d ray(std::cos(yaw_rad + angle), std::sin(yaw_rad + angle));
    double range_m = 1e9;
    if (ray.x() > 0.0) range_m = (3.0 - eye.x()) / ray.x();
    if (ray.y() > 0.0) range_m = std::min(range_m, (2.0 - eye.y()) / ray.y());
    if (ray.y() < 0.0) range_m = std::min(range_m, (-2.0 - eye.y()) / ray.y());
    return range_m;
  }

  testing::HsrOnItsWay hsr_;
  Eigen::VectorXd q_;
  std::filesystem::path scene_;
  Options options_;
};

TEST_F(LaserOnTheHsr, MeasuresTheWallsAroundIt) {
  options_.laser->sigma_m = 0.0;
  const double yaw_rad = 0.4;
  stand(yaw_rad);
  const Frame frame = next();
  ASSERT_EQ(points(frame).size(), 721U);
  EXPECT_NEAR(frame.T_world_camera.translation().z(), 0.1844, 1e-9);
  int of_walls = 0, of_robot = 0;
  for (std::size_t beam = 0; beam < 721; ++beam) {
    const Eigen::Vector3f& p = points(frame)[beam];
    ASSERT_TRUE(p.allFinite());
    EXPECT_EQ(p.z(), 0.0F);
    EXPECT_NEAR(std::remainder(std::atan2(p.y(), p.x()) - angle_rad(beam), 6.283185307), 0.0, 1e-4);
    if (std::abs(p.norm() - to_wall_m(yaw_rad, angle_rad(beam))) < 1e-4) {
      ++of_walls;
      continue;
    }
    // Behind it to both sides stands its own body.
    ++of_robot;
    EXPECT_NEAR(hsr_.distance_m(frame.T_world_camera * p.cast<double>(), q_), 0.0, 1e-4) << beam;
    EXPECT_GT(std::abs(angle_rad(beam)), 1.5);
  }
  EXPECT_GT(of_walls, 600);
  EXPECT_GT(of_robot, 0);
}

TEST_F(LaserOnTheHsr, ErrsAsItIsSaidTo) {
  options_.laser->sigma_m = 0.02;
  options_.laser->dropout = 0.1;
  stand(0.0);
  const Frame frame = next();
  double sum = 0.0, squares = 0.0;
  int count = 0, lost = 0;
  for (std::size_t beam = 160; beam < 560; ++beam) {
    const Eigen::Vector3f& p = points(frame)[beam];
    if (!p.allFinite()) {
      ++lost;
      continue;
    }
    const double error_m = p.norm() - to_wall_m(0.0, angle_rad(beam));
    sum += error_m;
    squares += error_m * error_m;
    ++count;
  }
  EXPECT_NEAR(sum / count, 0.0, 0.004);  // four standard deviations of a mean of 360
  EXPECT_NEAR(std::sqrt(squares / count), 0.02, 0.004);
  EXPECT_NEAR(lost, 40, 24);
}

/// On a path it looks where a camera would.
TEST_F(LaserOnTheHsr, OnAPathItsMiddleIsAhead) {
  options_.mount.reset();
  options_.laser->sigma_m = 0.0;
  options_.camera_path = {{0.0, {0.0, 0.0, 0.3}, Eigen::Vector3d(1.0, 0.0, 0.3), {}}};
  const Frame frame = next();
  EXPECT_NEAR(points(frame)[360].x(), 3.0, 1e-5);
  EXPECT_NEAR(points(frame)[600].norm(), 2.0, 1e-4);  // 90 degrees to the left
}

/// One of several sensors of a run sees the world of its first source.
TEST_F(LaserOnTheHsr, SeesTheWorldOfTheRunsFirstSource) {
  options_.laser->sigma_m = 0.0;
  stand(0.0);
  Options camera = testing::HsrOnItsWay::options(scene_);
  const auto first = create_source(camera, hsr_.context());
  ASSERT_TRUE(first) << first.error().describe();
  options_.scene.reset();
  HostContext context = hsr_.context();
  context.truth = dynamic_cast<GroundTruth*>(first->get());
  context.scene = context.truth->scene_until(Stamp{0});
  EXPECT_NEAR(points(next(options_, context))[360].x(), 3.0 - 0.1675, 1e-4);
}

TEST_F(LaserOnTheHsr, HasFaultsOfItsOwn) {
  stand(0.0);
  options_.fault.kind = "obstructed";
  EXPECT_TRUE(options_.check().empty());
  EXPECT_NEAR(points(next())[245].norm(), 0.15, 1e-6);
  options_.fault.kind = "lens";
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check().front().what, "is of cameras");
  options_.laser.reset();
  options_.fault.kind = "obstructed";
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check().front().what, "is of lasers");
}

}  // namespace
}  // namespace sidestep::simulator
