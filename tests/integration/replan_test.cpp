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

const std::string kConfig =
    std::string(SIDESTEP_SOURCE_DIR) + "/tests/integration/configs/tiny_replan.yaml";

class ReplanTest : public ::testing::Test {
 protected:
  [[nodiscard]] Finished run_it(const std::string& out, const std::vector<std::string>& sets = {},
                                const std::vector<std::string>& options = {}) const {
    std::vector<std::string> arguments = {"run", kConfig};
    if (options.empty()) {
      arguments.insert(arguments.end(), {"--out", (folder_.path() / out).string()});
    }
    arguments.insert(arguments.end(), options.begin(), options.end());
    for (const std::string& set : sets) arguments.insert(arguments.end(), {"--set", set});
    return run(arguments);
  }
  [[nodiscard]] Json summary(const std::string& out) const {
    return Json::parse(read_file(folder_.path() / out / "summary.json"), nullptr, false);
  }
  /// What does not depend on how fast the machine is.
  [[nodiscard]] Json timeless(const std::string& out) const {
    Json all = summary(out);
    all.erase("solve_ms");
    all.erase("search_ms");
    return all;
  }

  testing_support::TemporaryFolder folder_;
};

TEST_F(ReplanTest, GoesAroundWhatCrossesItsWay) {
  const Finished finished = run_it("run");
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json of = summary("run");
  EXPECT_EQ(of["success"], true);
  EXPECT_EQ(of["episodes"], 2);
  EXPECT_EQ(of["success_share"], 1.0);
  EXPECT_EQ(of["collisions_true"], 0);
  EXPECT_GT(of["min_true_clearance_m"], 0.0);
  EXPECT_GE(of["path_length"]["p50"], 2.6);
  EXPECT_LE(of["path_length"]["max"], 2.6 + 2.0) << "there and back, and about";
  const int replans = of["replans"], slowdowns = of["slowdowns"];
  EXPECT_GE(replans + slowdowns, 1) << "the way was free all along";
  EXPECT_GE(of["step_hz"], 249.0);
  EXPECT_GE(of["check_hz"], 5.0);
  EXPECT_LE(of["splice_velocity_jump_max"], 1e-3);
  EXPECT_EQ(of["frames_dropped"], 0);
  // The crosser leaves what it came through.
  EXPECT_GE(of["clear_frames"]["p50"], 1.0);
  for (const char* key : {"solve_ms", "search_ms", "stamp_to_trajectory_ms", "map_age_ms", "stops",
                          "appear_frames", "clear_frames", "ghost_vox"}) {
    EXPECT_TRUE(of.contains(key)) << key;
  }
  const std::string report = read_file(folder_.path() / "run" / "report.html");
  EXPECT_THAT(report, HasSubstr("Episode 0"));
  const std::string effective = read_file(folder_.path() / "run" / "effective_config.yaml");
  EXPECT_THAT(effective, HasSubstr("speed_fraction"));
  EXPECT_THAT(effective, Not(HasSubstr("attempts")));
  for (const char* picture : {"episode-0-above.png", "episode-0-time.png"}) {
    EXPECT_TRUE(fs::exists(folder_.path() / "run" / picture)) << picture;
  }
}

TEST_F(ReplanTest, ShardsTogetherAreTheWholeRun) {
  const std::vector<std::string> three = {"experiment.episodes=3", "experiment.first_episode=1"};
  const int whole = run_it("whole", three).exit_code;  // 1: not every episode succeeds
  ASSERT_LE(whole, 1);
  const auto at = [&](const std::string& out) { return (folder_.path() / out).string(); };
  for (const std::string i : {"1", "2", "3"}) {
    const Finished shard = run_it("", three, {"--out", at("shard" + i), "--shard", i + "/3"});
    ASSERT_LE(shard.exit_code, 1) << shard.error;
    EXPECT_THAT(shard.out, HasSubstr("Shard " + i + "/3: "));
  }
  EXPECT_EQ(summary("shard2")["episodes"], 1);
  const Finished merged =
      run({"report", at("shard2"), at("shard3"), at("shard1"), "--merged", at("merged")});
  ASSERT_EQ(merged.exit_code, whole) << merged.error;
  EXPECT_EQ(timeless("merged"), timeless("whole"));
  for (const char* file : {"report.html", "effective_config.yaml", "episode-1-above.png"}) {
    EXPECT_TRUE(fs::exists(folder_.path() / "merged" / file)) << file;
  }
  // The whole can be made by two processes, too, and some shards are not it.
  ASSERT_EQ(run_it("", three, {"--out", at("jobs"), "--jobs", "2"}).exit_code, whole);
  EXPECT_EQ(timeless("jobs"), timeless("whole"));
  const Finished lacking = run({"report", at("shard1"), at("shard3"), "--merged", at("lacking")});
  EXPECT_EQ(lacking.exit_code, 1);
  EXPECT_THAT(lacking.out, HasSubstr("of 3 episodes, only 2 were run"));
}

