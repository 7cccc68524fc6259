#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/runtime/results_store.hpp>

#include "command_line.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

using Json = nlohmann::json;

/// The closed loops that are shipped (configs/replan, and one of configs/sudden).
class Scenario : public ::testing::TestWithParam<const char*> {
 protected:
  /// The summary of the first episodes.
  [[nodiscard]] Json run_episodes(int count, const std::vector<std::string>& sets = {}) const {
    const std::string folder = std::string(GetParam()) == "living_room" ? "sudden/" : "replan/";
    const std::string config =
        std::string(SIDESTEP_SOURCE_DIR) + "/configs/" + folder + GetParam() + ".yaml";
    std::vector<std::string> arguments = {"run",   config,
                                          "--out", (folder_.path() / "run").string(),
                                          "--set", "experiment.episodes=" + std::to_string(count),
                                          "--set", "experiment.truth.measure=false"};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    const Finished finished = run(arguments);
    EXPECT_LE(finished.exit_code, 1) << finished.error;
    return Json::parse(read_file(folder_.path() / "run" / "summary.json"), nullptr, false);
  }

  testing_support::TemporaryFolder folder_;
};

TEST_P(Scenario, ReachesItsGoalWithoutTouchingAnything) {
  const Json of = run_episodes(1);
  ASSERT_TRUE(of.contains("success_share"));
  EXPECT_EQ(of["success_share"], 1.0) << of["failures"];
  EXPECT_EQ(of["collisions_true"], 0);
  EXPECT_GT(of["min_true_clearance_m"], 0.0);
}

/// Or it would say nothing for the map. A robot moves only once something is in its map: what the
/// camera beside the arm sees nearer than this is air, and what the laser sees in its plane could
/// stop it. It drives where it has not looked, or it would stay where it is.
TEST_P(Scenario, IsNotPassedByARobotThatSeesNothing) {
  constexpr int kEpisodes = 5;
  const std::string range_m = std::string(GetParam()) == "arm_reach" ? "0.6" : "0.2";
  const Json of = run_episodes(
      kEpisodes, {"mapper.max_range_m=" + range_m, "sources=null", "replanner.unseen_start_m=100"});
  ASSERT_TRUE(of.contains("success_share"));
  EXPECT_EQ(of["success_share"], 0.0);
  EXPECT_GE(of["collisions_true"], kEpisodes);
}

INSTANTIATE_TEST_SUITE_P(Replan, Scenario,
                         ::testing::Values("floor_pickup", "shelf_pickup", "table_pickup",
                                           "room_navigation", "arm_reach", "living_room"),
                         [](const auto& scenario) { return std::string(scenario.param); });

struct Fault {
  const char* name;
  std::vector<std::string> sets;
  const char* words;
  double from_s = 10.0;
};
void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.name; }

/// The HSR drives, and something goes wrong.
class HeadFault : public ::testing::Test {
 protected:
  [[nodiscard]] Finished drive(std::vector<std::string> sets,
                               const std::string& scenario = "replan/floor_pickup") const {
    sets.insert(sets.end(), {"experiment.truth.measure=false", "experiment.episodes=1"});
    std::vector<std::string> arguments = {
        "run", std::string(SIDESTEP_SOURCE_DIR) + "/configs/" + scenario + ".yaml", "--out",
        (folder_.path() / "run").string()};
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    return run(arguments);
  }
  testing_support::TemporaryFolder folder_;
};

/// With the camera or the laser, for four seconds.
class SensorFault : public HeadFault, public ::testing::WithParamInterface<Fault> {};

