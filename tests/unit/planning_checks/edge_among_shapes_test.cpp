#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/motion_check.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "support/chain_robot.hpp"

namespace sidestep {
namespace {

constexpr double kEdgeMargin_m = 0.01;
constexpr double kEdgeResolution_m = 0.005;
constexpr int kEdgeSamples = 400;

SceneObject edge_object(Shape shape, const Eigen::Vector3d& xyz_m, const Eigen::Vector3d& turn) {
  SceneObject made;
  made.name = "object";
  made.shape = std::move(shape);
  Transform pose = Transform::Identity();
  pose.translation() = xyz_m;
  pose.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  made.waypoints = {{0.0, pose}};
  return made;
}

/// Two of every shape, anywhere in the room.
Scene edge_scene(std::mt19937& random) {
  std::uniform_real_distribution<double> across(-1.7, 1.7), up(0.0, 1.5), size(0.1, 0.6);
  std::vector<SceneObject> objects;
  for (int i = 0; i < 10; ++i) {
    const Shape shapes[] = {Box{{size(random), size(random), size(random)}},
                            Cylinder{0.5 * size(random), size(random)}, Sphere{0.5 * size(random)},
                            Capsule{0.3 * size(random), size(random)},
                            indexed_mesh(triangulate(Box{{0.4, 0.2, 0.3}}))};
    objects.push_back(edge_object(shapes[i % 5], {across(random), across(random), up(random)},
                                  {across(random), across(random), up(random) + 0.1}));
  }
  objects.push_back(edge_object(HalfSpace{}, {0.0, 0.0, -0.2}, {1e-3, 0.0, 0.0}));
  return Scene(std::move(objects));
}

/// A chain of six turning joints whose axes are as askew as an arm's.
std::shared_ptr<testing_support::ChainRobot> edge_arm() {
  using testing_support::ChainRobot;
  RobotDescription d;
  std::vector<ChainRobot::Step> steps;
  for (int i = 0; i < 6; ++i) {
    const std::string name = "link" + std::to_string(i);
    d.links.push_back({name, i - 1});
    d.joints.push_back({"joint" + std::to_string(i), Joint::Type::kRevolute, -3.0, 3.0, 1.0, 1.0});
    ChainRobot::Step step;
    step.offset_m = i == 0 ? Eigen::Vector3d(0.0, 0.0, 0.1) : Eigen::Vector3d(0.05, 0.02, 0.22);
    step.axis = i % 2 == 0 ? Eigen::Vector3d::UnitZ() : Eigen::Vector3d(0.6, 0.8, 0.0);
    step.joint = i;
    steps.push_back(step);
    for (int s = 0; s < 3; ++s) {
      d.spheres.push_back({i, Eigen::Vector3d(0.01 * s, 0.0, 0.07 * s), 0.05 + 0.01 * s});
    }
  }
  d.self_collision_pairs = {{0, 3}, {0, 4}, {0, 5}, {1, 4}, {1, 5}, {2, 5}};
  return std::make_shared<ChainRobot>(std::move(d), std::move(steps));
}

/// Clearance from the definitions: the scene's own distance, point by point.
struct EdgeOracle {
  const RobotModel& robot;
  const Scene& scene;
  const Eigen::AlignedBox3d& bounds;
  SpacePolicy space;
  Scratch scratch = {};
  std::vector<Eigen::Vector3d> centres = {};

  double least_m(std::span<const double> q) {
    const RobotDescription& d = robot.description();
    centres.resize(d.spheres.size());
    robot.sphere_centres(q, centres, scratch);
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t s = 0; s < d.spheres.size(); ++s) {
      const double radius = d.spheres[s].radius_m;
      const std::string& link = d.links[static_cast<std::size_t>(d.spheres[s].link)].name;
      if (space.floor && link != space.floor->except_links.at(0)) {
        least = std::min(least, centres[s].z() - radius - space.floor->height_m - kEdgeMargin_m);
      }
      if (!bounds.contains(centres[s])) {
        if (space.outside == Space::kOccupied) least = -1.0;
        continue;
      }
      least = std::min(least,
                       scene.signed_distance(centres[s], 0.0).distance_m - radius - kEdgeMargin_m);
    }
    for (const auto& [first, second] : d.self_collision_pairs) {
      for (std::size_t a = 0; a < d.spheres.size(); ++a) {
        for (std::size_t b = 0; b < d.spheres.size(); ++b) {
          if (d.spheres[a].link != first || d.spheres[b].link != second) continue;
          least = std::min(least, (centres[a] - centres[b]).norm() - d.spheres[a].radius_m -
                                      d.spheres[b].radius_m);
        }
      }
    }
    return least;
  }
};

struct EdgeCase {
  const char* name;
  SpacePolicy space;
  bool is_mobile;
  double reach;  ///< Length of an edge, as a share of the way to another random configuration.
};

void PrintTo(const EdgeCase& edge, std::ostream* out) { *out << edge.name; }

class EdgeAmongShapes : public testing::TestWithParam<EdgeCase> {
 protected:
  EdgeAmongShapes() {
    if (GetParam().is_mobile) {
      robot_ = testing_support::mobile_arm();
    } else {
      robot_ = edge_arm();
    }
  }
  Eigen::VectorXd any_configuration() {
    std::uniform_real_distribution<double> unit(-1.0, 1.0);
    Eigen::VectorXd q(robot_->description().dof());
    for (Eigen::Index j = 0; j < q.size(); ++j) q[j] = 2.0 * unit(random_);
    if (GetParam().is_mobile) {
      q.head(2) *= 0.7;
      q[3] = 0.2 + 0.2 * unit(random_);
    }
    return q;
  }

