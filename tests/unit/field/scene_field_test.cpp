#include <sidestep/core/index.hpp>
#include <sidestep/field/scene_field.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gtest/gtest.h>

namespace sidestep {
namespace {

SceneObject object(std::string name, Shape shape, const Eigen::Vector3d& xyz_m,
                   const Eigen::Vector3d& turn = Eigen::Vector3d::Zero()) {
  Transform pose = Transform::Identity();
  pose.translation() = xyz_m;
  if (turn.norm() > 0.0) {
    pose.linear() = Eigen::AngleAxisd(turn.norm(), turn.normalized()).toRotationMatrix();
  }
  SceneObject made;
  made.name = std::move(name);
  made.shape = std::move(shape);
  made.waypoints = {{0.0, pose}};
  return made;
}

Scene all_shapes() {
  SceneObject walker = object("walker", Capsule{0.2, 0.7}, {1.0, -0.8, 0.5}, {0.4, 0.0, 0.2});
  Waypoint later = walker.waypoints.front();
  later.time_s = 2.0;
  later.T_world_object.translation().y() = 0.4;
  walker.waypoints.push_back(later);
  return Scene({object("floor", HalfSpace{}, {0.0, 0.0, -0.3}),
                object("table", Box{{0.8, 0.5, 0.1}}, {0.4, 0.2, 0.6}, {0.0, 0.3, 0.8}),
                object("post", Cylinder{0.15, 0.9}, {-0.6, -0.3, 0.2}, {0.7, -0.2, 0.0}),
                object("ball", Sphere{0.25}, {-0.4, 0.8, 0.9}), std::move(walker),
                object("block", indexed_mesh(triangulate(Box{{0.3, 0.3, 0.6}})), {-0.9, 0.6, 0.1},
                       {0.1, 0.9, 0.3})});
}

const Eigen::AlignedBox3d kBounds(Eigen::Vector3d(-1.5, -1.5, -0.5),
                                  Eigen::Vector3d(1.5, 1.5, 1.5));

std::vector<Eigen::Vector3d> random_points(std::size_t count, double beyond_m) {
  std::mt19937 random(3);
  std::vector<Eigen::Vector3d> points(count);
  for (Eigen::Vector3d& p : points) {
    for (int axis = 0; axis < 3; ++axis) {
      p[axis] = std::uniform_real_distribution<double>(kBounds.min()[axis] - beyond_m,
                                                       kBounds.max()[axis] + beyond_m)(random);
    }
  }
  return points;
}

TEST(SceneField, IsTheScenesDistance) {
  const Scene scene = all_shapes();
  for (const double time_s : {0.0, 1.3}) {
    const SceneField field(scene, Stamp::from_seconds(time_s), kBounds);
    const auto points = random_points(4001, 0.0);
    std::vector<double> distances(points.size());
    std::vector<FieldStatus> statuses(points.size());
    field.query(points, distances, {}, statuses);
    for (std::size_t i = 0; i < points.size(); ++i) {
      ASSERT_NEAR(distances[i], scene.signed_distance(points[i], time_s).distance_m, 1e-12)
          << points[i].transpose();
      EXPECT_EQ(statuses[i], FieldStatus::kKnown);
    }
  }
}

TEST(SceneField, GradientsAgreeWithFiniteDifferences) {
  const Scene scene = all_shapes();
  const SceneField field(scene, Stamp(), kBounds);
  const auto points = random_points(2000, 0.0);
  std::vector<double> distances(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  field.query(points, distances, gradients, {});
  int compared = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto slopes = [&](double step_m) {
      Eigen::Vector3d slope;
      for (int axis = 0; axis < 3; ++axis) {
        const Eigen::Vector3d step = step_m * Eigen::Vector3d::Unit(axis);
        slope[axis] = (scene.signed_distance(points[i] + step, 0.0).distance_m -
                       scene.signed_distance(points[i] - step, 0.0).distance_m) /
                      (2.0 * step_m);
      }
      return slope;
    };
    const Eigen::Vector3d slope = slopes(1e-6);
    if ((slope - slopes(1e-4)).norm() > 1e-3) continue;  // at a kink there is no gradient
    ++compared;
    ASSERT_NEAR((gradients[i] - slope).norm(), 0.0, 1e-5) << points[i].transpose();
  }
  EXPECT_GT(compared, 1800);
}

TEST(SceneField, FindsThePointsBelowTheirLimits) {
  const SceneField field(all_shapes(), Stamp(), kBounds);
  auto points = random_points(1600, 0.2);
  for (Eigen::Vector3d& p : points) p = p.cast<float>().cast<double>();
  points[77].y() = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> distances(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  std::vector<FieldStatus> statuses(points.size());
  field.query(points, distances, gradients, statuses);
  std::vector<PointFloats> in_lanes(points.size() / kFloatLanes);
  std::vector<double> limits_m(in_lanes.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    in_lanes[i / kFloatLanes].x[i % kFloatLanes] = static_cast<float>(points[i].x());
    in_lanes[i / kFloatLanes].y[i % kFloatLanes] = static_cast<float>(points[i].y());
    in_lanes[i / kFloatLanes].z[i % kFloatLanes] = static_cast<float>(points[i].z());
    limits_m[i / kFloatLanes] = -0.1 + 0.001 * static_cast<double>(i / kFloatLanes);
  }
  std::vector<FieldSample> samples(points.size());
  samples.resize(field.query_below(in_lanes, limits_m, false, samples));
  std::size_t next = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_listed =
        statuses[i] == FieldStatus::kOutside || !(distances[i] >= limits_m[i / kFloatLanes]);
    if (!is_listed) continue;
    ASSERT_LT(next, samples.size());
    const FieldSample& sample = samples[next++];
    ASSERT_EQ(sample.point, i);
    EXPECT_EQ(sample.status, statuses[i]);
    EXPECT_TRUE(sample.distance_m == distances[i] || std::isnan(distances[i]));
    EXPECT_EQ(sample.gradient, gradients[i]);
  }
  EXPECT_EQ(next, samples.size());
  EXPECT_GT(next, 400u);
}

TEST(SceneField, IsOutsideBeyondItsBounds) {
  const SceneField field(all_shapes(), Stamp(), kBounds);
  const std::vector<Eigen::Vector3d> points{
      kBounds.max(), {1.6, 0.3, 0.2}, {1.5, 0.3, 0.2}, {0.0, kInfinity, 0.0}, {0.0, 0.0, 1e300}};
  std::vector<double> distances(points.size());
  std::vector<Eigen::Vector3d> gradients(points.size());
  std::vector<FieldStatus> statuses(points.size());
  field.query(points, distances, gradients, statuses);
  EXPECT_EQ(statuses[0], FieldStatus::kKnown);
  EXPECT_EQ(statuses[1], FieldStatus::kOutside);
  EXPECT_EQ(distances[1], distances[2]);
  EXPECT_EQ(gradients[1].x(), 0.0);
  EXPECT_EQ(gradients[1].tail<2>(), gradients[2].tail<2>());
  EXPECT_TRUE(std::isnan(distances[3]));
  EXPECT_EQ(gradients[3], Eigen::Vector3d::Zero());
  EXPECT_TRUE(std::isfinite(distances[4]));
  EXPECT_EQ(statuses[4], FieldStatus::kOutside);
}

TEST(SceneField, HasADirectionInTheMiddleOfEveryShape) {
  const Scene scene({object("box", Box{{0.2, 0.4, 0.6}}, {0.0, 0.0, 0.5}),
                     object("ball", Sphere{0.2}, {1.0, 0.0, 0.5}),
                     object("post", Cylinder{0.1, 0.8}, {-1.0, 0.0, 0.5})});
  const SceneField field(scene, Stamp(), kBounds);
  const std::vector<Eigen::Vector3d> points{{0.0, 0.0, 0.5}, {1.0, 0.0, 0.5}, {-1.0, 0.0, 0.5}};
  std::vector<double> distances(3);
  std::vector<Eigen::Vector3d> gradients(3);
  field.query(points, distances, gradients, {});
  EXPECT_EQ(distances, (std::vector<double>{-0.1, -0.2, -0.1}));
  EXPECT_EQ(std::abs(gradients[0].x()), 1.0);  // the shortest way out
  for (const Eigen::Vector3d& gradient : gradients) EXPECT_DOUBLE_EQ(gradient.norm(), 1.0);
}

TEST(SceneField, IsEndlessWhereNothingStands) {
  const SceneField field(Scene(), Stamp(), kBounds);
  const std::vector<Eigen::Vector3d> points{{0.0, 0.0, 0.0}};
  std::vector<double> distances(1);
  std::vector<Eigen::Vector3d> gradients(1);
  field.query(points, distances, gradients, {});
  EXPECT_EQ(distances[0], std::numeric_limits<double>::infinity());
  EXPECT_EQ(gradients[0], Eigen::Vector3d::Zero());
}

TEST(SceneField, FindsWhatIsWithinALimit) {
  const Scene scene = all_shapes();
  const SceneField field(scene, Stamp(), kBounds);
  const auto points = random_points(4000, 0.5);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> limit_m(0.01, 0.6);
  std::vector<std::uint32_t> near(field.shapes().size()), nearer(field.shapes().size());
  int found = 0;
  for (std::size_t first = 0; first < points.size(); first += kLanes) {
    PointLanes group;
    double limits_m[kLanes], wider_m[kLanes], is_near[kLanes] = {}, again[kLanes] = {};
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const Eigen::Vector3d& p = points[first + lane];
      group.x[lane] = p.x(), group.y[lane] = p.y(), group.z[lane] = p.z();
      limits_m[lane] = limit_m(random);
      wider_m[lane] = limits_m[lane] + 0.1;
    }
    const std::size_t count =
        field.find_within(field.shapes(), group, limits_m, near.data(), is_near);
    std::size_t expected = 0;
    for (const SceneObject& object : scene.objects()) {
      const Scene alone({object});
      bool is_any = false;
      for (std::size_t lane = 0; lane < kLanes; ++lane) {
        is_any |= alone.signed_distance(points[first + lane], 0.0).distance_m < limits_m[lane];
      }
      if (is_any) ++expected;
    }
    EXPECT_EQ(count, expected);
    found += static_cast<int>(count);
    for (std::size_t lane = 0; lane < kLanes; ++lane) {
      const double distance_m = scene.signed_distance(points[first + lane], 0.0).distance_m;
      EXPECT_EQ(is_near[lane] != 0.0, distance_m < limits_m[lane]) << distance_m;
    }
    // Among those within a wider limit, too.
    std::fill(again, again + kLanes, 0.0);
    const std::size_t wide = field.find_within(field.shapes(), group, wider_m, near.data(), again);
    std::fill(again, again + kLanes, 0.0);
    EXPECT_EQ(field.find_within(std::span(near).first(wide), group, limits_m, nearer.data(), again),
              count);
    for (std::size_t lane = 0; lane < kLanes; ++lane) EXPECT_EQ(again[lane], is_near[lane]);
  }
  EXPECT_GT(found, 500);
}

}  // namespace
}  // namespace sidestep