TEST_P(SensorFault, IsNamedAndTheRobotStopsInTimeAndGoesOn) {
  std::vector<std::string> sets = GetParam().sets;
  const std::string sensor = sets.front().substr(0, sets.front().find(".fault"));
  const double from_s = GetParam().from_s;
  sets.push_back(sensor + ".fault.from_s=" + std::to_string(from_s));
  sets.push_back(sensor + ".fault.until_s=" + std::to_string(from_s + 4.0));
  const Finished finished = drive(sets);
  EXPECT_EQ(finished.exit_code, 0) << finished.error;  // it goes on once the camera is sound
  const auto reader = ResultsReader::open(folder_.path() / "run" / "results.sqlite");
  ASSERT_TRUE(reader);
  const auto times_s = (*reader)->column("event", "time_s");
  ASSERT_TRUE(times_s);
  for (std::size_t i = 0; i < times_s->size(); ++i) {
    const auto item = static_cast<std::int64_t>(i);
    const auto cause = (*reader)->text("event", item, "cause");
    if (!cause || !*cause || (**cause).find(GetParam().words) == std::string::npos) continue;
    const auto map_stamp_s = (*reader)->number("event", item, "map_stamp_s");
    ASSERT_TRUE(map_stamp_s && *map_stamp_s);
    RecordProperty("mapped_after_ms", static_cast<int>(1e3 * (**map_stamp_s - from_s)));
    RecordProperty("stops_after_ms", static_cast<int>(1e3 * ((*times_s)[i] - from_s)));
    // The newest frame that was believed, of ten a second: the next one tells.
    EXPECT_LE(**map_stamp_s, from_s + 0.9 + 1e-6);
    EXPECT_LT((*times_s)[i], from_s + 1.6);
    return;
  }
  ADD_FAILURE() << "nobody named it: " << finished.error;
}

INSTANTIATE_TEST_SUITE_P(
    Replan, SensorFault,
    ::testing::Values(Fault{"frozen", {"source.fault.kind=frozen"}, "frozen"},
                      Fault{"blind", {"source.fault.kind=blind"}, "blind"},
                      Fault{"lens", {"source.fault.kind=lens"}, "its lens"},
                      Fault{"pitched", {"source.fault.kind=mount"}, "not mounted"},
                      Fault{"rolled",
                            {"source.fault.kind=mount", "source.fault.turn_rad=[0, 0, 0.0873]"},
                            "not mounted"},
                      Fault{"laser_frozen",
                            {"sources.base_laser.fault.kind=frozen"},
                            "no map without base_laser: the laser is frozen"},
                      Fault{"laser_blind",
                            {"sources.base_laser.fault.kind=blind"},
                            "no map without base_laser: none of its depths"},
                      Fault{"laser_silent",
                            {"sources.base_laser.fault.kind=silent"},
                            "no map without base_laser, which has given no frame since that of"},
                      // While it drives: who stands learns nothing of it.
                      Fault{"laser_obstructed",
                            {"sources.base_laser.fault.kind=obstructed"},
                            "no map without base_laser: the laser sees its own robot",
                            20.0}),
    [](const auto& fault) { return std::string(fault.param.name); });

/// A mount that is turned about the vertical: what camera and laser both see tells of it.
TEST_F(HeadFault, OfACameraThatDoesNotAgreeWithTheLaserIsNamed) {
  const Finished finished =
      drive({"source.fault.kind=mount", "source.fault.turn_rad=[0, 0.0873, 0]",
             "source.fault.from_s=10", "experiment.duration_s=14"},
            "sudden/living_room");
  EXPECT_NE(finished.error.find("camera and laser do not agree"), std::string::npos)
      << finished.error;
}

/// Which sensors a robot can do without, its configuration says.
TEST_F(HeadFault, OfALaserThatIsNotNeededIsNamedAndTheRobotGoesOn) {
  const Finished finished =
      drive({"experiment.goes_on_without=[base_laser]", "sources.base_laser.fault.kind=silent",
             "sources.base_laser.fault.from_s=10"});
  EXPECT_EQ(finished.exit_code, 0) << finished.error;
  EXPECT_NE(finished.error.find("the robot goes on without base_laser"), std::string::npos)
      << finished.error;
}

TEST_F(HeadFault, IsNamed) {
  const Finished finished = drive({"executor.head_fails_at_s=10"});
  EXPECT_NE(finished.error.find("executor simulated: the head does not move"), std::string::npos)
      << finished.error;
}

}  // namespace
}  // namespace sidestep::testing
