#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../rosbag_source.hpp"
#include "support/wrong_option.hpp"

namespace sidestep::rosbag {
namespace {

using Wrong = testing_support::WrongOption<Options>;

class WrongRosbagOption : public ::testing::TestWithParam<Wrong> {};

TEST_P(WrongRosbagOption, IsTold) { testing_support::expect_told(GetParam()); }

void set_joints_base(Options& options, const char* from) {
  options.joints.emplace();
  options.joints->base.emplace();
  options.joints->base->from = from;
}

CalibrationStep matrix_step(std::vector<double> values) {
  CalibrationStep step;
  step.matrix = std::move(values);
  return step;
}

INSTANTIATE_TEST_SUITE_P(
    Options, WrongRosbagOption,
    ::testing::Values(Wrong{"depth_min_m", [](Options& o) { o.depth_min_m = 10.0; }},
                      Wrong{"pose.from", [](Options& o) { o.pose.from = "topic"; }},
                      Wrong{"pose.topic", [](Options& o) { o.pose.topic = "/mocap"; }},
                      Wrong{"pose.inverse", [](Options& o) { o.pose.inverse = true; }},
                      Wrong{"joints.base.from", [](Options& o) { set_joints_base(o, "odometry"); }},
                      Wrong{"joints.base.from",
                            [](Options& o) {
                              o.pose.from = "topic";
                              o.pose.topic = "/mocap";
                              set_joints_base(o, "tf");
                            }},
                      Wrong{"pose.T_body_camera[1].matrix",
                            [](Options& o) {
                              o.pose.T_body_camera = {CalibrationStep{}, matrix_step({1, 0, 0, 0})};
                            }},
                      Wrong{"pose.T_world_reference[0].matrix",
                            [](Options& o) {
                              o.pose.T_world_reference = {
                                  matrix_step({1, 0, 0, 0, 0, 1.1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})};
                            }},
                      Wrong{"pose.T_body_camera[0].matrix",  // a mirror
                            [](Options& o) {
                              o.pose.T_body_camera = {
                                  matrix_step({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1})};
                            }},
                      Wrong{"pose.T_body_camera[0].matrix", [](Options& o) {
                              o.pose.T_body_camera = {
                                  matrix_step({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})};
                              o.pose.T_body_camera[0].xyz_m.x() = 1.0;
                            }}));

TEST(RosbagOptions, HaveNothingWrongByDefault) {
  EXPECT_TRUE(Options{}.check().empty());
  EXPECT_EQ(product({}).matrix(), Transform::Identity().matrix());
}

/// A matrix that was written with few digits is a rotation all the same.
TEST(RosbagOptions, TakeTheRotationNearestToAMatrix) {
  const std::vector<CalibrationStep> steps{
      matrix_step({0.971, -0.121, 0.206, 0.1, 0.157, 0.973, -0.169, 0.2, -0.180, 0.196, 0.964, 0.3,
                   0, 0, 0, 1})};
  const Transform transform = product(steps);
  const Eigen::Matrix3d R = transform.linear();
  EXPECT_LT((R.transpose() * R - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff(), 1e-14);
  EXPECT_NEAR(R(0, 0), 0.971, 1e-3);
  EXPECT_NEAR(R(1, 2), -0.169, 1e-3);
  EXPECT_EQ(transform.translation(), Eigen::Vector3d(0.1, 0.2, 0.3));
}

}  // namespace
}  // namespace sidestep::rosbag