  std::shared_ptr<testing_support::ChainRobot> robot_;
  std::mt19937 random_{11};
};

TEST_P(EdgeAmongShapes, IsClearWhereDenseSamplingSaysSo) {
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d(-1.3, -1.3, -0.5),
                                   Eigen::Vector3d(1.3, 1.3, 1.6));
  int clear = 0, blocked = 0, wrongly_blocked = 0;
  std::optional<MotionCheck> check;  // one for all scenes
  for (int w = 0; w < 8; ++w) {
    const Scene scene = edge_scene(random_);
    const auto field = std::make_shared<const SceneField>(scene, Stamp(), bounds);
    if (check) {
      check->look_at(field, GetParam().space, kEdgeMargin_m);
    } else {
      check.emplace(robot_, field, GetParam().space, kEdgeMargin_m);
    }
    EdgeOracle oracle{*robot_, scene, bounds, GetParam().space};
    for (int i = 0; i < 80; ++i) {
      const Eigen::VectorXd from = any_configuration();
      const Eigen::VectorXd to = from + GetParam().reach * (any_configuration() - from);
      const std::span<const double> q_from(from.data(), static_cast<std::size_t>(from.size()));
      const double at_start_m = oracle.least_m(q_from);
      EXPECT_EQ(check->is_clear(q_from), at_start_m >= 0.0) << at_start_m;
      if (at_start_m < 0.0) continue;
      double least_m = at_start_m;
      for (int k = 1; k <= kEdgeSamples && least_m >= 0.0; ++k) {
        const Eigen::VectorXd q = from + static_cast<double>(k) / kEdgeSamples * (to - from);
        least_m = std::min(least_m, oracle.least_m({q.data(), q_from.size()}));
      }
      if (check->is_clear(q_from, {to.data(), q_from.size()}, kEdgeResolution_m)) {
        ++clear;
        ASSERT_GE(least_m, 0.0) << from.transpose() << " to " << to.transpose();
      } else {
        ++blocked;
        if (least_m > kEdgeResolution_m) ++wrongly_blocked;
      }
    }
  }
  EXPECT_GE(clear, 30);
  EXPECT_GE(blocked, 30);
  // Near the bounds of the field: shapes beyond them, and the border itself.
  EXPECT_LE(wrongly_blocked, GetParam().space.outside == Space::kFree ? 8 : 2);
}

TEST_P(EdgeAmongShapes, BlocksWhatTheDefinitionsBlockEightAtOnce) {
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d(-1.3, -1.3, -0.5),
                                   Eigen::Vector3d(1.3, 1.3, 1.6));
  const auto dof = static_cast<std::size_t>(robot_->description().dof());
  int clear = 0, blocked = 0;
  for (int w = 0; w < 6; ++w) {
    const Scene scene = edge_scene(random_);
    const auto field = std::make_shared<const SceneField>(scene, Stamp(), bounds);
    MotionCheck check(robot_, field, GetParam().space, kEdgeMargin_m);
    EdgeOracle oracle{*robot_, scene, bounds, GetParam().space};
    for (std::size_t i = 0; i < 80; ++i) {
      const std::size_t count = 1 + i % kLanes;
      std::vector<double> q;
      for (std::size_t k = 0; k < count; ++k) {
        const Eigen::VectorXd any = any_configuration();
        q.insert(q.end(), any.data(), any.data() + any.size());
      }
      const unsigned found = check.find_blocked(q);
      EXPECT_EQ(found >> count, 0u);
      for (std::size_t k = 0; k < count; ++k) {
        const double least_m = oracle.least_m(std::span<const double>(q).subspan(k * dof, dof));
        EXPECT_EQ((found >> k & 1u) != 0, least_m < 0.0) << least_m;
        ++(least_m < 0.0 ? blocked : clear);
      }
    }
  }
  EXPECT_GE(clear, 100);
  EXPECT_GE(blocked, 100);
}