TEST_F(ReplanTest, ShardsOfOtherRunsAreRefused) {
  const auto at = [&](const std::string& out) { return (folder_.path() / out).string(); };
  const auto shard = [&](const std::string& out, const std::string& which, const std::string& seed,
                         const std::string& first) {
    return run_it("",
                  {"experiment.episodes=2", "experiment.seed=" + seed,
                   "experiment.first_episode=" + first},
                  {"--out", at(out), "--shard", which})
        .exit_code;
  };
  ASSERT_EQ(shard("a", "1/2", "1", "0"), 0);
  ASSERT_EQ(shard("b", "2/2", "2", "0"), 0);
  ASSERT_EQ(shard("c", "2/2", "1", "5"), 0);
  const auto why = [&](const std::string& other) {
    const Finished merged = run({"report", at("a"), at(other), "--merged", at("merged")});
    EXPECT_EQ(merged.exit_code, 2);
    return merged.error;
  };
  EXPECT_THAT(why("b"), HasSubstr("`seed: 1` there, `seed: 2` here"));
  EXPECT_THAT(why("c"), HasSubstr("shard is of other episodes than the first"));
  EXPECT_THAT(why("a"), HasSubstr("shard 1/2 is there twice"));
  const Finished resumed =
      run_it("", {"experiment.episodes=2", "experiment.seed=1"}, {"--resume", at("a")});
  EXPECT_EQ(resumed.exit_code, 2);
  EXPECT_THAT(resumed.error, HasSubstr("is shard 1/2"));
  EXPECT_EQ(shard("d", "1/3", "1", "0"), 2) << "there are two episodes";
}

TEST_F(ReplanTest, KeepsClearOfWhatItsPredictorKnows) {
  const Finished finished = run_it("run", {"predictor={plugin: truth}"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json of = summary("run");
  EXPECT_EQ(of["success"], true);
  EXPECT_EQ(of["collisions_true"], 0);
  // The margin of 0.1 m that motions keep, less what the executor is off them.
  EXPECT_GT(of["min_true_clearance_m"], 0.08);
  const std::string effective = read_file(folder_.path() / "run" / "effective_config.yaml");
  EXPECT_THAT(effective, HasSubstr("plugin: truth"));
  EXPECT_THAT(effective, HasSubstr("prediction_margin_m: 0.1"));
}

TEST_F(ReplanTest, SaysWhatItsMotionsAndItsStopsKeep) {
  const Finished finished =
      run_it("run", {"robot.max_acceleration_mps2=0.5", "robot.max_braking_mps2=4.0",
                     "planning.acceleration_fraction=0.5", "experiment.episodes=1"});
  ASSERT_EQ(finished.exit_code, 0) << finished.error << finished.out;
  const Json limits{{"velocity", 0.4}, {"acceleration", 0.25}, {"braking", 2.0}};
  EXPECT_EQ(summary("run")["limits"], (Json{{"x", limits}, {"y", limits}}));
}

TEST_F(ReplanTest, LeavesTheCertificatesOfWhatItFollows) {
  const Finished finished = run_it("run", {"check.certificate=file", "experiment.episodes=1"});
  const Json of = summary("run");
  ASSERT_TRUE(of["certified_share"].is_number()) << finished.error << finished.out;
  std::size_t certificates = 0;
  const auto folder = folder_.path() / "run" / "certificates" / "episode-0";
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    EXPECT_EQ(std::system((RECHECK " " + file.path().string() + " >/dev/null").c_str()), 0);
    ++certificates;
  }
  const int motions = of["replans"].get<int>() + 1;  // and stops
  EXPECT_GE(static_cast<int>(certificates), 1);
  EXPECT_GE(static_cast<double>(certificates), of["certified_share"].get<double>() * motions);
  EXPECT_EQ(of["certified_share"], 1.0) << "the scene is known, and walkers are not in the map";
  EXPECT_THAT(read_file(folder_.path() / "run" / "report.html"), HasSubstr("href=\"certificates"));
}

TEST_F(ReplanTest, RefusesWhatOnlyPlansUse) {
  const auto check_with = [](const std::string& set) {
    return run({"check", kConfig, "--set", set});
  };
  const Finished refused = check_with("planning.attempts=3");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.error,
              HasSubstr("--set planning.attempts=3: 'attempts' has no effect in an experiment of "
                        "type 'replan' (known keys: unknown, outside, floor, dt_s"));
  // So one takes back what a base says.
  const Finished taken_back = check_with("planning.attempts=null");
  EXPECT_EQ(taken_back.exit_code, 0) << taken_back.error;
}

