#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include <gtest/gtest.h>

#include "../simulator.hpp"
#include "hsr_on_its_way.hpp"

namespace sidestep::simulator {
namespace {

/// Three cameras that look at the origin from around it.
class AroundTheHsr : public ::testing::Test {
 protected:
  AroundTheHsr() {
    scene_ =
        std::filesystem::path(::testing::TempDir()) /
        ("sidestep_around_" +
         std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()) + ".yaml");
    std::ofstream(scene_) << "objects: [{name: floor, shape: half_space}]\n";
    options_ = testing::HsrOnItsWay::options(scene_);
    options_.mount.reset();
    options_.fixed_cameras = {{{2.5, 0.0, 2.0}, {0.0, 0.0, 0.5}},
                              {{-1.5, 2.0, 2.5}, {0.0, 0.0, 0.5}},
                              {{-1.5, -2.0, 1.5}, {0.0, 0.0, 0.5}}};
  }
  ~AroundTheHsr() override { std::filesystem::remove(scene_); }

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

  testing::HsrOnItsWay hsr_;
  std::filesystem::path scene_;
  Options options_;
};

TEST_F(AroundTheHsr, TakeFramesInTurnAndSeeTheWholeRobotWhereItTrulyIs) {
  const Eigen::VectorXd q = hsr_.pose("neutral"), rest = Eigen::VectorXd::Zero(8);
  Eigen::VectorXd measured = q;
  measured[0] += 0.05;
  for (const double time_s : {0.0, 1.0}) {
    hsr_.motion().record({measured, rest}, Stamp::from_seconds(time_s));
    hsr_.motion().record_truth({q, rest}, Stamp::from_seconds(time_s));
  }
  const auto source = make();
  for (int k = 0; k < 7; ++k) {
    const Frame frame = next(*source);
    EXPECT_EQ(frame.sequence, k);
    EXPECT_EQ(frame.stamp, Stamp::from_seconds(0.1 * k));
    EXPECT_EQ(*frame.joint_positions, measured);
    const FixedCamera& camera = options_.fixed_cameras[static_cast<std::size_t>(k % 3)];
    EXPECT_EQ(frame.T_world_camera.translation(), camera.position_m);
    const Eigen::Vector3d ahead = (camera.look_at_m - camera.position_m).normalized();
    EXPECT_LT((frame.T_world_camera.linear().col(2) - ahead).norm(), 1e-12);
    const auto& image = std::get<DepthImage>(frame.measurement);
    int on_robot = 0, on_floor = 0;
    for (int v = 0; v < 120; v += 3) {
      for (int u = 0; u < 160; u += 3) {
        if (image.at(u, v) == 0.0F) continue;
        const Eigen::Vector3d p =
            frame.T_world_camera * image.camera.unproject(u, v, image.at(u, v));
        const double to_robot_m = hsr_.distance_m(p, q);
        EXPECT_LT(std::min(to_robot_m, std::abs(p.z())), 1e-5);
        (to_robot_m < 1e-5 ? on_robot : on_floor)++;
      }
    }
    EXPECT_GT(on_robot, 50);
    EXPECT_GT(on_floor, 500);
  }
}

TEST_F(AroundTheHsr, WaitForTheRobotsState) {
  hsr_.move(hsr_.pose("go"), Eigen::VectorXd::Zero(8), 0.0, 0.15);
  options_.pace = "clock";
  hsr_.clock().set_s(0.3);
  const auto source = make();
  const Deadline now(Deadline::SteadyClock::now());
  EXPECT_EQ((*source->next(now))->sequence, 1);
  EXPECT_EQ(source->next(now).error().code, ErrorCode::kDeadlineExceeded);
}

TEST_F(AroundTheHsr, AreThereInsteadOfAPathOrAMount) {
  EXPECT_TRUE(options_.check().empty());
  options_.camera_path = testing::room_options().camera_path;
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check()[0].parameters,
            (std::vector<std::string>{"fixed_cameras", "camera_path"}));
  options_.camera_path.clear();
  options_.mount = MountOptions{.link = "head_rgbd_sensor_link"};
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check()[0].parameters, (std::vector<std::string>{"mount", "fixed_cameras"}));
  options_.mount.reset();
  options_.fixed_cameras[1].look_at_m = options_.fixed_cameras[1].position_m;
  ASSERT_EQ(options_.check().size(), 1U);
  EXPECT_EQ(options_.check()[0].parameters[0], "fixed_cameras[1].look_at_m");
}

TEST_F(AroundTheHsr, SeeTheSceneAloneWhereNoRobotMoves) {
  conformance::TestHost host(1, testing::host_parts());
  auto source = create_source(options_, host.context());
  ASSERT_TRUE(source);
  const Frame frame = next(**source);
  EXPECT_FALSE(frame.joint_positions);
  const auto& image = std::get<DepthImage>(frame.measurement);
  const Eigen::Vector3d p = frame.T_world_camera * image.camera.unproject(79, 59, image.at(79, 59));
  EXPECT_NEAR(p.z(), 0.0, 1e-5);
}

}  // namespace
}  // namespace sidestep::simulator
