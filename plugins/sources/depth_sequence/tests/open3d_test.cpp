#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "../depth_sequence.hpp"
#include "conformance/test_host.hpp"
#include "sequence_testing.hpp"
#include "support/read_frames.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::depth_sequence {
namespace {

using ::testing::HasSubstr;

/// Three images and as many poses; the second is turned by a quarter about z.
class Open3d : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"000000", "000001", "000002"}) {
      testing::write_png(folder_.path() / "depth" / (std::string(name) + ".png"), 320, 240,
                         std::vector<std::uint16_t>(320 * 240, 1500));
    }
    folder_.write("scene/trajectory.log",
                  "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
                  "1 1 2\n0 -1 0 0.5\n1 0 0 -0.25\n0 0 1 2\n0 0 0 1\n"
                  "2 2 3\n1 0 0 3\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
    folder_.write("camera_intrinsic.json",
                  "{\"width\": 320, \"height\": 240, \"intrinsic_matrix\": "
                  "[310.0, 0, 0, 0, 311.0, 0, 160.5, 119.5, 1]}");
    options_.path = folder_.path();
    options_.rate_hz = 10.0;
  }

  testing_support::TemporaryFolder folder_;
  conformance::RecordingLog log_;
  YamlDocumentReader documents_;
  Options options_;
};

TEST_F(Open3d, ReadsImagesPosesAndTheCamera) {
  const auto source = create_source(options_, log_, documents_);
  ASSERT_TRUE(source) << source.error().describe();
  const auto frames = testing_support::read_frames(**source, 20);
  ASSERT_EQ(frames.size(), 3U);
  for (const auto& frame : frames) ASSERT_TRUE(frame) << frame.error().describe();
  const auto& image = std::get<DepthImage>(frames[1]->measurement);
  EXPECT_FLOAT_EQ(image.at(160, 120), 1.5F);
  EXPECT_EQ(image.camera.fx_px, 310.0);
  EXPECT_EQ(image.camera.fy_px, 311.0);
  EXPECT_EQ(image.camera.cx_px, 160.5);
  EXPECT_EQ(image.camera.cy_px, 119.5);
  EXPECT_EQ(frames[1]->stamp.ns, 100'000'000);
  // One metre ahead of the second camera's x is along the sequence's y.
  const Eigen::Vector3d ahead = frames[1]->T_world_camera * Eigen::Vector3d(1.0, 0.0, 0.0);
  EXPECT_TRUE(ahead.isApprox(Eigen::Vector3d(0.5, 0.75, 2.0), 1e-12));
}

/// Names without zeros in front are in the order of their numbers, too.
TEST_F(Open3d, OrdersImagesByTheirNumbers) {
  std::string log;
  for (int i = 0; i < 12; ++i) {
    const std::string name = std::to_string(i);
    testing::write_png(folder_.path() / "plain" / "depth" / (name + ".png"), 320, 240,
                       std::vector<std::uint16_t>(320 * 240, static_cast<std::uint16_t>(1000 + i)));
    log += name + " " + name + " 1\n1 0 0 " + name + "\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
  }
  folder_.write("plain/trajectory.log", log);
  std::filesystem::copy(folder_.path() / "camera_intrinsic.json",
                        folder_.path() / "plain" / "camera_intrinsic.json");
  options_.path = folder_.path() / "plain";
  const auto source = create_source(options_, log_, documents_);
  ASSERT_TRUE(source) << source.error().describe();
  const auto frames = testing_support::read_frames(**source, 20);
  ASSERT_EQ(frames.size(), 12U);
  for (int i = 0; i < 12; ++i) {
    const auto& frame = frames[static_cast<std::size_t>(i)];
    ASSERT_TRUE(frame) << frame.error().describe();
    EXPECT_NEAR(std::get<DepthImage>(frame->measurement).at(5, 5), 1.0 + 0.001 * i, 1e-6);
    EXPECT_EQ(frame->T_world_camera.translation().x(), i);
  }
}

TEST_F(Open3d, RefusesIntrinsicsOfOtherImages) {
  folder_.write("camera_intrinsic.json",
                "{\"width\": 640, \"height\": 480, \"intrinsic_matrix\": "
                "[525.0, 0, 0, 0, 525.0, 0, 159.5, 119.5, 1]}");
  const auto source = create_source(options_, log_, documents_);
  ASSERT_FALSE(source);
  EXPECT_THAT(source.error().describe(), HasSubstr("camera_intrinsic.json:1:11"));
  EXPECT_THAT(source.error().describe(), HasSubstr("the intrinsics of other images"));
}

TEST_F(Open3d, SaysWhichPoseIsMissingOrWrong) {
  folder_.write("scene/trajectory.log",
                "0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n"
                "1 1 2\n2 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n");
  const auto source = create_source(options_, log_, documents_);
  ASSERT_TRUE(source) << source.error().describe();
  const auto frames = testing_support::read_frames(**source, 20);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_TRUE(frames[0]);
  ASSERT_FALSE(frames[1]);
  EXPECT_THAT(frames[1].error().describe(), HasSubstr("not a rotation"));
  ASSERT_FALSE(frames[2]);
  EXPECT_THAT(frames[2].error().describe(), HasSubstr("there are only 2 poses"));
}

TEST_F(Open3d, RefusesALogThatIsNone) {
  for (const auto& [text, expected] : std::vector<std::pair<std::string, std::string>>{
           {"0 0 1\n1 0 0 0\n0 1 0 0\n", "the last pose is cut off"},
           {"0 0 1\n1 0 0\n", "trajectory.log:2: expected a row of four numbers"},
           {"0 0 1\n1 0 zero 0\n", "expected a number, found 'zero'"},
           {"0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n2 2 3\n",
            "trajectory.log:6: this is pose 2, expected 1"},
           {"1 0 0 0\n", "expected the three numbers of a pose"}}) {
    folder_.write("scene/trajectory.log", text);
    const auto source = create_source(options_, log_, documents_);
    ASSERT_FALSE(source) << text;
    EXPECT_THAT(source.error().describe(), HasSubstr(expected));
  }
}

}  // namespace
}  // namespace sidestep::depth_sequence
