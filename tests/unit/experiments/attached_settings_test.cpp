#include <sidestep/runtime/attached_settings.hpp>

#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/runtime/yaml_document.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A forearm and a hand, each turned by a joint about z; the hand 1 m along x.
std::shared_ptr<const RobotModel> forearm() {
  constexpr double kEndless = std::numeric_limits<double>::infinity();
  RobotDescription robot;
  robot.name = "forearm";
  robot.joints = {{"elbow", Joint::Type::kContinuous, -kEndless, kEndless, 1.0, kEndless},
                  {"wrist", Joint::Type::kContinuous, -kEndless, kEndless, 1.0, kEndless}};
  robot.links = {{"arm", -1}, {"hand", 0}};
  robot.spheres = {{0, {0.3, 0.0, 0.0}, 0.05}, {1, {0.0, 0.0, 0.0}, 0.05}};
  std::vector<TreeJoint> joints(2);
  for (std::size_t i = 0; i < 2; ++i) {
    joints[i].name = robot.joints[i].name;
    joints[i].motion = TreeJoint::Motion::kRotation;
    joints[i].joint = static_cast<int>(i);
  }
  joints[1].T_parent_joint.translate(Eigen::Vector3d(1.0, 0.0, 0.0));
  return std::move(*KinematicTree::create(std::move(robot), std::move(joints)));
}

class AttachedSettings : public testing::Test {
 protected:
  std::shared_ptr<const RobotModel> read(const std::string& text) {
    std::vector<Error> errors;
    const auto node = parse_yaml(text, "plan.yaml", errors);
    EXPECT_TRUE(node && errors.empty()) << text;
    auto carrying = read_attached(node.value_or(Node()), robot_, errors);
    errors_.clear();
    for (const Error& error : errors) {
      EXPECT_EQ(error.code, ErrorCode::kConfig);
      errors_.push_back(error.describe());
    }
    return carrying;
  }

  std::shared_ptr<const RobotModel> robot_ = forearm();
  std::vector<std::string> errors_;
};

TEST_F(AttachedSettings, LeaveTheRobotAloneWhereNothingIsAttached) {
  EXPECT_EQ(read("name: nothing"), robot_);
  EXPECT_EQ(read("attached: []"), robot_);
  EXPECT_THAT(errors_, IsEmpty());
}

TEST_F(AttachedSettings, PutSpheresOnTheLinkThatHoldsThem) {
  const auto carrying = read(
      "attached:\n- link: hand\n  name: rod\n  position_m: [0.1, 0, 0]\n"
      "  rpy_rad: [0, 0, 1.5707963267948966]\n"
      "  spheres: [{centre_m: [0.2, 0, 0], radius_m: 0.04}, {radius_m: 0.03}]\n");
  ASSERT_THAT(errors_, IsEmpty());
  const RobotDescription& robot = carrying->description();
  EXPECT_EQ(robot.links.back().name, "rod");
  ASSERT_EQ(robot.spheres.size(), 4u);
  EXPECT_EQ(robot.spheres[2].radius_m, 0.04);
  EXPECT_EQ(robot.shapes.size(), 2u);
  EXPECT_THAT(robot.self_collision_pairs, ElementsAre(std::pair(0, 2)));
  // Both joints turned by a quarter: the hand is at (0, 1) and points to -x; the rod, turned by
  // another quarter, lies from 0.1 m before it towards -y.
  const std::vector<double> q = {M_PI / 2, M_PI / 2};
  std::vector<Eigen::Vector3d> centres(4);
  Scratch scratch;
  carrying->sphere_centres(q, centres, scratch);
  EXPECT_LT((centres[2] - Eigen::Vector3d(-0.1, 0.8, 0.0)).norm(), 1e-12);
  EXPECT_LT((centres[3] - Eigen::Vector3d(-0.1, 1.0, 0.0)).norm(), 1e-12);
}

TEST_F(AttachedSettings, RefuseAShapeThatTakesTooManySpheres) {
  (void)read(
      "attached:\n- {link: hand, name: crate, protrusion_m: 0.001, boxes: [{size_m: [1, 1, "
      "1]}]}\n");
  EXPECT_THAT(errors_,
              ElementsAre(HasSubstr("plan.yaml:2:3: object 'crate': more than 2000 spheres are "
                                    "needed to cover a box so that none stands out by more than "
                                    "0.001 m (allow it a larger `protrusion_m`)")));
}