TEST_F(ReplanTest, TheSameSeedGivesTheSameRunAndAnotherSeedAnother) {
  ASSERT_EQ(run_it("first").exit_code, 0);
  ASSERT_EQ(run_it("second").exit_code, 0);
  ASSERT_EQ(run_it("other", {"experiment.seed=8"}).exit_code, 0);
  EXPECT_EQ(timeless("first"), timeless("second"));
  EXPECT_NE(summary("first")["time_to_goal_s"], summary("other")["time_to_goal_s"]);
}

TEST_F(ReplanTest, ResumingDoesWhatIsMissingAndNothingElse) {
  ASSERT_EQ(run_it("whole").exit_code, 0);
  ASSERT_EQ(run_it("parts", {"experiment.episodes=1"}).exit_code, 0);
  const std::string parts = (folder_.path() / "parts").string();
  const Finished resumed = run_it("parts", {}, {"--resume", parts});
  ASSERT_EQ(resumed.exit_code, 0) << resumed.error;
  EXPECT_EQ(timeless("whole"), timeless("parts"));

  const Finished other = run_it("parts", {"planning.qc=2.0"}, {"--resume", parts});
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.error, HasSubstr("the run to resume is another one: "));
}

TEST_F(ReplanTest, ABlockedGoalIsAFailureThatSaysWhy) {
  const Finished finished =
      run_it("run", {"experiment.goal.joints.x=1.3", "experiment.goal.joints.y=-0.1",
                     "experiment.random=null", "experiment.episodes=1", "experiment.duration_s=8"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  const Json of = summary("run");
  EXPECT_EQ(of["success_share"], 0.0);
  EXPECT_EQ(of["collisions_true"], 0);
  ASSERT_EQ(of["failures"].size(), 1U);
  EXPECT_THAT(of["failures"][0]["reason"].get<std::string>(),
              HasSubstr("the goal was not reached in time"));
}

TEST_F(ReplanTest, RunsByTheClockOnTheWall) {
  const Finished finished =
      run_it("run", {"experiment.clock=wall", "experiment.episodes=1", "experiment.duration_s=3"});
  const Json of = summary("run");
  // Whether it gets there in time is the machine's affair; that it ends and tells is not.
  EXPECT_TRUE(finished.exit_code == 0 || finished.exit_code == 1) << finished.error;
  EXPECT_EQ(of["episodes"], 1);
  EXPECT_GE(of["frames"], 1);
  EXPECT_EQ(of["collisions_true"], 0);
}

TEST_F(ReplanTest, TellsHowFarALongEpisodeHasCome) {
  // By the clock on the wall, to a goal that is blocked: it lasts its six seconds on any machine,
  // and at the latest its last step tells.
  const Finished finished =
      run_it("run", {"experiment.clock=wall", "experiment.episodes=1", "experiment.duration_s=6",
                     "experiment.goal.joints.x=1.3", "experiment.goal.joints.y=-0.1",
                     "experiment.random=null"});
  EXPECT_EQ(finished.exit_code, 1) << finished.error;
  EXPECT_THAT(finished.error, HasSubstr(" s of at most 6 s) 0/1 (0 %)"));
}

}  // namespace
}  // namespace sidestep::testing
