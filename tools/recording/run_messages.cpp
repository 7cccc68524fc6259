#include "run_messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "view_messages.hpp"

namespace sidestep {
namespace {

constexpr std::int64_t kSecond_ns = 1'000'000'000;

std::uint32_t count_of(int value) noexcept { return static_cast<std::uint32_t>(value); }

/// The whole number of mm that a depth is, 0 where there is none; nothing where it is no such
/// number, or too large.
std::optional<std::uint16_t> in_mm(float depth_m) noexcept {
  if (!(depth_m > 0.0F)) return std::uint16_t{0};
  const float mm = std::round(depth_m * 1000.0F);
  if (mm < 1.0F || mm > std::numeric_limits<std::uint16_t>::max()) return std::nullopt;
  // As whoever reads the image turns it into m again.
  const bool is_same = mm * 0.001F == depth_m || mm / 1000.0F == depth_m;
  return is_same ? std::optional(static_cast<std::uint16_t>(mm)) : std::nullopt;
}

/// All depths in mm; empty where one would lose.
std::vector<std::uint16_t> all_in_mm(const DepthImage& depth) {
  std::vector<std::uint16_t> all_mm;
  all_mm.reserve(depth.depth_m.size());
  for (const float depth_m : depth.depth_m) {
    const auto mm = in_mm(depth_m);
    if (!mm) return {};
    all_mm.push_back(*mm);
  }
  return all_mm;
}

template <class Number>
std::vector<std::byte> bytes_of(const std::vector<Number>& numbers) {
  const auto bytes = std::as_bytes(std::span(numbers));
  return {bytes.begin(), bytes.end()};
}

ros::Duration ros_duration(double seconds) noexcept {
  const std::int64_t ns = Stamp::from_seconds(seconds).ns;
  return {static_cast<std::int32_t>(ns / kSecond_ns), static_cast<std::int32_t>(ns % kSecond_ns)};
}

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

ros::Time ros_time(Stamp stamp, Stamp epoch) noexcept {
  constexpr std::int64_t kLast_ns =
      std::int64_t{std::numeric_limits<std::uint32_t>::max()} * kSecond_ns;
  // Neither sum can overflow: an epoch is not below 0.
  const std::int64_t ns = std::clamp<std::int64_t>(
      std::min(stamp.ns, kLast_ns) + std::min(epoch.ns, kLast_ns), 1, kLast_ns);
  return {static_cast<std::uint32_t>(ns / kSecond_ns), static_cast<std::uint32_t>(ns % kSecond_ns)};
}

Stamp run_stamp(ros::Time time, Stamp epoch) noexcept {
  return Stamp{std::int64_t{time.sec} * kSecond_ns + time.nsec - epoch.ns};
}

ros::Transform ros_transform(const Transform& transform) {
  const Eigen::Vector3d t = transform.translation();
  const Eigen::Quaterniond r = Eigen::Quaterniond(transform.linear()).normalized();
  return {{t.x(), t.y(), t.z()}, {r.x(), r.y(), r.z(), r.w()}};
}

ros::Pose ros_pose(const Transform& T_frame_object) {
  const ros::Transform as = ros_transform(T_frame_object);
  return {{as.translation.x, as.translation.y, as.translation.z}, as.rotation};
}

ros::Image depth_image(const DepthImage& depth, const ros::Header& header) {
  ros::Image image;
  image.header = header;
  image.height = count_of(depth.camera.height_px);
  image.width = count_of(depth.camera.width_px);
  if (const auto all_mm = all_in_mm(depth); !all_mm.empty()) {
    image.encoding = "16UC1";
    image.step = image.width * static_cast<std::uint32_t>(sizeof(std::uint16_t));
    image.data = bytes_of(all_mm);
    return image;
  }
  // In metres, NaN stands for no measurement (REP 118).
  std::vector<float> all_m = depth.depth_m;
  std::ranges::replace(all_m, 0.0F, std::numeric_limits<float>::quiet_NaN());
  image.encoding = "32FC1";
  image.step = image.width * static_cast<std::uint32_t>(sizeof(float));
  image.data = bytes_of(all_m);
  return image;
}

ros::CameraInfo camera_info(const CameraIntrinsics& camera, const ros::Header& header) {
  ros::CameraInfo info;
  info.header = header;
  info.height = count_of(camera.height_px);
  info.width = count_of(camera.width_px);
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {camera.fx_px, 0.0, camera.cx_px, 0.0, camera.fy_px, camera.cy_px, 0.0, 0.0, 1.0};
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info.P = {camera.fx_px, 0.0, camera.cx_px, 0.0, 0.0, camera.fy_px,
            camera.cy_px, 0.0, 0.0,          0.0, 1.0, 0.0};
  return info;
}

ros::PointCloud2 point_cloud(const PointCloud& cloud, const ros::Header& header) {
  constexpr std::uint32_t kNumber_bytes = sizeof(float);
  ros::PointCloud2 message;
  message.header = header;
  message.height = 1;
  message.width = static_cast<std::uint32_t>(cloud.points_m.size());
  for (const char* const name : {"x", "y", "z"}) {
    message.fields.push_back(
        {.name = name,
         .offset = static_cast<std::uint32_t>(message.fields.size()) * kNumber_bytes});
  }
  message.point_step = 3 * kNumber_bytes;
  message.row_step = message.point_step * message.width;
  message.data = bytes_of(cloud.points_m);
  return message;
}

ros::TFMessage link_transforms(const RobotDescription& robot,
                               std::span<const Transform> T_world_link, ros::Time time) {
  ros::TFMessage message;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& link = robot.links[i];
    if (link.name == kWorldFrame) continue;
    const bool has_parent = link.parent >= 0;
    const auto parent = static_cast<std::size_t>(std::max(link.parent, 0));
    ros::TransformStamped& transform = message.transforms.emplace_back();
    transform.header = {0, time, has_parent ? robot.links[parent].name : kWorldFrame};
    transform.child_frame_id = link.name;
    transform.transform = ros_transform(
        has_parent ? T_world_link[parent].inverse() * T_world_link[i] : T_world_link[i]);
  }
  return message;
}

ros::JointState joint_state(const RobotDescription& robot, std::span<const double> q,
                            ros::Time time) {
  ros::JointState message;
  message.header.stamp = time;
  for (const Joint& joint : robot.joints) message.name.push_back(joint.name);
  message.position.assign(q.begin(), q.end());
  return message;
}

ros::JointTrajectory joint_trajectory(const RobotDescription& robot, const Trajectory& trajectory,
                                      ros::Time start) {
  ros::JointTrajectory message;
  message.header = {0, start, kWorldFrame};
  for (const Joint& joint : robot.joints) message.joint_names.push_back(joint.name);
  for (int state = 0; state < trajectory.size(); ++state) {
    ros::JointTrajectoryPoint& point = message.points.emplace_back();
    const auto q = trajectory.q(state);
    const auto qdot = trajectory.qdot(state);
    point.positions.assign(q.begin(), q.end());
    point.velocities.assign(qdot.begin(), qdot.end());
    point.time_from_start = ros_duration(trajectory.times_s[static_cast<std::size_t>(state)]);
  }
  return message;
}

ros::UInt8MultiArray byte_array(std::span<const std::byte> bytes) {
  ros::UInt8MultiArray message;
  const auto size = static_cast<std::uint32_t>(bytes.size());
  message.layout.dim.push_back({"bytes", size, size});
  message.data.assign(bytes.begin(), bytes.end());
  return message;
}

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
