#include <sidestep/planning/costs.hpp>
#include <sidestep/planning/residual_names.hpp>

#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "conformance/cost_conformance.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using namespace conformance;
using testing::HasSubstr;

const double kNan = std::numeric_limits<double>::quiet_NaN();
const double kEndless = std::numeric_limits<double>::infinity();

Transform pose(const Eigen::Vector3d& p, double angle, const Eigen::Vector3d& axis) {
  Transform T = Transform::Identity();
  T.translate(p);
  T.rotate(Eigen::AngleAxisd(angle, axis.normalized()));
  return T;
}

class TaskCosts : public testing::Test {
 protected:
  const std::shared_ptr<const RobotModel> robot_ = testing_support::mobile_arm();
  const States states_ = random_states(7, 60, 3.0, 1.0);
  Scratch scratch_;

  Transform hand_at(const States& states, int state) {
    std::vector<Transform> poses(robot_->description().links.size());
    robot_->link_poses(states.one(state).q, poses, scratch_);
    return poses.back();
  }
  std::unique_ptr<StateCost> axis_cost(const Eigen::Vector3d& link, const Eigen::Vector3d& world) {
    return std::move(make_link_axis_cost(robot_, "hand", link, world, 0.1).value());
  }
};

TEST_F(TaskCosts, Conform) {
  const Transform target = pose({0.4, -0.3, 0.9}, 1.2, {1.0, 2.0, -0.5});
  const auto position = make_link_position_cost(robot_, "hand", target.translation(), 0.01);
  const auto whole = make_link_pose_cost(robot_, "hand", target, 0.02, 0.05);
  const auto orientation = make_link_orientation_cost(robot_, "fore_arm", target.linear(), 0.1);
  const auto axis = make_link_axis_cost(robot_, "hand", {0.0, 0.3, 1.0}, {0.1, 0.0, 2.0}, 0.1);
  Eigen::VectorXd sigmas = Eigen::VectorXd::LinSpaced(7, 0.1, 0.7);
  sigmas[2] = kEndless;
  const auto posture =
      make_posture_cost(robot_->description(), Eigen::VectorXd::Constant(7, 0.3), sigmas);
  for (const auto* cost : {&position, &whole, &orientation, &axis, &posture}) {
    ASSERT_TRUE(cost->has_value()) << cost->error().describe();
    expect_conforms(***cost, states_);
  }
  expect_conforms(*make_velocity_prior("rest", Eigen::VectorXd::Constant(7, 0.2), 0.1), states_);
  EXPECT_EQ((*position)->name(), "position_hand");
  EXPECT_EQ((*whole)->name(), "pose_hand");
  EXPECT_EQ((*orientation)->name(), "orientation_fore_arm");
}

TEST_F(TaskCosts, ConformNextToTheTarget) {
  // States a few 1e-3 rad and exactly at the target, where ratios of sines are series.
  States near{7, {}, {}, {}};
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 7; ++j) {
      near.q.push_back(0.2 * j - 0.5 + (i == 0 ? 0.0 : std::pow(10.0, -i - 1) * (j % 3 - 1)));
    }
    near.times_s.push_back(i);
  }
  near.qdot.resize(near.q.size());
  const Transform target = hand_at(near, 0);
  expect_conforms(*make_link_pose_cost(robot_, "hand", target, 0.01, 0.01).value(), near);
  const Eigen::Vector3d axis(0.2, 0.1, 1.0);
  const auto upright = axis_cost(axis, target.linear() * axis);
  expect_conforms(*upright, near);
  for (const double residual : evaluate(*upright, near.one(0)).residuals) {
    EXPECT_NEAR(residual, 0.0, 1e-12);
  }
}