/// A check that is only asked whether all is well goes along chords, and agrees with one that
/// tells.
TEST_P(EdgeAmongShapes, AndTrajectoriesAreValidWhereTheFullCheckSaysSo) {
  const Eigen::AlignedBox3d bounds(Eigen::Vector3d(-1.3, -1.3, -0.5),
                                   Eigen::Vector3d(1.3, 1.3, 1.6));
  for (Joint& joint : robot_->description().joints) joint.max_velocity = 1e3;
  int valid = 0, invalid = 0;
  for (int w = 0; w < 6; ++w) {
    const Scene scene = edge_scene(random_);
    const auto field = std::make_shared<const SceneField>(scene, Stamp(), bounds);
    FieldCheckSettings settings{.margin_m = kEdgeMargin_m};
    const auto full = make_field_check(robot_, field, GetParam().space, settings);
    settings.first_violation_only = true;
    const auto quick = make_field_check(robot_, field, GetParam().space, settings);
    EdgeOracle oracle{*robot_, scene, bounds, GetParam().space};
    for (int i = 0; i < 40; ++i) {
      // Odd ones bend at every state, even ones run straight to a corner and on from there.
      const Eigen::VectorXd a = any_configuration();
      const Eigen::VectorXd b = a + 0.2 * (any_configuration() - a);
      const Eigen::VectorXd c = b + 0.2 * (any_configuration() - b);
      const int dof = robot_->description().dof();
      Trajectory trajectory = make_trajectory(dof, 9, 0.25);
      for (int k = 0; k < 9; ++k) {
        const double s = k % 4 / 4.0;
        const Eigen::VectorXd q = k < 4 ? Eigen::VectorXd(a + s * (b - a))
                                        : Eigen::VectorXd(b + (k < 8 ? s : 1.0) * (c - b));
        for (int j = 0; j < dof; ++j) {
          const auto at = static_cast<std::size_t>(j);
          trajectory.q(k)[at] = q[j];
          trajectory.qdot(k)[at] = i % 2 == 1   ? 0.2 * std::sin(k + j)
                                   : k % 4 == 0 ? 0.0
                                                : b[j] - a[j];
        }
      }
      const auto told = full->check(trajectory, 0.0, Deadline());
      const auto asked = quick->check(trajectory, 0.0, Deadline());
      ASSERT_TRUE(told && asked);
      EXPECT_EQ(asked->valid(), told->valid()) << told->describe() << " but " << asked->describe();
      ++(asked->valid() ? valid : invalid);
      if (!asked->valid()) continue;
      std::vector<double> q(static_cast<std::size_t>(dof));
      for (double t = 0.0; t <= trajectory.duration_s(); t += 2e-3) {
        trajectory.sample(t, q, {});
        ASSERT_GE(oracle.least_m(q), -1e-9) << "at " << t;
      }
    }
  }
  EXPECT_GE(valid, 10);
  EXPECT_GE(invalid, 10);
}

INSTANTIATE_TEST_SUITE_P(
    Robots, EdgeAmongShapes,
    testing::Values(EdgeCase{"short", {Space::kFree, Space::kOccupied}, false, 0.15},
                    EdgeCase{"long", {Space::kFree, Space::kOccupied}, false, 0.7},
                    EdgeCase{"outside_free", {Space::kFree, Space::kFree}, false, 0.5},
                    EdgeCase{
                        "floor", {Space::kFree, Space::kFree, Floor{-0.1, {"link0"}}}, false, 0.5},
                    EdgeCase{"mobile", {Space::kFree, Space::kFree}, true, 0.4},
                    EdgeCase{"mobile_bounded", {Space::kFree, Space::kOccupied}, true, 0.2}),
    [](const auto& of) { return of.param.name; });

TEST(MotionCheckAmongShapes, IsNeverClearWithoutNumbers) {
  const auto robot = edge_arm();
  const auto field = std::make_shared<const SceneField>(
      Scene(), Stamp(),
      Eigen::AlignedBox3d(Eigen::Vector3d::Constant(-2.0), Eigen::Vector3d::Constant(2.0)));
  MotionCheck check(robot, field, {Space::kFree, Space::kFree}, 0.0);
  std::vector<double> q(6, 0.1), other(6, 0.2);
  EXPECT_TRUE(check.is_clear(q, other, 0.01));
  other[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(check.is_clear(other));
  EXPECT_FALSE(check.is_clear(q, other, 0.01));
  std::vector<double> both = q;
  both.insert(both.end(), other.begin(), other.end());
  EXPECT_EQ(check.find_blocked(both), 2u);
}

}  // namespace
}  // namespace sidestep
