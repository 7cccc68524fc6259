#include <algorithm>
#include <future>
#include <limits>
#include <numbers>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <sidestep/core/file.hpp>
#include <sidestep/experiments/experiments.hpp>
#include <sidestep/runtime/episode_clock.hpp>
#include <sidestep/runtime/paced_frames.hpp>
#include <sidestep/runtime/step_watch.hpp>
#include "closed_loop.hpp"
#include "replan_rows.hpp"
#include "support/chain_robot.hpp"
#include "support/host_fixture.hpp"
#include "support/temporary_folder.hpp"

namespace sidestep {
namespace {

using Json = nlohmann::json;
using Kind = ReplannerEvent::Kind;
using testing_support::flying_ball;

/// A frame every 0.1 s, of which some are missing.
class TenHertz final : public Source {
 public:
  explicit TenHertz(std::vector<std::int64_t> sequences) : sequences_(std::move(sequences)) {}
  Result<std::optional<Frame>> next(const Deadline&) override {
    if (at_ == sequences_.size()) return std::optional<Frame>();
    Frame frame;
    frame.sequence = sequences_[at_++];
    frame.stamp = Stamp{frame.sequence * 100'000'000};
    frame.measurement = DepthImage{};
    return std::optional<Frame>(std::move(frame));
  }
  std::optional<std::int64_t> frame_count() const override { return {}; }

 private:
  std::vector<std::int64_t> sequences_;
  std::size_t at_ = 0;
};

TEST(PacedFramesTest, PassesOnWhatIsDueAndCountsWhatIsMissing) {
  TenHertz source({0, 1, 4});
  EpisodeClock clock;
  PacedFrames frames(source, clock, false);
  const auto next_at = [&](double time_s) {
    clock.set(Stamp::from_seconds(time_s));
    return frames.next(Deadline());
  };
  EXPECT_EQ(next_at(0.0).value()->sequence, 0);
  const auto early = next_at(0.05);
  ASSERT_FALSE(early);
  EXPECT_EQ(early.error().code, ErrorCode::kDeadlineExceeded);
  EXPECT_EQ(next_at(0.1).value()->sequence, 1);
  EXPECT_FALSE(next_at(0.3));
  EXPECT_EQ(next_at(0.4).value()->sequence, 4);
  EXPECT_EQ(frames.take_span(), 5);
  EXPECT_EQ(frames.take_span(), 0);
  EXPECT_FALSE(next_at(0.5).value());
  const auto views = frames.take_views();
  ASSERT_EQ(views.size(), 3u);
  EXPECT_EQ(views[2].stamp_s, 0.4);
  EXPECT_TRUE(frames.take_views().empty());
}

/// A camera that has always the same to say.
class Stuck final : public Source {
 public:
  explicit Stuck(std::optional<Frame> frame) : frame_(std::move(frame)) {}
  Result<std::optional<Frame>> next(const Deadline&) override {
    ++asked;
    if (!frame_) return fail(ErrorCode::kBadFrame, "where the camera was is not known");
    return frame_;
  }
  std::optional<std::int64_t> frame_count() const override { return {}; }

  int asked = 0;

