#include "../depth_sequence.hpp"

#include <cmath>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "sequence_testing.hpp"
#include "support/read_frames.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::depth_sequence {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kWidth = 8;
constexpr int kHeight = 6;
const std::string kIntrinsics = "6 0 4\n0 6 3\n0 0 1\n";

std::string pose_text(double x_m) {
  return "1 0 0 " + std::to_string(x_m) + "\n0 1 0 0\n0 0 1 0\n0 0 0 1\n";
}

/// A 7-Scenes folder of frames 0 to 3; frame n looks from x = n metres.
class SevenScenes : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int i = 0; i < 4; ++i) write_frame(i);
    folder_.write("camera-intrinsics.txt", kIntrinsics);
    options_.path = folder_.path();
  }

  static std::string stem(int number) {
    std::string digits = std::to_string(number);
    return "frame-" + std::string(6 - digits.size(), '0') + digits;
  }
  [[nodiscard]] std::filesystem::path depth_file(int number) const {
    return folder_.path() / (stem(number) + ".depth.png");
  }
  void write_frame(int number) const {
    std::vector<std::uint16_t> raw(kWidth * kHeight, static_cast<std::uint16_t>(1000 + number));
    raw[1] = 0;
    raw[2] = 65535;
    raw[3] = 65534;
    testing::write_png(depth_file(number), kWidth, kHeight, raw);
    folder_.write(stem(number) + ".pose.txt", pose_text(number));
  }

  Result<std::unique_ptr<Source>> create() { return create_source(options_, log_, documents_); }

  /// Reads to the end; frames that are bad leave their error's text.
  std::vector<Result<Frame>> read_all() {
    const auto source = create();
    if (!source) {
      ADD_FAILURE() << source.error().describe();
      return {};
    }
    return testing_support::read_frames(**source, 100);
  }

  testing_support::TemporaryFolder folder_;
  conformance::RecordingLog log_;
  YamlDocumentReader documents_;
  Options options_;
};

TEST_F(SevenScenes, HandsOutEveryFrameInOrder) {
  options_.rate_hz = 10.0;
  EXPECT_EQ((*create())->frame_count(), 4);
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 4U);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    ASSERT_TRUE(frames[i]) << frames[i].error().describe();
    EXPECT_EQ(frames[i]->sequence, static_cast<std::int64_t>(i));
    EXPECT_EQ(frames[i]->stamp.ns, static_cast<std::int64_t>(i) * 100'000'000);
    EXPECT_EQ(frames[i]->T_world_camera.translation(),
              Eigen::Vector3d(static_cast<double>(i), 0, 0));
    const auto& image = std::get<DepthImage>(frames[i]->measurement);
    EXPECT_EQ(image.camera.width_px, kWidth);
    EXPECT_EQ(image.camera.height_px, kHeight);
    EXPECT_EQ(image.camera.fx_px, 6.0);
    EXPECT_EQ(image.camera.cx_px, 4.0);
    EXPECT_EQ(image.camera.cy_px, 3.0);
    ASSERT_EQ(image.depth_m.size(), static_cast<std::size_t>(kWidth * kHeight));
    EXPECT_FLOAT_EQ(image.depth_m[0], 1.0F + 0.001F * static_cast<float>(i));
  }
}

TEST_F(SevenScenes, TellsNothingFromInvalidAndCutsAtTheRange) {
  options_.depth_min_m = 1.0005;
  const auto frames = read_all();
  const auto& first = std::get<DepthImage>(frames[0]->measurement);
  EXPECT_EQ(first.depth_m[0], 0.0F) << "1 m is nearer than depth_min_m";
  EXPECT_EQ(first.depth_m[1], 0.0F);
  EXPECT_TRUE(std::isnan(first.depth_m[2])) << "65535";
  EXPECT_EQ(first.depth_m[3], 0.0F) << "65.534 m is beyond depth_max_m";
  EXPECT_GT(std::get<DepthImage>(frames[1]->measurement).depth_m[0], 1.0F);
}

TEST_F(SevenScenes, SelectsFramesByFirstStrideAndNumber) {
  options_.first_frame = 1;
  options_.stride = 2;
  auto frames = read_all();
  ASSERT_EQ(frames.size(), 2U);
  EXPECT_EQ(frames[0]->T_world_camera.translation().x(), 1.0);
  EXPECT_EQ(frames[1]->T_world_camera.translation().x(), 3.0);
  options_.max_frames = 1;
  EXPECT_EQ(read_all().size(), 1U);
  options_.first_frame = 4;
  EXPECT_THAT(create().error().describe(), HasSubstr("there are only 4 frames"));
}

