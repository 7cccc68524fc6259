// The parts of benchmarks/plain_driver: what it calls free, what its motions are tested at, what it
// says of its paths.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include <ompl/base/spaces/RealVectorStateSpace.h>
#include <sidestep/field/scene_field.hpp>
#include <sidestep/planning/motion_check.hpp>

#include "conformance/test_host.hpp"
#include "driver_table.hpp"
#include "path_judge.hpp"
#include "plain_search.hpp"
#include "planners.hpp"
#include "sphere_states.hpp"
#include "support/ball_robot.hpp"
#include "support/chain_robot.hpp"

namespace sidestep::plain_driver {
namespace {

namespace ob = ::ompl::base;
using Eigen::Vector3d;

SceneObject placed(const Shape& shape, const Transform& T_world_shape) {
  SceneObject object;
  object.name = "shape";
  object.shape = shape;
  object.waypoints = {{0.0, T_world_shape}};
  return object;
}

SceneObject box_at(const Vector3d& size_m, const Vector3d& xyz_m) {
  Transform pose = Transform::Identity();
  pose.translation() = xyz_m;
  return placed(Box{size_m}, pose);
}

std::span<const double> joints_at(const Vector3d& q) { return {q.data(), 3}; }

/// A point of a shape's surface and the direction away from it, in the shape's frame.
struct Contact {
  const char* name;
  Shape shape;
  Vector3d surface_m;
  Vector3d outward;
};

std::vector<Contact> contacts() {
  const Box box{{0.4, 0.6, 0.8}};
  const Cylinder can{0.3, 0.5};
  const double c = std::cos(1.0), s = std::sin(1.0);
  return {{"face of a box", box, {0.2, 0.1, -0.3}, {1, 0, 0}},
          {"edge of a box", box, {0.2, 0.3, 0.1}, Vector3d(1, 1, 0).normalized()},
          {"corner of a box", box, {-0.2, 0.3, -0.4}, Vector3d(-1, 1, -1).normalized()},
          {"side of a cylinder", can, {0.3 * c, 0.3 * s, -0.2}, {c, s, 0}},
          {"cap of a cylinder", can, {0.1, -0.1, 0.25}, {0, 0, 1}},
          {"rim of a cylinder", can, {0.3 * c, 0.3 * s, -0.25}, Vector3d(c, s, -1).normalized()},
          {"sphere", Sphere{0.25}, {0.0, 0.25 * c, 0.25 * s}, {0, c, s}}};
}

TEST(PlainSphereStates, TouchAShapeWhereTheirRadiusAndTheMarginReachIt) {
  constexpr double kRadius_m = 0.1, kMargin_m = 0.02, kTiny_m = 1e-9;
  Transform pose = Transform::Identity();
  pose.translation() << 0.7, -0.2, 0.4;
  pose.rotate(Eigen::AngleAxisd(0.8, Vector3d(1, 2, -1).normalized()));
  const auto robot = std::make_shared<testing_support::BallRobot>(kRadius_m);
  for (const Contact& contact : contacts()) {
    SphereStates states(robot, Scene({placed(contact.shape, pose)}), kMargin_m);
    const auto is_free_at = [&](double distance_m) {
      return states.is_free(joints_at(pose * (contact.surface_m + distance_m * contact.outward)));
    };
    EXPECT_TRUE(is_free_at(kRadius_m + kMargin_m + kTiny_m)) << contact.name;
    EXPECT_FALSE(is_free_at(kRadius_m + kMargin_m - kTiny_m)) << contact.name;
    EXPECT_FALSE(states.is_free(joints_at(pose.translation()))) << contact.name;
  }
}

TEST(PlainSphereStates, TouchEachOtherWhereTheirLinksArePaired) {
  RobotDescription description;
  description.joints = {{"slide", Joint::Type::kPrismatic, -1.0, 1.0, 1.0, 1.0}};
  description.links = {{"rail", -1}, {"carriage", 0}};
  description.spheres = {{0, Vector3d::Zero(), 0.1}, {1, Vector3d::Zero(), 0.2}};
  const std::vector<testing_support::ChainRobot::Step> steps = {{Vector3d::Zero(), {0, 0, 1}, -1},
                                                                {Vector3d::Zero(), {1, 0, 0}, 0}};
  const auto is_free = [&](double at_m) {
    const auto robot = std::make_shared<testing_support::ChainRobot>(description, steps);
    return SphereStates(robot, Scene(), 0.05).is_free({&at_m, 1});
  };
  EXPECT_TRUE(is_free(0.0));
  description.self_collision_pairs = {{0, 1}};
  EXPECT_FALSE(is_free(0.0));
  EXPECT_FALSE(is_free(0.3 - 1e-9));
  EXPECT_TRUE(is_free(0.3 + 1e-9));
}

/// Shapes of all kinds, turned at random, around the robot.
Scene cluttered(std::mt19937& random) {
  std::uniform_real_distribution<double> across(-1.2, 1.2), size(0.05, 0.4);
  std::vector<SceneObject> objects;
  for (int i = 0; i < 12; ++i) {
    const std::array<Shape, 4> kinds = {Box{{size(random), size(random), size(random)}},
                                        Cylinder{size(random), 2.0 * size(random)},
                                        Sphere{size(random)}, Capsule{size(random), size(random)}};
    Transform pose = Transform::Identity();
    pose.translation() << across(random), across(random), across(random);
    pose.rotate(Eigen::Quaterniond(across(random), across(random), across(random), across(random))
                    .normalized());
    objects.push_back(placed(kinds[static_cast<std::size_t>(i) % kinds.size()], pose));
  }
  return Scene(std::move(objects));
}

TEST(PlainSphereStates, AreThoseOfTheMotionCheck) {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> across(-1.5, 1.5);
  const auto robot = testing_support::mobile_arm();
  const Scene scene = cluttered(random);
  const Eigen::AlignedBox3d bounds_m(Vector3d::Constant(-9), Vector3d::Constant(9));
  MotionCheck check(robot, std::make_shared<const SceneField>(scene, Stamp(), bounds_m),
                    {Space::kFree, Space::kFree}, 0.01);
  SphereStates states(robot, scene, 0.01);
  int free = 0;
  for (int i = 0; i < 4000; ++i) {
    std::vector<double> q(7);
    for (double& value : q) value = across(random);
    ASSERT_EQ(states.is_free(q), check.is_clear(q)) << i;
    free += states.is_free(q) ? 1 : 0;
  }
  EXPECT_GT(free, 400);
  EXPECT_LT(free, 3600);
}

/// A ball that OMPL moves, and the configurations at which it was looked at.
class Mover {
 public:
  Mover(double radius_m, const Scene& scene)
      : search_(std::make_shared<testing_support::BallRobot>(radius_m), scene, 0.0) {
    auto& setup = search_.setup();
    const ob::StateValidityCheckerPtr check = setup.getStateValidityChecker();
    setup.setStateValidityChecker([this, check](const ob::State* state) {
      const double* q = state->as<ob::RealVectorStateSpace::StateType>()->values;
      looked_at.emplace_back(q[0], q[1], q[2]);
      return check->isValid(state);
    });
    setup.getSpaceInformation()->setup();
  }

