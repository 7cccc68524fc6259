#include <algorithm>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/geometry/scene.hpp>
#include <sidestep/runtime/results_store.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "command_line.hpp"
#include "support/stored_numbers.hpp"
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
                                const std::string& out = "run",
                                const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments = {"run", config};
    if (!out.empty()) arguments.insert(arguments.end(), {"--out", at(out)});
    for (const std::string& set : sets) {
      arguments.emplace_back("--set");
      arguments.push_back(set);
    }
    arguments.insert(arguments.end(), options.begin(), options.end());
    return run(arguments);
  }
  [[nodiscard]] std::string at(const std::string& out) const { return (folder_ / out).string(); }
  /// What was measured of six cases on every frame, without times and memory.
  [[nodiscard]] testing_support::StoredNumbers numbers(const std::string& out) const {
    std::vector<std::string> all = {"system", "update", "truth"};
    for (int i = 0; i < 6; ++i) all.push_back("update/" + std::to_string(i));
    return testing_support::stored_numbers(folder_ / out, all, {"_ms", "_mib"});
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

TEST_F(MappingBenchmarkTest, ShardsTogetherAreTheWholeRun) {
  const std::vector<std::string> sets = {"experiment.clock=every_frame"};
  ASSERT_EQ(run_it(kTiny, sets, "whole").exit_code, 0);
  for (const std::string i : {"1", "2"}) {
    const Finished shard = run_it(kTiny, sets, "shard" + i, {"--shard", i + "/2"});
    ASSERT_EQ(shard.exit_code, 0) << shard.error;
    EXPECT_THAT(shard.out, HasSubstr("Shard " + i + "/2: Success: 3 of 3 cases"));
  }
  // Of cases by system, sign and two resolutions, every other one.
  for (const auto& [shard, resolution_m] : {std::pair("shard1", 0.05), {"shard2", 0.1}}) {
    const Json systems = summary(shard).at("systems");
    ASSERT_EQ(systems.size(), 3u);
    for (const Json& s : systems) {
      EXPECT_EQ(s.at("resolution_m"), resolution_m);
      EXPECT_EQ(s.at("frames"), 8);
    }
    EXPECT_EQ(systems[1].at("signed"), true);
    EXPECT_EQ(systems[2].at("name"), "octree");
  }
  const Finished merged = run({"report", at("shard2"), at("shard1"), "--merged", at("merged")});
  ASSERT_EQ(merged.exit_code, 0) << merged.error;
  EXPECT_EQ(numbers("merged"), numbers("whole"));
  const Json ours = summary("merged"), theirs = summary("whole");
  ASSERT_EQ(ours.at("systems").size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const Json& one = ours.at("systems")[i];
    for (const char* key :
         {"name", "mapper", "field", "signed", "resolution_m", "success", "error", "clock",
          "frames", "published_ms", "max_error_m", "mean_error_m", "accuracy_checks",
          "compared_vox", "differing_vox", "truth", "real_time"}) {
      EXPECT_EQ(one.at(key), theirs.at("systems")[i].at(key)) << i << " " << key;
    }
  }
  for (const char* key : {"complete", "shard", "has_truth", "reference", "published_as"}) {
    EXPECT_EQ(ours.at(key), theirs.at(key)) << key;
  }
  EXPECT_EQ(ours.at("has_truth"), true);
  EXPECT_DOUBLE_EQ(ours.at("/systems/5/ratio/mean"_json_pointer),
                   ours.at("/systems/5/frame_ms/mean"_json_pointer).get<double>() /
                       ours.at("/systems/1/frame_ms/mean"_json_pointer).get<double>());
  EXPECT_TRUE(fs::exists(folder_ / "merged" / "mapping_times.png"));

  ASSERT_EQ(run_it(kTiny, sets, "jobs", {"--jobs", "3"}).exit_code, 0);
  EXPECT_EQ(numbers("jobs"), numbers("whole"));
  const Finished lacking =
      run({"report", at("jobs/shard-3"), at("jobs/shard-1"), "--merged", at("lacking")});
  EXPECT_EQ(lacking.exit_code, 1);
  EXPECT_THAT(lacking.out, HasSubstr("Incomplete: 4 of 6 cases"));

  // Where a shard fails, the whole does: fields of 32-bit distances, unlike those of `exact`.
  const std::vector<std::string> strict = {sets.front(), "experiment.expect={max_error_m: 1e-9}"};
  EXPECT_EQ(run_it(kTiny, strict, "strict1", {"--shard", "1/2"}).exit_code, 1);
  EXPECT_EQ(run_it(kTiny, strict, "strict2", {"--shard", "2/2"}).exit_code, 1);
  const Finished failed = run({"report", at("strict1"), at("strict2"), "--merged", at("strict")});
  EXPECT_EQ(failed.exit_code, 1);
  EXPECT_THAT(failed.out, HasSubstr("Failed: 2 of 6 cases"));
}

TEST_F(MappingBenchmarkTest, ShardsThatDoNotFitAreRefused) {
  const std::vector<std::string> sets = {"experiment.clock=every_frame"};
  ASSERT_EQ(run_it(kTiny, sets, "a", {"--shard", "1/2"}).exit_code, 0);
  ASSERT_EQ(run_it(kTiny, {sets.front(), "experiment.accuracy_every=4"}, "b", {"--shard", "2/2"})
                .exit_code,
            0);
  ASSERT_EQ(run_it(kTiny, {sets.front(), "experiment.frames_in_memory=3"}, "c", {"--shard", "2/2"})
                .exit_code,
            0);
  const auto merge = [&](const char* with) {
    return run({"report", at("a"), at(with), "--merged", at("merged")});
  };
  const auto refused = [&](const Finished& finished, const std::string& message) {
    EXPECT_EQ(finished.exit_code, 2) << message;
    EXPECT_THAT(finished.error, HasSubstr(message));
  };
  EXPECT_EQ(merge("c").exit_code, 0) << "the same frames, a few at a time";
  refused(merge("a"), "shard 1/2 is there twice");
  refused(merge("b"), "`accuracy_every: 5` there, `accuracy_every: 4` here");
  refused(run_it(kTiny, sets, "d", {"--shard", "1/7"}), "there are 6 cases, too few for 7 shards");
  refused(run_it(kTiny, sets, "", {"--resume", at("a")}), "the run to resume is shard 1/2");
}

TEST_F(MappingBenchmarkTest, AnInterruptedRunGoesOn) {
  const std::vector<std::string> sets = {"experiment.clock=every_frame", "source.frames=60",
                                         "experiment.resolutions_m=[0.05, 0.1]"};
  CommandLine command(
      {"run", kTiny, "--out", at("run"), "--set", sets[0], "--set", sets[1], "--set", sets[2]});
  ASSERT_TRUE(command.wait_for("exact at 0.1 m "));
  command.send(SIGINT);
  const Finished interrupted = command.wait();
  ASSERT_EQ(interrupted.exit_code, 1) << interrupted.error;
  EXPECT_THAT(interrupted.out, HasSubstr("--resume goes on"));
  const Json part = summary();
  EXPECT_EQ(part.at("complete"), false);
  ASSERT_GE(part.at("systems").size(), 1u);
  ASSERT_LT(part.at("systems").size(), 6u);
  EXPECT_EQ(part.at("systems")[0].at("frames"), 60);
  const Json first_ms = part.at("systems")[0].at("frame_ms");

  const Finished resumed = run_it(kTiny, sets, "", {"--resume", at("run")});
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  const Json all = summary();
  EXPECT_EQ(all.at("/systems/0/frame_ms"_json_pointer), first_ms) << "it was not measured again";
  EXPECT_EQ(all.at("/time/sessions"_json_pointer), 2);
  ASSERT_EQ(run_it(kTiny, sets, "whole").exit_code, 0);
  EXPECT_EQ(numbers("run"), numbers("whole"));
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
