#include "pcd_source.hpp"

#include <cmath>
#include <limits>
#include <stop_token>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/runtime/yaml_document.hpp>

#include "conformance/test_host.hpp"
#include "pcd_testing.hpp"
#include "support/read_frames.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::pcd {
namespace {

using testing::ascii_pcd;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::Points;

/// A folder of clouds a.pcd, b.pcd and c.pcd; cloud n holds n + 1 points on the optical axis, and
/// was taken from x = n metres.
class PcdSource : public ::testing::Test {
 protected:
  void SetUp() override {
    for (int n = 0; n < 3; ++n) write_cloud(n);
    folder_.write("notes.txt", "not a cloud");
    options_.path = folder_.path();
  }

  void write_cloud(int n) const {
    Points points;
    for (int i = 0; i <= n; ++i) points.emplace_back(0.0F, 0.0F, 1.0F + static_cast<float>(i));
    folder_.write(std::string(1, static_cast<char>('a' + n)) + ".pcd",
                  ascii_pcd(points, std::to_string(n) + " 0 0 1 0 0 0"));
  }

  Result<std::unique_ptr<Source>> create() { return create_source(options_, 7, log_); }
  std::string complaint() {
    const auto source = create();
    return source ? "no error" : source.error().describe();
  }

  std::vector<Result<Frame>> read_all() {
    const auto source = create();
    if (!source) {
      ADD_FAILURE() << source.error().describe();
      return {};
    }
    return testing_support::read_frames(**source, 100);
  }

  static const Points& points(const Frame& frame) {
    return std::get<PointCloud>(frame.measurement).points_m;
  }

  testing_support::TemporaryFolder folder_;
  conformance::RecordingLog log_;
  Options options_;
};

TEST_F(PcdSource, HandsOutEveryCloudInTheOrderOfTheNames) {
  options_.rate_hz = 10.0;
  EXPECT_EQ((*create())->frame_count(), 3);
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  for (std::size_t n = 0; n < frames.size(); ++n) {
    ASSERT_TRUE(frames[n]) << frames[n].error().describe();
    EXPECT_EQ(frames[n]->sequence, static_cast<std::int64_t>(n));
    EXPECT_EQ(frames[n]->stamp.ns, static_cast<std::int64_t>(n) * 100'000'000);
    EXPECT_EQ(frames[n]->T_world_camera.translation(),
              Eigen::Vector3d(static_cast<double>(n), 0, 0));
    EXPECT_EQ(points(*frames[n]).size(), n + 1);
  }
}

TEST_F(PcdSource, ReadsASingleFileAndSelectsAmongMany) {
  options_.path = folder_.path() / "b.pcd";
  EXPECT_EQ(read_all().size(), 1U);
  options_.path = folder_.path();
  options_.first_frame = 1;
  options_.stride = 1;
  options_.max_frames = 1;
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 1U);
  EXPECT_EQ(points(*frames[0]).size(), 2U);
  options_.first_frame = 3;
  EXPECT_THAT(complaint(), HasSubstr("there are only 3 point clouds"));
}

TEST_F(PcdSource, CountsForTheLogWhatItReadAndLeftOut) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  folder_.write("b.pcd", ascii_pcd({{0, 0, 1}, {nan, 0, 1}, {0, nan, nan}}));
  folder_.write("c.pcd", "no cloud");
  EXPECT_EQ(read_all().size(), 3U);
  const std::string folder = folder_.path().string();
  EXPECT_THAT(
      log_.messages(),
      ElementsAre("read " + folder + ": 3 point clouds, 1 other files",
                  folder + ": 2 of 3 frames handed out, 1 unusable, 2 points are not finite"));
  options_.first_frame = 1;
  EXPECT_EQ(read_all().size(), 2U);
  EXPECT_EQ(log_.count(LogLevel::kWarning), 1) << "that clouds were left out";
}

TEST_F(PcdSource, TakesPosesInOrder) {
  const std::string half = std::to_string(std::sqrt(0.5));
  options_.poses = folder_.write("poses.txt",
                                 "# stamp tx ty tz qx qy qz qw\n5 0 0 1 0 0 0 1\n"
                                 "6 0 0 2 0 0 " +
                                     half + " " + half + "\n\n7.5 0 0 3 0 0 0 1  # the last\n");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[2]->stamp, Stamp::from_seconds(7.5));
  EXPECT_EQ(frames[2]->T_world_camera.translation(), Eigen::Vector3d(0, 0, 3));
  // A quarter turn about z.
  EXPECT_TRUE((frames[1]->T_world_camera * Eigen::Vector3d(1, 0, 0))
                  .isApprox(Eigen::Vector3d(0, 1, 2), 1e-6));

  folder_.write("poses.txt", "5 0 0 1 0 0 0 1\n");
  EXPECT_THAT(complaint(), HasSubstr("there are 1 poses for 3 point clouds"));
  for (const char* second : {"5", "4.9"}) {
    folder_.write("poses.txt",
                  "5 0 0 1 0 0 0 1\n" + std::string(second) + " 0 0 1 0 0 0 1\n6 0 0 1 0 0 0 1\n");
    EXPECT_THAT(complaint(), HasSubstr("poses.txt: pose 1 is not later than the one before"));
  }
}