TEST_F(SevenScenes, CountsForTheLogWhatItReadAndLeftOut) {
  std::filesystem::remove(depth_file(2));                             // a pose without an image
  std::filesystem::remove(folder_.path() / (stem(3) + ".pose.txt"));  // an image without a pose
  folder_.write(stem(0) + ".color.png", "");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 4U);
  EXPECT_TRUE(frames[1]);
  EXPECT_FALSE(frames[2]);
  EXPECT_FALSE(frames[3]);
  const std::string folder = folder_.path().string();
  EXPECT_THAT(log_.messages(),
              ElementsAre("read " + folder +
                              ": 3 depth images and 3 poses of layout seven_scenes, 2 other files",
                          folder + ": 2 of 4 frames handed out, 2 unusable"));
}

TEST_F(SevenScenes, RefusesFramesWhoseNumbersAreNone) {
  const auto complaint_about = [&](const std::string& name) {
    folder_.write(name, pose_text(0));
    const auto source = create();
    std::filesystem::remove(folder_.path() / name);
    return source ? "no error" : source.error().describe();
  };
  EXPECT_THAT(complaint_about("frame-00000x.depth.png"), HasSubstr("the frame has no number"));
  EXPECT_THAT(complaint_about("frame-.pose.txt"), HasSubstr("the frame has no number"));
  EXPECT_THAT(complaint_about("frame-99999999999999999999.pose.txt"),
              HasSubstr("the frame has no number"));
  EXPECT_THAT(complaint_about("frame-9223372036854775807.depth.png"),
              HasSubstr("stamps end at 285 years"));
  EXPECT_THAT(complaint_about("frame-02.depth.png"), HasSubstr("has this number, too"));
  EXPECT_THAT(complaint_about("frame-0002.pose.txt"), HasSubstr("has this number, too"));
}

TEST_F(SevenScenes, AppliesTheWorldFrameUnlessToldNot) {
  folder_.write("world.yaml",
                "T_world_sequence:\n  - [0, -1, 0, 5]\n  - [1, 0, 0, 6]\n  - [0, 0, 1, 7]\n"
                "  - [0, 0, 0, 1]\n");
  auto frames = read_all();
  EXPECT_TRUE(frames[2]->T_world_camera.translation().isApprox(Eigen::Vector3d(5, 8, 7)));
  options_.use_world = false;
  frames = read_all();
  EXPECT_EQ(frames[2]->T_world_camera.translation(), Eigen::Vector3d(2, 0, 0));
}

