#include <gtest/gtest.h>

#include <sidestep/runtime/truth_check.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing_support::flying_ball;

constexpr double kBall_m = 0.1;
constexpr double kObstacle_m = 0.2;

SceneObject ball_at(const std::string& name, const Eigen::Vector3d& p_world) {
  return {name, Sphere{kObstacle_m}, {{0.0, Transform(Eigen::Translation3d(p_world))}}, false};
}

SceneObject mover(const std::string& name, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                  double until_s) {
  return {name,
          Sphere{kObstacle_m},
          {{0.0, Transform(Eigen::Translation3d(from))},
           {until_s, Transform(Eigen::Translation3d(to))}},
          false};
}

/// Along x at 1 m/s from x = -2, at a height, every 10 ms.
std::vector<TruePose> flight(double y, double duration_s = 4.0) {
  std::vector<TruePose> poses;
  for (int i = 0; i <= static_cast<int>(100 * duration_s); ++i) {
    poses.push_back({0.01 * i, Eigen::Vector3d(-2.0 + 0.01 * i, y, 0.0)});
  }
  return poses;
}

std::vector<TruePose> standing(double duration_s) {
  std::vector<TruePose> poses = flight(0.0, duration_s);
  for (TruePose& pose : poses) pose.q.setZero();
  return poses;
}

class TruthCheckTest : public testing::Test {
 protected:
  [[nodiscard]] TrueMotion check(const std::vector<TruePose>& poses) const {
    auto motion = check_true_motion(flying_ball(kBall_m), std::make_shared<Scene>(objects_), poses,
                                    settings_);
    EXPECT_TRUE(motion) << motion.error().describe();
    return motion.value();
  }

  std::vector<SceneObject> objects_;
  TrueMotionSettings settings_;
};

TEST_F(TruthCheckTest, MeasuresTheLeastClearanceAndWhen) {
  objects_ = {ball_at("near", {0.5, 0.0, 0.0}), ball_at("far", {-1.0, -0.3, 0.0})};
  const TrueMotion motion = check(flight(0.36));
  EXPECT_NEAR(motion.min_clearance_m, 0.06, 1e-6);
  EXPECT_EQ(motion.nearest_object, "near");
  EXPECT_EQ(motion.nearest_link, "ball");
  EXPECT_NEAR(motion.nearest_s, 2.5, 1e-9);
  EXPECT_TRUE(motion.contacts.empty());
}

TEST_F(TruthCheckTest, MeasuresTheClearanceOverTime) {
  objects_ = {
      ball_at("ahead", {0.5, 0.0, 0.0}),
      ball_at("aside", {-1.0, 0.5, 0.0}),
      {"floor", HalfSpace{}, {{0.0, Transform(Eigen::Translation3d(0.0, 0.0, -0.2))}}, false}};
  settings_.farthest_over_time_m = 0.6;
  const TrueMotion motion = check(flight(0.0));
  ASSERT_EQ(motion.clearances.size(), 41U) << "ten a second";
  for (std::size_t i = 0; i < motion.clearances.size(); ++i) {
    const double time_s = 0.1 * static_cast<double>(i);
    const double x = -2.0 + time_s;
    const double nearest_m = std::min(std::abs(x - 0.5), std::hypot(x + 1.0, 0.5));
    EXPECT_NEAR(motion.clearances[i].time_s, time_s, 1e-9);
    const double expected_m = std::clamp(nearest_m - kBall_m - kObstacle_m, 0.0, 0.6);
    EXPECT_NEAR(motion.clearances[i].clearance_m, expected_m, 1e-4) << "at " << time_s << " s";
  }
}

TEST_F(TruthCheckTest, WhatIsFartherThanSearchedCountsAsThatFar) {
  objects_ = {ball_at("far", {0.0, 0.0, 0.0})};
  settings_.farthest_m = 0.4;
  const TrueMotion motion = check(flight(1.0));
  EXPECT_EQ(motion.min_clearance_m, 0.4);
  EXPECT_EQ(motion.nearest_object, "");
}

