#include "../simulator.hpp"

#include <filesystem>
#include <fstream>
#include <set>
#include <stop_token>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simulator_testing.hpp"

namespace sidestep::simulator {
namespace {

using ::testing::HasSubstr;

/// Those of the project's folder, as a list in a sentence.
std::string names_of_scenes() {
  std::set<std::string> names;
  for (const auto& file : std::filesystem::directory_iterator(testing::scenes())) {
    if (file.path().extension() == ".yaml") names.insert(file.path().stem());
  }
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

class SimulatorSource : public ::testing::Test {
 protected:
  void SetUp() override {
    options_ = testing::room_options();
    options_.frames = 4;
    options_.rate_hz = 1.0;
    options_.camera = {80, 60, 69.3, 69.3, 39.5, 29.5};
  }
  std::unique_ptr<Source> make(std::uint64_t seed = 1) {
    auto source = create_source(options_, host_.context(seed));
    if (!source) ADD_FAILURE() << source.error().describe();
    return source ? std::move(*source) : nullptr;
  }
  static Frame next(Source& source) {
    auto frame = source.next(Deadline());
    if (!frame || !*frame) {
      ADD_FAILURE() << "no frame";
      return {};
    }
    return std::move(**frame);
  }
  static const std::vector<float>& depth(const Frame& frame) {
    return std::get<DepthImage>(frame.measurement).depth_m;
  }

  conformance::TestHost host_{2, testing::host_parts()};
  Options options_;
};

TEST_F(SimulatorSource, HandsOutAsManyFramesAsAskedAtTheirTimes) {
  const auto source = make();
  EXPECT_EQ(source->frame_count(), 4);
  for (int i = 0; i < 4; ++i) {
    const Frame frame = next(*source);
    EXPECT_EQ(frame.sequence, i);
    EXPECT_EQ(frame.stamp.ns, std::int64_t{i} * 1'000'000'000);
    EXPECT_FALSE(frame.joint_positions);
    EXPECT_EQ(depth(frame).size(), 80U * 60U);
  }
  EXPECT_FALSE(source->next(Deadline())->has_value());
  EXPECT_FALSE(source->next(Deadline())->has_value());
}

TEST_F(SimulatorSource, EveryPointLiesOnASurfaceOfItsGroundTruth) {
  const auto source = make();
  const auto* truth = dynamic_cast<const GroundTruth*>(source.get());
  ASSERT_NE(truth, nullptr);
  int measured = 0;
  for (int i = 0; i < 4; ++i) {
    const Frame frame = next(*source);
    const auto& image = std::get<DepthImage>(frame.measurement);
    for (int v = 0; v < 60; ++v) {
      for (int u = 0; u < 80; ++u) {
        const double depth_m = image.at(u, v);
        if (depth_m == 0.0) continue;
        ++measured;
        const Eigen::Vector3d p_world =
            frame.T_world_camera * image.camera.unproject(u, v, depth_m);
        EXPECT_NEAR(truth->scene().signed_distance(p_world, frame.stamp.seconds()).distance_m, 0.0,
                    1e-5);
      }
    }
  }
  EXPECT_GT(measured, 4 * 80 * 60 / 2);
}

TEST_F(SimulatorSource, SeesMovingObjectsWhereTheyAreAtTheStamp) {
  options_.scene = "corridor";
  options_.frames = 0;
  options_.rate_hz = 2.0;
  options_.range_max_m = 12.0;
  options_.camera_path = {{0.0, {0.2, 0.0, 1.2}, Eigen::Vector3d(5.0, 0.0, 0.9), {}}};
  const auto source = make();
  EXPECT_FALSE(source->frame_count().has_value());
  const Scene& scene = dynamic_cast<const GroundTruth&>(*source).scene();
  std::vector<float> before;
  for (int i = 0; i < 8; ++i) {
    const Frame frame = next(*source);
    EXPECT_NE(depth(frame), before);
    before = depth(frame);
    const auto& image = std::get<DepthImage>(frame.measurement);
    for (int v = 0; v < 60; v += 3) {
      for (int u = 0; u < 80; u += 3) {
        if (image.at(u, v) == 0.0F) continue;
        const Eigen::Vector3d p_world =
            frame.T_world_camera * image.camera.unproject(u, v, image.at(u, v));
        EXPECT_NEAR(scene.signed_distance(p_world, 0.5 * i).distance_m, 0.0, 1e-5);
      }
    }
  }
}

TEST_F(SimulatorSource, NoiseRepeatsForASeedOnly) {
  options_.noise.model = "kinect";
  const auto first = make(5);
  const auto again = make(5);
  const auto other = make(6);
  const Frame frame = next(*first);
  EXPECT_EQ(depth(frame), depth(next(*again)));
  EXPECT_NE(depth(frame), depth(next(*other)));
}

TEST_F(SimulatorSource, FindsScenesByNameAndByPath) {
  options_.scene = testing::scenes() / "corridor.yaml";
  EXPECT_EQ(dynamic_cast<GroundTruth&>(*make()).scene().objects()[1].name, "wall_left");
  options_.scene = "corridor.yaml";
  EXPECT_NE(make(), nullptr);
  options_.scene = "roam";
  const auto unknown = create_source(options_, host_.context());
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(unknown.error().describe(), HasSubstr("did you mean 'room'?"));
  options_.scene = "somewhere_else_entirely";
  EXPECT_THAT(create_source(options_, host_.context()).error().describe(),
              HasSubstr("(there are: " + names_of_scenes() + ")"));
}

TEST_F(SimulatorSource, TellsEveryMistakeOfAScene) {
  const auto file = std::filesystem::path(::testing::TempDir()) / "sidestep_simulator_bad.yaml";
  std::ofstream(file) << "objects:\n  - {name: a, shape: {mesh: {file: none.obj}}}\n"
                         "  - {name: a, shape: {sphere: {radius_m: -1}}}\n";
  options_.scene = file;
  const auto source = create_source(options_, host_.context());
  std::filesystem::remove(file);
  ASSERT_FALSE(source);
  EXPECT_EQ(source.error().code, ErrorCode::kConfig);
  const std::string text = source.error().describe();
  EXPECT_THAT(text, HasSubstr("the scene has 3 mistakes"));
  EXPECT_THAT(text, HasSubstr("none.obj"));
  EXPECT_THAT(text, HasSubstr("no such mesh file"));
  EXPECT_THAT(text, HasSubstr("sidestep_simulator_bad.yaml:3:12: another object is named 'a'"));
  EXPECT_THAT(text, HasSubstr("radius_m must be greater than 0"));
}

TEST_F(SimulatorSource, CountsMistakesThatNobodyReads) {
  const auto file = std::filesystem::path(::testing::TempDir()) / "sidestep_simulator_many.yaml";
  std::string objects = "objects:\n";
  for (int i = 0; i < 100000; ++i) objects += "  - 1\n";
  std::ofstream(file) << objects;
  options_.scene = file;
  const auto source = create_source(options_, host_.context());
  std::filesystem::remove(file);
  ASSERT_FALSE(source);
  const std::string text = source.error().describe();
  EXPECT_THAT(text, HasSubstr("the scene has 100000 mistakes, of which these are the first 100"));
  EXPECT_THAT(text, HasSubstr("sidestep_simulator_many.yaml:101:"));
  EXPECT_THAT(text, ::testing::Not(HasSubstr("sidestep_simulator_many.yaml:102:")));
}

TEST_F(SimulatorSource, RefusesAnEmptyRangeAndABadPath) {
  options_.range_min_m = 6.0;
  options_.camera_path.clear();
  const auto mistakes = options_.check();
  ASSERT_EQ(mistakes.size(), 2U);
  EXPECT_EQ(mistakes[0].parameters[0], "camera_path");
  EXPECT_EQ(mistakes[1].parameters[0], "range_min_m");
}

TEST_F(SimulatorSource, StopsAtDeadlinesWithoutLosingAFrame) {
  const auto source = make();
  const Deadline past(Deadline::SteadyClock::now());
  EXPECT_EQ(source->next(past).error().code, ErrorCode::kDeadlineExceeded);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_EQ(source->next(Deadline(stop.get_token())).error().code, ErrorCode::kCancelled);
  EXPECT_EQ(next(*source).sequence, 0);
}

}  // namespace
}  // namespace sidestep::simulator
