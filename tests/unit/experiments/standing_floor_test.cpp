#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sidestep/robot/kinematic_tree.hpp>
#include <sidestep/runtime/standing_floor.hpp>
#include <sidestep/runtime/task_settings.hpp>

namespace sidestep {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// A chain of links, each of which has a ball, and is moved by a joint of its own or is fixed.
class ChainMaker {
 public:
  ChainMaker() { robot_.name = "chain"; }

  ChainMaker& add(const std::string& name, TreeJoint::Motion motion, const Eigen::Vector3d& axis,
                  Joint::Type type = Joint::Type::kPrismatic) {
    TreeJoint joint{name};
    joint.motion = motion;
    joint.axis = axis;
    if (motion != TreeJoint::Motion::kFixed) {
      joint.joint = robot_.dof();
      const bool is_endless = type == Joint::Type::kContinuous;
      robot_.joints.push_back(
          {name, type, is_endless ? -INFINITY : -1.0, is_endless ? INFINITY : 1.0, 1.0, 1.0});
    }
    return add(joint);
  }
  ChainMaker& add(const TreeJoint& joint) {
    const int link = static_cast<int>(robot_.links.size());
    robot_.links.push_back({joint.name, link - 1});
    robot_.spheres.push_back({link, Eigen::Vector3d::Zero(), 0.1});
    joints_.push_back(joint);
    return *this;
  }
  /// tilt: of each axis against where it belongs.
  ChainMaker& drive(Joint::Type turning = Joint::Type::kContinuous, double tilt = 0.0) {
    return add("world", TreeJoint::Motion::kFixed, Eigen::Vector3d::UnitZ())
        .add("x", TreeJoint::Motion::kTranslation, Eigen::Vector3d(1.0, 0.0, tilt).normalized())
        .add("y", TreeJoint::Motion::kTranslation, Eigen::Vector3d(0.0, 1.0, tilt).normalized())
        .add("t", TreeJoint::Motion::kRotation, Eigen::Vector3d(tilt, 0.0, 1.0).normalized(),
             turning);
  }
  [[nodiscard]] std::shared_ptr<const RobotModel> robot() const {
    auto tree = KinematicTree::create(robot_, joints_);
    EXPECT_TRUE(tree) << tree.error().describe();
    return std::shared_ptr<const RobotModel>(std::move(*tree));
  }

 private:
  RobotDescription robot_;
  std::vector<TreeJoint> joints_;
};

const Eigen::Vector3d kUp = Eigen::Vector3d::UnitZ();
constexpr auto kRotation = TreeJoint::Motion::kRotation;
constexpr auto kTranslation = TreeJoint::Motion::kTranslation;

TEST(StandingFloor, IsThereForWhatAPlannedJointRaises) {
  TreeJoint tilted{"tilted"};  // fixed, a quarter turn about x: its y is the vertical
  tilted.T_parent_joint.rotate(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()));
  const auto robot = ChainMaker()
                         .drive()
                         .add(tilted)
                         .add("pan", kRotation, Eigen::Vector3d::UnitY(), Joint::Type::kRevolute)
                         .add("lift", kTranslation, Eigen::Vector3d::UnitY())
                         .add("hand", TreeJoint::Motion::kFixed, kUp)
                         .robot();
  const auto floor = standing_floor(*robot);
  ASSERT_TRUE(floor);
  EXPECT_EQ(floor->height_m, 0.0);
  EXPECT_THAT(floor->except_links, ElementsAre("world", "x", "y", "t", "tilted", "pan"));
}

/// Lifts have 1 m either way, and balls a radius of 0.1 m.
TEST(StandingFloor, KeepsNobodyFromWhatIsAboveItWhereverTheJointsAre) {
  const auto clear_links = [](double height_m) {
    TreeJoint column{"column"};
    column.T_parent_joint.translation().z() = height_m;
    const auto robot = ChainMaker()
                           .drive()
                           .add(column)
                           .add("lift", kTranslation, kUp)
                           .add("pan", kRotation, kUp, Joint::Type::kRevolute)
                           .add("tilt", kRotation, Eigen::Vector3d::UnitY(), Joint::Type::kRevolute)
                           .robot();
    PlanningSettings planning;
    stand_on_floor(planning, *robot);
    EXPECT_THAT(planning.floor->except_links, ElementsAre("world", "x", "y", "t", "column"));
    return planning.floor->clear_links;
  };
  EXPECT_THAT(clear_links(1.11), ElementsAre("lift", "pan"));
  EXPECT_THAT(clear_links(1.09), ElementsAre());
}

