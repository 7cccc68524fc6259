#include <sidestep/robot/attached_object.hpp>

#include <algorithm>
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/planning/costs.hpp>

#include "conformance/cost_conformance.hpp"
#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kEndless = std::numeric_limits<double>::infinity();

/// An arm of two turning links of 1 m on a base, with a hand fixed at its end and a finger that
/// turns on that.
std::unique_ptr<KinematicTree> arm_with_hand() {
  RobotDescription robot;
  robot.name = "arm";
  robot.joints = {{"shoulder", Joint::Type::kContinuous, -kEndless, kEndless, 1.0, kEndless},
                  {"elbow", Joint::Type::kContinuous, -kEndless, kEndless, 1.0, kEndless},
                  {"knuckle", Joint::Type::kContinuous, -kEndless, kEndless, 1.0, kEndless}};
  robot.links = {{"base", -1}, {"upper", 0}, {"lower", 1}, {"hand", 2}, {"finger", 3}};
  std::vector<TreeJoint> joints(5);
  const double along_m[] = {0.0, 0.0, 1.0, 1.0, 0.0};
  const int moved_by[] = {-1, 0, 1, -1, 2};
  for (std::size_t i = 0; i < 5; ++i) {
    joints[i].name = robot.links[i].name;
    joints[i].T_parent_joint.translate(Eigen::Vector3d(along_m[i], 0.0, 0.0));
    joints[i].joint = moved_by[i];
    if (moved_by[i] >= 0) joints[i].motion = TreeJoint::Motion::kRotation;
  }
  for (int link = 0; link < 5; ++link) {
    robot.spheres.push_back({link, {0.1, 0.0, 0.0}, 0.05});
  }
  return std::move(*KinematicTree::create(std::move(robot), std::move(joints)));
}

AttachedObject tray() {
  AttachedObject object{.name = "tray", .link = "hand"};
  object.T_link_object.translate(Eigen::Vector3d(0.2, 0.0, 0.0));
  object.spheres = {{{0.0, 0.3, 0.0}, 0.1}, {{0.0, -0.3, 0.0}, 0.1}};
  object.shapes.push_back({Box{{0.1, 0.8, 0.02}}, Transform::Identity()});
  return object;
}

TEST(AttachObject, MovesWithTheLinkThatHoldsIt) {
  const auto arm = arm_with_hand();
  const auto holding = attach_object(*arm, tray());
  ASSERT_TRUE(holding) << holding.error().describe();
  const RobotDescription& robot = (*holding)->description();
  ASSERT_EQ(robot.spheres.size(), 7u);
  EXPECT_EQ(robot.links.back().name, "tray");
  EXPECT_EQ(robot.shapes.back().link, 5);
  EXPECT_EQ(robot.joints.size(), 3u);

  Scratch scratch;
  std::vector<Eigen::Vector3d> centres(7);
  (*holding)->sphere_centres(std::vector<double>{0.4, 0.9, 0.0}, centres, scratch);
  const Eigen::Vector3d elbow(std::cos(0.4), std::sin(0.4), 0.0);
  const Eigen::Vector3d along(std::cos(1.3), std::sin(1.3), 0.0);
  const Eigen::Vector3d across(-along.y(), along.x(), 0.0);
  EXPECT_LT((centres[5] - (elbow + 1.2 * along + 0.3 * across)).norm(), 1e-12);
  EXPECT_LT((centres[6] - (elbow + 1.2 * along - 0.3 * across)).norm(), 1e-12);
}

TEST(AttachObject, IsCheckedAgainstLinksThatMayNotTouchIt) {
  const auto arm = arm_with_hand();
  AttachedObject object = tray();
  // The hand, and the lower arm that it is fixed to, always touch.
  EXPECT_THAT((*attach_object(*arm, object))->description().self_collision_pairs,
              ElementsAre(std::pair(0, 5), std::pair(1, 5), std::pair(4, 5)));
  object.touch_links = {"finger"};
  EXPECT_THAT((*attach_object(*arm, object))->description().self_collision_pairs,
              ElementsAre(std::pair(0, 5), std::pair(1, 5)));
}

TEST(AttachObject, IsFeltBySelfCollisionCosts) {
  const std::shared_ptr<const RobotModel> arm = arm_with_hand();
  AttachedObject object = tray();
  object.touch_links = {"finger"};
  const std::shared_ptr<const RobotModel> holding = std::move(*attach_object(*arm, object));
  EXPECT_EQ(make_self_collision_cost(arm, 0.4, 0.05)->residual_count(), 0);
  const auto cost = make_self_collision_cost(holding, 0.4, 0.05);
  EXPECT_EQ(cost->residual_count(), 2);
  // Folded back, the hand lies at the base.
  conformance::States folded = conformance::random_states(3, 20, 0.3, 1.0);
  for (std::size_t i = 0; i < 20; ++i) folded.q[3 * i + 1] += 2.9;
  conformance::expect_conforms(*cost, folded);
}

TEST(AttachObject, SaysWhatMakesNoSense) {
  const auto arm = arm_with_hand();
  const auto error = [&](const std::function<void(AttachedObject&)>& change) {
    AttachedObject object = tray();
    change(object);
    const auto attached = attach_object(*arm, object);
    return attached ? std::string("attached") : attached.error().describe();
  };
  EXPECT_THAT(error([](AttachedObject& o) { o.link = "hnd"; }), HasSubstr("no link 'hnd'"));
  EXPECT_THAT(error([](AttachedObject& o) { o.touch_links = {"thumb"}; }),
              HasSubstr("no link 'thumb'"));
  EXPECT_THAT(error([](AttachedObject& o) { o.name = "upper"; }), HasSubstr("'upper'"));
  EXPECT_THAT(error([](AttachedObject& o) { o.spheres[0].radius_m = -1.0; }), HasSubstr("radius"));
  EXPECT_THAT(error([](AttachedObject& o) { o.T_link_object.translation().x() = std::nan(""); }),
              HasSubstr("not finite"));
  const auto other = attach_object(*testing_support::mobile_arm(), tray());
  ASSERT_FALSE(other);
  EXPECT_THAT(other.error().message, HasSubstr("kinematic trees only"));
}

}  // namespace
}  // namespace sidestep
