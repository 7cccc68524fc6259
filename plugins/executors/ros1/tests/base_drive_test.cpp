#include "base_drive.hpp"

#include <cmath>
#include <numbers>

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

}  // namespace
}  // namespace sidestep::ros1_executor