  bool is_clear(const Vector3d& from, const Vector3d& to) {
    const auto& space = search_.setup().getStateSpace();
    ob::ScopedState<> start(space), goal(space);
    for (int j = 0; j < 3; ++j) {
      start[static_cast<unsigned>(j)] = from[j];
      goal[static_cast<unsigned>(j)] = to[j];
    }
    return search_.setup().getSpaceInformation()->checkMotion(start.get(), goal.get());
  }

  std::vector<Vector3d> looked_at;

 private:
  PlainSearch search_;
};

/// How far along a motion it was looked at, from its start, in order.
std::vector<double> places_along(const Vector3d& from, const Vector3d& to) {
  Mover mover(0.1, Scene());
  EXPECT_TRUE(mover.is_clear(from, to));
  std::vector<double> places{0.0};  // that the start is free is known before
  for (const Vector3d& q : mover.looked_at) {
    places.push_back((q - from).dot((to - from).normalized()));
    EXPECT_NEAR((q - from - places.back() * (to - from).normalized()).norm(), 0.0, 1e-12);
  }
  std::ranges::sort(places);
  return places;
}

TEST(PlainSearch, TestsMotionsAtPointsAtMostAThirtySecondApart) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> across(-9.0, 9.0);
  for (int i = 0; i < 20; ++i) {
    const Vector3d from(across(random), across(random), across(random));
    const Vector3d to(across(random), across(random), across(random));
    const std::vector<double> places = places_along(from, to);
    EXPECT_NEAR(places.back(), (to - from).norm(), 1e-9);
    double widest = 0.0;
    for (std::size_t p = 1; p < places.size(); ++p) {
      widest = std::max(widest, places[p] - places[p - 1]);
    }
    EXPECT_LE(widest, 1.0 / 32.0 + 1e-9);
    EXPECT_GE(widest, 1.0 / 40.0);  // as the comparison says: no finer
  }
}

/// A plate thinner than the way between two points that are tested, right between them.
class BetweenPoints : public ::testing::Test {
 protected:
  static constexpr double kRadius_m = 0.002, kThickness_m = 0.001;
  static SceneObject plate() {
    const std::vector<double> places = places_along(Vector3d::Zero(), {1, 0, 0});
    return box_at({kThickness_m, 2, 2}, {0.5 * (places[10] + places[11]), 0, 0});
  }
  static std::vector<double> path(const std::vector<Vector3d>& vertices) {
    std::vector<double> values;
    for (const Vector3d& q : vertices) values.insert(values.end(), q.begin(), q.end());
    return values;
  }