TEST_F(PcdSource, TakesTheNearestPoseWithinReach) {
  for (int n = 0; n < 3; ++n) {
    std::filesystem::remove(folder_.path() / (std::string(1, static_cast<char>('a' + n)) + ".pcd"));
  }
  // By name 10.5 comes before 9.25; in time it does not.
  for (const char* name : {"9.25.pcd", "10.5.pcd", "11.pcd"}) {
    folder_.write(name, ascii_pcd({{0, 0, 1}}));
  }
  options_.match = "stamp";
  options_.poses =
      folder_.write("poses.txt", "10.492 2 0 0 0 0 0 1\n9.25 1 0 0 0 0 0 1\n10.6 3 0 0 0 0 0 1\n");
  const auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  ASSERT_TRUE(frames[0] && frames[1]);
  EXPECT_EQ(frames[0]->stamp, Stamp::from_seconds(9.25));
  EXPECT_EQ(frames[0]->T_world_camera.translation().x(), 1.0);
  EXPECT_EQ(frames[1]->stamp, Stamp::from_seconds(10.5));
  EXPECT_EQ(frames[1]->T_world_camera.translation().x(), 2.0);
  ASSERT_FALSE(frames[2]);
  EXPECT_EQ(frames[2].error().code, ErrorCode::kBadFrame);
  EXPECT_THAT(frames[2].error().describe(), HasSubstr("11.pcd"));
  EXPECT_THAT(frames[2].error().describe(), HasSubstr("no pose within max_pose_offset_s of 11.0"));

  folder_.write("later.pcd", ascii_pcd({{0, 0, 1}}));
  EXPECT_THAT(complaint(), HasSubstr("later.pcd: 'later' is no time in seconds"));
}

TEST_F(PcdSource, TurnsPointsIntoTheOpticalFrame) {
  // The sensor at (1, 2, 3), turned a quarter about z: its x looks along the world's y.
  const std::string half = std::to_string(std::sqrt(0.5));
  const std::string viewpoint = "1 2 3 " + half + " 0 0 " + half;
  options_.path = folder_.write("one.pcd", ascii_pcd({{4, 0.5F, 0.25F}}, viewpoint));
  options_.points_in = "forward";
  auto frames = read_all();
  ASSERT_TRUE(frames[0]);
  // Forward is z, left is -x, up is -y.
  EXPECT_TRUE(points(*frames[0])[0].isApprox(Eigen::Vector3f(-0.5F, -0.25F, 4.0F), 1e-6F));
  const Eigen::Vector3d seen(0.5, 6.0, 3.25);
  EXPECT_EQ(complaint(), "no error");
  EXPECT_TRUE(
      (frames[0]->T_world_camera * points(*frames[0])[0].cast<double>()).isApprox(seen, 1e-5));

  options_.path = folder_.write("one.pcd", ascii_pcd({seen.cast<float>()}, viewpoint));
  options_.points_in = "world";
  frames = read_all();
  ASSERT_TRUE(frames[0]);
  EXPECT_TRUE(
      (frames[0]->T_world_camera * points(*frames[0])[0].cast<double>()).isApprox(seen, 1e-5));
  EXPECT_TRUE(points(*frames[0])[0].isApprox(Eigen::Vector3f(4.0F, 0.5F, 0.25F), 1e-5F));
}

TEST_F(PcdSource, OneBadCloudLeavesTheOthersAlone) {
  folder_.write("b.pcd", testing::header(2, "ascii") + "1 2 3\n");
  auto frames = read_all();
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_TRUE(frames[0] && frames[2]);
  ASSERT_FALSE(frames[1]);
  EXPECT_EQ(frames[1].error().code, ErrorCode::kBadFrame);
  EXPECT_EQ(frames[1].error().where, "frame 1 (" + (folder_.path() / "b.pcd").string() + ")");
  EXPECT_EQ(frames[1].error().message, "the file is cut off: it holds 1 of 2 points");

  folder_.write("b.pcd",
                "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n"
                "1 2 3\n");
  frames = read_all();
  ASSERT_FALSE(frames[1]);
  EXPECT_THAT(frames[1].error().describe(), HasSubstr("no pose: the file has no VIEWPOINT"));
}

