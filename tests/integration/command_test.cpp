#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;
using Json = nlohmann::json;

const std::string kTiny = std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny.yaml";

class CommandTest : public ::testing::Test {
 protected:
  /// `sidestep run` of the tiny configuration into a folder of this test's.
  [[nodiscard]] Finished run_tiny(std::vector<std::string> more, const std::string& out = "run") {
    std::vector<std::string> arguments = {"run", kTiny, "--out", (folder_ / out).string()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run(arguments);
  }
  [[nodiscard]] Json summary(const std::string& out = "run") const {
    return Json::parse(read_file(folder_ / out / "summary.json"), nullptr, false);
  }
  [[nodiscard]] std::string config(const std::string& text) const {
    const fs::path file = folder_ / "config.yaml";
    std::ofstream(file) << text;
    return file.string();
  }

  testing_support::TemporaryFolder own_folder_;
  fs::path folder_ = own_folder_.path();
};

TEST_F(CommandTest, RefusesConfigurationsThatWouldShareAFolder) {
  fs::create_directories(folder_ / "other");
  fs::copy_file(kTiny, folder_ / "other" / fs::path(kTiny).filename());
  const Finished finished =
      run({"run", kTiny, (folder_ / "other" / fs::path(kTiny).filename()).string(), "--out",
           (folder_ / "run").string()});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_THAT(finished.error, HasSubstr("two configurations are named"));
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(CommandTest, PlansAroundAPillar) {
  const Finished finished = run_tiny({});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  EXPECT_THAT(finished.out, HasSubstr("Success: plan 'around' passed every check"));
  EXPECT_THAT(finished.out, HasSubstr("report.html"));
  for (const char* file :
       {"effective_config.yaml", "summary.json", "results.sqlite", "run.log", "report.html",
        "depth.png", "frame_times.png", "plan-1-around-slice-1.png", "plan-1-around-joints.png",
        "plan-1-around-velocities.png", "plan-1-around-clearance.png"}) {
    EXPECT_TRUE(fs::exists(folder_ / "run" / file)) << file;
  }
  EXPECT_THAT(read_file(folder_ / "run" / "effective_config.yaml"), HasSubstr("max_distance_m"));

  const Json json = summary();
  EXPECT_EQ(json.at("success"), true);
  EXPECT_EQ(json.at("frames"), 8);
  EXPECT_EQ(json.at("bad_frames"), 0);
  EXPECT_EQ(json.at("configuration"), "tiny");
  EXPECT_GT(json.at("/map/occupied_vox"_json_pointer), 0);
  for (const char* key : {"p50", "p95", "max"}) {
    EXPECT_GT(json.at("map").at("frame_ms").at(key), 0.0);
  }
  const Json& plan = json.at("plans").at(0);
  EXPECT_EQ(plan.at("name"), "around");
  for (const char* key : {"success", "valid_snapshot", "valid_independent"}) {
    EXPECT_EQ(plan.at(key), true) << key;
  }
  for (const char* key : {"min_clearance_m", "duration_s", "solve_ms", "iterations"}) {
    EXPECT_GT(plan.at(key), 0) << key;
  }
  EXPECT_EQ(plan.at("checks").at("scene").at("outcome"), "valid");
  EXPECT_EQ(plan.at("reason"), "");
  EXPECT_TRUE(plan.at("explanation").is_null());
}

TEST_F(CommandTest, CountsInTheLogWhatItReadOfEachFile) {
  const Finished finished = run_tiny({"--set", "robot={plugin: urdf, profile: planar}"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const std::string log = read_file(folder_ / "run" / "run.log");
  EXPECT_THAT(log, HasSubstr("planar/robot.urdf: 3 links, 2 joints, 1 shapes; read "));
  EXPECT_THAT(log, HasSubstr("planar/profile.yaml: 2 planned joints, 1 spheres, 1 poses, 0 pairs "
                             "of links"));
  EXPECT_THAT(log, HasSubstr("tiny_scene.yaml: 3 objects, 0 of them moving, 0 groups of people, 0 "
                             "recorded people"));
  EXPECT_THAT(finished.error, Not(HasSubstr("3 links"))) << "no news on a terminal";
}

TEST_F(CommandTest, LeavesTheCertificateOfAPlan) {
  const Finished finished = run_tiny({"--set", "check.certificate=file"});
  const std::string file = "certificates/around.json";
  ASSERT_EQ(summary().at("/plans/0/certificate"_json_pointer), "proven") << finished.error;
  EXPECT_EQ(std::system((RECHECK " " + (folder_ / "run" / file).string() + " >/dev/null").c_str()),
            0);
  EXPECT_THAT(read_file(folder_ / "run" / "report.html"), HasSubstr("href=\"" + file + "\""));
}

TEST_F(CommandTest, LeavesTheTrajectoryOfAPlanForOtherPrograms) {
  const Finished finished = run_tiny({"--set", "experiment.trajectories=csv"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  std::istringstream table(read_file(folder_ / "run" / "trajectories" / "around.csv"));
  std::string header, line, last;
  std::getline(table, header);
  EXPECT_EQ(header, "time_s,x,y,x.velocity,y.velocity");
  int states = 0;
  for (; std::getline(table, line); ++states) last = line;
  EXPECT_GT(states, 2);
  std::ranges::replace(last, ',', ' ');
  std::istringstream fields(last);
  double time_s = 0.0, x = 0.0, y = 0.0;
  fields >> time_s >> x >> y;
  EXPECT_NEAR(time_s, summary().at("/plans/0/duration_s"_json_pointer).get<double>(), 1e-6);
  EXPECT_NEAR(x, 2.7, 1e-3);
  EXPECT_NEAR(y, -0.1, 1e-3);
}

TEST_F(CommandTest, ReachesAnEndEffectorGoal) {
  // The configuration named as the goal is short of where the link is to be.
  const std::vector<std::string> options = {
      "--set", "optimiser.plugin=gp_chain",
      "--set", "experiment.plans.0.goal.joints.x=2.4",
      "--set", "experiment.plans.0.end_effector={link: body, position_m: [2.7, -0.1, 0.0]}"};
  const Finished finished = run_tiny(options);
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  std::vector<std::string> misspelt = options;
  misspelt.insert(misspelt.end(), {"--set", "experiment.plans.0.end_effector.link=bdy"});
  const Finished refused = run_tiny(misspelt, "misspelt");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error, HasSubstr("no link 'bdy' (did you mean 'body'?)"));
}

TEST_F(CommandTest, SendsNoPlanThatTheRobotCannotFollow) {
  // 2.4 m in 1.5 s, at most 0.5 m/s^2: not as it is optimised, but once it is timed anew.
  const std::vector<std::string> hasty = {"--set", "planning.duration_s=1.5", "--set",
                                          "robot.max_acceleration_mps2=0.5"};
  std::vector<std::string> as_optimised = hasty;
  as_optimised.insert(as_optimised.end(), {"--set", "planning.retime=false"});
  const Finished refused = run_tiny(as_optimised, "refused");
  EXPECT_EQ(refused.exit_code, 1) << refused.error;
  const Json sent_too_fast = summary("refused").at("plans").at(0);
  EXPECT_TRUE(sent_too_fast.at("retiming").is_null());
  EXPECT_THAT(std::string(sent_too_fast.at("reason")), HasSubstr("acceleration limit"));

  const Finished timed = run_tiny(hasty, "timed");
  ASSERT_EQ(timed.exit_code, 0) << timed.error << timed.out;
  const Json plan = summary("timed").at("plans").at(0);
  const double before_s = plan.at("retiming").at("before_s");
  EXPECT_GE(before_s, 1.5);  // later attempts are given more time
  EXPECT_LE(before_s, 2.5);
  // At least a triangle over the straight way, at the 0.45 m/s^2 that planning uses.
  EXPECT_GT(plan.at("duration_s"), 2.0 * std::sqrt(2.4 / 0.45));
  EXPECT_LE(plan.at("retiming").at("deviation"), 1e-4);
}

TEST_F(CommandTest, PrintsNothingButTheSummaryAsJson) {
  const Finished finished = run_tiny({"--json"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_EQ(finished.out, read_file(folder_ / "run" / "summary.json"));
  EXPECT_TRUE(Json::accept(finished.out));
}

TEST_F(CommandTest, GivesTheSamePlanForTheSameSeed) {
  const std::vector<std::string> options = {"--seed", "5", "--threads", "1", "--json"};
  ASSERT_EQ(run_tiny(options, "first").exit_code, 0);
  ASSERT_EQ(run_tiny(options, "second").exit_code, 0);
  EXPECT_EQ(summary("first").at("/provenance/seed"_json_pointer), 5);
  EXPECT_EQ(summary("first").at("/provenance/threads"_json_pointer), 1);
  std::vector<double> columns[2];
  for (const int i : {0, 1}) {
    auto results = ResultsReader::open(folder_ / (i == 0 ? "first" : "second") / "results.sqlite");
    ASSERT_TRUE(results) << results.error().describe();
    columns[i] = (*results)->column("trajectory/0", "q.x").value();
  }
  EXPECT_FALSE(columns[0].empty());
  EXPECT_EQ(columns[0], columns[1]);
}

/// In or on the pillar, give or take a voxel of the map.
void expect_on_pillar(const Json& point_m) {
  ASSERT_TRUE(point_m.is_array());
  EXPECT_NEAR(point_m.at(0), 1.5, 0.2 + 0.06);
  EXPECT_NEAR(point_m.at(1), 0.0, 0.2 + 0.06);
}

TEST_F(CommandTest, NamesTheLinkOfAGoalInCollision) {
  const Finished finished = run_tiny({"--set", "experiment.plans.0.goal.joints.x=1.35"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  const Json plan = summary().at("plans").at(0);
  EXPECT_EQ(plan.at("success"), false);
  EXPECT_THAT(std::string(plan.at("reason")), HasSubstr("the goal is not valid: "));
  EXPECT_THAT(std::string(plan.at("reason")), HasSubstr("m inside an obstacle"));
  EXPECT_THAT(finished.out, HasSubstr(std::string(plan.at("reason"))));
  EXPECT_EQ(plan.at("attempts"), 0);
  EXPECT_TRUE(plan.at("min_clearance_m").is_null());
  const Json held = plan.at("/explanation/hindrances/0"_json_pointer);
  EXPECT_EQ(held.at("term"), "obstacle");
  expect_on_pillar(held.at("obstacle_m"));
  EXPECT_TRUE(fs::exists(folder_ / "run" / "plan-1-around-slice-1.png"));
}

TEST_F(CommandTest, ExplainsWhatHoldsAPlanWhoeverMadeIt) {
  // Obstacles weigh next to nothing, so that the plan goes straight through the pillar.
  for (const std::string optimiser : {"gp_chain", "gp_ceres"}) {
    const Finished finished =
        run_tiny({"--set", "planning.sigma_obstacle=1000", "--set", "planning.attempts=1", "--set",
                  "optimiser.plugin=" + optimiser},
                 optimiser);
    EXPECT_EQ(finished.exit_code, 1) << finished.error;
    const Json plan = summary(optimiser).at("plans").at(0);
    const Json hindrances = plan.at("/explanation/hindrances"_json_pointer);
    ASSERT_FALSE(hindrances.empty());
    const Json& first = hindrances.at(0);
    EXPECT_EQ(first.at("term"), "obstacle");
    EXPECT_EQ(first.at("broken"), true);
    expect_on_pillar(first.at("obstacle_m"));
    // Between 1.15 and 1.85 m of the way from 0.3 to 2.7 m the ball is in the pillar.
    const double optimised_s = plan.at("/retiming/before_s"_json_pointer);
    EXPECT_GT(first.at("worst_s"), 0.3 * optimised_s);
    EXPECT_LT(first.at("worst_s"), 0.7 * optimised_s);
    const std::string what = first.at("what");
    EXPECT_THAT(what, HasSubstr("inside an obstacle at ("));
    EXPECT_THAT(read_file(folder_ / optimiser / "run.log"),
                HasSubstr("is held (times as optimised): " + what));
    EXPECT_THAT(read_file(folder_ / optimiser / "report.html"), HasSubstr(what));
  }
}

TEST_F(CommandTest, SavesThePlansBesideOneThatFails) {
  const Finished finished = run({"run",
                                 config("base: " + kTiny +
                                        "\nschema_version: 1\nexperiment:\n  plans:\n"
                                        "    - {name: into, start: {joints: {x: 0.3, y: 0.05}}, "
                                        "goal: {joints: {x: 1.35, y: 0.0}}}\n"
                                        "    - {name: aside, start: {joints: {x: 0.3, y: 0.05}}, "
                                        "goal: {joints: {x: 0.3, y: -0.8}}}\n"),
                                 "--out", (folder_ / "run").string()});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_EQ(summary().at("plans").at(0).at("success"), false);
  EXPECT_EQ(summary().at("plans").at(1).at("success"), true);
  EXPECT_THAT(finished.out, HasSubstr("1 of 2 plans did not succeed"));
}

TEST_F(CommandTest, ReportsEveryMistakeInOnePass) {
  const std::string file = config(R"(schema_version: 1
experiment:
  type: plan
  sead: 7
  threads: -1
  plans:
    - {name: a, start: {joints: {x: 0, z: 1}}, goal: {joints: {x: 99, y: 0}}}
robot: {plugin: point, radius_m: .nan}
source: {plugin: simulator, frames: many, camera_path: []}
mapper: {plugin: voxel_grid, resolution_m: -0.1, resolution_m: 0.1}
field: {plugin: edt, signed: maybe}
optimiser: {plugin: gp_cerez}
planing: {}
)");
  const Finished checked = run({"check", file});
  EXPECT_EQ(checked.exit_code, 2);
  for (const char* part :
       {":4:3: unknown key 'sead' (did you mean 'seed'?)", ":5:12: 'threads'", ":8:34: 'radius_m'",
        ":9:37: 'frames'", ":10:50:", ":11:30: 'signed'", ":11:8: 'unknown' is missing",
        ":12:21: there is no optimiser plugin 'gp_cerez'", "did you mean 'gp_ceres'?",
        ":13:1: unknown key 'planing'", "`planning`"}) {
    EXPECT_THAT(checked.error, HasSubstr(part));
  }
  EXPECT_THAT(checked.error, HasSubstr(file + ":"));
  EXPECT_EQ(run({"run", file, "--out", (folder_ / "run").string()}).exit_code, 2);
  EXPECT_FALSE(fs::exists(folder_ / "run"));
}

TEST_F(CommandTest, ReadsOneValueAfterEachSet) {
  const std::string first = config("schema_version: 1\nbase: " + kTiny + "\n");
  const std::string set = "experiment.seed=3";
  for (const auto& order : std::vector<std::vector<std::string>>{{"--set", set, first, kTiny},
                                                                 {first, "--set", set, kTiny},
                                                                 {first, kTiny, "--set", set}}) {
    std::vector<std::string> arguments = {"check"};
    arguments.insert(arguments.end(), order.begin(), order.end());
    const Finished checked = run(arguments);
    EXPECT_EQ(checked.exit_code, 0) << checked.error;
    EXPECT_EQ(checked.out, first + ": ok\n" + kTiny + ": ok\n");
  }
  const Finished mistaken = run({"check", first, "--set", "experiment.seed=x", kTiny});
  EXPECT_EQ(mistaken.exit_code, 2);
  EXPECT_EQ(mistaken.out, first + ": 1 error\n" + kTiny + ": 1 error\n");
}

TEST_F(CommandTest, ChecksThePosesOfPlans) {
  const Finished checked = run({"check", kTiny, "--set", "experiment.plans.0.goal.pose=table",
                                "--set", "experiment.plans.0.start.joints={x: 1, w: 0}"});
  EXPECT_EQ(checked.exit_code, 2);
  EXPECT_THAT(checked.error, HasSubstr("has no pose 'table'"));
  EXPECT_THAT(checked.error, HasSubstr("has no joint 'w'"));
  EXPECT_THAT(checked.out, HasSubstr("2 errors"));
}

TEST_F(CommandTest, ARobotMayStandOnTheFloorWhereItIsAllowedTo) {
  std::ofstream(folder_ / "floor.yaml") << "objects:\n  - {name: floor, shape: half_space}\n";
  const std::string file = config(R"(schema_version: 1
experiment: {type: plan, plans: [{name: turn, start: {pose: ready}, goal: {pose: left}}]}
robot: {plugin: urdf, profile: panda}
source:
  plugin: simulator
  scene: floor.yaml
  frames: 2
  camera: {width_px: 160, height_px: 120, fx_px: 100.0, fy_px: 100.0, cx_px: 79.5, cy_px: 59.5}
  camera_path: [{time_s: 0.0, position_m: [-1.5, -1.5, 1.4], look_at_m: [0.0, 0.0, 0.3]}]
mapper: {plugin: voxel_grid, resolution_m: 0.08, size_vox: [50, 50, 25], origin_m: [-2, -2, -0.1]}
field: {plugin: edt, unknown: free}
optimiser: {plugin: gp_ceres}
planning: {unknown: free, outside: occupied, attempts: 3, max_unknown_share: 1.0}
)");
  const auto run_with = [&](const std::string& contacts) {
    return run({"run", file, "--out", (folder_ / "run").string(), "--set",
                "check.allowed_contacts=" + contacts});
  };
  const Finished standing = run_with("[]");
  EXPECT_EQ(standing.exit_code, 1) << standing.error;
  EXPECT_THAT(standing.out, HasSubstr("in the true scene, not shown to be valid: panda_link0"));
  const Finished allowed = run_with("[{link: panda_link0, object: floor}]");
  EXPECT_EQ(allowed.exit_code, 0) << allowed.error << allowed.out;
  const Finished misspelt = run_with("[{link: panda_link0, object: flour}]");
  EXPECT_EQ(misspelt.exit_code, 2) << misspelt.out;
  EXPECT_THAT(misspelt.error, HasSubstr("there is no object in the scene 'flour' (did you mean "
                                        "'floor'?)"));
}

TEST_F(CommandTest, EndsWithThreeForAMissingPlugin) {
  const Finished finished = run_tiny({"--set", "optimiser.plugin=gp_cerez"});
  EXPECT_EQ(finished.exit_code, 3);
  EXPECT_THAT(finished.error, HasSubstr("did you mean 'gp_ceres'?"));
}

TEST_F(CommandTest, EndsWithFourForMissingData) {
  const Finished finished =
      run_tiny({"--set", "source={plugin: depth_sequence, path: /no/such/data}"});
  EXPECT_EQ(finished.exit_code, 4) << finished.error;
  EXPECT_THAT(finished.error, HasSubstr("/no/such/data"));
  EXPECT_THAT(read_file(folder_ / "run" / "run.log"), HasSubstr("/no/such/data"));
}

TEST_F(CommandTest, EndsWithTwoForWrongUsage) {
  EXPECT_EQ(run({"frobnicate"}).exit_code, 2);
  EXPECT_EQ(run({"run"}).exit_code, 2);
  EXPECT_EQ(run({"run", kTiny, "--threads", "many"}).exit_code, 2);
  EXPECT_EQ(run({"run", kTiny, "--frobnicate"}).exit_code, 2);
  const Finished unknown = run({"check", "no_such_configuration"});
  EXPECT_EQ(unknown.exit_code, 2);
  EXPECT_THAT(unknown.error, HasSubstr("no_such_configuration"));
}

TEST_F(CommandTest, HelpsWithoutArguments) {
  for (const auto& arguments : {std::vector<std::string>{}, {"--help"}}) {
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 0);
    for (const char* word : {"run", "check", "plugins", "report"}) {
      EXPECT_THAT(finished.out, HasSubstr(word));
    }
  }
  EXPECT_THAT(run({"--version"}).out, HasSubstr("sidestep "));
}

TEST_F(CommandTest, KeepsWhatWasMeasuredWhenInterrupted) {
  CommandLine command({"run", kTiny, "--out", (folder_ / "run").string(), "--set",
                       "source.frames=0"});  // a stream without end
  ASSERT_TRUE(command.wait_for("mapping 1"));
  command.send(SIGINT);
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Interrupted"));
  EXPECT_EQ(summary().at("interrupted"), true);
  EXPECT_EQ(summary().at("success"), false);
  const int frames = summary().at("frames");
  EXPECT_GT(frames, 0);
  auto results = ResultsReader::open(folder_ / "run" / "results.sqlite");
  ASSERT_TRUE(results) << results.error().describe();
  EXPECT_EQ((*results)->column("frame", "field_ms")->size(), static_cast<std::size_t>(frames));
  EXPECT_TRUE(fs::exists(folder_ / "run" / "report.html"));
}

TEST_F(CommandTest, TakesSignalsThatComeTogetherForOne) {
  CommandLine command({"run", kTiny, "--out", (folder_ / "run").string(), "--set",
                       "source.frames=0"});  // a stream without end
  ASSERT_TRUE(command.wait_for("mapping 1"));
  for (const int signal : {SIGSTOP, SIGTERM, SIGINT, SIGCONT}) command.send(signal);
  const Finished finished = command.wait();
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.out, HasSubstr("Interrupted"));
}

TEST_F(CommandTest, ReplacesAnEarlierRunsFilesAndNoOthers) {
  ASSERT_EQ(run_tiny({}).exit_code, 0);
  std::ofstream(folder_ / "run" / "notes.txt") << "mine";
  std::ofstream(folder_ / "run" / "plan-2-old-joints.png") << "stale";
  const Finished finished =
      run_tiny({"--set", "source={plugin: depth_sequence, path: /no/such/data}"});
  EXPECT_EQ(finished.exit_code, 4);
  EXPECT_FALSE(fs::exists(folder_ / "run" / "summary.json"));
  EXPECT_FALSE(fs::exists(folder_ / "run" / "report.html"));
  EXPECT_FALSE(fs::exists(folder_ / "run" / "plan-2-old-joints.png"));
  EXPECT_EQ(read_file(folder_ / "run" / "notes.txt"), "mine");
}

TEST_F(CommandTest, RebuildsAndComparesReports) {
  ASSERT_EQ(run_tiny({}, "a").exit_code, 0);
  ASSERT_EQ(run_tiny({"--set", "source.frames=4"}, "b").exit_code, 0);
  const std::string before = read_file(folder_ / "a" / "report.html");
  fs::remove(folder_ / "a" / "report.html");
  fs::remove(folder_ / "a" / "depth.png");
  const fs::path comparison = folder_ / "comparison.html";
  const Finished finished = run({"report", (folder_ / "a").string(), (folder_ / "b").string(),
                                 "--comparison", comparison.string()});
  ASSERT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_EQ(read_file(folder_ / "a" / "report.html"), before);
  EXPECT_TRUE(fs::exists(folder_ / "a" / "depth.png"));
  EXPECT_THAT(finished.out, HasSubstr("around"));
  EXPECT_THAT(read_file(comparison), HasSubstr("<td>around</td>"));

  const Finished none = run({"report", folder_.string()});
  EXPECT_EQ(none.exit_code, 2);
  EXPECT_THAT(none.error, HasSubstr("no finished run"));
}

TEST_F(CommandTest, ListsPluginsAndTheirParameters) {
  const Finished list = run({"plugins"});
  EXPECT_EQ(list.exit_code, 0);
  EXPECT_THAT(list.out, HasSubstr("gp_ceres"));
  const Finished one = run({"plugins", "voxel_grid"});
  EXPECT_THAT(one.out, HasSubstr("resolution_m: number [m]"));
  const Json json = Json::parse(run({"plugins", "--json"}).out);
  EXPECT_TRUE(std::ranges::any_of(json, [](const Json& plugin) {
    return plugin.at("name") == "edt" && plugin.at("kind") == "field";
  }));
  const Finished unknown = run({"plugins", "voxel_gird"});
  EXPECT_EQ(unknown.exit_code, 3);
  EXPECT_THAT(unknown.error, HasSubstr("did you mean 'voxel_grid'?"));
}

TEST_F(CommandTest, TellsWhyAPluginThatIsAskedForIsNotUsable) {
  const fs::path library = folder_ / "libfield_mine.so";
  std::ofstream(library) << "no library";
  setenv("SIDESTEP_PLUGIN_PATH", folder_.c_str(), 1);
  const Finished finished = run({"plugins", "mine"});
  unsetenv("SIDESTEP_PLUGIN_PATH");
  EXPECT_EQ(finished.exit_code, 3);
  EXPECT_THAT(finished.error, HasSubstr(library.string() + " is not usable"));
  EXPECT_THAT(finished.error, HasSubstr("there is no plugin 'mine'"));
}

TEST_F(CommandTest, FindsNoMistakeInTheConfigurationsThatAreInstalled) {
  int checked = 0;
  for (const auto& entry : fs::directory_iterator(std::string(SIDESTEP_SOURCE_DIR) + "/configs")) {
    if (entry.path().extension() != ".yaml") continue;
    const Finished finished = run({"check", entry.path().string()});
    EXPECT_EQ(finished.exit_code, 0) << finished.error;
    ++checked;
  }
  EXPECT_GT(checked, 0);
}

}  // namespace
}  // namespace sidestep::testing