TEST_F(TaskCosts, MeasureHowFarALinkIsOutsideARegion) {
  const States one = states_.one(3);
  const Eigen::Vector3d hand_m = hand_at(one, 0).translation();
  // Inside along x, at 0.2 m beyond along y, at 0.1 m short of it along z.
  const Eigen::Vector3d centre_m = hand_m + Eigen::Vector3d(0.05, -0.5, 0.4);
  const PoseFreedom region{.within_m = {0.1, 0.3, 0.3}};
  const auto cost =
      make_link_position_cost(robot_, "hand", centre_m, 0.01, region).value_or(nullptr);
  ASSERT_NE(cost, nullptr);
  const Evaluation at = evaluate(*cost, one);
  EXPECT_EQ(at.residuals[0], 0.0);
  EXPECT_NEAR(at.residuals[1], 20.0, 1e-9);
  EXPECT_NEAR(at.residuals[2], -10.0, 1e-9);
  EXPECT_GT(expect_jacobians_match_differences(*cost, one), 0);
  expect_conforms(*cost, states_);
}

TEST_F(TaskCosts, MeasureAgainstTheNearestOfSeveralTargets) {
  const States one = states_.one(3);
  const Transform hand = hand_at(one, 0);
  const auto moved = [&](const Eigen::Vector3d& by_m, double turn_rad) {
    Transform target = hand;
    target.translation() += by_m;
    target.rotate(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitZ()));
    return target;
  };
  // Near but turned, farther and turned less, far.
  const PoseFreedom others{.alternatives = {moved({0.03, 0.0, 0.0}, 0.1), moved({1, 0, 0}, 0.0)}};
  const auto cost =
      make_link_pose_cost(robot_, "hand", moved({0.0, 0.01, 0.0}, 0.9), 0.01, 0.1, others)
          .value_or(nullptr);
  ASSERT_NE(cost, nullptr);
  const Evaluation at = evaluate(*cost, one);
  EXPECT_NEAR(at.residuals[0], -3.0, 1e-9);
  EXPECT_NEAR(at.residuals[5], -1.0, 1e-9);
  EXPECT_GT(expect_jacobians_match_differences(*cost, one), 0);
  const auto* named = dynamic_cast<const NamesResiduals*>(cost.get());
  ASSERT_NE(named, nullptr);
  EXPECT_EQ(named->residual_name(0).target, "the nearest of its targets");
}

TEST_F(TaskCosts, RotationIsTheAngleFarFromTheTarget) {
  const States one = states_.one(3);
  const Transform hand = hand_at(one, 0);
  const Eigen::Vector3d about = Eigen::Vector3d(1.0, -2.0, 0.7).normalized();
  for (const double angle : {1e-9, 1e-3, 0.5, 2.0, 3.0, 3.1415}) {
    const Eigen::Matrix3d target =
        hand.linear() * Eigen::AngleAxisd(-angle, about).toRotationMatrix();
    const auto cost = make_link_orientation_cost(robot_, "hand", target, 0.5).value_or(nullptr);
    ASSERT_NE(cost, nullptr);
    const Evaluation at = evaluate(*cost, one);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(at.residuals[static_cast<std::size_t>(k)], 2.0 * angle * about[k], 1e-11)
          << angle;
    }
    EXPECT_GT(expect_jacobians_match_differences(*cost, one), 0) << angle;
  }
}

TEST_F(TaskCosts, AxisIsTheAngleUpToTheOppositeDirection) {
  const States one = states_.one(5);
  const Eigen::Vector3d hand_z = hand_at(one, 0).linear().col(2);
  for (const double angle : {1e-9, 1e-3, 0.00999, 0.0101, 1.5, 3.0, 3.14}) {
    const Eigen::Vector3d world =
        Eigen::AngleAxisd(angle, hand_z.unitOrthogonal()).toRotationMatrix() * hand_z;
    const auto cost = axis_cost(Eigen::Vector3d::UnitZ(), world);
    const Evaluation at = evaluate(*cost, one);
    EXPECT_NEAR(std::hypot(at.residuals[0], at.residuals[1]), angle / 0.1, 1e-9);
    EXPECT_GT(expect_jacobians_match_differences(*cost, one), 0) << angle;
  }
  const Evaluation opposite = evaluate(*axis_cost(Eigen::Vector3d::UnitZ(), -hand_z), one);
  EXPECT_NEAR(std::hypot(opposite.residuals[0], opposite.residuals[1]), std::numbers::pi / 0.1,
              1e-6);
  for (const double entry : opposite.jacobian_q) EXPECT_TRUE(std::isfinite(entry));
}

