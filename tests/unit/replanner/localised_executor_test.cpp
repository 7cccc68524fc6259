#include <sidestep/runtime/localised_executor.hpp>

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include <sidestep/core/index.hpp>

#include "conformance/analytic_models.hpp"
#include "conformance/localiser_conformance.hpp"

namespace sidestep {
namespace {

using conformance::turning_robot;

/// Keeps what it is told, by odometry.
class Obedient final : public Executor {
 public:
  [[nodiscard]] Result<Measured> current() override { return Measured{state, now}; }
  [[nodiscard]] Result<void> follow(const Trajectory& trajectory, Stamp) override {
    if (on_follow) on_follow();
    if (is_refusing) return fail(ErrorCode::kInvalidArgument, "too far");
    followed.push_back(trajectory);
    return {};
  }
  [[nodiscard]] Result<void> stop() override {
    ++stops;
    return {};
  }
  RobotState state{Eigen::Vector3d(1.0, 2.0, 0.5), Eigen::Vector3d(0.1, 0.0, 0.2)};
  Stamp now{1'000'000'000};
  std::vector<Trajectory> followed;
  int stops = 0;
  bool is_refusing = false;
  std::function<void()> on_follow;
};

class LocalisedExecutorTest : public testing::Test {
 protected:
  void localise(double x_m, double y_m, double yaw_rad, std::string lost = {}) {
    MapSnapshot map;
    map.localisation = Localisation{transform_from_xyz_rpy({x_m, y_m, 0.0}, {0.0, 0.0, yaw_rad}),
                                    0.0, 0.0, std::move(lost)};
    slot_.publish(std::move(map));
  }
  static Trajectory drive() {
    return straight_line({Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.1, 0, 0)},
                         {Eigen::Vector3d(1, 0, 0), Eigen::Vector3d(0.1, 0, 0)}, 11, 1.0);
  }
  static Eigen::Vector3d begin(const Trajectory& trajectory) {
    return Eigen::Vector3d::Map(trajectory.q(0).data());
  }

  Obedient inner_;
  SnapshotSlot slot_;
  LocalisedExecutor executor_{inner_, *BaseJoints::of(*turning_robot()), slot_};
};

TEST_F(LocalisedExecutorTest, GoesByOdometryUntilALocaliserSaysMore) {
  EXPECT_EQ(executor_.current()->state.q, inner_.state.q);
  ASSERT_TRUE(executor_.follow(drive(), {}));
  EXPECT_EQ(inner_.followed.back().positions, drive().positions);
}

TEST_F(LocalisedExecutorTest, TakesStatesToTheMapAndTrajectoriesBack) {
  localise(3.0, -1.0, std::numbers::pi / 2);
  const RobotState state = executor_.current()->state;
  EXPECT_TRUE(state.q.isApprox(Eigen::Vector3d(1.0, 0.0, 0.5 + std::numbers::pi / 2)));
  EXPECT_NEAR((state.qdot - Eigen::Vector3d(0.0, 0.1, 0.2)).norm(), 0.0, 1e-12);

  Trajectory from_here = drive();
  for (int i = 0; i < from_here.size(); ++i) {
    std::ranges::copy(as_span(state.q), from_here.q(i).begin());
    std::ranges::copy(as_span(state.qdot), from_here.qdot(i).begin());
  }
  ASSERT_TRUE(executor_.follow(from_here, {}));
  EXPECT_TRUE(begin(inner_.followed.back()).isApprox(inner_.state.q));
  EXPECT_NEAR(inner_.followed.back().qdot(3)[0], 0.1, 1e-12);
  EXPECT_NEAR(inner_.followed.back().qdot(3)[1], 0.0, 1e-12);
}

TEST_F(LocalisedExecutorTest, SendsWhatIsFollowedAgainOnceItLiesElsewhere) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  localise(0.001, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 1u);
  localise(0.003, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  ASSERT_EQ(inner_.followed.size(), 2u);
  EXPECT_NEAR(begin(inner_.followed.back()).x(), -0.003, 1e-12);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 2u);
}

TEST_F(LocalisedExecutorTest, SendsNothingAfterAStop) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  ASSERT_TRUE(executor_.stop());
  localise(0.1, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 1u);
  EXPECT_EQ(inner_.stops, 1);
}

