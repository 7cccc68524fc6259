#include <gmock/gmock.h>

#include <cmath>

#include "closed_loop_run.hpp"

namespace sidestep::testing {
namespace {

using ::testing::HasSubstr;

/// From the decision to rest, at most: the lead, and 1 m/s braked away in half a second, twice.
constexpr double kToRest_s = 1.2;
constexpr double kRest_m = 1e-3;

/// A part of the loop goes wrong for a while.
struct Fault {
  std::string part;
  std::string fault;
  std::string reason;    ///< Of the event that tells of it.
  std::string cause;     ///< Part of what that says.
  bool recovers = true;  ///< Once the fault is over; else the robot stands until the end.
  double from_s = 0.6;
  double until_s = 3.0;
  std::string kind = "stopped";
};

std::string name_of(const ::testing::TestParamInfo<Fault>& fault) {
  return fault.param.part + "_" + fault.param.fault +
         (fault.param.from_s == 0.0 ? "_at_first" : "") +
         (fault.param.until_s > 100.0 ? "_for_good" : "");
}

void PrintTo(const Fault& fault, std::ostream* out) { *out << fault.part << " " << fault.fault; }

std::vector<std::string> settings_of(const Fault& fault, std::vector<std::string> more = {}) {
  more.push_back(fault.part + ".fault=" + fault.fault);
  more.push_back(fault.part + ".from_s=" + std::to_string(fault.from_s));
  more.push_back(fault.part + ".until_s=" + std::to_string(fault.until_s));
  return more;
}

class ClosedLoopFault : public ::testing::TestWithParam<Fault> {};

/// Whatever the fault, and however fast the machine.
void expect_order(const ClosedLoopRun& run) {
  EXPECT_EQ(run.summary["interrupted"], false);
  EXPECT_EQ(run.summary["episodes"], 1);
  EXPECT_EQ(run.summary["collisions_true"], 0);
  EXPECT_GT(run.summary["min_true_clearance_m"], 0.0);
  EXPECT_THAT(run.report, HasSubstr("Episode 0"));
}

TEST_P(ClosedLoopFault, IsSurvivedNamedAndHurtsNobody) {
  const Fault& fault = GetParam();
  const ClosedLoopRun run(settings_of(fault));
  SCOPED_TRACE(run.story());
  expect_order(run);
  const StoredEvent* told = run.first(fault.kind, fault.reason);
  ASSERT_NE(told, nullptr);
  EXPECT_THAT(told->cause, HasSubstr(fault.cause));
  EXPECT_GE(told->time_s, fault.from_s);
  if (!fault.recovers) {
    EXPECT_EQ(run.finished.exit_code, 1);
    EXPECT_LE(run.moved_m(told->time_s + kToRest_s, 1e9), kRest_m);
    EXPECT_THAT(run.summary["failures"][0]["reason"].get<std::string>(), HasSubstr(fault.cause));
    return;
  }
  if (fault.kind == "stopped") {
    EXPECT_LE(run.moved_m(told->time_s + kToRest_s, fault.until_s), kRest_m);
    const StoredEvent* recovered = run.last("recovered", fault.reason);
    ASSERT_NE(recovered, nullptr);
    EXPECT_GE(recovered->time_s, fault.until_s);
  }
  EXPECT_EQ(run.finished.exit_code, 0);
  EXPECT_EQ(run.summary["success"], true);
}

INSTANTIATE_TEST_SUITE_P(
    Sources, ClosedLoopFault,
    ::testing::Values(
        Fault{"source", "stalls", "map", "source faulty has given no frame since"},
        Fault{"source", "stalls", "map", "source faulty has given no frame yet", true, 0.0},
        Fault{"source", "ends", "map", "source faulty has no more frames", false},
        Fault{"source", "throws", "map", "source faulty: threw: is on fire", false},
        Fault{"source", "throws", "map", "source faulty: threw: is on fire", false, 0.0},
        Fault{"source", "fails", "map", "source faulty: the cable is loose", false},
        Fault{"source", "out_of_order", "map", "source faulty: frame"},
        Fault{"source", "clock_back", "map", "source faulty: frame"},
        Fault{"source", "pose_missing", "map", "source faulty, frame"},
        Fault{"source", "pose_missing_at_once", "map", "where the camera was is not known"},
        Fault{"source", "pose_nan", "map", "its camera pose is not finite"},
        Fault{"source", "depth_nan", "map", "none of its depths is a number"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Maps, ClosedLoopFault,
    ::testing::Values(Fault{"mapper", "throws", "map", "mapper faulty: threw: is on fire", false},
                      Fault{"mapper", "fails", "map", "mapper faulty: has seen enough", false},
                      Fault{"field", "throws", "map", "field faulty: threw: is on fire", false},
                      Fault{"field", "fails", "map", "field faulty: has nothing to say", false},
                      Fault{"field", "returns_null", "map", "field faulty: returned no field",
                            false}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Optimisers, ClosedLoopFault,
    ::testing::Values(
        Fault{"optimiser", "throws", "plugin", "optimiser faulty: threw: is on fire"},
        Fault{"optimiser", "throws", "plugin", "optimiser faulty: threw: is on fire", true, 0.0},
        Fault{"optimiser", "throws", "plugin", "optimiser faulty: threw: is on fire", false, 0.6,
              1e9},
        Fault{"optimiser", "throws_a_number", "plugin", "optimiser faulty: threw"},
        Fault{"optimiser", "fails", "plugin", "optimiser faulty: not my kind of problem"},
        Fault{"optimiser", "nan", "plugin", "optimiser faulty returned a broken trajectory"},
        Fault{"optimiser", "infinite", "plugin", "is not a finite number"},
        Fault{"optimiser", "joint_count", "plugin", "it moves 3 joints, the robot has 2"},
        Fault{"optimiser", "wrong_start", "plugin",
              "optimiser faulty returned a broken trajectory"},
        Fault{"optimiser", "times_go_back", "plugin", "times do not increase"},
        Fault{"optimiser", "empty", "plugin", "optimiser faulty returned a broken trajectory"},
        Fault{"optimiser", "finds_nothing", "blocked", "optimiser faulty", true, 0.6, 3.0,
              "replan_failed"},
        Fault{"optimiser", "wrong_end", "blocked", "optimiser faulty", true, 0.6, 3.0,
              "replan_failed"},
        Fault{"optimiser", "beyond_limits", "blocked", "optimiser faulty", true, 0.6, 3.0,
              "replan_failed"},
        Fault{"optimiser", "too_fast", "blocked", "", true, 0.6, 3.0, "replanned"}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Executors, ClosedLoopFault,
    ::testing::Values(
        Fault{"executor", "refuses", "executor", "executor faulty: the brakes are on", true, 0.6,
              3.0, "replan_failed"},
        Fault{"executor", "refuses", "executor", "executor faulty: the brakes are on", true, 0.0,
              3.0, "replan_failed"},
        Fault{"executor", "throws_on_follow", "executor", "executor faulty: threw: is on fire"},
        Fault{"executor", "throws_on_current", "executor", "executor faulty: threw: is on fire"},
        Fault{"executor", "fails", "executor", "executor faulty: no word from the robot"},
        Fault{"executor", "silent", "executor", "newest state of executor faulty"},
        Fault{"executor", "measures_nan", "executor", "executor faulty measured a state"},
        Fault{"executor", "stands_still", "not_following", "executor faulty"},
        Fault{"executor", "throws_at_all", "executor",
              "the executor's own stop failed: plugin executor faulty: threw", true, 0.6, 1.0}),
    name_of);

class ClosedLoopFaultByTheWall : public ::testing::TestWithParam<Fault> {};

/// Whether it gets to the goal in time is the machine's affair.
TEST_P(ClosedLoopFaultByTheWall, IsSurvivedNamedAndHurtsNobody) {
  const Fault& fault = GetParam();
  const ClosedLoopRun run(settings_of(fault, {"experiment.clock=wall", "experiment.duration_s=6"}));
  SCOPED_TRACE(run.story());
  expect_order(run);
  EXPECT_TRUE(run.finished.exit_code == 0 || run.finished.exit_code == 1);
  const StoredEvent* told = run.first("stopped", fault.reason);
  ASSERT_NE(told, nullptr);
  EXPECT_THAT(told->cause, HasSubstr(fault.cause));
  const bool is_planning_held_up = fault.fault == "hangs" && fault.part != "source";
  if (!is_planning_held_up) return;
  EXPECT_THAT(run.finished.error, HasSubstr("the executor is told to stop"));
}

INSTANTIATE_TEST_SUITE_P(
    All, ClosedLoopFaultByTheWall,
    ::testing::Values(Fault{"source", "hangs", "map", "source faulty has given no frame since"},
                      Fault{"mapper", "throws", "map", "mapper faulty: threw: is on fire"},
                      Fault{"optimiser", "hangs", "plugin", "optimiser faulty took"},
                      Fault{"executor", "hangs", "executor", "executor faulty took"},
                      Fault{"executor", "throws_on_current", "executor",
                            "executor faulty: threw: is on fire"}),
    name_of);

TEST(ClosedLoopEnd, LeavesNoRobotMoving) {
  const ClosedLoopRun run({"experiment.duration_s=1.0"});
  SCOPED_TRACE(run.story());
  EXPECT_EQ(run.finished.exit_code, 1);
  const StoredEvent* stopped = run.first("stopped", "end");
  ASSERT_NE(stopped, nullptr);
  EXPECT_THAT(stopped->cause, HasSubstr("the episode is over"));
  EXPECT_GT(run.moved_m(0.5, 1.0), 0.2) << "it did not move anyway";
  // 2 m/s^2, in the 72 ms that the last two states that are kept span, and the speed of rest.
  EXPECT_LT(run.last_speed_mps(), 0.17);
}

TEST(ClosedLoopEnd, IsNoSuccessWhereWhatTheRobotTouchedIsNotKnown) {
  const ClosedLoopRun run({"executor.fault=truth_throws", "executor.from_s=0.6"});
  SCOPED_TRACE(run.story());
  EXPECT_EQ(run.finished.exit_code, 1);
  EXPECT_EQ(run.summary["episodes"], 1);
  EXPECT_THAT(run.summary["failures"][0]["reason"].get<std::string>(),
              HasSubstr("executor faulty: threw: is on fire"));
  EXPECT_NE(run.first("reached", "goal"), nullptr);
}

}  // namespace
}  // namespace sidestep::testing