  const std::shared_ptr<const Scene> scene_ =
      std::make_shared<const Scene>(std::vector<SceneObject>{plate()});
  const PathJudge judge_{
      testing_support::flying_ball(kRadius_m), {Space::kFree, Space::kFree}, {}, true};
};

TEST_F(BetweenPoints, ThePlainDriverMissesWhatTheJudgeFinds) {
  Mover mover(kRadius_m, *scene_);
  ASSERT_TRUE(mover.is_clear(Vector3d::Zero(), {1, 0, 0}));
  const auto verdict = judge_.judge(scene_, path({{0, 0, 0}, {1, 0, 0}}));
  ASSERT_TRUE(verdict) << verdict.error().describe();
  EXPECT_TRUE(verdict->is_in_collision);
  EXPECT_FALSE(verdict->is_unproven);
  EXPECT_TRUE(verdict->is_touching);
  EXPECT_GT(verdict->depth_m, 0.0);
  EXPECT_LE(verdict->depth_m, kRadius_m + 0.5 * kThickness_m + 1e-9);
}

TEST_F(BetweenPoints, APathAroundItIsShownClear) {
  const auto verdict = judge_.judge(scene_, path({{0, 0, 0}, {0, 2, 0}, {1, 2, 0}, {1, 0, 0}}));
  ASSERT_TRUE(verdict) << verdict.error().describe();
  EXPECT_FALSE(verdict->is_in_collision);
  EXPECT_FALSE(verdict->is_unproven);
  EXPECT_FALSE(verdict->is_touching);
  EXPECT_EQ(verdict->depth_m, 0.0);
}

TEST_F(BetweenPoints, APathBeyondALimitIsAnError) {
  const auto verdict = judge_.judge(scene_, path({{0, 0, 0}, {-5, 0, 0}}));
  ASSERT_FALSE(verdict);
  EXPECT_NE(verdict.error().describe().find("limit"), std::string::npos);
}

/// A ball on one side of a wall 2 m wide and high, to go to the other.
class PlainPlan : public ::testing::Test {
 protected:
  PlainAnswer plan(std::vector<SceneObject> objects, double limit_s, std::uint64_t seed = 1) {
    const ompl_optimiser::Session session(seed, log_);
    return plan_plainly(robot_, Scene(std::move(objects)), start_, goal_, 0.0, limit_s);
  }
  Vector3d vertex(const PlainAnswer& answer, std::size_t i) const {
    return Eigen::Map<const Vector3d>(answer.path.data() + 3 * i);
  }