 private:
  std::optional<Frame> frame_;
};

TEST(PacedFramesTest, ASourceOfBadFramesIsAskedOnceAtATime) {
  Stuck source{std::nullopt};
  EpisodeClock clock;
  PacedFrames frames(source, clock, false);
  for (const double time_s : {0.0, 0.004, 0.008}) {
    clock.set(Stamp::from_seconds(time_s));
    EXPECT_EQ(frames.next(Deadline()).error().code, ErrorCode::kBadFrame);
    EXPECT_EQ(frames.next(Deadline()).error().code, ErrorCode::kDeadlineExceeded);
  }
  EXPECT_EQ(source.asked, 3);
}

TEST(PacedFramesTest, AFrameThatMeasuredNothingIsBad) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  const auto code_of = [](auto measurement) {
    Frame frame;
    frame.measurement = std::move(measurement);
    Stuck source(std::move(frame));
    EpisodeClock clock;
    const auto passed = PacedFrames(source, clock, false).next(Deadline());
    return passed ? std::nullopt : std::optional(passed.error().code);
  };
  EXPECT_EQ(code_of(DepthImage{{}, {kNaN, kNaN}}), ErrorCode::kBadFrame);
  EXPECT_EQ(code_of(DepthImage{{}, {kNaN, 0.0F}}), std::nullopt) << "out of range is no fault";
  EXPECT_EQ(code_of(PointCloud{{{kNaN, 0.0F, 1.0F}}}), ErrorCode::kBadFrame);
  EXPECT_EQ(code_of(PointCloud{{{kNaN, 0.0F, 1.0F}, {0.0F, 0.0F, 1.0F}}}), std::nullopt);
  EXPECT_EQ(code_of(PointCloud{}), std::nullopt);
}

TEST(StepWatchTest, TellsOnceOfAStepThatDoesNotComeBack) {
  std::promise<void> told;  // a second time would throw
  StepWatch watch(1e-3, [&] { told.set_value(); });
  watch.begin();
  told.get_future().wait();
  watch.end();
}

TEST(StepWatchTest, SaysNothingOfStepsThatEndAndGoesWhenTold) {
  int told = 0;
  {
    StepWatch watch(3600.0, [&] { ++told; });
    for (int i = 0; i < 100; ++i) {
      watch.begin();
      watch.end();
    }
  }
  EXPECT_EQ(told, 0);
}

EpisodeEvent event_of(Kind kind, double time_s, double solve_ms = 0.0, double jump = 0.0) {
  EpisodeEvent event;
  event.kind = kind;
  event.stamp = Stamp::from_seconds(time_s);
  event.solve_ms = solve_ms;
  event.splice_velocity_jump = jump;
  event.cause = "because";
  if (kind == Kind::kPlanned || kind == Kind::kReplanned) {
    event.map_age_ms = 40.0;
    event.stamp_to_trajectory_ms = 140.0;
  }
  return event;
}

/// A ball that flies from 0 to 1 along x in 2 s beside a box.
EpisodeRecord flight(std::int64_t episode) {
  EpisodeRecord record;
  record.episode = episode;
  record.reached = true;
  record.duration_s = 2.0;
  record.steps = 500;
  record.checks = 25;
  record.frames = 20;
  record.frames_dropped = 1;
  record.q_goal = Eigen::Vector3d::UnitX();
  record.scene = std::make_shared<Scene>(std::vector<SceneObject>{
      {"floor", HalfSpace{}, {{0.0, Transform(Eigen::Translation3d(0, 0, -1))}}, false},
      {"box", Box{{0.2, 0.4, 0.2}}, {{0.0, Transform(Eigen::Translation3d(2, 0, 0))}}, false}});
  for (int i = 0; i <= 250; ++i) {
    record.poses.push_back({0.008 * i, 0.004 * i * Eigen::Vector3d::UnitX()});
  }
  record.truth.min_clearance_m = 0.3;
  record.events = {event_of(Kind::kPlanned, 0.1, 4.0, 0.0),
                   event_of(Kind::kReplanned, 1.0, 2.0, 1e-5), event_of(Kind::kReached, 2.0)};
  record.mapping = {{0.0, 0.03, 1.0, 2.0}, {0.1, 0.13, 1.0, 2.0}};
  return record;
}

class ReplanRowsTest : public testing::Test {
 protected:
  void record(const std::vector<EpisodeRecord>& episodes) {
    auto store = ResultsStore::open(file_, {});
    ASSERT_TRUE(store);
    Recorder recorder(**store);
    record_replan_head({}, recorder);
    for (const EpisodeRecord& episode : episodes) {
      record_episode(episode, *flying_ball(0.1), 3, recorder);
    }
    ASSERT_TRUE(recorder.commit());
  }
  [[nodiscard]] ExperimentOutcome summary_of(int planned) const {
    auto rows = read_replan_rows(file_);
    EXPECT_TRUE(rows) << rows.error().describe();
    rows->head.episodes = planned;
    return summarise_replan("replan", *rows);
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "results.sqlite";
};

TEST_F(ReplanRowsTest, SummarisesWhatWasRecorded) {
  EpisodeRecord touched = flight(1);
  touched.truth.min_clearance_m = -0.02;
  touched.truth.nearest_link = "ball";
  touched.truth.nearest_object = "box";
  touched.contacts = {{{"ball", "box", 1.9, 2.0, 0.02}, "unseen"}};
  touched.reason = "link 'ball' touched 'box' (unseen)";
  touched.events.push_back(event_of(Kind::kReplanFailed, 1.9, 50.0));
  touched.events.push_back(event_of(Kind::kReplanFailed, 1.92));  // nothing was solved
  touched.events.push_back(event_of(Kind::kStopped, 1.95));
  record({flight(0), touched});
  const ExperimentOutcome outcome = summary_of(2);
  EXPECT_FALSE(outcome.success);
  const Json summary = Json::parse(outcome.summary_json);
  EXPECT_EQ(summary["episodes"], 2);
  EXPECT_EQ(summary["success_share"], 0.5);
  EXPECT_EQ(summary["collisions_true"], 1);
  EXPECT_EQ(summary["min_true_clearance_m"], -0.02);
  EXPECT_EQ(summary["nearest"], (Json{{"episode", 1}, {"link", "ball"}, {"object", "box"}}));
  EXPECT_NE(outcome.verdict.find("least true clearance -0.020 m, of ball to box."),
            std::string::npos)
      << outcome.verdict;
  EXPECT_EQ(summary["replans"], 2);
  EXPECT_EQ(summary["solve_ms"]["p50"], 3.0);
  EXPECT_EQ(summary["solve_ms"]["max"], 4.0);
  EXPECT_EQ(summary["search_ms"]["p50"], 4.0);  // of 2, 2, 4, 4 and 50
  EXPECT_EQ(summary["search_ms"]["max"], 50.0);
  for (const char* key : {"p50", "p95", "max"}) {
    EXPECT_EQ(summary["stamp_to_trajectory_ms"][key], 140.0);
  }
  EXPECT_EQ(summary["step_hz"], 250.0);
  EXPECT_EQ(summary["check_hz"], 12.5);
  EXPECT_EQ(summary["map_age_ms"]["p95"], 40.0);
  EXPECT_EQ(summary["splice_velocity_jump_max"], 1e-5);
  EXPECT_EQ(summary["stops"], 1);
  EXPECT_EQ(summary["frames_dropped"], 2);
  for (const char* key : {"/appear_frames/p95", "/clear_frames/p95", "/ghost_vox"}) {
    EXPECT_TRUE(summary.at(Json::json_pointer(key)).is_null()) << key;
  }
  EXPECT_FALSE(summary.contains("tracks")) << "there were none";
  EXPECT_EQ(summary["collisions"][0]["object"], "box");
  EXPECT_EQ(summary["collisions"][0]["cause"], "unseen");
  EXPECT_EQ(summary["failures"][0]["episode"], 1);
}

TEST_F(ReplanRowsTest, TellsHowTheMapFollowedWhatMoves) {
  EpisodeRecord first = flight(0), second = flight(1);
  first.following = {
      {1.0, 2.0}, {3.0}, 4, 60, 40, TrackRecord{80, 60, {0.5, 0.75}, 1, {0.125, 0.25}, {0.5}, 0}};
  second.following = {{2.0}, {}, 1, 20, 20, TrackRecord{20, 20, {}, 0, {0.375}, {0.25, 0.0}, 2}};
  record({first, second});
  const Json summary = Json::parse(summary_of(2).summary_json);
  EXPECT_EQ(summary["appear_frames"]["p95"], 2.0);
  EXPECT_EQ(summary["clear_frames"]["p95"], 3.0);
  EXPECT_EQ(summary["seen_share"], 0.75);
  EXPECT_EQ(summary["ghost_vox"], 5);
  const Json& tracks = summary["tracks"];
  EXPECT_EQ(tracks["found_share"], 0.8);
  EXPECT_EQ(tracks["delay_s"]["max"], 0.75);
  EXPECT_EQ(tracks["switches"], 1);
  EXPECT_EQ(tracks["false"], 2);
  EXPECT_EQ(tracks["position_error_m"]["mean"], 0.25);
  EXPECT_EQ(tracks["velocity_error_mps"]["mean"], 0.25);
}

TEST_F(ReplanRowsTest, SucceedsOnlyWithEveryEpisode) {
  record({flight(0), flight(1)});
  EXPECT_TRUE(summary_of(2).success);
  EXPECT_FALSE(summary_of(3).success);
  EXPECT_NE(summary_of(2).verdict.find("2 of 2 episodes"), std::string::npos);
}

TEST_F(ReplanRowsTest, KeepsPicturesFromAbove) {
  record({flight(0)});
  auto reader = ResultsReader::open(file_);
  ASSERT_TRUE(reader);
  EXPECT_EQ((*reader)->array_items("picture/0", "robot").value(),
            (std::vector<std::int64_t>{0, 1, 2}));
  const auto robot = (*reader)->array("picture/0", 1, "robot").value();
  ASSERT_TRUE(robot);
  EXPECT_NEAR(robot->values[0], 0.5, 1e-2);  // half way, of 1 m
  EXPECT_NEAR(robot->values[2], 0.1, 1e-6);
  EXPECT_EQ((*reader)->number("picture/0", 1, "objects").value(), 1.0) << "the floor is no object";
}

TEST_F(ReplanRowsTest, ReportsTheEpisodesThatWereRunWhateverTheirNumbers) {
  EpisodeRecord late = flight(6);
  late.reached = false;
  late.reason = "the goal was not reached in time";
  record({flight(4), flight(5), late});
  testing_support::HostFixture fixture({PLUGIN_FOLDER});
  ASSERT_TRUE(save_outcome(summary_of(3), folder_.path(), fixture.host));
  const auto html = read_file(folder_.path() / "report.html");
  ASSERT_TRUE(html) << html.error().describe();
  std::vector<std::size_t> order;
  for (const char* episode : {"<h2>Episode 4<", "<h2>Episode 6<", "<h2>Episode 5<"}) {
    order.push_back(html->find(episode));
    EXPECT_NE(order.back(), std::string::npos) << episode;
  }
  EXPECT_TRUE(std::ranges::is_sorted(order));
  EXPECT_EQ(html->find("<h2>Episode 0<"), std::string::npos);
  for (const char* picture : {"episode-4-above.png", "episode-6-above.png"}) {
    EXPECT_TRUE(std::filesystem::exists(folder_.path() / picture)) << picture;
  }
  EXPECT_NE(html->find("66.7 %"), std::string::npos) << "two of three succeeded";
}

TEST_F(ReplanRowsTest, RefusesAStoreOfSomethingElse) {
  ASSERT_TRUE(ResultsStore::open(file_, {}));
  EXPECT_FALSE(read_replan_rows(file_));
}

TEST(OutlineFromAbove, IsTheConvexHullOfTheShadow) {
  const double quarter = std::numbers::pi / 4.0;
  Transform turned = Transform::Identity();
  turned.translate(Eigen::Vector3d(1.0, 2.0, 3.0));
  turned.rotate(Eigen::AngleAxisd(quarter, Eigen::Vector3d::UnitZ()));
  const auto box = outline_from_above(Box{{2.0, 2.0, 5.0}}, turned);
  ASSERT_EQ(box.size(), 4u);
  for (const Eigen::Vector2d& corner : box) {
    EXPECT_NEAR((corner - Eigen::Vector2d(1.0, 2.0)).norm(), std::sqrt(2.0), 1e-12);
    EXPECT_NEAR((corner - Eigen::Vector2d(1.0, 2.0)).cwiseAbs().minCoeff(), 0.0, 1e-12);
  }
  // A capsule that lies along y.
  Transform lying = Transform::Identity();
  lying.rotate(Eigen::AngleAxisd(2.0 * quarter, Eigen::Vector3d::UnitX()));
  double farthest = 0.0;
  for (const Eigen::Vector2d& corner : outline_from_above(Capsule{0.2, 1.0}, lying)) {
    farthest = std::max(farthest, std::abs(corner.y()));
    EXPECT_LE(std::abs(corner.x()), 0.2 + 1e-12);
  }
  EXPECT_NEAR(farthest, 0.7, 0.01);
  EXPECT_TRUE(outline_from_above(HalfSpace{}, Transform::Identity()).empty());
}

/// A camera at the origin that looks along `yaw`.
CameraView view_at(double stamp_s, double yaw) {
  Transform pose = Transform::Identity();
  pose.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  pose = Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) * pose;
  return {stamp_s, pose, CameraIntrinsics{64, 48, 50.0, 50.0, 31.5, 23.5}};
}

TEST(CauseOfContact, TellsWhatWasSeenFromWhatWasNot) {
  constexpr double kRest = 0.02;
  const TrueContact contact{"ball", "box", 1.6, 1.7, 0.01};
  EpisodeRecord episode = flight(0);
  EXPECT_EQ(cause_of(contact, episode, kRest), "unknown") << "there is no camera";
  for (int i = 0; i < 20; ++i) episode.views.push_back(view_at(0.1 * i, 0.0));
  EXPECT_EQ(cause_of(contact, episode, kRest), "fault");
  episode.views[13] = view_at(1.3, std::numbers::pi);
  EXPECT_EQ(cause_of(contact, episode, kRest), "unseen");
  for (TruePose& pose : episode.poses) pose.q.setZero();
  EXPECT_EQ(cause_of(contact, episode, kRest), "walked into while stopped");
}

TEST(ProblemFromAMovingStart, BeginsWithItsVelocityAndHasTimeToBrake) {
  PlanningSettings settings;
  settings.unknown = settings.outside = "free";
  settings.dt_s = 0.1;
  const auto robot = flying_ball(0.1);
  const RobotState moving{Eigen::Vector3d::Zero(), 0.5 * Eigen::Vector3d::UnitY()};
  const Problem at_rest =
      make_problem(robot, nullptr, settings, moving.q, Eigen::Vector3d::UnitX());
  const Problem posed = make_problem(robot, nullptr, settings, moving, Eigen::Vector3d::UnitX());
  EXPECT_EQ(posed.start.qdot, moving.qdot);
  EXPECT_EQ(at_rest.start.qdot, Eigen::Vector3d::Zero());
  // Of 2 m/s and, as that is reached in 0.5 s, 4 m/s^2 it may use 1.6 and 3.6: twice 1.069 s for
  // the metre, and 0.139 s to brake.
  EXPECT_EQ(at_rest.support_states, 22 + 1);
  EXPECT_EQ(posed.support_states, 23 + 1);
}

}  // namespace
}  // namespace sidestep
