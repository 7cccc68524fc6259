#include "run_markers.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "run_messages.hpp"
#include "view_messages.hpp"

namespace sidestep {
namespace {

constexpr ros::ColorRGBA kRobotColour{0.9F, 0.6F, 0.1F, 0.5F};
constexpr ros::ColorRGBA kVoxelColour{0.35F, 0.45F, 0.6F, 1.0F};
constexpr ros::ColorRGBA kStillColour{0.6F, 0.6F, 0.6F, 0.4F};
constexpr ros::ColorRGBA kMovingColour{0.8F, 0.2F, 0.2F, 0.6F};
constexpr double kPathWidth_m = 0.01;
constexpr double kPathStep_s = 0.05;
constexpr int kMostPathPoints = 400;

ros::Vector3 cube(double edge_m) noexcept { return {edge_m, edge_m, edge_m}; }
ros::Point ros_point(const Eigen::Vector3d& p) noexcept { return {p.x(), p.y(), p.z()}; }

ros::MarkerArray fresh(ros::Time time) {
  ros::MarkerArray array;
  ros::Marker& all = array.markers.emplace_back();
  all.header = {0, time, kWorldFrame};
  all.action = ros::Marker::kDeleteAll;
  return array;
}

ros::Marker& add(ros::MarkerArray& array, std::string ns, ros::Marker::Type type, ros::Time time) {
  const auto id = static_cast<std::int32_t>(array.markers.size());
  ros::Marker& marker = array.markers.emplace_back();
  marker.header = {0, time, kWorldFrame};
  marker.ns = std::move(ns);
  marker.id = id;
  marker.type = type;
  marker.scale = cube(1.0);
  return marker;
}

/// Adds the markers that draw a shape.
class ShapeDrawing {
 public:
  ShapeDrawing(ros::MarkerArray& array, std::string name, const Transform& T_world_shape,
               const ros::ColorRGBA& colour, ros::Time time)
      : array_(array),
        name_(std::move(name)),
        T_world_shape_(T_world_shape),
        colour_(colour),
        time_(time) {}

  void operator()(const Box& box) const {
    draw(ros::Marker::kCube).scale = {box.size_m.x(), box.size_m.y(), box.size_m.z()};
  }
  void operator()(const Sphere& sphere) const {
    draw(ros::Marker::kSphere).scale = cube(2.0 * sphere.radius_m);
  }
  void operator()(const Cylinder& cylinder) const {
    const double width_m = 2.0 * cylinder.radius_m;
    draw(ros::Marker::kCylinder).scale = {width_m, width_m, cylinder.length_m};
  }
  void operator()(const Capsule& capsule) const {
    (*this)(Cylinder{capsule.radius_m, capsule.length_m});
    for (const double side : {-0.5, 0.5}) {
      draw(ros::Marker::kSphere, {0.0, 0.0, side * capsule.length_m}).scale =
          cube(2.0 * capsule.radius_m);
    }
  }
  void operator()(const HalfSpace&) const {
    constexpr double kSide_m = 20.0, kThick_m = 0.01;
    draw(ros::Marker::kCube, {0.0, 0.0, -0.5 * kThick_m}).scale = {kSide_m, kSide_m, kThick_m};
  }
  void operator()(const std::shared_ptr<const Mesh>& mesh) const {
    ros::Marker& marker = draw(ros::Marker::kTriangleList);
    for (const Eigen::Vector3i& triangle : mesh->triangles) {
      for (const int corner : triangle) {
        marker.points.push_back(ros_point(mesh->vertices_m[static_cast<std::size_t>(corner)]));
      }
    }
  }

 private:
  ros::Marker& draw(ros::Marker::Type type,
                    const Eigen::Vector3d& at_m = Eigen::Vector3d::Zero()) const {
    ros::Marker& marker = add(array_, name_, type, time_);
    marker.pose = ros_pose(T_world_shape_ * Eigen::Translation3d(at_m));
    marker.color = colour_;
    return marker;
  }

  ros::MarkerArray& array_;
  std::string name_;
  Transform T_world_shape_;
  ros::ColorRGBA colour_;
  ros::Time time_;
};

void add_line(ros::MarkerArray& array, const std::string& ns, const ros::ColorRGBA& colour,
              ros::Time time) {
  ros::Marker& marker = add(array, ns, ros::Marker::kLineStrip, time);
  marker.scale = {kPathWidth_m, 0.0, 0.0};
  marker.color = colour;
}

}  // namespace

ros::MarkerArray sphere_markers(const RobotDescription& robot, ros::Time time) {
  ros::MarkerArray array = fresh(time);
  for (const CollisionSphere& sphere : robot.spheres) {
    const std::string& link = robot.links[static_cast<std::size_t>(sphere.link)].name;
    ros::Marker& marker = add(array, link, ros::Marker::kSphere, time);
    marker.header.frame_id = link;
    marker.frame_locked = 1;
    marker.pose.position = ros_point(sphere.centre_link_m);
    marker.scale = cube(2.0 * sphere.radius_m);
    marker.color = kRobotColour;
  }
  return array;
}

ros::MarkerArray voxel_markers(const OccupancyBits& voxels, ros::Time time) {
  ros::MarkerArray array = fresh(time);
  const std::vector<Eigen::Vector3d> centres_m = voxels.occupied_centres_m();
  if (centres_m.empty()) return array;  // rviz takes a list of none for a mistake.
  ros::Marker& marker = add(array, "occupied", ros::Marker::kCubeList, time);
  marker.scale = cube(voxels.grid().resolution_m);
  marker.color = kVoxelColour;
  marker.points.reserve(centres_m.size());
  for (const Eigen::Vector3d& centre_m : centres_m) marker.points.push_back(ros_point(centre_m));
  return array;
}

ros::MarkerArray object_markers(const Scene& scene, bool moving, double time_s, ros::Time time) {
  ros::MarkerArray array = fresh(time);
  for (const SceneObject& object : scene.objects()) {
    if (object.moves() != moving) continue;
    std::visit(ShapeDrawing(array, object.name, object.T_world_object(time_s),
                            moving ? kMovingColour : kStillColour, time),
               object.shape);
  }
  return array;
}

ros::MarkerArray path_markers(const RobotModel& robot, std::span<const DrawnMotion> motions,
                              ros::Time time) {
  const RobotDescription& description = robot.description();
  const auto base = static_cast<std::size_t>(base_link(description));
  const auto tool = static_cast<std::size_t>(tool_link(description));
  std::vector<Transform> T_world_link(description.links.size());
  std::vector<double> q(static_cast<std::size_t>(description.dof()));
  Scratch scratch;
  ros::MarkerArray array = fresh(time);
  for (const DrawnMotion& motion : motions) {
    if (motion.trajectory.size() == 0) continue;
    add_line(array, motion.name + "/base", motion.base, time);
    add_line(array, motion.name + "/tool", motion.tool, time);
    ros::Marker& at_base = array.markers[array.markers.size() - 2];
    ros::Marker& at_tool = array.markers.back();
    const double duration_s = motion.trajectory.duration_s();
    const int steps = std::max(
        1, static_cast<int>(std::min(std::ceil(duration_s / kPathStep_s), kMostPathPoints - 1.0)));
    for (int i = 0; i <= steps; ++i) {
      motion.trajectory.sample(duration_s * i / steps, q, {});
      robot.link_poses(q, T_world_link, scratch);
      at_base.points.push_back(ros_point(T_world_link[base].translation()));
      at_tool.points.push_back(ros_point(T_world_link[tool].translation()));
    }
  }
  return array;
}

}  // namespace sidestep
