#include "base_drive.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include <gtest/gtest.h>

namespace sidestep::ros1_executor {
namespace {

constexpr double kGain_per_s = 1.5;
const BaseSpeeds kFastest(0.5, 0.5, 1.2);

BaseTracking tracking(bool rolls) { return {rolls, kGain_per_s, kFastest}; }

/// At rest there.
PlanarMotion at(double x_m, double y_m, double yaw_rad) {
  return {{x_m, y_m, yaw_rad}, Eigen::Vector3d::Zero()};
}

/// Round a circle about the origin, counted from the positive x axis, ahead or back.
PlanarMotion on_circle(double radius_m, double speed_mps, double time_s) {
  const double rate = speed_mps / radius_m, angle = rate * time_s;
  const double yaw = angle + (speed_mps > 0.0 ? 0.5 : -0.5) * std::numbers::pi;
  return {{radius_m * std::cos(angle), radius_m * std::sin(angle),
           speed_mps > 0.0 ? yaw : yaw + std::numbers::pi},
          {-speed_mps * std::sin(angle), speed_mps * std::cos(angle), rate}};
}

/// Where a base is after `dt_s` at these speeds: along an arc.
void move(Eigen::Vector3d& pose, const BaseSpeeds& speeds, double dt_s) {
  const double yaw = pose.z() + 0.5 * dt_s * speeds.z();
  pose.head<2>() += dt_s * (Eigen::Rotation2Dd(yaw) * speeds.head<2>());
  pose.z() += dt_s * speeds.z();
}

TEST(TrackingSpeeds, AreThoseThatItWasToldWhereItIsThere) {
  const PlanarMotion told = on_circle(2.0, 0.3, 1.7);
  for (const bool rolls : {false, true}) {
    const BaseSpeeds speeds = tracking_speeds(told, told, tracking(rolls));
    EXPECT_NEAR(speeds.x(), 0.3, 1e-12);  // along its heading, the circle's tangent
    EXPECT_NEAR(speeds.y(), 0.0, 1e-12);
    EXPECT_NEAR(speeds.z(), 0.15, 1e-12);
  }
}

TEST(TrackingSpeeds, LetErrorsOfAHolonomicBaseDecayByTheGain) {
  constexpr double kStep_s = 1e-3, kTime_s = 1.2;
  Eigen::Vector3d pose = on_circle(2.0, 0.2, 0.0).pose + Eigen::Vector3d(0.05, -0.04, 0.1);
  for (double t = 0.0; t < kTime_s; t += kStep_s) {
    move(pose, tracking_speeds(on_circle(2.0, 0.2, t), {pose, {}}, tracking(false)), kStep_s);
  }
  const double left = std::exp(-kGain_per_s * kTime_s);
  const Eigen::Vector3d error = pose - on_circle(2.0, 0.2, kTime_s).pose;
  EXPECT_NEAR(error.x(), left * 0.05, 5e-4);
  EXPECT_NEAR(error.y(), left * -0.04, 5e-4);
  EXPECT_NEAR(error.z(), left * 0.1, 5e-4);
}

/// Small, at one speed along a line: e'' + 2 g e' + g^2 e = 0, at every speed and in reverse.
TEST(TrackingSpeeds, LetErrorsAcrossARollingBaseDecayCriticallyDamped) {
  constexpr double kStep_s = 1e-3, kTime_s = 1.5, kError_m = 1e-3;
  for (const double speed_mps : {0.12, 0.4, -0.3}) {
    Eigen::Vector3d pose(0.0, kError_m, 0.0);
    for (double t = 0.0; t < kTime_s; t += kStep_s) {
      const PlanarMotion told{{speed_mps * t, 0.0, 0.0}, {speed_mps, 0.0, 0.0}};
      const BaseSpeeds speeds = tracking_speeds(told, {pose, {}}, tracking(true));
      ASSERT_EQ(speeds.y(), 0.0);
      move(pose, speeds, kStep_s);
    }
    const double gt = kGain_per_s * kTime_s;
    EXPECT_NEAR(pose.y(), kError_m * (1.0 + gt) * std::exp(-gt), 0.01 * kError_m) << speed_mps;
  }
}

/// Drives that act 0.05 s late and lag by 0.08 s, odometry at 50 Hz, as the command goes out.
TEST(TrackingSpeeds, KeepARollingBaseWithLateDrivesOnACircle) {
  constexpr double kStep_s = 0.02, kLag_s = 0.08;
  constexpr int kDelay = 3;
  for (const double speed_mps : {0.3, -0.3}) {
    Eigen::Vector3d pose = on_circle(1.0, speed_mps, 0.0).pose + Eigen::Vector3d(0.04, 0.03, -0.1);
    BaseSpeeds driven = BaseSpeeds::Zero();
    std::vector<BaseSpeeds> sent(kDelay, BaseSpeeds::Zero());
    double worst_m = 0.0;
    for (double t = 0.0; t < 20.0; t += kStep_s) {
      const PlanarMotion told = on_circle(1.0, speed_mps, t);
      sent.push_back(tracking_speeds(told, {pose, {}}, tracking(true)));
      driven += kStep_s / kLag_s * (sent[sent.size() - 1 - kDelay] - driven);
      move(pose, driven, kStep_s);
      const double off_m = (pose - on_circle(1.0, speed_mps, t + kStep_s).pose).head<2>().norm();
      if (t > 6.0) worst_m = std::max(worst_m, off_m);
    }
    EXPECT_LT(worst_m, 0.01) << speed_mps;
  }
}

TEST(TrackingSpeeds, AreReducedTogetherWhereTheyAreTooFast) {
  const PlanarMotion told{{4.0, 0.0, 0.4}, {0.3, 0.0, 0.2}};
  for (const bool rolls : {false, true}) {
    BaseTracking unlimited = tracking(rolls);
    unlimited.fastest.setConstant(1e6);
    const BaseSpeeds speeds = tracking_speeds(told, at(0.0, 0.0, 0.0), tracking(rolls));
    const BaseSpeeds wanted = tracking_speeds(told, at(0.0, 0.0, 0.0), unlimited);
    EXPECT_NEAR(speeds.cwiseQuotient(kFastest).cwiseAbs().maxCoeff(), 1.0, 1e-12);
    EXPECT_LT(speeds.cross(wanted).norm(), 1e-12);
    EXPECT_GT(speeds.dot(wanted), 0.0);
  }
}

/// By their joints, which are along the world's axes, not the base's.
TEST(TrackingSpeeds, OfAHolonomicBaseAreWithinItsJointsLimits) {
  const double yaw_rad = 0.25 * std::numbers::pi;
  PlanarMotion told = at(0.0, 0.0, yaw_rad);
  told.velocity = {0.45, 0.45, 0.0};
  EXPECT_NEAR(tracking_speeds(told, told, tracking(false)).x(), 0.45 * std::numbers::sqrt2, 1e-12);
  told.velocity = {0.6, 0.0, 0.0};
  EXPECT_NEAR(tracking_speeds(told, told, tracking(false)).norm(), 0.5, 1e-12);
}

TEST(TrackingSpeeds, TurnTheShorterWay) {
  const double almost = std::numbers::pi - 0.05;
  for (const bool rolls : {false, true}) {
    EXPECT_GT(tracking_speeds(at(0, 0, -almost), at(0, 0, almost), tracking(rolls)).z(), 0.0);
    EXPECT_GT(tracking_speeds(at(0, 0, almost + 4.0 * std::numbers::pi), at(0, 0, almost - 0.1),
                              tracking(rolls))
                  .z(),
              0.0);
  }
}

constexpr double kMaxAge_s = 0.2, kFarthest = 0.1;
constexpr double kSpeed_mps = 0.3;

Stamp s_at(double seconds) { return Stamp::from_seconds(1000.0 + seconds); }

/// Of a robot of an arm's joint and a base: along x at one speed, from `from_m` on, for
/// `duration_s`.
Trajectory ahead(double from_m, double duration_s) {
  Trajectory trajectory = make_trajectory(4, 2, duration_s);
  for (int i = 0; i < 2; ++i) {
    trajectory.q(i)[1] = from_m + kSpeed_mps * trajectory.times_s[static_cast<std::size_t>(i)];
    trajectory.qdot(i)[1] = kSpeed_mps;
  }
  return trajectory;
}

class BaseFollowerTest : public ::testing::Test {
 protected:
  /// Ahead; infinity where nothing is sent.
  double speed_at(double seconds) {
    const auto speeds = follower_.speeds_at(s_at(seconds));
    return speeds ? speeds->x() : std::numeric_limits<double>::infinity();
  }
  static constexpr double kSilent = std::numeric_limits<double>::infinity();