TEST_F(TaskCosts, AxisLeavesTheTurnAboutItFree) {
  // The base turns about the world's z: no cost changes.
  States turned = states_.one(2);
  const auto cost = axis_cost(Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ());
  const Evaluation before = evaluate(*cost, turned);
  turned.q[2] += 1.1;
  const Evaluation after = evaluate(*cost, turned);
  EXPECT_NEAR(std::hypot(before.residuals[0], before.residuals[1]),
              std::hypot(after.residuals[0], after.residuals[1]), 1e-9);
}

TEST_F(TaskCosts, PostureLeavesAJointOfInfiniteSigmaAlone) {
  Eigen::VectorXd sigmas = Eigen::VectorXd::Constant(7, 0.5);
  sigmas[0] = kEndless;
  const auto cost =
      make_posture_cost(robot_->description(), Eigen::VectorXd::Zero(7), sigmas).value_or(nullptr);
  ASSERT_NE(cost, nullptr);
  const Evaluation at = evaluate(*cost, states_.one(0));
  EXPECT_EQ(at.residuals[0], 0.0);
  EXPECT_DOUBLE_EQ(at.residuals[1], 2.0 * states_.q[1]);
}

TEST_F(TaskCosts, KeepWhatIsNotANumber) {
  States broken = states_.one(0);
  broken.q[4] = kNan;
  const auto whole = make_link_pose_cost(robot_, "hand", Transform::Identity(), 0.02, 0.05);
  for (const double residual : evaluate(**whole, broken, false).residuals) {
    EXPECT_TRUE(std::isnan(residual));
  }
  for (const double residual :
       evaluate(*axis_cost({0.0, 0.0, 1.0}, {0.0, 0.0, 1.0}), broken, false).residuals) {
    EXPECT_TRUE(std::isnan(residual));
  }
}

TEST_F(TaskCosts, SayWhatMakesNoSense) {
  const auto message = [](const Result<std::unique_ptr<StateCost>>& cost) {
    if (cost) return std::string("made");
    EXPECT_EQ(cost.error().code, ErrorCode::kInvalidArgument);
    return cost.error().message;
  };
  const Eigen::Vector3d p(0.1, 0.2, 0.3), z = Eigen::Vector3d::UnitZ();
  EXPECT_THAT(message(make_link_position_cost(robot_, "hnd", p, 0.1)),
              HasSubstr("robot 'mobile_arm' has no link 'hnd'"));
  EXPECT_THAT(message(make_link_position_cost(robot_, "hand", p, 0.0)),
              HasSubstr("position of link 'hand' must be positive"));
  EXPECT_THAT(message(make_link_position_cost(robot_, "hand", {kNan, 0, 0}, 0.1)),
              HasSubstr("position wanted of link 'hand' is not finite"));
  EXPECT_THAT(message(make_link_pose_cost(robot_, "hand", Transform::Identity(), 0.1, kNan)),
              HasSubstr("rotation of link 'hand' must be positive"));
  EXPECT_THAT(
      message(make_link_orientation_cost(robot_, "hand", 2.0 * Eigen::Matrix3d::Identity(), 0.1)),
      HasSubstr("not a rotation"));
  EXPECT_THAT(message(make_link_axis_cost(robot_, "hand", Eigen::Vector3d::Zero(), z, 0.1)),
              HasSubstr("no direction"));
  EXPECT_THAT(message(make_link_axis_cost(robot_, "hand", z, z, -1.0)), HasSubstr("axis of link"));
  const Eigen::VectorXd q = Eigen::VectorXd::Zero(7), ones = Eigen::VectorXd::Ones(7);
  EXPECT_THAT(message(make_posture_cost(robot_->description(), q.head(6), ones)),
              HasSubstr("6 positions"));
  EXPECT_THAT(message(make_posture_cost(robot_->description(), q, -ones)),
              HasSubstr("joint x must be positive"));
  EXPECT_THAT(message(make_posture_cost(robot_->description(), kNan * ones, ones)),
              HasSubstr("joint x is not finite"));
}

}  // namespace
}  // namespace sidestep
