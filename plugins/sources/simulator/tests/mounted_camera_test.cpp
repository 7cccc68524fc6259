#include "../viewpoint.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "../simulator.hpp"
#include "hsr_on_its_way.hpp"
#include "voxel_grid.hpp"

namespace sidestep::simulator {
namespace {

/// The HSR in front of a wall 2 m ahead, with its arm stretched out.
class CameraOnTheHsr : public ::testing::Test {
 protected:
  CameraOnTheHsr() {
    scene_ =
        std::filesystem::path(::testing::TempDir()) /
        ("sidestep_wall_" +
         std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".yaml");
    std::ofstream(scene_) << "objects:\n"
                             "  - {name: floor, shape: half_space}\n"
                             "  - {name: wall, shape: {box: {size_m: [0.2, 8, 3]}},"
                             " pose: {xyz_m: [2.1, 0, 1.5]}}\n";
    options_ = testing::HsrOnItsWay::options(scene_);
  }
  ~CameraOnTheHsr() override { std::filesystem::remove(scene_); }

  std::unique_ptr<Source> make() {
    auto made = create_source(options_, hsr_.context());
    if (!made) throw std::runtime_error(made.error().describe());
    return std::move(*made);
  }
  static Frame next(Source& source) {
    auto frame = source.next(Deadline());
    if (!frame || !*frame) throw std::runtime_error("no frame");
    return std::move(**frame);
  }
  /// Drives sideways and lowers its arm for 3 s.
  void reach() {
    Eigen::VectorXd qdot = Eigen::VectorXd::Zero(8);
    qdot[hsr_.joint("odom_y")] = 0.2;
    qdot[hsr_.joint("odom_t")] = 0.05;
    qdot[hsr_.joint("arm_flex_joint")] = -0.2;
    hsr_.move(hsr_.pose("reach_table"), qdot, 0.0, 3.0);
  }

