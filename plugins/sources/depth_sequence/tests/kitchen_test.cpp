#include <array>
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "../depth_sequence.hpp"
#include "conformance/test_host.hpp"

namespace sidestep::depth_sequence {
namespace {

const std::filesystem::path kKitchen =
    std::filesystem::path(SIDESTEP_SHARED_DATA) / "kinect_kitchen";

class Kitchen : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(kKitchen)) GTEST_SKIP() << "no recording at " << kKitchen;
    options_.path = kKitchen;
  }
  Options options_;
  conformance::RecordingLog log_;
  YamlDocumentReader documents_;
};

TEST_F(Kitchen, EveryFrameIsReadAndTheCameraIsAtEyeHeight) {
  auto source = create_source(options_, log_, documents_);
  ASSERT_TRUE(source) << source.error().describe();
  EXPECT_EQ((*source)->frame_count(), 300);
  int frames = 0;
  while (true) {
    const auto frame = (*source)->next(Deadline());
    ASSERT_TRUE(frame) << frame.error().describe();
    if (!*frame) break;
    ++frames;
    const double height_m = (*frame)->T_world_camera.translation().z();
    EXPECT_GT(height_m, 1.24);
    EXPECT_LT(height_m, 1.59);
  }
  EXPECT_EQ(frames, 300);
  // README, intrinsics and the world's frame are the other files.
  EXPECT_THAT(log_.messages(),
              ::testing::ElementsAre(
                  ::testing::EndsWith(
                      ": 300 depth images and 300 poses of layout seven_scenes, 3 other files"),
                  ::testing::EndsWith(": 300 of 300 frames handed out, 0 unusable")));
}

/// world.yaml says where the table stands and how high its top is.
TEST_F(Kitchen, TheTablesTopIsWhereTheRecordingSays) {
  options_.stride = 10;
  auto source = create_source(options_, log_, documents_);
  ASSERT_TRUE(source) << source.error().describe();
  constexpr double kBin_m = 0.01;
  std::array<int, 150> heights{};
  while (true) {
    const auto frame = (*source)->next(Deadline());
    ASSERT_TRUE(frame) << frame.error().describe();
    if (!*frame) break;
    const auto& image = std::get<DepthImage>((*frame)->measurement);
    for (int v = 0; v < image.camera.height_px; v += 2) {
      for (int u = 0; u < image.camera.width_px; u += 2) {
        const double depth_m = image.at(u, v);
        if (!(depth_m > 0.0)) continue;
        const Eigen::Vector3d p_world =
            (*frame)->T_world_camera * image.camera.unproject(u, v, depth_m);
        const bool over_table = p_world.x() > 1.2 && p_world.x() < 2.0 && p_world.y() > -1.1 &&
                                p_world.y() < 0.95 && p_world.z() > 0.3 && p_world.z() < 1.5;
        if (over_table) ++heights[static_cast<std::size_t>(p_world.z() / kBin_m)];
      }
    }
  }
  const auto mode = std::max_element(heights.begin(), heights.end()) - heights.begin();
  EXPECT_NEAR((static_cast<double>(mode) + 0.5) * kBin_m, 0.713, 0.0125);
}

}  // namespace
}  // namespace sidestep::depth_sequence
