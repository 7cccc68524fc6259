#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using Json = nlohmann::json;

const std::string kTiny =
    std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny_mapping.yaml";
const std::string kConfigs = std::string(SIDESTEP_SOURCE_DIR) + "/configs/mapping/";
const std::string kSmallCamera =
    "source.camera={width_px: 320, height_px: 240, fx_px: 277.0, fy_px: 277.0, cx_px: 159.5, "
    "cy_px: 119.5}";

class MappingBenchmarkTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const std::string& config, const std::vector<std::string>& sets,
                                const std::string& out = "run") {
    std::vector<std::string> arguments = {"run", config, "--out", (folder_ / out).string()};
    for (const std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(set);
    }
    return run(arguments);
  }
  [[nodiscard]] Json summary(const std::string& out = "run") const {
    return Json::parse(read_file(folder_ / out / "summary.json"), nullptr, false);
  }

  testing_support::TemporaryFolder own_folder_;
  fs::path folder_ = own_folder_.path();
};

TEST_F(MappingBenchmarkTest, AMapOfNothingIsNoSuccess) {
  const Finished finished = run_it(kTiny, {"experiment.origin_m=[40,40,0]"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("the map is empty: no point of any frame lies in the map"));
  EXPECT_THAT(finished.out, HasSubstr("experiment.origin_m: ["));
  for (const Json& s : summary().at("systems")) EXPECT_EQ(s.at("success"), false);
}

TEST_F(MappingBenchmarkTest, MeasuresEverySystemOnTheSameFrames) {
  const Finished finished = run_it(kTiny, {});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_THAT(finished.out, HasSubstr("Somebody 2020"));
  const Json systems = summary().at("systems");
  ASSERT_EQ(systems.size(), 6u);
  for (const Json& s : systems) {
    SCOPED_TRACE(s.dump());
    EXPECT_EQ(s.at("frames"), 8);
    EXPECT_EQ(s.at("bad_frames"), 0);
    for (const char* key : {"mean", "sd", "p50", "p95", "max"}) {
      EXPECT_GE(s.at("frame_ms").at(key), 0.0);
      for (const char* stage : {"integrate", "field", "publish"}) {
        EXPECT_TRUE(s.at("stages_ms").at(stage).at(key).is_number());
      }
    }
    EXPECT_EQ(s.at("accuracy_checks"), 2) << "after frame 5 and at the end";
    EXPECT_GT(s.at("compared_vox"), 100);
    EXPECT_LT(s.at("max_error_m"), s.at("mapper") == "voxel_grid" ? 1e-6 : 0.06);
    EXPECT_GT(s.at("/truth/surface_vox"_json_pointer), 50);
    EXPECT_GT(s.at("/truth/collision_recall"_json_pointer), 0.9);
    EXPECT_TRUE(s.at("/truth/appear_frames"_json_pointer).is_null()) << "nothing moves";
    const Json& real_time = s.at("real_time");
    EXPECT_EQ(real_time.at("frames").get<int>() + real_time.at("dropped").get<int>(), 8);
    EXPECT_TRUE(s.at("ratio").is_object() || s.at("name") != "exact");
  }
  EXPECT_EQ(systems[0].at("published_ms"), 12.5);
  EXPECT_TRUE(systems[1].at("published_ms").is_null());
  EXPECT_EQ(systems[0].at("signed"), false);
  EXPECT_EQ(systems[2].at("signed"), true);
  EXPECT_DOUBLE_EQ(systems[0].at("/ratio/mean"_json_pointer), 1.0);
  EXPECT_DOUBLE_EQ(systems[4].at("/ratio/mean"_json_pointer),
                   systems[4].at("/frame_ms/mean"_json_pointer).get<double>() /
                       systems[0].at("/frame_ms/mean"_json_pointer).get<double>());

  const std::string csv = read_file(folder_ / "run" / "table.csv");
  EXPECT_EQ(std::ranges::count(csv, '\n'), 7);
  const std::string report = read_file(folder_ / "run" / "report.html");
  for (const char* part : {"Time of an update", "Somebody 2020", "Maps against the true scene",
                           "In real time", "By quarter", "data:image/png"}) {
    EXPECT_THAT(report, HasSubstr(part));
  }
  auto results = ResultsReader::open(folder_ / "run" / "results.sqlite");
  ASSERT_TRUE(results) << results.error().describe();
  EXPECT_EQ((*results)->column("update/5", "frame_ms")->size(), 8u);
}

TEST_F(MappingBenchmarkTest, ReadsLongSequencesAWindowAtATime) {
  ASSERT_EQ(run_it(kTiny, {}, "whole").exit_code, 0);
  ASSERT_EQ(run_it(kTiny, {"experiment.frames_in_memory=3"}, "windows").exit_code, 0);
  const Json whole = summary("whole").at("systems"), windows = summary("windows").at("systems");
  ASSERT_EQ(whole.size(), windows.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const char* key : {"frames", "max_error_m", "mean_error_m", "compared_vox", "truth"}) {
      EXPECT_EQ(whole[i].at(key), windows[i].at(key)) << i << " " << key;
    }
  }
}