  testing::HsrOnItsWay hsr_;
  std::filesystem::path scene_;
  Options options_;
};

/// From the robot's dimensions.
TEST_F(CameraOnTheHsr, StandsWhereTheRobotsKinematicsPutIt) {
  Eigen::VectorXd q = hsr_.pose("neutral");
  q[0] = 0.3;
  q[1] = -0.2;
  q[2] = 0.7;
  q[hsr_.joint("arm_lift_joint")] = 0.4;
  hsr_.move(q, Eigen::VectorXd::Zero(8), 0.0, 1.0);
  const auto source = make();
  const Frame frame = next(*source);
  const double tilt = -0.3;
  const Eigen::Vector3d in_head(-0.079796, 0.022, 0.215172);
  const Eigen::Vector3d in_base(
      0.02 + in_head.x() * std::cos(tilt) - in_head.z() * std::sin(tilt), in_head.y(),
      0.752 + 0.5 * 0.4 + in_head.x() * std::sin(tilt) + in_head.z() * std::cos(tilt));
  const Eigen::Vector3d expected(0.3 + std::cos(0.7) * in_base.x() - std::sin(0.7) * in_base.y(),
                                 -0.2 + std::sin(0.7) * in_base.x() + std::cos(0.7) * in_base.y(),
                                 in_base.z());
  EXPECT_LT((frame.T_world_camera.translation() - expected).norm(), 1e-9);
  const Eigen::Vector3d ahead(std::cos(tilt) * std::cos(0.7), std::cos(tilt) * std::sin(0.7),
                              std::sin(tilt));
  EXPECT_LT((frame.T_world_camera.linear().col(2) - ahead).norm(), 1e-9);
  EXPECT_LT(frame.T_world_camera.linear().col(1).z(), -0.9);  // y down
  EXPECT_EQ(*frame.joint_positions, q);
}

TEST_F(CameraOnTheHsr, IsMovedOnItsLinkByItsOwnPose) {
  hsr_.move(hsr_.pose("neutral"), Eigen::VectorXd::Zero(8), 0.0, 1.0);
  const Frame plain = next(*make());
  options_.mount->xyz_m = {0.01, 0.02, 0.03};
  options_.mount->rpy_rad = {0.1, 0.2, 0.3};
  const Frame moved = next(*make());
  const Transform expected =
      plain.T_world_camera * transform_from_xyz_rpy({0.01, 0.02, 0.03}, {0.1, 0.2, 0.3});
  EXPECT_TRUE(moved.T_world_camera.isApprox(expected, 1e-12));
}

TEST_F(CameraOnTheHsr, SeesTheSceneAndTheRobotsOwnArm) {
  reach();
  const auto source = make();
  const Scene& scene = dynamic_cast<const GroundTruth&>(*source).scene();
  EXPECT_EQ(scene.objects().size(), 2U);
  int on_robot = 0;
  int on_scene = 0;
  for (int k = 0; k < 30; k += 1) {
    const Frame frame = next(*source);
    EXPECT_EQ(frame.sequence, k);
    const auto& image = std::get<DepthImage>(frame.measurement);
    for (int v = 0; v < 120; v += 5) {
      for (int u = 0; u < 160; u += 5) {
        if (image.at(u, v) == 0.0F) continue;
        const Eigen::Vector3d p =
            frame.T_world_camera * image.camera.unproject(u, v, image.at(u, v));
        const double to_robot_m =
            hsr_.distance_m(p, *frame.joint_positions, "head_rgbd_sensor_link");
        const double to_scene_m =
            std::abs(scene.signed_distance(p, frame.stamp.seconds()).distance_m);
        EXPECT_LT(std::min(to_robot_m, to_scene_m), 1e-5);
        (to_robot_m < to_scene_m ? on_robot : on_scene)++;
      }
    }
  }
  EXPECT_GT(on_robot, 300);
  EXPECT_GT(on_scene, 3000);
}

/// What has been mapped in 3 s: ghosts are occupied voxels far from every surface of the scene, as
/// many as there were at a time.
struct Mapped {
  std::int64_t self_points = 0;
  int occupied = 0;
  int ghosts = 0;
};

void count_voxels(const voxel_grid::VoxelGrid& map, const Scene& scene, Mapped& mapped) {
  const GridSpec& grid = map.grid();
  const VoxelBits occupied = map.occupied();
  mapped.occupied = 0;
  int ghosts = 0;
  for (int k = 0; k < grid.size_vox.z(); ++k) {
    for (int j = 0; j < grid.size_vox.y(); ++j) {
      for (int i = 0; i < grid.size_vox.x(); ++i) {
        if (!occupied.at(grid, {i, j, k})) continue;
        ++mapped.occupied;
        const double to_scene_m = scene.signed_distance(grid.centre_m({i, j, k}), 0.0).distance_m;
        if (to_scene_m > 2.0 * grid.resolution_m) ++ghosts;
      }
    }
  }
  mapped.ghosts = std::max(mapped.ghosts, ghosts);
}

Mapped map_all(Source& source, const HostContext& context, bool tells_joints) {
  voxel_grid::VoxelGridOptions options;
  options.resolution_m = 0.025;
  options.size_vox = {128, 160, 80};
  options.origin_m = {-0.8, -2.0, 0.0};
  voxel_grid::VoxelGrid map(options, context);
  Mapped mapped;
  for (int k = 0; k < 30; ++k) {
    auto frame = source.next(Deadline());
    if (!tells_joints) (*frame)->joint_positions.reset();
    const auto update = map.integrate(**frame);
    if (!update) throw std::runtime_error(update.error().describe());
    mapped.self_points += update->counts.self;
    if (k % 3 == 2) count_voxels(map, dynamic_cast<const GroundTruth&>(source).scene(), mapped);
  }
  return mapped;
}

TEST_F(CameraOnTheHsr, LeavesNothingOfTheRobotInTheMap) {
  reach();
  const Mapped with = map_all(*make(), hsr_.context(), true);
  EXPECT_GT(with.self_points, 30 * 100);
  EXPECT_GT(with.occupied, 500);
  EXPECT_EQ(with.ghosts, 0);
  const Mapped without = map_all(*make(), hsr_.context(), false);
  EXPECT_EQ(without.self_points, 0);
  EXPECT_GT(without.ghosts, 0);
}

TEST_F(CameraOnTheHsr, SeesTheTruthAndReportsWhatIsMeasured) {
  const Eigen::VectorXd q = hsr_.pose("neutral");
  Eigen::VectorXd measured = q;
  measured[0] += 0.05;
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(8);
  hsr_.motion().record({measured, rest}, Stamp{});
  hsr_.motion().record_truth({q, rest}, Stamp{});
  const Frame frame = next(*make());
  EXPECT_EQ(*frame.joint_positions, measured);
  const auto& image = std::get<DepthImage>(frame.measurement);
  // The wall is seen as far as it is from where the robot truly stands: beyond, by its error.
  const Eigen::Vector3d p = frame.T_world_camera * image.camera.unproject(80, 30, image.at(80, 30));
  EXPECT_NEAR(p.x(), 2.05, 1e-5);
}

}  // namespace
}  // namespace sidestep::simulator
