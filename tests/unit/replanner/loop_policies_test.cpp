#include <sidestep/runtime/loop_policies.hpp>

#include <fstream>
#include <iterator>
#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "closed_loop.hpp"

namespace sidestep {
namespace {

using testing::Contains;
using testing::UnorderedElementsAre;
using testing_support::Ball;
using testing_support::BallField;
using testing_support::Balls;
using testing_support::ClosedLoop;
using Kind = ReplannerEvent::Kind;
using Reason = ReplannerEvent::Reason;
using Status = Replanner::Status;
using Call = ExecutorCall::Kind;
using Steps = std::vector<LoopStep>;

std::optional<Result<Solution>> no_path(const Problem&, const Trajectory&, const Deadline&) {
  Solution none;
  none.status = SolveStatus::kNoPath;
  none.reason = "walled in";
  return none;
}

Steps recorded(ClosedLoop& loop, double until_s, const std::function<void(double)>& before = {}) {
  Steps run;
  loop.note_step = [&](const LoopStep& step) { run.push_back(step); };
  loop.run(until_s, before);
  loop.note_step = {};
  return run;
}

/// A run to the goal past what appears before it.
const Steps& detour() {
  static const Steps kRun = [] {
    ClosedLoop loop;
    return recorded(loop, 20.0, [&](double t) {
      if (t >= 1.0) loop.obstacles = {Ball{{2.0, 0.0, 0.0}, 0.3}};
    });
  }();
  return kRun;
}

/// A stop before a wall, until that is gone.
const Steps& wall() {
  static const Steps kRun = [] {
    ClosedLoop loop;
    loop.planner.misbehave = [&](const Problem& problem, const Trajectory& initial,
                                 const Deadline& deadline) {
      return loop.mapped.empty() ? std::optional<Result<Solution>>()
                                 : no_path(problem, initial, deadline);
    };
    return recorded(loop, 12.0, [&](double t) {
      loop.obstacles = t >= 1.0 && t < 8.0 ? Balls{Ball{{2.5, 0.0, 0.0}, 0.6}} : Balls{};
    });
  }();
  return kRun;
}

/// Somebody who comes straight at the robot and goes again.
const Steps& visitor() {
  static const Steps kRun = [] {
    ReplannerSettings settings = ClosedLoop::defaults();
    settings.obstacle_speed_mps = 0.5;
    ClosedLoop loop(settings);
    loop.limits.acceleration = {0.25, 0.25, 0.25};
    loop.limits.velocity = {0.4, 0.4, 0.4};
    loop.tells_what_moves = true;
    return recorded(loop, 14.0, [&](double t) {
      loop.obstacles =
          t < 8.0 ? Balls{Ball{{3.0 - 0.3 * std::min(t, 6.0), 0.0, 0.0}, 0.2}} : Balls{};
    });
  }();
  return kRun;
}

/// Index of the first step with such an event.
std::size_t first(const Steps& run, Kind kind) {
  const auto has = [&](const LoopStep& step) {
    return std::ranges::count(step.events, kind, &ReplannerEvent::kind) > 0;
  };
  return static_cast<std::size_t>(std::ranges::find_if(run, has) - run.begin());
}

ReplannerEvent& event(LoopStep& step, Kind kind) {
  return *std::ranges::find(step.events, kind, &ReplannerEvent::kind);
}

ExecutorCall& follow_call(LoopStep& step) {
  return *std::ranges::find(step.calls, Call::kFollow, &ExecutorCall::kind);
}

/// Changes what was sent, and what is followed since then.
void change_sent(LoopStep& step, const std::function<void(Trajectory&)>& change) {
  ExecutorCall& call = follow_call(step);
  auto changed = std::make_shared<Trajectory>(*call.trajectory);
  change(*changed);
  call.trajectory = step.followed = changed;
}

void set_map(LoopStep& step, const Balls& balls, double later_s = 0.0) {
  const Stamp stamp = Stamp::from_seconds(step.map.field->info().stamp.seconds() + later_s);
  step.map.field = std::make_shared<BallField>(balls, stamp);
}

Ball ahead(const LoopStep& step, double by_s, double radius_m) {
  Eigen::Vector3d at;
  step.followed->sample(step.now.seconds() - step.followed_start.seconds() + by_s,
                        std::span(at.data(), 3), {});
  return {at, radius_m};
}

/// A map in which nobody has seen anything.
class UnseenField final : public DistanceField {
 public:
  using DistanceField::DistanceField;
  void query(std::span<const Eigen::Vector3d>, std::span<double> distances_m,
             std::span<Eigen::Vector3d>, std::span<FieldStatus> statuses) const noexcept override {
    std::ranges::fill(distances_m, 5.0);
    std::ranges::fill(statuses, FieldStatus::kUnknown);
  }
};

std::set<std::string_view> broken(const Steps& run, const ReplannerSettings& settings,
                                  const SpacePolicy& space) {
  const auto robot = std::make_shared<testing_support::BallRobot>(ClosedLoop::kRadius_m);
  LoopPolicies policies(robot, {{1.0, 1.0, 1.0}, {1.0, 1.0, 1.0}, {"x", "y", "z"}}, space,
                        settings);
  std::set<std::string_view> names;
  for (const LoopStep& step : run) {
    for (const PolicyBreach& breach : policies.judge(step)) names.insert(breach.policy);
  }
  return names;
}

/// A run that was changed so as to break one promise.
struct Mutant {
  std::string policy;
  const Steps& (*of)();
  std::function<void(Steps&)> change;
  std::function<void(ReplannerSettings&, SpacePolicy&)> set = {};
};

/// While the robot drives, and nothing else happens.
constexpr std::size_t kDriving = 60;

Mutant while_driving(std::string policy, std::function<void(LoopStep&)> change,
                     std::function<void(ReplannerSettings&, SpacePolicy&)> set = {}) {
  return {std::move(policy), &detour, [=](Steps& run) { change(run[kDriving]); }, std::move(set)};
}
Mutant when(std::string policy, const Steps& (*of)(), Kind kind,
            std::function<void(LoopStep&)> change,
            std::function<void(ReplannerSettings&, SpacePolicy&)> set = {}) {
  return {std::move(policy), of, [=](Steps& run) { change(run[first(run, kind)]); },
          std::move(set)};
}
Mutant of_event(std::string policy, const Steps& (*of)(), Kind kind,
                std::function<void(ReplannerEvent&)> change,
                std::function<void(ReplannerSettings&, SpacePolicy&)> set = {}) {
  return when(
      std::move(policy), of, kind, [=](LoopStep& step) { change(event(step, kind)); },
      std::move(set));
}
Mutant of_motion(std::string policy, const Steps& (*of)(), Kind kind,
                 std::function<void(Trajectory&)> change) {
  return when(std::move(policy), of, kind, [=](LoopStep& step) { change_sent(step, change); });
}

Executor::Measured& measured(LoopStep& step) { return *step.calls.front().measured; }

ReplannerEvent failure(const LoopStep& step, Reason reason = Reason::kBlocked) {
  ReplannerEvent event;
  event.kind = Kind::kReplanFailed;
  event.reason = reason;
  event.stamp = step.now;
  event.cause = "it failed";
  return event;
}

void by_the_wall(ReplannerSettings& settings, SpacePolicy&) { settings.limit_wall_time = true; }

/// The middle state of what is followed.
std::size_t middle(const Trajectory& motion) {
  return 3 * static_cast<std::size_t>(motion.size() / 2);
}

std::vector<Mutant> of_what_it_is_given() {
  return {
      while_driving("stops_without_state",
                    [](LoopStep& step) {
                      step.calls.front().succeeded = false;
                      step.calls.front().measured.reset();
                    }),
      while_driving("stops_with_senseless_state",
                    [](LoopStep& step) { measured(step).state.q[0] = NAN; }),
      while_driving("stops_with_old_state",
                    [](LoopStep& step) { measured(step).stamp.ns -= 1'000'000'000; }),
      while_driving("stops_off_its_way", [](LoopStep& step) { measured(step).state.q[0] += 1.0; }),
      while_driving("stops_as_clock_goes_back", [](LoopStep& step) { step.now.ns -= 5'000'000; }),
      when("reached_at_goal", &detour, Kind::kReached,
           [](LoopStep& step) { measured(step).state.q[0] += 0.5; }),
      when("reached_at_rest", &detour, Kind::kReached,
           [](LoopStep& step) { measured(step).state.qdot[0] = 0.5; }),
      {"reached_for_good", &detour,
       [](Steps& run) {
         run.push_back(run.back());
         run.back().events.clear();
         run.back().status = Status::kWaiting;
       }},
      when("reached_is_told", &detour, Kind::kReached, [](LoopStep& step) { step.events.clear(); }),
      when("waits_for_first_map", &detour, Kind::kPlanned, [](LoopStep& step) { step.map = {}; }),
      {"misses_first_map", &detour,
       [](Steps& run) {
         LoopStep step = run.front();
         step.map = {};
         step.events.clear();
         step.calls.resize(1);
         step.followed = nullptr;
         step.status = Status::kWaiting;
         run.clear();
         for (int i = 0; i < 200; ++i) {
           step.now.ns += 4'000'000;
           measured(step).stamp = step.now;
           run.push_back(step);
         }
       }},
      while_driving("stops_in_old_map", [](LoopStep& step) { set_map(step, {}, -1.0); }),
      while_driving("stops_in_map_ahead", [](LoopStep& step) { set_map(step, {}, 1.0); }),
      while_driving("stops_as_maps_go_back", [](LoopStep& step) { set_map(step, {}, -0.1); }),
      of_event("plans_in_fresh_map", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.map_stamp.ns -= 1'000'000'000; }),
      of_event("plans_in_newest_map", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.map_stamp.ns -= 1; }),
      of_event("plans_in_later_maps", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.map_stamp.ns = -1; }),
      {"checks_once", &detour,
       [](Steps& run) {
         for (std::size_t i = kDriving; i < run.size(); ++i) run[i].checks += 2;
       }},
      {"searches_when_due", &detour,
       [](Steps& run) {
         LoopStep& step = run[first(run, Kind::kReplanned) + 1];
         step.events.push_back(failure(step));
       }},
      {"searches_new_maps", &detour,
       [](Steps& run) {
         const std::size_t at = first(run, Kind::kReplanned);
         LoopStep& step = run[at + 50];
         step.map.field = run[at].map.field;
         step.events.push_back(failure(step));
       }},
      of_event("tries_each_guess_once", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) {
                 event.tried.push_back(event.tried.front());
                 ++event.attempts;
               }),
      of_event("led_by_what_was_tried", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.guess = "sampled"; }),
      of_event(
          "stop_is_last_guess", &detour, Kind::kReplanned,
          [](ReplannerEvent& event) { event.tried.insert(event.tried.begin(), "after_stop"); }),
      of_event(
          "follows_nothing_late", &detour, Kind::kReplanned,
          [](ReplannerEvent& event) { event.solve_ms = 1e4; }, &by_the_wall),
  };
}

std::vector<Mutant> of_what_it_sends() {
  const auto replanned = [](std::string policy, std::function<void(Trajectory&)> change) {
    return of_motion(std::move(policy), &detour, Kind::kReplanned, std::move(change));
  };
  return {
      replanned("sends_whole_trajectories", [](Trajectory& t) { t.positions[3] = NAN; }),
      when("sends_from_now_on", &detour, Kind::kReplanned,
           [](LoopStep& step) { follow_call(step).start.ns += 1'000'000'000; }),
      when("sends_one_trajectory", &detour, Kind::kReplanned,
           [](LoopStep& step) { step.calls.push_back(ExecutorCall(follow_call(step))); }),
      replanned("position_is_continuous",
                [](Trajectory& t) {
                  for (double& q : t.positions) q += 0.01;
                }),
      replanned("velocity_is_continuous", [](Trajectory& t) { t.qdot(0)[1] += 0.01; }),
      replanned("keeps_what_is_followed",
                [](Trajectory& t) {
                  for (int i = 1; i < t.size(); ++i) t.q(i)[1] += 0.01;
                }),
      of_event("takes_over_in_time", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.takeover.ns += 1'000'000'000; }),
      of_event("splices_at_its_velocity", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.splice_velocity_jump = 0.1; }),
      of_motion("starts_where_it_is", &detour, Kind::kPlanned,
                [](Trajectory& t) {
                  for (double& q : t.positions) q += 0.5;
                }),
      of_motion("sets_out_from_rest", &detour, Kind::kPlanned,
                [](Trajectory& t) { t.qdot(0)[0] = 0.3; }),
      replanned("ends_at_rest", [](Trajectory& t) { t.velocities.back() = 0.3; }),
      replanned("keeps_joint_limits", [](Trajectory& t) { t.positions[middle(t)] = 11.0; }),
      replanned("keeps_velocity_limits", [](Trajectory& t) { t.velocities[middle(t)] = 1.5; }),
      replanned("keeps_acceleration_limits", [](Trajectory& t) { t.velocities[middle(t)] += 0.3; }),
      of_motion("keeps_braking_limits", &wall, Kind::kStopped,
                [](Trajectory& t) { t.velocities[middle(t)] += 0.3; }),
      when("plan_is_clear", &detour, Kind::kReplanned,
           [](LoopStep& step) { set_map(step, {ahead(step, 2.0, 0.1)}); }),
      when("stop_is_clear", &wall, Kind::kStopped,
           [](LoopStep& step) { set_map(step, {ahead(step, 0.5, 0.1)}); }),
      {"has_a_stop", &detour,
       [](Steps& run) {
         LoopStep& step = run[230];  // at 0.8 m/s it stops within 0.35 m
         Ball near = ahead(step, 0.0, 0.1);
         near.centre_m.x() += 0.4;
         set_map(step, {near});
       }},
      while_driving(
          "cannot_be_reached",
          [](LoopStep& step) {
            Ball near = ahead(step, 0.0, 0.1);
            near.centre_m.y() += 0.4;
            auto moving = std::make_shared<MovingObstacles>();
            moving->balls.push_back({near.centre_m, near.radius_m});
            moving->stamp = step.now;
            step.map.moving = moving;
          },
          [](ReplannerSettings& settings, SpacePolicy&) { settings.obstacle_speed_mps = 1.6; }),
      when("plan_keeps_from_predicted", &detour, Kind::kPlanned,
           [](LoopStep& step) {
             PredictedSet set;
             set.bottom_m = -1.0;
             set.top_m = 1.0;
             set.knots = {{0.0, {2.0, 0.0}, 0.1}, {60.0, {2.0, 0.0}, 0.1}};
             step.prediction = std::make_shared<Prediction>(*Prediction::create(step.now, {set}));
           }),
      when(
          "plan_keeps_to_seen", &detour, Kind::kReplanned,
          [](LoopStep& step) {
            step.map.field = std::make_shared<UnseenField>(step.map.field->info());
          },
          [](ReplannerSettings& settings, SpacePolicy& space) {
            settings.unseen_start_m = 0.1;
            space.floor = Floor{-5.0, {"ball"}};
          }),
  };
}

std::vector<Mutant> of_stops() {
  return {
      while_driving("stops_for_faults",
                    [](LoopStep& step) { step.events.push_back(failure(step, Reason::kPlugin)); }),
      when("recovers_before_it_goes_on", &wall, Kind::kRecovered,
           [](LoopStep& step) {
             std::erase_if(step.events,
                           [](const ReplannerEvent& e) { return e.kind == Kind::kRecovered; });
           }),
      when("recovers_with_a_plan", &wall, Kind::kRecovered,
           [](LoopStep& step) {
             std::erase_if(step.events,
                           [](const ReplannerEvent& e) { return e.kind == Kind::kPlanned; });
           }),
      of_event("recovers_from_its_cause", &wall, Kind::kRecovered,
               [](ReplannerEvent& event) { event.reason = Reason::kClock; }),
      {"slowed_then_stopped", &visitor,
       [](Steps& run) {
         for (LoopStep& step : run) {
           std::erase_if(step.events, [](const ReplannerEvent& e) {
             return e.kind == Kind::kStopped && e.reason == Reason::kMoving;
           });
         }
       }},
      {"stops_once", &wall,
       [](Steps& run) {
         const std::size_t at = first(run, Kind::kStopped);
         run[at + 1].events.push_back(event(run[at], Kind::kStopped));
       }},
      of_event("stops_for_a_cause", &wall, Kind::kStopped,
               [](ReplannerEvent& event) { event.cause.clear(); }),
      of_event("stops_for_a_known_reason", &wall, Kind::kStopped,
               [](ReplannerEvent& event) { event.reason = Reason::kCost; }),
      of_event("owner_ends_it", &wall, Kind::kStopped,
               [](ReplannerEvent& event) { event.reason = Reason::kEnd; }),
      of_event("stop_begins_in_time", &wall, Kind::kStopped,
               [](ReplannerEvent& event) { event.takeover.ns += 1'000'000'000; }),
      while_driving(
          "own_stop_is_told",
          [](LoopStep& step) { step.calls.push_back({.kind = Call::kStop, .succeeded = true}); }),
      when("own_stop_is_last_resort", &wall, Kind::kStopped,
           [](LoopStep& step) { step.calls.push_back({.kind = Call::kStop, .succeeded = true}); }),
      while_driving("repeats_failed_stop",
                    [](LoopStep& step) { step.calls.push_back({.kind = Call::kStop}); }),
      while_driving("refusal_is_told",
                    [](LoopStep& step) {
                      step.calls.push_back(
                          {.kind = Call::kFollow, .trajectory = step.followed, .start = step.now});
                    }),
      while_driving(
          "stops_after_long_step", [](LoopStep& step) { step.took_s = 3.0; }, &by_the_wall),
  };
}

std::vector<Mutant> of_what_it_tells() {
  return {
      when("motions_are_told", &detour, Kind::kReplanned,
           [](LoopStep& step) { step.events.clear(); }),
      when("told_plans_are_sent", &detour, Kind::kReplanned,
           [](LoopStep& step) { step.calls.resize(1); }),
      while_driving("failure_keeps_motion",
                    [](LoopStep& step) {
                      step.events.push_back(failure(step));
                      step.followed_start = step.now;
                    }),
      when("follows_what_it_sent", &detour, Kind::kReplanned,
           [](LoopStep& step) {
             auto other = std::make_shared<Trajectory>(*step.followed);
             other->positions.back() += 1.0;
             step.followed = other;
           }),
      while_driving(
          "follows_nothing_after_own_stop",
          [](LoopStep& step) { step.calls.push_back({.kind = Call::kStop, .succeeded = true}); }),
      while_driving("waits_at_rest", [](LoopStep& step) { step.status = Status::kWaiting; }),
      {"moves_when_it_says", &wall,
       [](Steps& run) { run[first(run, Kind::kRecovered) - 10].status = Status::kMoving; }},
      of_event("events_are_of_their_step", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.stamp.ns += 1; }),
      of_event("events_have_numbers", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.cost = NAN; }),
      of_event("plans_for_a_known_reason", &detour, Kind::kReplanned,
               [](ReplannerEvent& event) { event.reason = Reason::kExecutor; }),
  };
}

std::vector<Mutant> mutants() {
  std::vector<Mutant> all;
  for (const auto& group :
       {of_what_it_is_given(), of_what_it_sends(), of_stops(), of_what_it_tells()}) {
    all.insert(all.end(), group.begin(), group.end());
  }
  return all;
}

TEST(LoopPolicies, EachGuardsAPromiseThatTheDocumentationMakes) {
  std::ifstream in(std::string(SIDESTEP_SOURCE_DIR) + "/docs/closed_loop.md");
  const std::string text(std::istreambuf_iterator<char>(in), {});
  const std::string plain = std::regex_replace(text, std::regex("\\s+"), " ");
  std::set<std::string_view> names;
  for (const LoopPolicy& policy : LoopPolicies::all()) {
    EXPECT_NE(plain.find(policy.promise), std::string::npos)
        << policy.name << ": " << policy.promise;
    EXPECT_TRUE(names.insert(policy.name).second) << policy.name;
  }
  EXPECT_GE(names.size(), 56U);
}

TEST(LoopPolicies, RunsThatAreAsTheyWereBreakNone) {
  for (const auto run : {&detour, &wall}) {
    EXPECT_THAT(broken(run(), ClosedLoop::defaults(), {Space::kFree, Space::kFree}),
                UnorderedElementsAre());
    EXPECT_GT(run().size(), 1000U);
  }
}

TEST(LoopPolicies, EachIsBrokenByARunThatDoesNotKeepIt) {
  std::set<std::string_view> seen;
  for (const Mutant& mutant : mutants()) {
    SCOPED_TRACE(mutant.policy);
    Steps run = mutant.of();
    mutant.change(run);
    ReplannerSettings settings = ClosedLoop::defaults();
    SpacePolicy space{Space::kFree, Space::kFree};
    if (mutant.set) mutant.set(settings, space);
    const auto names = broken(run, settings, space);
    EXPECT_THAT(names, Contains(std::string_view(mutant.policy)));
    const auto all = LoopPolicies::all();
    const auto its = std::ranges::find(all, mutant.policy, &LoopPolicy::name);
    ASSERT_NE(its, all.end());
    seen.insert(its->name);
  }
  for (const LoopPolicy& policy : LoopPolicies::all()) {
    EXPECT_TRUE(seen.contains(policy.name)) << "no run breaks " << policy.name;
  }
}

}  // namespace
}  // namespace sidestep
