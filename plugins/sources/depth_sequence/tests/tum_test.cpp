#include <cmath>
#include <numbers>

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

class Tum : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const char* name : {"a", "b", "c"}) {
      testing::write_png(folder_.path() / "depth" / (std::string(name) + ".png"), 640, 480,
                         std::vector<std::uint16_t>(640 * 480, 10000));
    }
    folder_.write("depth.txt",
                  "# depth maps\n# timestamp filename\n1305031102.160407 depth/a.png\n"
                  "1305031102.200000 depth/b.png\n1305031102.260000 depth/c.png\n");
    const std::string half = std::to_string(std::sqrt(0.5));
    folder_.write("groundtruth.txt",
                  "# timestamp tx ty tz qx qy qz qw\n1305031102.150000 0 0 0 0 0 0 1\n"
                  "1305031102.200000 1 2 3 0 0 0 1\n1305031102.240000 3 2 3 0 0 " +
                      half + " " + half + "\n1305031102.280000 3 4 3 0 0 " + half + " " + half +
                      "\n");
    options_.path = folder_.path();
  }

  std::vector<Result<Frame>> read_all() {
    const auto source = create_source(options_, log_, documents_);
    if (!source) {
      std::vector<Result<Frame>> refusal;
      refusal.emplace_back(tl::unexpect, source.error());
      return refusal;
    }
    return testing_support::read_frames(**source, 20);
  }

  testing_support::TemporaryFolder folder_;
  conformance::RecordingLog log_;
  YamlDocumentReader documents_;
  Options options_;
};

TEST_F(Tum, ReadsDepthInFiveThousandthsOfAMetreAndTheUsualCamera) {
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  ASSERT_TRUE(frames[0]) << frames[0].error().describe();
  const auto& image = std::get<DepthImage>(frames[0]->measurement);
  EXPECT_FLOAT_EQ(image.at(320, 240), 2.0F);
  EXPECT_EQ(image.camera.fx_px, 525.0);
  EXPECT_EQ(image.camera.cx_px, 319.5);
  EXPECT_NEAR(static_cast<double>(frames[0]->stamp.ns), 1305031102.160407e9, 500.0);
}

TEST_F(Tum, SaysWhichImagesAreNotListed) {
  testing::write_png(folder_.path() / "depth" / "d.png", 640, 480,
                     std::vector<std::uint16_t>(640 * 480, 10000));
  EXPECT_EQ(read_all().size(), 3U);
  const std::string folder = folder_.path().string();
  EXPECT_THAT(
      log_.messages(),
      ::testing::IsSupersetOf(
          {"read " + folder + ": 3 depth images and 4 poses of layout tum",
           folder + ": 1 images beside those of depth.txt are not listed there, and not read",
           folder + ": 3 of 3 frames handed out, 0 unusable"}));
  EXPECT_EQ(log_.count(LogLevel::kWarning), 1);
}

TEST_F(Tum, InterpolatesThePoseToTheDepthStamp) {
  // 10.407 of 50 ms; at a pose's own stamp; half-way.
  folder_.write("depth.txt",
                "1305031102.160407 depth/a.png\n1305031102.2 depth/b.png\n"
                "1305031102.22 depth/c.png\n");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  for (const auto& frame : frames) ASSERT_TRUE(frame) << frame.error().describe();
  EXPECT_TRUE(
      frames[0]->T_world_camera.translation().isApprox(0.20814 * Eigen::Vector3d(1, 2, 3), 1e-4));
  EXPECT_TRUE(frames[1]->T_world_camera.translation().isApprox(Eigen::Vector3d(1, 2, 3), 1e-4));
  EXPECT_TRUE(frames[2]->T_world_camera.translation().isApprox(Eigen::Vector3d(2, 2, 3), 1e-4));
  const Eigen::Matrix3d eighth =
      Eigen::AngleAxisd(std::numbers::pi / 4, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_TRUE(frames[2]->T_world_camera.linear().isApprox(eighth, 1e-4));
}

TEST_F(Tum, RefusesFramesThatThePosesDoNotCover) {
  folder_.write("depth.txt",
                "1305031102.1 depth/a.png\n1305031102.2 depth/b.png\n1305031102.3 depth/c.png\n");
  auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_THAT(frames[0].error().describe(), HasSubstr("poses begin after"));
  EXPECT_EQ(frames[0].error().code, ErrorCode::kBadFrame);
  EXPECT_THAT(frames[0].error().where, HasSubstr("frame 0 ("));
  EXPECT_TRUE(frames[1]);
  EXPECT_THAT(frames[2].error().describe(), HasSubstr("poses end before"));

  folder_.write("depth.txt", "1305031102.22 depth/a.png\n1305031102.17 depth/b.png\n");
  options_.max_pose_gap_s = 0.045;
  frames = read_all();
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_THAT(frames[0].error().describe(), HasSubstr("max_pose_gap_s"));
  EXPECT_TRUE(frames[1]) << "the list is put in the order of its stamps";
}

TEST_F(Tum, RefusesFramesBesidePosesThatAreNone) {
  folder_.write("groundtruth.txt",
                "1305031102.15 0 0 0 0 0 0 1\n1305031102.19 nan 0 0 0 0 0 1\n"
                "1305031102.21 0 0 0 0 0 0 0.5\n1305031102.25 0 0 0 0 0 0 1\n"
                "1305031102.27 0 0 0 0 0 0 1\n");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_THAT(frames[0].error().describe(), HasSubstr("no usable pose around"));
  EXPECT_THAT(frames[1].error().describe(), HasSubstr("no usable pose around"));
  EXPECT_TRUE(frames[2]);
}

TEST_F(Tum, NamesTheLineOfAMalformedList) {
  folder_.write("groundtruth.txt", "# header\n1305031102.15 0 0 0 0 0 1\n");
  EXPECT_THAT(read_all()[0].error().describe(), HasSubstr("groundtruth.txt:2"));
  folder_.write("groundtruth.txt", "1305031102.15 0 0 zero 0 0 0 1\n");
  EXPECT_THAT(read_all()[0].error().describe(), HasSubstr("found 'zero'"));
  std::filesystem::remove(folder_.path() / "groundtruth.txt");
  EXPECT_EQ(read_all()[0].error().code, ErrorCode::kNotFound);
  EXPECT_THAT(read_all()[0].error().describe(), HasSubstr("groundtruth.txt"));
  SetUp();
  folder_.write("depth.txt", "1305031102.2 depth/a.png\nnever depth/b.png\n");
  EXPECT_THAT(read_all()[0].error().describe(), HasSubstr("depth.txt:2"));
  folder_.write("depth.txt", "1e300 depth/b.png\n");
  EXPECT_THAT(read_all()[0].error().describe(), HasSubstr("no time in seconds"));
}

TEST_F(Tum, NamesAMissingImageAndGoesOn) {
  std::filesystem::remove(folder_.path() / "depth" / "b.png");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_THAT(frames[1].error().describe(), HasSubstr("b.png"));
  EXPECT_TRUE(frames[2]);
}

}  // namespace
}  // namespace sidestep::depth_sequence
