#include <sidestep/runtime/gaze_loop.hpp>

#include <limits>
#include <stdexcept>

#include <gmock/gmock.h>

#include "conformance/gaze_conformance.hpp"
#include "conformance/test_host.hpp"

namespace sidestep {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Still : public Executor {
 public:
  [[nodiscard]] Result<Measured> current() override { return fail(ErrorCode::kIo, "not asked"); }
  [[nodiscard]] Result<void> follow(const Trajectory&, Stamp) override { return {}; }
  [[nodiscard]] Result<void> stop() override { return {}; }
};

class Turning final : public Still, public HeadTurner {
 public:
  [[nodiscard]] Result<void> turn_head(const HeadAngles& to) override {
    if (is_stuck) return fail(ErrorCode::kIo, "the neck is stuck");
    turned.push_back(to);
    return {};
  }
  std::vector<HeadAngles> turned;
  bool is_stuck = false;
};

class Told final : public Gaze {
 public:
  [[nodiscard]] Result<HeadAngles> look(const GazeRequest& request) override {
    if (is_throwing) throw std::runtime_error("I am dizzy");
    seen.emplace(request);
    at = request.at;
    camera_stamp_s = request.camera != nullptr ? request.camera->stamp_s : -1.0;
    return angles;
  }
  HeadAngles angles{0.5, -0.4};
  HeadAngles at;
  double camera_stamp_s = 0.0;
  bool is_throwing = false;
  std::optional<GazeRequest> seen;
};

class Loop : public ::testing::Test {
 protected:
  Result<GazeLoop> make(Executor& executor) {
    return GazeLoop::create(
        {robot_, gaze_, executor, motion_, slot_, log_, "gaze told", "executor turning"});
  }
  void step(GazeLoop& loop, double time_s, const Replanner::Way& way = {}) {
    const Stamp now = Stamp::from_seconds(time_s);
    if (!loop.is_due(now)) return;
    loop.look(now, {Eigen::Vector2d(0.3, 0.0), Eigen::Vector2d::Zero()}, way);
  }