TEST_F(MappingBenchmarkTest, FailsWhereASystemDoesNotReachWhatIsExpected) {
  const Finished finished = run_it(
      kTiny, {"experiment.expect={collision_recall: 1.0}", "experiment.truth={min_z_m: -1.0}"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_THAT(finished.out, HasSubstr("a collision recall of"));
  EXPECT_EQ(summary().at("success"), false);
}

TEST_F(MappingBenchmarkTest, GoesOnAfterASystemThatFails) {
  const Finished finished = run_it(kTiny, {"plugin_paths=[" THROWING_PLUGINS "]",
                                           "experiment.systems.1.mapper={plugin: throwing}",
                                           "experiment.systems.1.field.plugin=edt"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  const Json systems = summary().at("systems");
  ASSERT_EQ(systems.size(), 6u);
  EXPECT_EQ(systems[0].at("success"), true);
  EXPECT_EQ(systems[4].at("success"), false);
  EXPECT_EQ(systems[4].at("error"), "mapper throwing, frame 0: has seen enough");
}

TEST_F(MappingBenchmarkTest, RefusesAGridThatAMapperCannotHave) {
  // OctoMap's voxels lie on multiples of the resolution: this origin does not.
  const Finished finished = run_it(kTiny, {"experiment.origin_m=[-0.51, -2.4, -0.1]"});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("'origin_m[0]' must be a multiple of resolution_m"));
}

TEST_F(MappingBenchmarkTest, KeepsWhatWasMeasuredWhenInterrupted) {
  CommandLine command({"run", kTiny, "--out", (folder_ / "run").string(), "--set",
                       "source.frames=0", "--set", "experiment.frames_in_memory=8"});
  ASSERT_TRUE(command.wait_for("exact at 0.05 m 1"));
  command.send(SIGINT);
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Interrupted"));
  const Json json = summary();
  EXPECT_EQ(json.at("interrupted"), true);
  ASSERT_EQ(json.at("systems").size(), 1u);
  const int frames = json.at("systems")[0].at("frames");
  EXPECT_GT(frames, 0);
  auto results = ResultsReader::open(folder_ / "run" / "results.sqlite");
  ASSERT_TRUE(results) << results.error().describe();
  EXPECT_EQ((*results)->column("update/0", "frame_ms")->size(), static_cast<std::size_t>(frames));
  EXPECT_TRUE(fs::exists(folder_ / "run" / "report.html"));
}

TEST_F(MappingBenchmarkTest, SeesAWalkerComeAndLeaveNothingBehind) {
  const Finished finished = run_it(kConfigs + "walker_leaves.yaml", {kSmallCamera});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json systems = summary().at("systems");
  ASSERT_EQ(systems.size(), 2u);
  for (const Json& s : systems) {
    SCOPED_TRACE(s.at("resolution_m").dump());
    const Json& truth = s.at("truth");
    EXPECT_LE(truth.at("/appear_frames/max"_json_pointer), 2);
    EXPECT_EQ(truth.at("never_appeared"), 0);
    EXPECT_GT(truth.at("/gone_frames/voxels"_json_pointer), 500);
    EXPECT_LE(truth.at("/gone_frames/max"_json_pointer), 5);
    EXPECT_EQ(truth.at("ghost_vox"), 0);
    EXPECT_LT(s.at("max_error_m"), 1e-6);
  }
}

TEST_F(MappingBenchmarkTest, SoaksForAsLongAsItIsTold) {
  const Finished finished = run_it(kConfigs + "soak.yaml", {kSmallCamera, "experiment.frames=120",
                                                            "experiment.resolutions_m=[0.1]"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json system = summary().at("systems").at(0);
  EXPECT_EQ(system.at("frames"), 120);
  const Json& quarters = system.at("quarters");
  ASSERT_EQ(quarters.size(), 4u);
  for (const Json& quarter : quarters) EXPECT_EQ(quarter.at("frames"), 30);
  // 30 frames kept by mistake would be 9 MiB more each quarter.
  EXPECT_LE(quarters[3].at("memory_mib"), quarters[1].at("memory_mib").get<double>() + 8.0);
  EXPECT_LT(system.at("max_error_m"), 1e-6);
}

TEST(CowAndLady, LeavesRoomForTheCamera) {
  const fs::path configs = fs::path(SIDESTEP_SOURCE_DIR) / "configs";
  const YamlDocumentReader documents;
  const auto document = documents.read(configs / "scenes" / "cow_and_lady.yaml");
  ASSERT_TRUE(document) << document.error().describe();
  const SceneReading reading = read_scene(*document);
  ASSERT_TRUE(reading.errors.empty()) << reading.errors.front().describe();
  const auto path = documents.read(configs / "parts" / "handheld_path.yaml");
  ASSERT_TRUE(path) << path.error().describe();
  const Node::List& waypoints = path->find("source")->find("camera_path")->items();
  ASSERT_EQ(waypoints.size(), 285u) << "142 s, every half second";
  for (const Node& waypoint : waypoints) {
    const auto at = waypoint.find("position_m")->as_doubles(3);
    ASSERT_TRUE(at);
    const SceneDistance near =
        reading.scene.signed_distance(Eigen::Vector3d((*at)[0], (*at)[1], (*at)[2]), 0.0);
    EXPECT_GT(near.distance_m, 0.2)
        << waypoint.mark().to_string() << " "
        << reading.scene.objects()[static_cast<std::size_t>(near.object)].name;
  }
}

}  // namespace
}  // namespace sidestep::testing
