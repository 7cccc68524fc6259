#include <algorithm>
#include <mutex>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/run_observer.hpp>

#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep::testing {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Keeps all that it is told, in the order of the calls.
struct Witness final : RunObserver {
  void begin(const ObservedWorld& world) override { note("begin"), worlds.push_back(world); }
  void mapped(const ObservedMap& map) override { note("mapped"), maps.push_back(map); }
  void stepped(const ObservedStep& step) override { note("stepped"), steps.push_back(step); }
  void happened(const ObservedEvent& event) override { note("happened"), events.push_back(event); }
  void end(const ObservedEnd& end) override { note("end"), ends.push_back(end); }

  void note(const char* call) { calls.emplace_back(call); }
  [[nodiscard]] auto count(const std::string& call) const {
    return std::ranges::count(calls, call);
  }

  std::vector<std::string> calls;
  std::vector<ObservedWorld> worlds;
  std::vector<ObservedMap> maps;
  std::vector<ObservedStep> steps;
  std::vector<ObservedEvent> events;
  std::vector<ObservedEnd> ends;
};

class ObserverTest : public ::testing::Test {
 protected:
  /// The summary of a run that `observer` looks on at.
  Json run(const std::string& name, RunObserver* observer,
           const std::vector<std::string>& overrides = {}) {
    testing_support::HostFixture fixture({PLUGIN_FOLDER});
    const auto reading = read_configuration(kConfigs / name, overrides, fixture.documents);
    EXPECT_TRUE(reading.errors.empty());
    const fs::path out = folder_.path() / std::to_string(runs_++);
    fs::create_directories(out);
    ExperimentContext context{reading.configuration, fixture.host, fixture.log,
                              fixture.documents,     out,          7};
    context.observer = observer;
    const auto outcome = run_experiment(context);
    EXPECT_TRUE(outcome) << outcome.error().describe();
    if (!outcome) return {};
    const Json summary = Json::parse(outcome->summary_json);
    return summary;
  }

  const fs::path kConfigs = fs::path(SIDESTEP_SOURCE_DIR) / "tests/integration/configs";
  testing_support::TemporaryFolder folder_;
  int runs_ = 0;
};

TEST_F(ObserverTest, IsToldAllOfAClosedLoopInOrderAndChangesNothing) {
  Witness witness;
  Json observed = run("tiny_replan.yaml", &witness);
  Json alone = run("tiny_replan.yaml", nullptr);
  for (Json* summary : {&observed, &alone}) {
    for (const char* key : {"solve_ms", "search_ms"}) summary->erase(key);
  }
  EXPECT_EQ(observed, alone);

  EXPECT_EQ(witness.count("begin"), observed["episodes"]);
  EXPECT_EQ(witness.count("end"), observed["episodes"]);
  EXPECT_EQ(witness.calls.front(), "begin");
  EXPECT_EQ(witness.calls.back(), "end");
  EXPECT_EQ(witness.worlds[1].episode, 1);
  EXPECT_NE(witness.worlds[0].q_start, witness.worlds[1].q_start);
  EXPECT_NE(witness.worlds[0].scene, nullptr);
  EXPECT_EQ(static_cast<std::int64_t>(witness.maps.size()), observed["frames"]);
  for (const ObservedMap& map : witness.maps) {
    EXPECT_EQ(map.frame->stamp, map.step.stamp);
    EXPECT_EQ(map.snapshot.field->info().stamp, map.step.stamp);
    EXPECT_NEAR(map.published.seconds() - map.received.seconds(), 0.02, 1e-9) << "mapping_s";
  }
  for (const ObservedStep& step : witness.steps) {
    ASSERT_EQ(step.q.size(), witness.worlds[0].q_start.size());
    ASSERT_EQ(step.q_true.size(), step.q.size());
  }
  EXPECT_TRUE(std::ranges::all_of(witness.ends, &ObservedEnd::success));
}

TEST_F(ObserverTest, SeesWhatIsFollowedAndWhatWasTurnedDown) {
  using Kind = ReplannerEvent::Kind;
  Witness witness;
  // Nothing will do near the block that the goal is beside.
  run("tiny_replan.yaml", &witness,
      {"experiment.goal.joints.x=1.3", "experiment.goal.joints.y=-0.1", "experiment.random=null",
       "experiment.episodes=1", "experiment.duration_s=8"});
  ASSERT_FALSE(witness.ends.front().success);
  int turned_down = 0;
  for (const ObservedEvent& shown : witness.events) {
    const Kind kind = shown.event.kind;
    const bool is_new = kind == Kind::kPlanned || kind == Kind::kReplanned;
    ASSERT_EQ(shown.followed != nullptr, is_new || kind == Kind::kStopped || kind == Kind::kSlowed);
    if (is_new) {
      EXPECT_GE(shown.followed->size(), 2);
      EXPECT_EQ(shown.followed_start, shown.event.stamp);
    }
    if (shown.event.refused == nullptr) continue;
    ++turned_down;
    EXPECT_TRUE(shown.event.refused->validate());
    EXPECT_EQ(shown.event.refused->dof, shown.followed ? shown.followed->dof : 2);
  }
  EXPECT_GE(turned_down, 1);
}

TEST_F(ObserverTest, SeesWhatIsTrackedAndPredicted) {
  Witness witness;
  run("tiny_replan.yaml", &witness,
      {"predictor.plugin=constant_velocity", "experiment.episodes=1"});
  const auto has_both = [](const ObservedStep& step) {
    return step.tracks != nullptr && !step.tracks->tracks.empty() && step.prediction != nullptr &&
           !step.prediction->sets().empty();
  };
  const auto shown = std::ranges::find_if(witness.steps, has_both);
  ASSERT_NE(shown, witness.steps.end());
  EXPECT_EQ(shown->prediction->sets()[0].track, shown->tracks->tracks[0].id);
  EXPECT_NEAR(shown->tracks->tracks[0].position_m.x(), 1.3, 0.3) << "the crosser's lane";
}

TEST_F(ObserverTest, SeesWhoTouchedWhom) {
  Witness witness;
  // Nothing brakes for what moves.
  const Json summary =
      run("tiny_replan.yaml", &witness,
          {"replanner.obstacle_speed_mps=0", "experiment.random=null", "experiment.episodes=1"});
  const std::vector<TrueContact>& seen = witness.ends.front().contacts;
  ASSERT_EQ(seen.size(), summary["collisions"].size());
  ASSERT_FALSE(seen.empty());
  EXPECT_EQ(seen[0].object, summary["collisions"][0]["object"]);
  EXPECT_EQ(seen[0].is_by_robot(), summary["collisions"][0]["by"] == "robot");
}

TEST_F(ObserverTest, SeesTheMapAndThePlansOfAPlanExperiment) {
  Witness witness;
  const Json summary = run("tiny.yaml", &witness, {"optimiser.plugin=gp_chain"});
  EXPECT_EQ(witness.count("begin"), 1);
  EXPECT_EQ(witness.count("end"), 1);
  EXPECT_EQ(witness.count("stepped"), 0);
  EXPECT_EQ(static_cast<std::int64_t>(witness.maps.size()), summary["frames"]);
  EXPECT_EQ(witness.events.size(), summary["plans"].size());
}

}  // namespace
}  // namespace sidestep::testing
