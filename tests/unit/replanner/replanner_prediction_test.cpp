#include <cmath>
#include <stdexcept>

#include <gtest/gtest.h>

#include <sidestep/runtime/predict.hpp>

#include "closed_loop.hpp"

namespace sidestep::testing_support {
namespace {

using Kind = ReplannerEvent::Kind;

constexpr double kPerson_m = 0.3;
constexpr double kMargin_m = 0.1;
constexpr double kHorizon_s = 6.0;

/// Takes what is tracked to go on as it goes.
class GoesOn final : public Predictor {
 public:
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    if (misbehave) return misbehave(request);
    std::vector<PredictedSet> sets;
    for (const Track& track : request.tracks.tracks) {
      const Eigen::Vector2d end_m = track.position_m + request.horizon_s * track.velocity_mps;
      sets.push_back(
          {track.id,
           1.0,
           track.bottom_m,
           track.top_m,
           {{0.0, track.position_m, track.radius_m}, {request.horizon_s, end_m, track.radius_m}}});
    }
    return Prediction::create(request.tracks.stamp, std::move(sets));
  }
  std::function<Result<Prediction>(const PredictionRequest&)> misbehave;
};

Tracks one_track(const Eigen::Vector2d& position_m, const Eigen::Vector2d& velocity_mps,
                 Stamp stamp) {
  Track track;
  track.id = 5;
  track.position_m = position_m;
  track.velocity_mps = velocity_mps;
  track.covariance.setZero();
  track.radius_m = kPerson_m;
  track.bottom_m = -1.0;
  track.top_m = 1.0;
  track.last_seen = stamp;
  return {{track}, stamp};
}

/// Somebody walks, and is tracked as he truly walks.
class AmongPeople : public ::testing::Test {
 protected:
  /// Runs until the goal is reached. `person`: place and velocity at a time.
  void run(const std::function<std::pair<Eigen::Vector2d, Eigen::Vector2d>(double)>& person,
           double until_s) {
    loop.predictor = &predictor;
    loop.tracks = [&](Stamp stamp) {
      const auto [position_m, velocity_mps] = person(stamp.seconds());
      return std::make_shared<const Tracks>(one_track(position_m, velocity_mps, stamp));
    };
    loop.run(until_s, [&](double t) {
      if (loop.path.empty()) return;
      const Eigen::Vector2d apart = loop.path.back().head<2>() - person(t).first;
      least_m = std::min(least_m, apart.norm() - kPerson_m - ClosedLoop::kRadius_m);
    });
  }

  static ReplannerSettings settings() {
    ReplannerSettings settings = ClosedLoop::defaults();
    settings.escalation = {"retimed", "straight_line"};
    settings.prediction_horizon_s = kHorizon_s;
    settings.prediction_margin_m = kMargin_m;
    return settings;
  }

