#include <algorithm>
#include <limits>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "../conversions.hpp"

namespace sidestep::ros_messages {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Stamp time_s(double seconds) { return Stamp::from_seconds(seconds); }

Transform turned(double yaw_rad, const Eigen::Vector3d& translation_m) {
  return transform_from_xyz_rpy(translation_m, {0.0, 0.0, yaw_rad});
}

/// A base that drives at 1 m/s along x and turns at 0.5 rad/s; a head that nods; a camera on it.
Transform T_map_base(double t) { return turned(0.5 * t, {t, 2.0, 0.0}); }
Transform T_base_head(double t) {
  return transform_from_xyz_rpy({0.1, 0.0, 1.0 + 0.2 * t}, {0.0, -0.3 * t, 0.0});
}
const Transform kT_head_camera = transform_from_xyz_rpy({0.05, 0.02, 0.1}, {-1.57, 0.0, -1.57});

struct Told {
  std::string parent;
  std::string child;
  double t;
};

/// Everything that tf says of that robot in [0, 2] s, ten times a second.
std::vector<Told> all_told() {
  std::vector<Told> told;
  for (int i = 0; i <= 20; ++i) {
    told.push_back({"map", "base", 0.1 * i});
    told.push_back({"base", "head", 0.1 * i});
  }
  return told;
}

void tell(const Told& told, TfTree& tree) {
  const Transform pose = told.child == "base" ? T_map_base(told.t) : T_base_head(told.t);
  EXPECT_TRUE(tree.add(told.parent, told.child, time_s(told.t), rigid_pose(pose)));
}

TfTree robot() {
  TfTree tree;
  for (const Told& told : all_told()) tell(told, tree);
  EXPECT_TRUE(tree.add_static("head", "camera", rigid_pose(kT_head_camera)));
  return tree;
}

double distance(const Transform& a, const Transform& b) {
  return (a.matrix() - b.matrix()).cwiseAbs().maxCoeff();
}

LookupFailure failure(const TfTree& tree, const char* target, const char* source, double t,
                      double max_gap_s) {
  const auto found = tree.lookup(target, source, time_s(t), max_gap_s);
  EXPECT_FALSE(found);
  return found ? LookupFailure{} : found.error();
}

/// The motion is uniform between samples, so that linear and slerp are exact.
TEST(TfTree, FollowsTheMotionBetweenTransforms) {
  const TfTree tree = robot();
  for (const double t : {0.0, 0.03, 0.77, 1.25, 2.0}) {
    const auto found = tree.lookup("map", "camera", time_s(t), 0.1);
    ASSERT_TRUE(found) << found.error().message;
    EXPECT_LT(distance(*found, T_map_base(t) * T_base_head(t) * kT_head_camera), 1e-9) << t;
  }
}

TEST(TfTree, GoesDownAndAcrossAsWell) {
  TfTree tree = robot();
  const Transform T_base_lidar = turned(0.7, {0.2, 0.0, 0.3});
  tree.add_static("base", "lidar", rigid_pose(T_base_lidar));
  const Transform expected = T_base_lidar.inverse() * T_base_head(0.5) * kT_head_camera;
  EXPECT_LT(distance(tree.lookup("lidar", "camera", time_s(0.5), 0.1).value(), expected), 1e-9);
  EXPECT_LT(distance(tree.lookup("camera", "lidar", time_s(0.5), 0.1).value(), expected.inverse()),
            1e-9);
  EXPECT_LT(distance(tree.lookup("camera", "base", time_s(0.5), 0.1).value(),
                     (T_base_head(0.5) * kT_head_camera).inverse()),
            1e-9);
  EXPECT_EQ(tree.lookup("head", "head", time_s(99.0), 0.0).value().matrix(),
            Transform::Identity().matrix());
}

/// What lies above both frames is not needed, and may be missing.
TEST(TfTree, NeedsOnlyWhatLiesBetweenTheFrames) {
  TfTree tree = robot();
  tree.add("earth", "map", time_s(50.0), {});
  EXPECT_TRUE(tree.lookup("map", "camera", time_s(1.0), 0.1));
  EXPECT_TRUE(tree.lookup("head", "camera", time_s(99.0), 0.1));
}

TEST(TfTree, DoesNotDependOnTheOrderOfTransforms) {
  const TfTree ordered = robot();
  for (unsigned seed = 0; seed < 5; ++seed) {
    auto told = all_told();
    std::shuffle(told.begin(), told.end(), std::mt19937(seed));
    TfTree tree;
    tree.add_static("head", "camera", rigid_pose(kT_head_camera));
    for (const Told& one : told) tell(one, tree);
    for (const double t : {0.01, 0.5, 1.99}) {
      EXPECT_EQ(tree.lookup("map", "camera", time_s(t), 0.1).value().matrix(),
                ordered.lookup("map", "camera", time_s(t), 0.1).value().matrix());
    }
  }
}

TEST(TfTree, SaysWhyItDoesNotKnow) {
  TfTree tree = robot();
  tree.add("odom", "other_base", time_s(1.0), {});
  EXPECT_EQ(failure(tree, "map", "camera", -0.1, 0.1).fault, LookupFault::kTooEarly);
  const LookupFailure late = failure(tree, "map", "camera", 2.1, 0.1);
  EXPECT_EQ(late.fault, LookupFault::kTooLate);
  EXPECT_THAT(late.message, AllOf(HasSubstr("'head'"), HasSubstr("2.000000 s")));
  EXPECT_EQ(failure(tree, "map", "camera", 0.55, 0.09).fault, LookupFault::kGap);
  const LookupFailure unknown = failure(tree, "map", "gripper", 0.5, 0.1);
  EXPECT_EQ(unknown.fault, LookupFault::kUnknown);
  EXPECT_THAT(unknown.message, HasSubstr("'gripper'"));
  const LookupFailure apart = failure(tree, "odom", "camera", 0.5, 0.1);
  EXPECT_EQ(apart.fault, LookupFault::kNotConnected);
  EXPECT_THAT(apart.message, AllOf(HasSubstr("'camera'"), HasSubstr("'odom'")));
  EXPECT_THAT(tree.roots(), ElementsAre("map", "odom"));
  EXPECT_TRUE(tree.missing_path("odom", "camera"));
  EXPECT_FALSE(tree.missing_path("camera", "map"));
}

TEST(TfTree, IsNotFooledByCircles) {
  TfTree tree;
  tree.add("a", "b", time_s(1.0), {});
  tree.add("b", "a", time_s(1.0), {});
  tree.add("map", "c", time_s(1.0), {});
  EXPECT_EQ(failure(tree, "map", "a", 1.0, 1.0).fault, LookupFault::kNotConnected);
  EXPECT_TRUE(tree.lookup("a", "b", time_s(1.0), 1.0));
  EXPECT_FALSE(tree.add("a", "a", time_s(2.0), {})) << "a frame below itself";
  EXPECT_FALSE(tree.add("", "a", time_s(2.0), {}));
}

/// A cup that is handed from one arm to the other.
TEST(TfTree, TakesNoFrameAcrossAChangeOfItsParent) {
  TfTree tree;
  tree.add_static("base", "left", rigid_pose(turned(0.0, {0.0, 1.0, 0.0})));
  tree.add_static("base", "right", rigid_pose(turned(0.0, {0.0, -1.0, 0.0})));
  tree.add("left", "cup", time_s(1.0), {});
  tree.add("left", "cup", time_s(2.0), {});
  tree.add("right", "cup", time_s(3.0), {});
  EXPECT_EQ(tree.lookup("base", "cup", time_s(1.5), 1.0).value().translation().y(), 1.0);
  EXPECT_EQ(tree.lookup("base", "cup", time_s(3.0), 1.0).value().translation().y(), -1.0);
  const LookupFailure between = failure(tree, "base", "cup", 2.5, 1.0);
  EXPECT_EQ(between.fault, LookupFault::kReparented);
  EXPECT_THAT(between.message, AllOf(HasSubstr("'left'"), HasSubstr("'right'")));
}

TEST(TfTree, KeepsTheFirstOfTwoTransformsOfOneStamp) {
  TfTree tree;
  EXPECT_TRUE(tree.add("map", "base", time_s(1.0), rigid_pose(turned(0.0, {1.0, 0.0, 0.0}))));
  EXPECT_FALSE(tree.add("map", "base", time_s(1.0), rigid_pose(turned(0.0, {5.0, 0.0, 0.0}))));
  EXPECT_EQ(tree.lookup("map", "base", time_s(1.0), 0.0).value().translation().x(), 1.0);
}

TEST(TfTree, ReadsMessagesWithTheSlashOfOldNames) {
  TfMessage message;
  message.transforms.push_back(
      to_transform(rigid_pose(turned(0.3, {1.0, 2.0, 3.0})), time_s(4.0), "/map", "/base"));
  TfTree tree;
  EXPECT_EQ(add_transforms(message, false, tree), 0);
  EXPECT_LT(
      distance(tree.lookup("map", "/base", time_s(4.0), 0.0).value(), turned(0.3, {1.0, 2.0, 3.0})),
      1e-15);
}

TEST(TfTree, CountsTheTransformsThatAreNone) {
  TfMessage message;
  for (int i = 0; i < 4; ++i) {
    message.transforms.push_back(to_transform({}, time_s(i), "map", "base"));
  }
  message.transforms[0].transform.rotation.w = 0.0;
  message.transforms[1].transform.translation.y = std::numeric_limits<double>::quiet_NaN();
  message.transforms[2].transform.rotation.z = std::numeric_limits<double>::infinity();
  TfTree tree;
  EXPECT_EQ(add_transforms(message, false, tree), 3);
  EXPECT_TRUE(tree.lookup("map", "base", time_s(3.0), 0.0));
}

TEST(TfTree, ForgetsWhatIsNoLongerNeeded) {
  TfTree tree = robot();
  const auto before = tree.lookup("map", "camera", time_s(1.55), 0.1).value().matrix();
  tree.forget_before(time_s(1.55));
  EXPECT_EQ(tree.lookup("map", "camera", time_s(1.55), 0.1).value().matrix(), before);
  EXPECT_EQ(failure(tree, "map", "camera", 1.45, 0.1).fault, LookupFault::kTooEarly);
}

/// Of two opposite quaternions of one rotation the way between them is the short one.
TEST(RigidPose, TurnsTheShortWay) {
  const RigidPose a = rigid_pose(turned(0.2, {0.0, 0.0, 0.0}));
  RigidPose b = rigid_pose(turned(0.4, {0.0, 0.0, 0.0}));
  b.rotation.coeffs() = -b.rotation.coeffs();
  EXPECT_LT(distance(interpolate(a, b, 0.5).transform(), turned(0.3, {0.0, 0.0, 0.0})), 1e-12);
}

TEST(Stamps, OutsideOfWhatRosCanWriteAreTheNearest) {
  EXPECT_EQ(to_stamp(to_ros_time(Stamp{1'600'000'000'123'456'789})).ns, 1'600'000'000'123'456'789);
  EXPECT_EQ(to_stamp(to_ros_time(Stamp{-5})).ns, 0);
  EXPECT_EQ(to_stamp(to_ros_time(Stamp{std::numeric_limits<std::int64_t>::max()})).ns,
            0xffffffffLL * 1'000'000'000);
}

}  // namespace
}  // namespace sidestep::ros_messages
