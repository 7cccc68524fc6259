#include <algorithm>
#include <map>
#include <set>

#include <gtest/gtest.h>

#include "run_messages.hpp"
#include "support/chain_robot.hpp"
#include "support/opaque_field.hpp"

namespace sidestep::testing {
namespace {

Eigen::Vector3d vector_of(const ros::Point& p) { return {p.x, p.y, p.z}; }

TEST(RobotMarkers, AreItsSpheresInTheFramesOfTheirLinks) {
  const auto robot = testing_support::mobile_arm();
  const RobotDescription& description = robot->description();
  const ros::MarkerArray array = sphere_markers(description, {1, 2});
  ASSERT_EQ(array.markers.size(), description.spheres.size() + 1);
  EXPECT_EQ(array.markers[0].action, ros::Marker::kDeleteAll);
  std::set<std::pair<std::string, int>> names;
  for (std::size_t i = 0; i < description.spheres.size(); ++i) {
    const CollisionSphere& sphere = description.spheres[i];
    const ros::Marker& marker = array.markers[i + 1];
    EXPECT_EQ(marker.type, ros::Marker::kSphere);
    EXPECT_EQ(marker.header.frame_id,
              description.links[static_cast<std::size_t>(sphere.link)].name);
    EXPECT_EQ(marker.frame_locked, 1);
    EXPECT_EQ(vector_of(marker.pose.position), sphere.centre_link_m);
    EXPECT_EQ(marker.scale.x, 2.0 * sphere.radius_m);
    names.emplace(marker.ns, marker.id);
  }
  EXPECT_EQ(names.size(), description.spheres.size()) << "markers replace one another";
}

/// A field whose occupied voxels are those of a list; known where `known` says.
std::shared_ptr<const DenseField> field_of(const std::vector<Eigen::Vector3i>& occupied) {
  const FieldInfo info{.grid = {{-1.0, -2.0, 0.5}, 0.1, {40, 20, 18}}};
  return make_dense_field(info, [&](const Eigen::Vector3i& voxel) {
    return std::ranges::find(occupied, voxel) == occupied.end() ? 0.3 : -0.05;
  });
}

struct ByPlace {
  bool operator()(const Eigen::Vector3d& a, const Eigen::Vector3d& b) const {
    return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end());
  }
};
std::vector<Eigen::Vector3d> sorted(std::vector<Eigen::Vector3d> points) {
  std::ranges::sort(points, ByPlace{});
  return points;
}

TEST(MapMarkers, AreCubesAtTheOccupiedVoxels) {
  const std::vector<Eigen::Vector3i> occupied{{0, 0, 0}, {39, 19, 17}, {16, 3, 15}, {15, 16, 16}};
  const auto field = field_of(occupied);
  OccupancyBits voxels;
  EXPECT_TRUE(voxels.update(field).any());
  const ros::MarkerArray array = voxel_markers(voxels, {1, 2});
  ASSERT_EQ(array.markers.size(), 2U);
  const ros::Marker& cubes = array.markers[1];
  EXPECT_EQ(cubes.type, ros::Marker::kCubeList);
  EXPECT_EQ(cubes.scale.y, 0.1);
  std::vector<Eigen::Vector3d> drawn, expected;
  for (const ros::Point& point : cubes.points) drawn.push_back(vector_of(point));
  for (const Eigen::Vector3i& voxel : occupied) {
    expected.push_back(Eigen::Vector3d(-1.0, -2.0, 0.5) +
                       0.1 * (voxel.cast<double>() + Eigen::Vector3d::Constant(0.5)));
  }
  drawn = sorted(drawn), expected = sorted(expected);
  ASSERT_EQ(drawn.size(), expected.size());
  for (std::size_t i = 0; i < drawn.size(); ++i) EXPECT_TRUE(drawn[i].isApprox(expected[i]));
}

TEST(MapMarkers, FollowTheMapFieldByField) {
  OccupancyBits voxels;
  EXPECT_TRUE(voxels.update(field_of({{1, 1, 1}})).any());
  EXPECT_FALSE(voxels.update(field_of({{1, 1, 1}})).any());
  EXPECT_TRUE(voxels.update(field_of({{1, 1, 1}, {20, 1, 1}})).any());
  EXPECT_EQ(voxels.occupied_centres_m().size(), 2U);
  EXPECT_TRUE(voxels.update(field_of({{20, 1, 1}})).any());
  ASSERT_EQ(voxels.occupied_centres_m().size(), 1U);
  EXPECT_TRUE(voxels.occupied_centres_m()[0].isApprox(Eigen::Vector3d(1.05, -1.85, 0.65)));
  EXPECT_TRUE(voxels.update(field_of({})).any());
  EXPECT_EQ(voxel_markers(voxels, {1, 2}).markers.size(), 1U) << "an empty list of cubes";
}

TEST(MapMarkers, LeaveOutWhatNobodyHasSeen) {
  const auto field = field_of({{3, 3, 3}, {4, 3, 3}});
  DenseField::Blocks blocks = field->blocks();
  DenseField::KnownBlocks known = field->known_blocks();
  auto seen = std::make_shared<KnownBlock>(known.block(0));
  seen->rows[3 + 16 * 3] = static_cast<std::uint16_t>(~(1U << 4));
  known.set(0, seen);
  OccupancyBits voxels;
  voxels.update(std::make_shared<const DenseField>(field->info(), blocks, known));
  ASSERT_EQ(voxels.occupied_centres_m().size(), 1U);
  EXPECT_NEAR(voxels.occupied_centres_m()[0].x(), -0.65, 1e-12);
}

TEST(MapMarkers, AreTheSameOfAFieldThatIsAsked) {
  const auto field = field_of({{0, 0, 0}, {39, 19, 17}, {16, 3, 15}, {15, 16, 16}});
  OccupancyBits dense, asked;
  dense.update(field);
  asked.update(std::make_shared<testing_support::OpaqueField>(field));
  EXPECT_EQ(dense.occupied_centres_m(), asked.occupied_centres_m());
}

SceneObject object(const std::string& name, Shape shape, bool moves = false) {
  SceneObject object{
      name, std::move(shape), {{0.0, Transform(Eigen::Translation3d(1, 2, 3))}}, {}, {}};
  if (moves) object.waypoints.push_back({2.0, Transform(Eigen::Translation3d(3, 2, 3))});
  return object;
}

TEST(SceneMarkers, DrawEveryShape) {
  auto mesh = std::make_shared<Mesh>();
  mesh->vertices_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh->triangles = {{0, 1, 2}, {0, 1, 3}};
  const Scene scene({object("box", Box{{1, 2, 3}}), object("ball", Sphere{0.5}),
                     object("tin", Cylinder{0.2, 0.7}), object("pill", Capsule{0.1, 0.4}),
                     object("floor", HalfSpace{}),
                     object("mesh", std::shared_ptr<const Mesh>(mesh)),
                     object("walker", Sphere{0.3}, true)});
  const ros::MarkerArray array = object_markers(scene, false, 1.0, {1, 2});
  std::map<std::string, std::vector<const ros::Marker*>> by_name;
  for (const ros::Marker& marker : array.markers) by_name[marker.ns].push_back(&marker);
  EXPECT_EQ(by_name.count("walker"), 0U);
  const auto scale = [&](const std::string& name, std::size_t i = 0) {
    const ros::Vector3& s = by_name.at(name).at(i)->scale;
    return Eigen::Vector3d(s.x, s.y, s.z);
  };
  EXPECT_EQ(by_name.at("box")[0]->type, ros::Marker::kCube);
  EXPECT_EQ(scale("box"), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(vector_of(by_name.at("box")[0]->pose.position), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(by_name.at("ball")[0]->type, ros::Marker::kSphere);
  EXPECT_EQ(scale("ball"), Eigen::Vector3d::Ones());
  EXPECT_EQ(by_name.at("tin")[0]->type, ros::Marker::kCylinder);
  EXPECT_EQ(scale("tin"), Eigen::Vector3d(0.4, 0.4, 0.7));
  ASSERT_EQ(by_name.at("pill").size(), 3U);
  EXPECT_EQ(vector_of(by_name.at("pill")[2]->pose.position), Eigen::Vector3d(1, 2, 3.2));
  const ros::Marker& floor = *by_name.at("floor")[0];
  EXPECT_DOUBLE_EQ(floor.pose.position.z + 0.5 * floor.scale.z, 3.0) << "its top is the plane";
  const ros::Marker& drawn = *by_name.at("mesh")[0];
  EXPECT_EQ(drawn.type, ros::Marker::kTriangleList);
  ASSERT_EQ(drawn.points.size(), 6U);
  EXPECT_EQ(vector_of(drawn.points[5]), Eigen::Vector3d(0, 0, 1));
}

TEST(SceneMarkers, DrawWhatMovesWhereItIs) {
  const Scene scene({object("box", Box{{1, 2, 3}}), object("walker", Sphere{0.3}, true)});
  const ros::MarkerArray array = object_markers(scene, true, 0.5, {1, 2});
  ASSERT_EQ(array.markers.size(), 2U);
  EXPECT_EQ(array.markers[1].ns, "walker");
  EXPECT_TRUE(vector_of(array.markers[1].pose.position).isApprox(Eigen::Vector3d(1.5, 2.0, 3.0)));
}

TEST(PathMarkers, AreTheWaysOfBaseAndTool) {
  const auto robot = testing_support::flying_ball(0.2);
  robot->description().spheres.insert(robot->description().spheres.begin(),
                                      {0, Eigen::Vector3d::Zero(), 0.1});
  // Along x and then along y, at 1 m/s: the base slides along x only.
  Trajectory trajectory = make_trajectory(3, 2, 1.0);
  trajectory.positions = {0, 0, 0, 1, 2, 0};
  trajectory.velocities = {1, 2, 0, 1, 2, 0};
  const DrawnMotion motion{"followed", trajectory, {}, {}};
  const ros::MarkerArray array = path_markers(*robot, std::span(&motion, 1), {1, 2});
  ASSERT_EQ(array.markers.size(), 3U);
  const ros::Marker &base = array.markers[1], &tool = array.markers[2];
  EXPECT_EQ(base.ns, "followed/base");
  EXPECT_EQ(tool.ns, "followed/tool");
  ASSERT_EQ(base.points.size(), tool.points.size());
  ASSERT_GE(base.points.size(), 20U);
  for (std::size_t i = 0; i < base.points.size(); ++i) {
    const double t = static_cast<double>(i) / static_cast<double>(base.points.size() - 1);
    EXPECT_TRUE(vector_of(base.points[i]).isApprox(Eigen::Vector3d(t, 0, 0), 1e-9)) << i;
    EXPECT_TRUE(vector_of(tool.points[i]).isApprox(Eigen::Vector3d(t, 2 * t, 0), 1e-9)) << i;
  }
}

}  // namespace
}  // namespace sidestep::testing