  BaseFollower follower_{{1, 2, 3}, tracking(false), kMaxAge_s, kFarthest};
};

TEST_F(BaseFollowerTest, DrivesToTheEndThoughNobodyRenewsItStandsAndFallsSilent) {
  EXPECT_EQ(speed_at(0.0), kSilent);
  follower_.follow(ahead(0.0, 2.0), s_at(1.0));
  EXPECT_EQ(speed_at(0.9), kSilent);  // not begun
  for (double t = 1.0; t < 2.99; t += 0.02) EXPECT_NEAR(speed_at(t), kSpeed_mps, 1e-12) << t;
  EXPECT_EQ(speed_at(3.01), 0.0);
  EXPECT_EQ(speed_at(3.4), 0.0);
  EXPECT_EQ(speed_at(3.55), kSilent);
}

TEST_F(BaseFollowerTest, GoesOnUntilWhatComesNextBegins) {
  follower_.follow(ahead(0.0, 5.0), s_at(0.0));
  EXPECT_NEAR(speed_at(0.5), kSpeed_mps, 1e-12);
  Trajectory rest = ahead(0.3, 1.0);
  std::ranges::fill(rest.velocities, 0.0);
  std::ranges::copy(rest.q(0), rest.q(1).begin());
  follower_.follow(rest, s_at(1.0));
  EXPECT_NEAR(speed_at(0.98), kSpeed_mps, 1e-12);
  EXPECT_EQ(speed_at(1.0), 0.0);
  follower_.follow(ahead(0.3, 5.0), s_at(3.0));
  follower_.follow(ahead(0.3, 1.0), s_at(1.5));  // instead
  EXPECT_NEAR(speed_at(1.6), kSpeed_mps, 1e-12);
  EXPECT_EQ(speed_at(2.6), 0.0);
  EXPECT_EQ(speed_at(3.2), kSilent);
}

TEST_F(BaseFollowerTest, HoldsAtOnceAndForgetsWhatWasToCome) {
  follower_.follow(ahead(0.0, 5.0), s_at(0.0));
  EXPECT_NEAR(speed_at(0.5), kSpeed_mps, 1e-12);
  follower_.follow(ahead(0.3, 5.0), s_at(1.0));
  follower_.hold();
  EXPECT_EQ(speed_at(0.52), 0.0);
  EXPECT_EQ(speed_at(1.0), 0.0);
  EXPECT_EQ(speed_at(1.1), kSilent);
}

TEST_F(BaseFollowerTest, StandsBeforeWhatBeginsAfterAHold) {
  follower_.hold();
  follower_.follow(ahead(0.0, 5.0), s_at(0.3));
  EXPECT_EQ(speed_at(0.1), 0.0);
  EXPECT_NEAR(speed_at(0.4), kSpeed_mps, 1e-12);
}

TEST_F(BaseFollowerTest, SteersByOdometryThatIsNewAndNear) {
  follower_.follow(ahead(0.0, 5.0), s_at(0.0));
  const auto behind = [&](double off_m, double when_s) {
    follower_.measure({{kSpeed_mps * when_s - off_m, 0.0, 0.0}, {kSpeed_mps, 0.0, 0.0}},
                      s_at(when_s));
  };
  behind(0.04, 1.0);
  const double steered = kSpeed_mps + kGain_per_s * 0.04;
  EXPECT_NEAR(speed_at(1.0), steered, 1e-9);
  EXPECT_NEAR(speed_at(1.1), steered, 1e-9);       // it went on as it went
  EXPECT_NEAR(speed_at(1.21), kSpeed_mps, 1e-12);  // too old
  behind(0.11, 1.3);
  EXPECT_NEAR(speed_at(1.3), kSpeed_mps, 1e-12);  // too far
  behind(0.04, 2.0);
  EXPECT_NEAR(speed_at(1.4), kSpeed_mps, 1e-12);  // from the future
}

/// Of what drives that reach nine tenths of what they are sent leave behind, the loop keeps a base
/// on wheels within what its gain has left: v / 10 over the gain.
TEST(BaseFollowerOnWheels, MakesUpForDrivesThatFallShort) {
  BaseFollower follower({1, 2, 3}, tracking(true), kMaxAge_s, kFarthest);
  follower.follow(ahead(0.0, 20.0), s_at(0.0));
  Eigen::Vector3d pose(0.0, 0.03, 0.05);
  BaseSpeeds speeds = BaseSpeeds::Zero();
  for (double t = 0.0; t < 15.0; t += 0.02) {
    follower.measure({pose, {0.9 * speeds.x(), 0.0, 0.0}}, s_at(t));
    speeds = *follower.speeds_at(s_at(t));
    move(pose, 0.9 * speeds, 0.02);
  }
  const double left_m = kSpeed_mps * (1.0 / 0.9 - 1.0) / kGain_per_s;
  EXPECT_NEAR(pose.x(), kSpeed_mps * 15.0 - left_m, 0.01);
  EXPECT_NEAR(pose.y(), 0.0, 1e-3);
  EXPECT_NEAR(pose.z(), 0.0, 1e-3);
}

}  // namespace
}  // namespace sidestep::ros1_executor