TEST_F(LocalisedExecutorTest, SendsNothingAfterAStopThatCameWhileItWasTold) {
  inner_.on_follow = [this] { ASSERT_TRUE(executor_.stop()); };
  ASSERT_TRUE(executor_.follow(drive(), {}));
  localise(0.1, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 1u);
}

/// Nor where it throws.
TEST_F(LocalisedExecutorTest, StaysStoppedWhereTheNextMotionIsRefused) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  ASSERT_TRUE(executor_.stop());
  inner_.is_refusing = true;
  EXPECT_FALSE(executor_.follow(drive(), {}));
  inner_.is_refusing = false;
  inner_.on_follow = [] { throw std::runtime_error("unplugged"); };
  EXPECT_THROW((void)executor_.follow(drive(), {}), std::runtime_error);
  inner_.on_follow = nullptr;
  localise(0.1, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 1u);
}

/// From another thread, while something is sent again.
TEST_F(LocalisedExecutorTest, StopsAgainWhereAStopCameMeanwhile) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  localise(0.1, 0.0, 0.0);
  inner_.on_follow = [this] { ASSERT_TRUE(executor_.stop()); };
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.stops, 2);
}

TEST_F(LocalisedExecutorTest, SendsNothingAgainOnceItIsOver) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  inner_.now = Stamp::from_seconds(20.0);
  localise(0.1, 0.0, 0.0);
  ASSERT_TRUE(executor_.current());
  EXPECT_EQ(inner_.followed.size(), 1u);
}

TEST_F(LocalisedExecutorTest, DoesNotKnowTheRobotThatIsNotCorrected) {
  ASSERT_TRUE(executor_.follow(drive(), {}));
  inner_.is_refusing = true;
  localise(0.01, 0.0, 0.0);
  EXPECT_TRUE(executor_.current());
  localise(0.03, 0.0, 0.0);
  EXPECT_FALSE(executor_.current());
  inner_.is_refusing = false;
  EXPECT_TRUE(executor_.current());
}

TEST_F(LocalisedExecutorTest, TurnsOnBeyondHalfATurn) {
  inner_.state.q[2] = 0.0;
  for (int i = 0; i <= 50; ++i) {
    localise(0.0, 0.0, 0.1 * i);
    EXPECT_NEAR(executor_.current()->state.q[2], 0.1 * i, 1e-9);
  }
  Trajectory turned = drive();
  for (int i = 0; i < turned.size(); ++i) turned.q(i)[2] = 5.0;
  ASSERT_TRUE(executor_.follow(turned, {}));
  EXPECT_NEAR(inner_.followed.back().q(0)[2], 0.0, 1e-9);
}

TEST_F(LocalisedExecutorTest, DoesNotKnowWhereALostRobotIs) {
  localise(0.0, 0.0, 0.0, "localiser mine: it is dark");
  const auto state = executor_.current();
  ASSERT_FALSE(state);
  EXPECT_THAT(state.error().describe(), testing::HasSubstr("localiser mine: it is dark"));
  EXPECT_EQ(executor_.believed()->state.q, inner_.state.q);
}

TEST_F(LocalisedExecutorTest, PassesAStateOfTooFewJointsOn) {
  inner_.state = {Eigen::VectorXd::Zero(1), {}};
  EXPECT_EQ(executor_.current()->state.q.size(), 1);
}

TEST(BaseJoints, MoveAllThatHasAShape) {
  const auto robot = turning_robot();
  const auto base = BaseJoints::of(*robot);
  ASSERT_TRUE(base) << base.error().describe();
  EXPECT_EQ(base->yaw(), 2);
  // A chain on a base that cannot turn: its first joint moves not the base.
  const conformance::PlanarRobot arm({.rotary_joints = 2, .mobile = true});
  EXPECT_FALSE(BaseJoints::of(arm));
  EXPECT_FALSE(BaseJoints::of(conformance::PlanarRobot({.rotary_joints = 3})));
}

}  // namespace
}  // namespace sidestep