  std::shared_ptr<const KinematicTree> robot_ = conformance::robot_with_head();
  Told gaze_;
  Turning executor_;
  RobotMotion motion_;
  SnapshotSlot slot_;
  conformance::RecordingLog log_;
};

TEST_F(Loop, AsksTenTimesASecondAndTurnsTheHeadWithinItsLimits) {
  auto loop = make(executor_);
  ASSERT_TRUE(loop) << loop.error().describe();
  gaze_.angles = {5.0, -0.4};
  for (int i = 0; i < 250; ++i) {
    gaze_.angles.tilt_rad = -0.4 - 0.001 * i;
    step(*loop, 0.004 * i);
  }
  ASSERT_EQ(executor_.turned.size(), 10U);
  EXPECT_EQ(executor_.turned[0].pan_rad, 2.0);
  EXPECT_EQ(executor_.turned[0].tilt_rad, -0.4);
}

/// Whose frames are not believed sees the floor from there.
TEST_F(Loop, RestsTheHeadWhileNoFrameComesIntoTheMap) {
  auto loop = make(executor_);
  MapSnapshot map;
  map.field = std::make_shared<conformance::BallField>(std::vector<conformance::Ball>{});
  slot_.publish(map);
  const double stamp_s = map.field->info().stamp.seconds();
  step(*loop, stamp_s + 0.5);
  ASSERT_FALSE(executor_.turned.empty());
  EXPECT_EQ(executor_.turned.back().pan_rad, 0.5);
  step(*loop, stamp_s + 1.5);
  const HeadAngles rest = Head::create(robot_)->rest();
  EXPECT_EQ(executor_.turned.back().pan_rad, rest.pan_rad);
  EXPECT_EQ(executor_.turned.back().tilt_rad, rest.tilt_rad);
}

TEST_F(Loop, SaysWhereTheHeadIsWhatTheWayIsAndWhereTheMapWasSeenFrom) {
  auto loop = make(executor_);
  step(*loop, 0.1);
  EXPECT_EQ(gaze_.at.pan_rad, 0.0);  // nobody has told: it rests
  EXPECT_EQ(gaze_.seen->way, nullptr);
  EXPECT_EQ(gaze_.seen->field, nullptr);
  EXPECT_EQ(gaze_.camera_stamp_s, -1.0);

  motion_.record_head({0.2, -0.1}, Stamp::from_seconds(0.7));
  MapSnapshot map;
  map.field = std::make_shared<conformance::BallField>(std::vector<conformance::Ball>{});
  map.camera = CameraView{0.6, Transform::Identity(), {}};
  const Trajectory way = make_trajectory(2, 3, 1.0);
  map.tracks = std::make_shared<const Tracks>();
  map.moving = std::make_shared<const MovingObstacles>();
  slot_.publish(map);
  step(*loop, 0.8, {&way, 0.7, 1.5});
  EXPECT_EQ(gaze_.seen->tracks, map.tracks.get());
  EXPECT_EQ(gaze_.seen->moving, map.moving.get());
  EXPECT_EQ(gaze_.seen->way_blocked_s, 1.5);
  EXPECT_EQ(gaze_.at.pan_rad, 0.2);
  EXPECT_EQ(gaze_.seen->way, &way);
  EXPECT_EQ(gaze_.seen->way_from_s, 0.7);
  EXPECT_EQ(gaze_.seen->field, map.field.get());
  EXPECT_EQ(gaze_.camera_stamp_s, 0.6);
}

TEST_F(Loop, TellsTheHeadAgainOnceASecondWhereItWasTold) {
  auto loop = make(executor_);
  step(*loop, 1.0);
  gaze_.angles.pan_rad += 0.005;  // as measured: it hangs a little
  for (int i = 1; i < 10; ++i) step(*loop, 1.0 + 0.1 * i);
  EXPECT_EQ(executor_.turned.size(), 1U);
  step(*loop, 2.05);
  ASSERT_EQ(executor_.turned.size(), 2U);
  EXPECT_EQ(executor_.turned[1].pan_rad, executor_.turned[0].pan_rad);
  gaze_.angles.pan_rad += 0.1;
  step(*loop, 2.2);
  EXPECT_EQ(executor_.turned.size(), 3U);
}

TEST_F(Loop, LeavesTheHeadAloneWhereTheGazeIsAtFaultAndNamesItOnce) {
  auto loop = make(executor_);
  gaze_.is_throwing = true;
  step(*loop, 1.0);
  step(*loop, 2.0);
  EXPECT_TRUE(executor_.turned.empty());
  ASSERT_EQ(log_.messages().size(), 1U);
  EXPECT_THAT(log_.messages()[0], HasSubstr("gaze told"));
  EXPECT_THAT(log_.messages()[0], HasSubstr("I am dizzy; the head stays as it is"));
  gaze_.is_throwing = false;
  step(*loop, 3.0);
  EXPECT_EQ(executor_.turned.size(), 1U);
}

TEST_F(Loop, LeavesTheHeadAloneWhereAnglesAreNotNumbers) {
  auto loop = make(executor_);
  gaze_.angles.tilt_rad = std::numeric_limits<double>::quiet_NaN();
  step(*loop, 1.0);
  EXPECT_TRUE(executor_.turned.empty());
  EXPECT_THAT(log_.messages(), ElementsAre(HasSubstr("angles that are not numbers")));
}

TEST_F(Loop, NamesAnExecutorWhoseHeadDoesNotTurn) {
  auto loop = make(executor_);
  executor_.is_stuck = true;
  step(*loop, 1.0);
  EXPECT_THAT(log_.messages(), ElementsAre(HasSubstr("the neck is stuck")));
}

TEST_F(Loop, NeedsAHeadAndAnExecutorThatTurnsIt) {
  Still still;
  const auto stiff = make(still);
  ASSERT_FALSE(stiff);
  EXPECT_THAT(stiff.error().describe(), HasSubstr("executor turning turns no head"));
  robot_ = nullptr;
  const auto ball = std::make_shared<conformance::PlanarRobot>(conformance::PlanarRobot::Shape{});
  const auto headless = GazeLoop::create(
      {ball, gaze_, executor_, motion_, slot_, log_, "gaze told", "executor turning"});
  ASSERT_FALSE(headless);
  EXPECT_EQ(headless.error().code, ErrorCode::kUnsupported);
}

}  // namespace
}  // namespace sidestep