TEST_F(AttachedSettings, CoverBoxesAndCylindersWithSpheres) {
  const auto carrying = read(
      "attached:\n- link: hand\n  protrusion_m: 0.01\n"
      "  boxes: [{size_m: [0.3, 0.1, 0.02], position_m: [0, 0, 0.2]}]\n"
      "  cylinders: [{radius_m: 0.03, length_m: 0.2, rpy_rad: [1.5707963267948966, 0, 0]}]\n"
      "  touch_links: [arm]\n");
  ASSERT_THAT(errors_, IsEmpty());
  const RobotDescription& robot = carrying->description();
  EXPECT_THAT(robot.self_collision_pairs, IsEmpty());
  const auto is_covered = [&](const Eigen::Vector3d& p) {
    for (const CollisionSphere& sphere : robot.spheres) {
      if (sphere.link == 2 && (sphere.centre_link_m - p).norm() <= sphere.radius_m) return true;
    }
    return false;
  };
  for (int i = 0; i <= 20; ++i) {
    const double share = i / 20.0 - 0.5;
    for (const double side : {-0.5, 0.5}) {
      const Eigen::Vector3d edge(0.3 * share, 0.1 * side, 0.2 + 0.02 * side);
      EXPECT_TRUE(is_covered(edge)) << edge.transpose();
      const Eigen::Vector3d rim(0.06 * side, 0.2 * share, 0.0);
      EXPECT_TRUE(is_covered(rim)) << rim.transpose();
    }
  }
  EXPECT_FALSE(is_covered({0.0, 0.0, 0.1}));
}

TEST_F(AttachedSettings, HoldOneObjectByAnother) {
  const auto carrying = read(
      "attached:\n- {name: tray, link: hand, spheres: [{radius_m: 0.1}]}\n"
      "- {name: cup, link: tray, position_m: [0, 0, 0.1], spheres: [{radius_m: 0.05}]}\n");
  ASSERT_THAT(errors_, IsEmpty());
  EXPECT_EQ(carrying->description().links.back().parent, 2);
}

TEST_F(AttachedSettings, BecomeAFrameWhereTheyAreToBe) {
  const auto carrying =
      read("attached: [{name: tip, link: hand, position_m: [0, 0, 0.2], frame_only: true}]");
  ASSERT_THAT(errors_, IsEmpty());
  const RobotDescription& description = carrying->description();
  EXPECT_EQ(description.links.back().name, "tip");
  EXPECT_EQ(description.spheres.size(), robot_->description().spheres.size());
  EXPECT_EQ(description.self_collision_pairs, robot_->description().self_collision_pairs);
  (void)read("attached: [{link: hand, frame_only: true, spheres: [{radius_m: 0.1}]}]");
  ASSERT_EQ(errors_.size(), 1u);
  EXPECT_THAT(errors_[0], HasSubstr("is a frame alone, and has an extent"));
}

TEST_F(AttachedSettings, SayWhereAnObjectIsWrong) {
  const auto carrying = read(
      "attached:\n"
      "- {link: hnd, spheres: [{radius_m: 0.1}], touch_links: [arm, am]}\n"
      "- {link: hand}\n"
      "- {name: arm, link: hand, spheres: [{radius_m: 0.1}]}\n"
      "- {name: \"\", link: hand, spheres: [{radius_m: 0.1}]}\n");
  EXPECT_EQ(carrying, robot_);
  ASSERT_EQ(errors_.size(), 5u);
  EXPECT_EQ(errors_[0], "plan.yaml:2:10: robot 'forearm' has no link 'hnd' (did you mean 'hand'?)");
  EXPECT_EQ(errors_[1], "plan.yaml:2:62: robot 'forearm' has no link 'am' (did you mean 'arm'?)");
  EXPECT_THAT(errors_[2], HasSubstr("plan.yaml:3:3: object 'object' has no extent"));
  EXPECT_THAT(errors_[3], HasSubstr("plan.yaml:4:10: robot 'forearm' has a link 'arm' already"));
  EXPECT_THAT(errors_[4], HasSubstr("plan.yaml:5:10: an attached object's name is empty"));
}

TEST_F(AttachedSettings, SayWhereTheRobotCannotCarryAnything) {
  robot_ = testing_support::mobile_arm();
  EXPECT_EQ(read("attached: [{link: hand, spheres: [{radius_m: 0.1}]}]"), robot_);
  ASSERT_EQ(errors_.size(), 1u);
  EXPECT_THAT(errors_[0], HasSubstr("plan.yaml:1:12: objects can be attached to kinematic trees"));
}

TEST_F(AttachedSettings, PassOverWhatTheirSchemaRefuses) {
  EXPECT_EQ(read("attached: [{spheres: [{radius_m: 0.1}]}, 3, {link: hand, spheres: [{}]}]"),
            robot_);
  EXPECT_THAT(errors_, IsEmpty());
}

}  // namespace
}  // namespace sidestep