/// Whoever moves along the line between the two at the first touch is who touches.
TEST_F(TruthCheckTest, TellsWhoseContactItWas) {
  const auto approach_mps = [&](const std::vector<TruePose>& poses) {
    const TrueMotion motion = check(poses);
    EXPECT_EQ(motion.contacts.size(), 1u);
    return motion.contacts.empty() ? -1.0 : motion.contacts[0].approach_mps;
  };
  objects_ = {ball_at("post", {0.0, 0.0, 0.0})};
  EXPECT_NEAR(approach_mps(flight(0.0)), 1.0, 0.01);
  // The line of centres is at 30 degrees to the way.
  EXPECT_NEAR(approach_mps(flight(0.15)), std::cos(std::asin(0.15 / 0.3)), 0.05);
  objects_ = {mover("walker", {-3.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, 4.0)};
  EXPECT_EQ(approach_mps(standing(4.0)), 0.0);
  objects_ = {mover("faster", {-4.0, 0.0, 0.0}, {6.0, 0.0, 0.0}, 4.0)};
  EXPECT_NEAR(approach_mps(flight(0.0, 3.0)), -1.0, 0.01) << "it runs into a robot that flees";
  objects_ = {mover("oncoming", {2.0, 0.0, 0.0}, {-2.0, 0.0, 0.0}, 4.0)};
  EXPECT_NEAR(approach_mps(flight(0.0)), 1.0, 0.01) << "both are to blame, so the robot is";
  objects_ = {mover("from_nowhere", {0.0, 0.0, -1000.0}, {0.0, 0.0, 0.0}, 2.0)};
  objects_[0].waypoints[0].time_s = 2.0 - 1e-6;
  EXPECT_EQ(approach_mps(flight(0.0)), 0.0);
}

TEST_F(TruthCheckTest, FindsAContactFromItsFirstTouchToItsLast) {
  objects_ = {ball_at("post", {0.0, 0.0, 0.0})};
  const TrueMotion motion = check(flight(0.0));
  ASSERT_EQ(motion.contacts.size(), 1u);
  const TrueContact& contact = motion.contacts[0];
  EXPECT_EQ(contact.object, "post");
  EXPECT_EQ(contact.link, "ball");
  // The surfaces meet where the centres are 0.3 m apart, 1.7 s after the start.
  EXPECT_NEAR(contact.begin_s, 1.7, 0.011);
  EXPECT_NEAR(contact.end_s, 2.3, 0.011);
  EXPECT_GT(contact.depth_m, 0.19);
  EXPECT_LT(motion.min_clearance_m, -0.19);
}

TEST_F(TruthCheckTest, MeetsAMovingObjectWhereItIsAtThatTime) {
  objects_ = {mover("walker", {0.0, -2.0, 0.0}, {0.0, 2.0, 0.0}, 4.0)};
  const TrueMotion motion = check(standing(4.0));
  ASSERT_EQ(motion.contacts.size(), 1u);
  EXPECT_NEAR(motion.contacts[0].begin_s, 1.7, 0.011);
  EXPECT_NEAR(motion.contacts[0].end_s, 2.3, 0.011);
  // Who leaves before it comes is not touched.
  EXPECT_TRUE(check(standing(1.6)).contacts.empty());
}

TEST_F(TruthCheckTest, CountsTouchesOfOneObjectApartInTimeAndOfTwoObjects) {
  objects_ = {ball_at("first", {-1.0, 0.0, 0.0}), ball_at("second", {1.0, 0.0, 0.0})};
  EXPECT_EQ(check(flight(0.0)).contacts.size(), 2u);

  SceneObject back_and_forth = mover("pendulum", {0.0, -1.0, 0.0}, {0.0, 1.0, 0.0}, 1.0);
  back_and_forth.waypoints.push_back({2.0, back_and_forth.waypoints[0].T_world_object});
  objects_ = {back_and_forth};
  // It is away from 0.65 s to 1.35 s.
  EXPECT_EQ(check(standing(2.0)).contacts.size(), 2u);
  settings_.apart_s = 0.8;
  EXPECT_EQ(check(standing(2.0)).contacts.size(), 1u);
}

TEST_F(TruthCheckTest, LeavesOutAllowedContacts) {
  objects_ = {ball_at("post", {0.0, 0.0, 0.0})};
  settings_.allowed_contacts = {{"ball", "post"}};
  const TrueMotion motion = check(flight(0.0));
  EXPECT_TRUE(motion.contacts.empty());
  EXPECT_EQ(motion.min_clearance_m, settings_.farthest_m);
}

TEST_F(TruthCheckTest, RefusesWhatMakesNoSense) {
  objects_ = {ball_at("post", {0.0, 0.0, 0.0})};
  const auto scene = std::make_shared<Scene>(objects_);
  const std::vector<TruePose> wrong = {{0.0, Eigen::Vector2d::Zero()}};
  const auto sized = check_true_motion(flying_ball(kBall_m), scene, wrong, {});
  ASSERT_FALSE(sized);
  EXPECT_NE(sized.error().message.find("2 joints"), std::string::npos) << sized.error().describe();
  settings_.allowed_contacts = {{"ball", "pots"}};
  const auto named = check_true_motion(flying_ball(kBall_m), scene, flight(1.0), settings_);
  ASSERT_FALSE(named);
  EXPECT_NE(named.error().describe().find("did you mean 'post'?"), std::string::npos)
      << named.error().describe();
}

}  // namespace
}  // namespace sidestep