  static constexpr double kAmple_s = 60.0;
  conformance::RecordingLog log_;
  const std::shared_ptr<const RobotModel> robot_ =
      std::make_shared<testing_support::BallRobot>(0.1);
  const Vector3d start_{-1, 0, 0};
  const Vector3d goal_{1, 0, 0};
};

TEST_F(PlainPlan, IsAStraightLineWhereNothingIsInTheWay) {
  const PlainAnswer answer = plan({}, kAmple_s);
  ASSERT_TRUE(answer.is_solved);
  EXPECT_NEAR(answer.length, 2.0, 1e-6);
}

TEST_F(PlainPlan, GoesAroundAWall) {
  const SceneObject wall = box_at({0.1, 2, 2}, {0, 0, 0});
  const PlainAnswer answer = plan({wall}, kAmple_s);
  ASSERT_TRUE(answer.is_solved);
  const std::size_t vertices = answer.path.size() / 3;
  EXPECT_EQ(vertex(answer, 0), start_);
  EXPECT_EQ(vertex(answer, vertices - 1), goal_);
  double length = 0.0;
  for (std::size_t i = 1; i < vertices; ++i) {
    length += (vertex(answer, i) - vertex(answer, i - 1)).norm();
  }
  EXPECT_NEAR(answer.length, length, 1e-9);
  // No way is shorter than over the middle of an edge, less what points 1/32 apart may cut off.
  EXPECT_GT(answer.length, 2.0 * std::hypot(1.0, 1.0));
  EXPECT_GT(answer.count.states, 0);
  EXPECT_EQ(answer.count.timed, (answer.count.states + 60) / 61);
  EXPECT_EQ(plan({wall}, kAmple_s).path, answer.path);
  EXPECT_NE(plan({wall}, kAmple_s, 2).path, answer.path);
}

TEST_F(PlainPlan, IsNoneWhereTheGoalOrTheStartIsTaken) {
  for (const Vector3d& taken : {start_, goal_}) {
    const PlainAnswer answer = plan({box_at({0.5, 0.5, 0.5}, taken)}, 0.05);
    EXPECT_FALSE(answer.is_solved);
    EXPECT_TRUE(answer.path.empty());
  }
}

Solve solved(const std::string& family, double search_ms, double simplify_ms) {
  Solve solve{family, 1, {}, {}};
  solve.answer.is_solved = true;
  solve.answer.search_ms = search_ms;
  solve.answer.simplify_ms = simplify_ms;
  solve.answer.count = {120, 2, 2.0 * search_ms};
  return solve;
}

TEST(PlainSummary, TellsCollisionsAtPointsFromThoseBetweenThem) {
  std::vector<Solve> solves = {solved("a", 1, 10), solved("a", 2, 20), solved("b", 3, 60)};
  solves[0].answer.is_broken = true;
  solves[0].verdict = {true, false, 0.5, false};
  solves[1].verdict = {true, false, 0.25, true};
  solves[2].verdict = {false, true, 0.0, false};
  solves.push_back({"b", 9, {}, {}});  // without a path
  const auto summary = summary_of(solves, true);
  ASSERT_EQ(summary["rows"].size(), 3u);
  const auto all = summary["rows"][0], b = summary["rows"][2];
  EXPECT_EQ(all["problems"], 4);
  EXPECT_EQ(all["solved"], 3);
  EXPECT_EQ(all["search_ms"]["p50"], 2.0);
  EXPECT_EQ(all["simplified_ms"]["p50"], 22.0);
  EXPECT_EQ(all["state_check_us"], 2.0);  // (2 + 4 + 6) / 6
  EXPECT_EQ(all["in_collision"]["paths"], 2);
  EXPECT_EQ(all["in_collision"]["at_points"], 1);
  EXPECT_EQ(all["in_collision"]["deepest_between_m"], 0.25);
  EXPECT_EQ(all["unproven"], 1);
  EXPECT_EQ(all["shapes_touching"], 1);
  EXPECT_EQ(b["family"], "b");
  EXPECT_EQ(b["in_collision"]["paths"], 0);
  EXPECT_TRUE(b["in_collision"]["deepest_between_m"].is_null());
  EXPECT_EQ(summary["unsolved"], nlohmann::ordered_json::array({"b 9"}));
}

}  // namespace
}  // namespace sidestep::plain_driver