TEST_F(SevenScenes, NamesWhatIsWrongInTheWorldFile) {
  folder_.write("world.yaml", "T_world_sequence:\n  - [0, -1, 0, 5]\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("world.yaml:"));
  folder_.write("world.yaml",
                "T_world_sequence:\n  - [2, 0, 0, 5]\n  - [0, 1, 0, 6]\n  - [0, 0, 1, 7]\n"
                "  - [0, 0, 0, 1]\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("not a rotation"));
  folder_.write("world.yaml", "T_wold_sequence: 3\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("unknown key 'T_wold_sequence'"));
}

struct Damage {
  std::string name;
  std::string says;
  std::function<void()> apply;
};

TEST_F(SevenScenes, OneBadFrameLeavesTheOthersAlone) {
  const auto pose = [&](const std::string& text) {
    return [this, text] { folder_.write(stem(2) + ".pose.txt", text); };
  };
  const std::vector<Damage> damages = {
      {"missing image", "no such depth image", [&] { std::filesystem::remove(depth_file(2)); }},
      {"truncated image", "truncated",
       [&] {
         const std::string whole = testing::read_file(depth_file(2));
         folder_.write(stem(2) + ".depth.png", whole.substr(0, whole.size() / 2 + 20));
       }},
      {"empty image", "empty", [&] { folder_.write(stem(2) + ".depth.png", ""); }},
      {"8 bits", "of 8 bits", [&] { testing::write_png(depth_file(2), 8, 6, {}, {.bits = 8}); }},
      {"wrong size", "has 6 x 8 pixels, the sequence's have 8 x 6",
       [&] { testing::write_png(depth_file(2), 6, 8, {}); }},
      {"missing pose", "no usable pose: there is no such file",
       [&] { std::filesystem::remove(folder_.path() / (stem(2) + ".pose.txt")); }},
      {"NaN in the pose", "not finite", pose("1 0 0 nan\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")},
      {"infinite pose", "not finite", pose("1 0 0 -inf\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")},
      {"short pose", "4 x 4 numbers, found 15", pose("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0\n")},
      {"long pose", "4 x 4 numbers, found 17", pose("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1 1\n")},
      {"words", "found 'one'", pose("one 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")},
      {"scaled", "not a rotation", pose("1.1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")},
      {"mirrored", "not a rotation", pose("-1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n")},
      {"zero pose", "not a rotation", pose("0 0 0 0\n0 0 0 0\n0 0 0 0\n0 0 0 0\n")},
      {"last row", "last row", pose("1 0 0 0\n0 1 0 0\n0 0 1 0\n0 1 0 1\n")},
  };
  for (const Damage& damage : damages) {
    SCOPED_TRACE(damage.name);
    write_frame(2);
    damage.apply();
    const auto frames = read_all();
    ASSERT_EQ(frames.size(), 4U);
    for (const int good : {0, 1, 3}) EXPECT_TRUE(frames[static_cast<std::size_t>(good)]);
    ASSERT_FALSE(frames[2]);
    EXPECT_EQ(frames[2].error().code, ErrorCode::kBadFrame);
    EXPECT_THAT(frames[2].error().describe(), HasSubstr(damage.says));
    EXPECT_THAT(frames[2].error().where, HasSubstr("frame 2 ("));
    EXPECT_THAT(frames[2].error().where, HasSubstr("frame-000002"));
    EXPECT_EQ(frames[3]->sequence, 3);
  }
}

TEST_F(SevenScenes, ABadFirstFrameDecidesNothing) {
  testing::write_png(depth_file(0), 6, 8, {});
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 4U);
  EXPECT_FALSE(frames[0]);
  EXPECT_TRUE(frames[1]);
}

TEST_F(SevenScenes, PosesThatAreNearlyRigidAreMadeRigid) {
  folder_.write(stem(1) + ".pose.txt", "1.002 0.001 0 1\n0 0.999 0 2\n0 0 1 3\n0 0 0 1\n");
  const auto frames = read_all();
  ASSERT_TRUE(frames[1]);
  const Eigen::Matrix3d rotation = frames[1]->T_world_camera.linear();
  EXPECT_TRUE((rotation.transpose() * rotation).isIdentity(1e-12));
  EXPECT_LT((rotation - Eigen::Matrix3d::Identity()).norm(), 3e-3);
}

TEST_F(SevenScenes, TellsOfGapsInTheNumbers) {
  write_frame(9);
  EXPECT_EQ(read_all().size(), 5U);
  EXPECT_THAT(log_.messages(),
              ::testing::Contains(HasSubstr("5 frames are missing between number 0 and 9")));
  EXPECT_EQ(log_.count(LogLevel::kWarning), 1);
}

TEST_F(SevenScenes, FailsWhereNoneOfTheImagesCanBeRead) {
  for (int i = 0; i < 4; ++i) folder_.write(stem(i) + ".depth.png", "?");
  const auto source = create();
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::kNotFound);
}

TEST_F(SevenScenes, ChecksTheIntrinsics) {
  folder_.write("camera-intrinsics.txt", "6 0 40\n0 6 3\n0 0 1\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("principal point lies outside"));
  options_.camera.cx_px = 3.5;
  EXPECT_TRUE(create());
  folder_.write("camera-intrinsics.txt", "-6 0 4\n0 6 3\n0 0 1\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("focal lengths"));
  folder_.write("camera-intrinsics.txt", "6 0 4\n0 6\n");
  EXPECT_THAT(create().error().describe(), HasSubstr("3 x 3 numbers, found 5"));
  std::filesystem::remove(folder_.path() / "camera-intrinsics.txt");
  EXPECT_THAT(create().error().describe(), HasSubstr("intrinsics of the images of 8 x 6"));
  options_.camera = {.fx_px = 5.0, .fy_px = 5.5, .cx_px = 4.0, .cy_px = 3.0};
  const auto frames = read_all();
  EXPECT_EQ(std::get<DepthImage>(frames[0]->measurement).camera.fy_px, 5.5);
}

TEST_F(SevenScenes, NamesAMissingFolderAndTheLayoutsItKnows) {
  options_.path = folder_.path() / "nowhere";
  auto source = create();
  EXPECT_EQ(source.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(source.error().describe(), HasSubstr("nowhere"));

  std::filesystem::create_directory(options_.path);
  source = create();
  EXPECT_EQ(source.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(source.error().describe(), HasSubstr("frame-000000.depth.png"));
  EXPECT_THAT(source.error().describe(), HasSubstr("groundtruth.txt"));

  options_.path = folder_.path();
  options_.format = "tum";
  EXPECT_THAT(create().error().describe(), HasSubstr("of the layout 'tum'"));
}

TEST_F(SevenScenes, StopsAtDeadlinesWithoutLosingAFrame) {
  auto source = create();
  ASSERT_TRUE(source);
  const Deadline past(Deadline::SteadyClock::now());
  EXPECT_EQ((*source)->next(past).error().code, ErrorCode::kDeadlineExceeded);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ((*source)->next(Deadline(stop.get_token())).error().code, ErrorCode::kCancelled);
  const auto frame = (*source)->next(Deadline());
  ASSERT_TRUE(frame);
  EXPECT_EQ((*frame)->sequence, 0);
}

TEST_F(SevenScenes, RefusesAnEmptyRangeOfDepths) {
  options_.depth_min_m = 3.0;
  options_.depth_max_m = 2.0;
  const auto mistakes = options_.check();
  ASSERT_EQ(mistakes.size(), 1U);
  EXPECT_EQ(mistakes[0].parameters[0], "depth_min_m");
}

}  // namespace
}  // namespace sidestep::depth_sequence