TEST_F(PcdSource, NamesWhatIsWrongWithPathsAndPoses) {
  options_.poses = folder_.write("poses.txt", "5 0 0 1 0 0 0 1\n6 0 0 1 0 0 0\n");
  EXPECT_THAT(complaint(),
              HasSubstr("poses.txt:2: expected 'stamp tx ty tz qx qy qz qw', found 7"));
  folder_.write("poses.txt", "5 0 zero 1 0 0 0 1\n");
  EXPECT_THAT(complaint(), HasSubstr("poses.txt:1: expected a finite number, found 'zero'"));
  folder_.write("poses.txt", "5 0 0 1 0 0 0 0\n");
  EXPECT_THAT(complaint(), HasSubstr("poses.txt:1: the quaternion qx qy qz qw has the length 0"));
  folder_.write("poses.txt", "1e300 0 0 1 0 0 0 1\n");
  EXPECT_THAT(complaint(), HasSubstr("poses.txt:1: '1e300' is no time in seconds"));
  options_.poses = folder_.path() / "no_poses.txt";
  EXPECT_THAT(complaint(), HasSubstr("no_poses.txt: there is no such file of poses"));
  options_ = {};
  options_.path = folder_.path() / "nowhere";
  EXPECT_THAT(complaint(), HasSubstr("nowhere: there is no such file or folder of point clouds"));
  std::filesystem::create_directory(options_.path);
  EXPECT_THAT(complaint(), HasSubstr("nowhere: the folder holds no .pcd file"));
}

TEST_F(PcdSource, StopsAtDeadlinesWithoutLosingACloud) {
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

/// Options as a configuration writes them.
class PcdOptions : public ::testing::Test {
 protected:
  std::vector<Error> read(const std::string& yaml) {
    const auto node = YamlDocumentReader().read(folder_.write("options.yaml", yaml));
    std::vector<Error> errors;
    if (!node) return {node.error()};
    check_against_schema(*node, Options::parameters().schema(), {}, errors);
    if (errors.empty()) Options::parameters().read(*node, options_, errors);
    return errors;
  }
  [[nodiscard]] std::string mistakes() const {
    std::string text;
    for (const OptionMistake& mistake : options_.check()) {
      text += mistake.parameters.at(0) + " " + mistake.what + "\n";
    }
    return text;
  }
  testing_support::TemporaryFolder folder_;
  Options options_;
};

TEST_F(PcdOptions, FiltersAreAListOfNamedItems) {
  const auto errors = read(
      "path: clouds\nfilters:\n  - crop: {min_m: [0, 0, 0], max_m: [1, 1, 1], keep: outside}\n"
      "  - voxel: {leaf_m: 0.05}\n  - outlier: {}\n  - plane: {distance_m: 0.01}\n");
  ASSERT_TRUE(errors.empty()) << errors[0].describe();
  ASSERT_EQ(options_.filters.size(), 4U);
  ASSERT_TRUE(options_.filters[0].crop);
  EXPECT_EQ(options_.filters[0].crop->max_m, Eigen::Vector3d(1, 1, 1));
  ASSERT_TRUE(options_.filters[1].voxel);
  EXPECT_EQ(options_.filters[1].voxel->leaf_m, 0.05);
  ASSERT_TRUE(options_.filters[2].outlier);
  EXPECT_EQ(options_.filters[2].outlier->neighbours, OutlierFilter().neighbours);
  ASSERT_TRUE(options_.filters[3].plane);
  EXPECT_TRUE(options_.check().empty());
}

TEST_F(PcdOptions, MistakesInFiltersAreToldWithTheirPlace) {
  auto errors =
      read("path: clouds\nfilters:\n  - voxel: {leaf: 0.05}\n  - crop: {min_m: [0, 0]}\n");
  ASSERT_EQ(errors.size(), 3U);
  EXPECT_THAT(errors[0].describe(), HasSubstr("options.yaml:3"));
  EXPECT_THAT(errors[0].describe(), HasSubstr("'leaf_m'"));
  EXPECT_THAT(errors[1].describe(), HasSubstr("min_m"));
  EXPECT_THAT(errors[2].describe(), HasSubstr("max_m"));

  ASSERT_TRUE(read("path: clouds\nfilters: [{voxel: {}, plane: {}}]\n").empty());
  EXPECT_EQ(mistakes(), "filters[0] names 2 filters, expected one\n");
  ASSERT_TRUE(
      read("path: clouds\nfilters: [{crop: {min_m: [0, 0, 1], max_m: [1, 1, 1]}}]\n").empty());
  EXPECT_EQ(mistakes(), "filters[0].crop.min_m must be below max_m along each axis\n");
  ASSERT_TRUE(read("path: clouds\nmatch: stamp\nfilters: [{}]\n").empty());
  EXPECT_EQ(mistakes(),
            "filters[0] names 0 filters, expected one\nmatch is stamp, but poses is not set\n");
}

}  // namespace
}  // namespace sidestep::pcd