  GoesOn predictor;
  ClosedLoop loop{settings()};
  double least_m = std::numeric_limits<double>::infinity();
};

TEST_F(AmongPeople, WaitsForWhomeverCrossesAndThenGoes) {
  // He is at x = 2 when the robot would be, crosses at 0.5 m/s, and is never in its field.
  const auto crossing = [](double t) {
    return std::pair(Eigen::Vector2d(2.0, -1.25 + 0.5 * t), Eigen::Vector2d(0.0, 0.5));
  };
  run(crossing, 20.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_EQ(loop.count(Kind::kStopped), 0) << loop.story();
  // One step of both lies between what is noted.
  EXPECT_GT(least_m, kMargin_m - 2.0 * ClosedLoop::kStep_s) << loop.story();
}

TEST_F(AmongPeople, MeetsHimWhereNothingIsPredicted) {
  const auto crossing = [](double t) {
    return std::pair(Eigen::Vector2d(2.0, -1.25 + 0.5 * t), Eigen::Vector2d(0.0, 0.5));
  };
  predictor.misbehave = [](const PredictionRequest& request) {
    Track elsewhere = request.tracks.tracks.front();
    return Prediction::create(
        request.tracks.stamp,
        {{elsewhere.id, 1.0, -1.0, 1.0, {{0.0, {50, 50}, 0.1}, {kHorizon_s, {50, 50}, 0.1}}}});
  };
  run(crossing, 20.0);
  EXPECT_LT(least_m, 0.0) << "the crossing is no test of anything";
}

TEST_F(AmongPeople, SetsOutSoonerWhenHeTurnsBack) {
  // From far off he comes to stand in the way at 3 s, and would stay in it; he turns back.
  const auto turning = [](double t) {
    const double y_m = t < 2.0 ? -1.4 + 0.3 * t : -0.8 - 0.5 * (t - 2.0);
    return std::pair(Eigen::Vector2d(2.0, y_m), Eigen::Vector2d(0.0, t < 2.0 ? 0.3 : -0.5));
  };
  run(turning, 20.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_GT(least_m, kMargin_m - 2.0 * ClosedLoop::kStep_s) << loop.story();
  const auto sooner = [](const ReplannerEvent& event) {
    return event.kind == Kind::kReplanned && event.reason == ReplannerEvent::Reason::kSooner;
  };
  EXPECT_TRUE(std::ranges::any_of(loop.events, sooner)) << loop.story();
  // By his first course the way is blocked until (0.6 + 0.8) / 0.3 s later.
  EXPECT_LT(loop.ticks * ClosedLoop::kStep_s, 9.0) << loop.story();
}

TEST_F(AmongPeople, TakesUpTheWayAsItWasFoundHoweverOftenItIsSlowed) {
  // He cannot decide whether to cross for 12 s, and then turns away.
  const auto wavering = [](double t) {
    const double turns = std::floor(t / 0.4);
    const double there_m = 0.4 * 0.5 * (t / 0.4 - turns);
    const bool comes = t < 12.0 && std::fmod(turns, 2.0) == 0.0;
    if (t >= 12.0)
      return std::pair(Eigen::Vector2d(2.0, -1.2 - 0.5 * (t - 12.0)), Eigen::Vector2d(0.0, -0.5));
    return std::pair(Eigen::Vector2d(2.0, comes ? -1.2 + there_m : -1.0 - there_m),
                     Eigen::Vector2d(0.0, comes ? 0.5 : -0.5));
  };
  loop.predictor = &predictor;
  loop.tracks = [&](Stamp stamp) {
    const auto [position_m, velocity_mps] = wavering(stamp.seconds());
    return std::make_shared<const Tracks>(one_track(position_m, velocity_mps, stamp));
  };
  std::vector<int> states;  // of one motion after another
  loop.run(30.0, [&](double) {
    const int now = loop.replanner->followed().size();
    if (now > 0 && (states.empty() || states.back() != now)) states.push_back(now);
  });
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_GE(loop.count(Kind::kReplanned), 4) << loop.story();
  // The first is not slowed; the second is, and has a state for each of its steps of time.
  ASSERT_GE(states.size(), 3U);
  EXPECT_LE(*std::ranges::max_element(states), 2 * states[1]) << ::testing::PrintToString(states);
}

TEST_F(AmongPeople, StepsAsideWhereItHasToWaitInHisWay) {
  // Something lies on the goal for 15 s; he walks over where the robot waits.
  loop.obstacles = {{{4.0, 0.0, 0.0}, 0.3}};
  const auto over_it = [&](double t) {
    if (t > 15.0) loop.obstacles.clear();
    return std::pair(Eigen::Vector2d(0.05, -5.0 + 0.8 * t), Eigen::Vector2d(0.0, 0.8));
  };
  run(over_it, 30.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_GT(least_m, kMargin_m - 2.0 * ClosedLoop::kStep_s) << loop.story();
  const auto is_aside = [](const ReplannerEvent& event) {
    return event.reason == ReplannerEvent::Reason::kAside && event.guess == "aside";
  };
  const auto aside = std::ranges::find_if(loop.events, is_aside);
  ASSERT_NE(aside, loop.events.end()) << loop.story();
  // He is near from 0.6 m before it on, after 5.5 s: the robot waits until then, and is gone
  // before.
  EXPECT_GT(aside->stamp.seconds(), 2.0) << loop.story();
  EXPECT_LT(aside->stamp.seconds(), 5.5) << loop.story();
}

TEST_F(AmongPeople, StaysWhereItIsInNobodysWay) {
  loop.obstacles = {{{4.0, 0.0, 0.0}, 0.3}};
  run(
      [](double t) {
        return std::pair(Eigen::Vector2d(1.5, -5.0 + 0.8 * t), Eigen::Vector2d(0.0, 0.8));
      },
      10.0);
  EXPECT_EQ(loop.count(Kind::kPlanned), 0) << loop.story();
}

TEST(BlockedGoal, GivesWayToAnotherThatDoesWhatIsAsked) {
  ClosedLoop loop;
  loop.obstacles = {{{4.0, 0.0, 0.0}, 0.3}};
  std::vector<double> asked_s;
  std::vector<Eigen::VectorXd> goals;
  loop.other_goal =
      [&](const std::shared_ptr<const DistanceField>&) -> std::optional<Eigen::VectorXd> {
    asked_s.push_back(loop.executor.now.seconds());
    goals.push_back(loop.replanner->goal());
    if (asked_s.size() == 1) return std::nullopt;  // none is found
    // The second is in the obstacle, too.
    return asked_s.size() == 2 ? Eigen::Vector3d(4.0, 0.1, 0.0) : Eigen::Vector3d(3.0, 1.0, 0.0);
  };
  loop.run(20.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  ASSERT_EQ(asked_s.size(), 3U);
  EXPECT_GE(asked_s[1] - asked_s[0], 1.0 - 1e-9);  // about once a second
  EXPECT_GE(asked_s[2] - asked_s[1], 1.0 - 1e-9);
  EXPECT_LT(asked_s[2] - asked_s[0], 4.0);
  for (const Eigen::VectorXd& goal : goals) EXPECT_EQ(goal, ClosedLoop::goal().q);
  EXPECT_LT((loop.executor.state().q - Eigen::Vector3d(3.0, 1.0, 0.0)).norm(), 0.03);
  EXPECT_EQ(loop.replanner->goal(), Eigen::Vector3d(3.0, 1.0, 0.0));
}

TEST(BlockedGoal, StaysWhatItIsWhereItIsFree) {
  ClosedLoop loop;
  loop.other_goal =
      [](const std::shared_ptr<const DistanceField>&) -> std::optional<Eigen::VectorXd> {
    return Eigen::Vector3d(3.0, 1.0, 0.0);
  };
  loop.run(20.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_EQ(loop.replanner->goal(), ClosedLoop::goal().q);
}

/// Knows where he is, whatever is tracked.
class Knows final : public Predictor {
 public:
  [[nodiscard]] Result<Prediction> predict(const PredictionRequest& request) override {
    const double now_s = request.tracks.stamp.seconds();
    PredictedSet set{-1, 1.0, -1.0, 1.0, {}};
    for (const double time_s : {0.0, request.horizon_s}) {
      set.knots.push_back({time_s, {2.0, -1.25 + 0.5 * (now_s + time_s)}, kPerson_m});
    }
    return Prediction::create(request.tracks.stamp, {set});
  }
  [[nodiscard]] PredictionSubject subject() const noexcept override {
    return PredictionSubject::kThings;
  }
};

TEST_F(AmongPeople, NeedsNoTracksWhereThePredictorDoesNotGoByThem) {
  Knows knows;
  loop.predictor = &knows;
  double nearest_m = std::numeric_limits<double>::infinity();
  loop.run(20.0, [&](double t) {
    if (loop.path.empty()) return;
    const Eigen::Vector2d apart =
        loop.path.back().head<2>() - Eigen::Vector2d(2.0, -1.25 + 0.5 * t);
    nearest_m = std::min(nearest_m, apart.norm() - kPerson_m - ClosedLoop::kRadius_m);
  });
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  EXPECT_GT(nearest_m, kMargin_m - 2.0 * ClosedLoop::kStep_s) << loop.story();
}

TEST_F(AmongPeople, GivesOptimisersACostOfWhatIsPredictedIfTold) {
  for (const bool is_told : {false, true}) {
    ClosedLoop fresh(settings());
    fresh.predictor = &predictor;
    fresh.tracks = [](Stamp stamp) {
      return std::make_shared<const Tracks>(one_track({2.0, 3.0}, {0.0, 0.0}, stamp));
    };
    if (is_told) fresh.moving_costs.emplace();
    int posed = 0, with_cost = 0;
    fresh.planner.misbehave = [&](const Problem& problem, const Trajectory&, const Deadline&) {
      ++posed;
      with_cost += std::ranges::any_of(
          problem.terms, [](const CostTerm& term) { return term.cost->name() == "moving"; });
      return std::nullopt;
    };
    fresh.run(0.5);
    EXPECT_GT(posed, 0);
    EXPECT_EQ(with_cost, is_told ? posed : 0);
  }
}

TEST_F(AmongPeople, GoesByTheWorstCaseWhereThePredictorFails) {
  predictor.misbehave = [](const PredictionRequest&) -> Result<Prediction> {
    throw std::runtime_error("no idea");
  };
  // In 6 s the worst case comes 9.6 m far: from 30 m it leaves the way free, from 3 m it does not.
  const auto stands_at = [](double x_m) {
    return
        [x_m](double) { return std::pair(Eigen::Vector2d(x_m, 0.0), Eigen::Vector2d(0.0, 0.0)); };
  };
  run(stands_at(30.0), 12.0);
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
  const auto names_it = [](const std::string& warning) {
    return warning.find("predictor goes_on") != std::string::npos &&
           warning.find("no idea") != std::string::npos;
  };
  const auto told = std::ranges::count_if(loop.log.warnings, names_it);
  EXPECT_GE(told, 1);
  EXPECT_LE(told, 1 + static_cast<int>(loop.ticks * ClosedLoop::kStep_s)) << "once a second";

  ClosedLoop near(settings());
  near.predictor = &predictor;
  near.tracks = [](Stamp stamp) {
    return std::make_shared<const Tracks>(one_track({3.0, 0.0}, {0.0, 0.0}, stamp));
  };
  near.run(5.0);
  EXPECT_NE(near.status, Replanner::Status::kReached);
  EXPECT_FALSE(near.path.empty());
  for (const Eigen::Vector3d& at : near.path) EXPECT_LT(at.x(), 0.1) << near.story();
}

TEST_F(AmongPeople, StopsWhereATrackMakesNoSense) {
  // The map leaves out what is tracked: without a place for it, he is nowhere.
  const auto lost = [](double t) {
    const double x_m = t > 1.0 && t < 3.0 ? std::nan("") : 9.0;
    return std::pair(Eigen::Vector2d(x_m, 5.0), Eigen::Vector2d(0.0, 0.0));
  };
  run(lost, 20.0);
  const ReplannerEvent* stop = loop.first(Kind::kStopped);
  ASSERT_NE(stop, nullptr) << loop.story();
  EXPECT_EQ(stop->reason, ReplannerEvent::Reason::kMap);
  EXPECT_NE(stop->cause.find("track 5"), std::string::npos) << stop->cause;
  EXPECT_LT(stop->stamp.seconds(), 1.1);
  EXPECT_EQ(loop.count(Kind::kStopped), 1) << loop.story();
  EXPECT_EQ(loop.count(Kind::kRecovered), 1) << loop.story();
  EXPECT_EQ(loop.status, Replanner::Status::kReached) << loop.story();
}

TEST(Predict, FallsBackToTheWorstCaseAndNamesThePredictor) {
  GoesOn predictor;
  QuietLog log;
  const Tracks tracks = one_track({1.0, 2.0}, {0.5, 0.0}, Stamp::from_seconds(3.0));
  const PredictionRequest request{tracks, kHorizon_s};
  EXPECT_EQ(predict(predictor, "predictor p", request, log).value().speed_mps(), 0.5);
  EXPECT_TRUE(log.warnings.empty());
  const auto set = [](double from_s, double to_s) {
    return std::vector<PredictedSet>{
        {5, 1.0, -1.0, 1.0, {{from_s, {0, 0}, 0.3}, {to_s, {0, 0}, 0.3}}}};
  };
  const double nan = std::nan("");
  const std::vector<std::function<Result<Prediction>()>> wrong = {
      [] { return Prediction::create(Stamp::from_seconds(3.0), {}); },
      [&] { return Prediction::create(Stamp::from_seconds(2.0), set(0.0, kHorizon_s)); },
      [&] { return Prediction::create(Stamp::from_seconds(3.0), set(0.5, kHorizon_s)); },
      [&] { return Prediction::create(Stamp::from_seconds(3.0), set(0.0, 2.0)); },
      [&] { return Prediction::create(Stamp::from_seconds(3.0), set(0.0, nan)); },
      []() -> Result<Prediction> { throw std::runtime_error("no idea"); }};
  for (const auto& answer : wrong) {
    log.warnings.clear();
    predictor.misbehave = [&](const PredictionRequest&) { return answer(); };
    const Prediction worst = predict(predictor, "predictor p", request, log).value();
    ASSERT_EQ(log.warnings.size(), 1u);
    EXPECT_NE(log.warnings[0].find("predictor p"), std::string::npos) << log.warnings[0];
    EXPECT_NE(log.warnings[0].find("worst case"), std::string::npos) << log.warnings[0];
    // After 2 s it may be 3.2 m from where it was, in any direction.
    std::vector<double> distance_m(1);
    const std::vector<Eigen::Vector3d> p{{1.0, 2.0 - 4.0, 0.0}};
    worst.query(2.0, p, distance_m, {});
    EXPECT_NEAR(distance_m[0], 4.0 - kPerson_m - 2.0 * kWalkingSpeed_mps, 1e-9);
  }
}

}  // namespace
}  // namespace sidestep::testing_support