TEST(StandingFloor, SeesAJointThatIsHeldAtAnAngle) {
  TreeJoint held{"held"};  // turned about x by a quarter, so that what slides along y rises
  held.motion = kRotation;
  held.axis = Eigen::Vector3d::UnitX();
  held.offset = M_PI / 2;
  const auto robot = ChainMaker()
                         .drive()
                         .add(held)
                         .add("level", kTranslation, kUp)
                         .add("rising", kTranslation, Eigen::Vector3d::UnitY())
                         .robot();
  const auto floor = standing_floor(*robot);
  ASSERT_TRUE(floor);
  EXPECT_THAT(floor->except_links, ElementsAre("world", "x", "y", "t", "held", "level"));
}

TEST(StandingFloor, IsThereForABaseThatTurnsWithinLimits) {
  const auto robot =
      ChainMaker().drive(Joint::Type::kRevolute).add("lift", kTranslation, kUp).robot();
  const auto floor = standing_floor(*robot);
  ASSERT_TRUE(floor);
  EXPECT_THAT(floor->except_links, ElementsAre("world", "x", "y", "t"));
}

TEST(StandingFloor, IsThereForABaseWhoseAxesAreRounded) {
  const auto with_tilt = [](double tilt) {
    return ChainMaker()
        .drive(Joint::Type::kContinuous, tilt)
        .add("lift", kTranslation, kUp)
        .robot();
  };
  for (const double tilt : {1e-8, 1e-6, 9e-5}) {
    const auto floor = standing_floor(*with_tilt(tilt));
    ASSERT_TRUE(floor) << tilt;
    EXPECT_THAT(floor->except_links, ElementsAre("world", "x", "y", "t")) << tilt;
  }
  for (const double tilt : {2e-4, 1e-2}) EXPECT_FALSE(standing_floor(*with_tilt(tilt))) << tilt;
}

TEST(StandingFloor, IsNoneWhereNothingCanFallIntoIt) {
  EXPECT_FALSE(standing_floor(*ChainMaker().drive().robot()));  // moves in the plane alone
  const auto on_a_table = ChainMaker()
                              .add("turn", kRotation, kUp, Joint::Type::kContinuous)
                              .add("lift", kTranslation, kUp)
                              .robot();
  EXPECT_FALSE(standing_floor(*on_a_table));
  const auto crane = ChainMaker()
                         .add("x", kTranslation, Eigen::Vector3d::UnitX())
                         .add("y", kTranslation, Eigen::Vector3d::UnitY())
                         .add("z", kTranslation, kUp)
                         .add("turn", kRotation, kUp, Joint::Type::kContinuous)
                         .robot();
  EXPECT_FALSE(standing_floor(*crane));
}

TEST(StandingFloor, GivesWayToTheOneThatIsGiven) {
  const auto robot = ChainMaker().drive().add("lift", kTranslation, kUp).robot();
  PlanningSettings planning;
  planning.floor.emplace().height_m = -100.0;
  stand_on_floor(planning, *robot);
  EXPECT_EQ(planning.floor->height_m, -100.0);
  planning.floor.reset();
  stand_on_floor(planning, *robot);
  ASSERT_TRUE(planning.floor);
  EXPECT_EQ(planning.floor->height_m, 0.0);
}

/// A base that a plan leaves where it is stands on the floor, too.
TEST(StandingFloor, IsUnderABaseThatIsHeld) {
  ChainMaker held;
  held.add("world", TreeJoint::Motion::kFixed, kUp);
  for (const int axis : {0, 1, 2}) {
    TreeJoint joint{"base_" + std::to_string(axis)};
    joint.motion = axis == 2 ? TreeJoint::Motion::kRotation : TreeJoint::Motion::kTranslation;
    joint.axis = Eigen::Vector3d::Unit(axis);
    joint.offset = 0.3;
    held.add(joint);
  }
  const auto robot =
      held.add("arm", TreeJoint::Motion::kRotation, Eigen::Vector3d::UnitY()).robot();
  const auto floor = standing_floor(*robot);
  ASSERT_TRUE(floor);
  EXPECT_THAT(floor->except_links, ElementsAre("world", "base_0", "base_1", "base_2"));
}

TEST(StandingFloor, RefusesATargetBelowIt) {
  Task task;
  std::optional<FloorEntry> floor;
  floor.emplace().except_links = {"base"};
  EXPECT_EQ(target_below_floor(task, floor), "");
  task.target = EndEffectorEntry{{.position_m = {1.0, 1.0, -0.03}}, "hand"};
  EXPECT_EQ(target_below_floor(task, floor), "hand is to be 0.030 m below the floor");
  EXPECT_EQ(target_below_floor(task, std::nullopt), "");
  task.target->link = "base";
  EXPECT_EQ(target_below_floor(task, floor), "");
  task.target = EndEffectorEntry{{.position_m = {1.0, 1.0, 0.03}}, "hand"};
  EXPECT_EQ(target_below_floor(task, floor), "");
}

}  // namespace
}  // namespace sidestep
