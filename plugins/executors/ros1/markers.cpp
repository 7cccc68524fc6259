#include "markers.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

using ros_messages::Marker;
using ros_messages::MarkerArray;

constexpr int kPathPoints = 60;
constexpr double kPathWidth_m = 0.015;

using Colour = decltype(Marker::color);

Colour colour_of(float r, float g, float b, float a) {
  Colour colour;
  colour.r = r;
  colour.g = g;
  colour.b = b;
  colour.a = a;
  return colour;
}
const Colour kRobot = colour_of(0.2F, 0.5F, 0.9F, 0.5F);
const Colour kEnd = colour_of(0.3F, 0.8F, 0.4F, 0.25F);
const Colour kFollowed = colour_of(0.1F, 0.7F, 0.2F, 1.0F);
const Colour kProposed = colour_of(0.95F, 0.6F, 0.1F, 1.0F);

/// To a point or a size of a marker.
void assign(auto& to, const Eigen::Vector3d& from) {
  to.x = from.x();
  to.y = from.y();
  to.z = from.z();
}

/// From red (0) over yellow, green and cyan to blue (1).
Colour rainbow(double share, float alpha) {
  const double x = 4.0 * std::clamp(share, 0.0, 1.0);
  const auto ramp = [](double value) { return static_cast<float>(std::clamp(value, 0.0, 1.0)); };
  return colour_of(ramp(2.0 - x), ramp(std::min(x, 4.0 - x)), ramp(x - 2.0), alpha);
}

/// An array that removes all that its topic showed, and one list of boxes.
MarkerArray boxes(const std::string& group, const std::string& frame, ::ros::Time stamp,
                  const Eigen::Vector3d& size_m) {
  MarkerArray array;
  Marker& all = array.markers.emplace_back();
  all.header.frame_id = frame;
  all.header.stamp = stamp;
  all.action = Marker::DELETEALL;
  Marker& list = array.markers.emplace_back(all);
  list.ns = group;
  list.type = Marker::CUBE_LIST;
  list.action = Marker::ADD;
  list.pose.orientation.w = 1.0;
  assign(list.scale, size_m);
  list.color.a = 1.0F;
  return array;
}

void add(Marker& list, const Eigen::Vector3d& centre_m, const Colour& colour) {
  assign(list.points.emplace_back(), centre_m);
  list.colors.push_back(colour);
}

/// RViz takes a list of none for a mistake.
MarkerArray without_empty(MarkerArray array) {
  if (array.markers.back().points.empty()) array.markers.pop_back();
  return array;
}

}  // namespace

MarkerPainter::MarkerPainter(std::shared_ptr<const RobotModel> robot, std::string frame)
    : robot_(std::move(robot)),
      frame_(std::move(frame)),
      centres_m_(robot_->description().spheres.size()),
      T_world_link_(robot_->description().links.size()) {}

Result<MarkerPainter> MarkerPainter::create(std::shared_ptr<const RobotModel> robot,
                                            const std::string& link, const std::string& frame) {
  MarkerPainter painter(std::move(robot), frame);
  const RobotDescription& description = painter.robot_->description();
  painter.link_ = static_cast<int>(description.links.size()) - 1;
  if (link.empty()) return painter;
  const auto index = description.link_index(link);
  if (!index) {
    return fail(ErrorCode::kConfig, "robot '" + description.name + "' has no link '" + link + "'",
                "executor.markers.link");
  }
  painter.link_ = *index;
  return painter;
}

Marker MarkerPainter::marker(const std::string& group, int id, int type, Stamp stamp) const {
  Marker marker;
  marker.header.frame_id = frame_;
  marker.header.stamp = ros_messages::to_ros_time(stamp);
  marker.ns = group;
  marker.id = id;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1.0;
  return marker;
}

void MarkerPainter::add_spheres(const std::string& group, std::span<const double> q, Stamp stamp,
                                MarkerArray& into) {
  robot_->sphere_centres(q, centres_m_, scratch_);
  const auto& spheres = robot_->description().spheres;
  for (std::size_t s = 0; s < spheres.size(); ++s) {
    Marker ball = marker(group, static_cast<int>(s), Marker::SPHERE, stamp);
    assign(ball.pose.position, centres_m_[s]);
    ball.scale.x = ball.scale.y = ball.scale.z = 2.0 * spheres[s].radius_m;
    ball.color = group == "robot" ? kRobot : kEnd;
    into.markers.push_back(std::move(ball));
  }
}

void MarkerPainter::add_path(const Trajectory& plan, double from_s, PlanState state, Stamp stamp,
                             MarkerArray& into) {
  Marker line = marker("plan", 0, Marker::LINE_STRIP, stamp);
  line.scale.x = kPathWidth_m;
  line.color = state == PlanState::kFollowed ? kFollowed : kProposed;
  std::vector<double> q(static_cast<std::size_t>(plan.dof));
  for (int i = 0; i <= kPathPoints; ++i) {
    const double share = static_cast<double>(i) / kPathPoints;
    plan.sample(from_s + share * (plan.duration_s() - from_s), q, {});
    robot_->link_poses(q, T_world_link_, scratch_);
    assign(line.points.emplace_back(),
           T_world_link_[static_cast<std::size_t>(link_)].translation());
  }
  into.markers.push_back(std::move(line));
}

MarkerArray MarkerPainter::paint(const Eigen::VectorXd& q, const Trajectory& plan, double from_s,
                                 PlanState state, Stamp ros_stamp) {
  MarkerArray array;
  add_spheres("robot", {q.data(), static_cast<std::size_t>(q.size())}, ros_stamp, array);
  if (plan.size() > 0 && from_s < plan.duration_s()) {
    add_path(plan, from_s, state, ros_stamp, array);
    add_spheres("plan_end", plan.q(plan.size() - 1), ros_stamp, array);
    return array;
  }
  array.markers.push_back(marker("plan", 0, Marker::LINE_STRIP, ros_stamp));
  array.markers.back().action = Marker::DELETE;
  for (std::size_t s = 0; s < centres_m_.size(); ++s) {
    array.markers.push_back(marker("plan_end", static_cast<int>(s), Marker::SPHERE, ros_stamp));
    array.markers.back().action = Marker::DELETE;
  }
  return array;
}

MarkerArray voxel_markers(const OccupancyBits& voxels, const std::string& frame,
                          ::ros::Time stamp) {
  const GridSpec& grid = voxels.grid();
  MarkerArray array = boxes("occupied", frame, stamp, Eigen::Vector3d::Constant(grid.resolution_m));
  const double bottom_m = grid.origin_m.z();
  const double height_m = std::max(1, grid.size_vox.z()) * grid.resolution_m;
  for (const Eigen::Vector3d& centre_m : voxels.occupied_centres_m()) {
    add(array.markers.back(), centre_m, rainbow((centre_m.z() - bottom_m) / height_m, 1.0F));
  }
  return without_empty(std::move(array));
}

MarkerArray slice_markers(const DistanceField& field, double height_m, const std::string& frame,
                          ::ros::Time stamp) {
  const GridSpec& grid = field.info().grid;
  const int largest = std::max(grid.size_vox.x(), grid.size_vox.y());
  const int stride = std::max(1, (largest + kMostSliceSquares - 1) / kMostSliceSquares);
  const double side_m = stride * grid.resolution_m;
  constexpr double kThick_m = 0.002;
  MarkerArray array = boxes("field", frame, stamp, {side_m, side_m, kThick_m});
  if (grid.size_vox.minCoeff() < 1) return without_empty(std::move(array));
  const double top_m = grid.centre_m(grid.size_vox - Eigen::Vector3i::Ones()).z();
  const double bottom_m = grid.centre_m(Eigen::Vector3i::Zero()).z();
  const double z_m = std::clamp(height_m, bottom_m, top_m);
  constexpr double kFar_m = 1.0;
  const double max_m = std::min(field.info().max_distance_m, kFar_m);

  const auto columns = static_cast<std::size_t>((grid.size_vox.x() + stride - 1) / stride);
  std::vector<Eigen::Vector3d> points_m(columns);
  std::vector<double> distances_m(columns);
  std::vector<FieldStatus> statuses(columns);
  for (int y = 0; y < grid.size_vox.y(); y += stride) {
    for (std::size_t c = 0; c < columns; ++c) {
      points_m[c] = grid.centre_m({static_cast<int>(c) * stride, y, 0});
      points_m[c].z() = z_m;
    }
    field.query(points_m, distances_m, {}, statuses);
    for (std::size_t c = 0; c < columns; ++c) {
      if (statuses[c] != FieldStatus::kKnown || std::isnan(distances_m[c])) continue;
      add(array.markers.back(), points_m[c], rainbow(distances_m[c] / max_m, 0.6F));
    }
  }
  return without_empty(std::move(array));
}

MapView::MapView(const MapMarkerOptions& options, std::string frame)
    : options_(options), frame_(std::move(frame)) {
  if (options_.rate_hz <= 0.0) return;
  // Who comes between two pictures sees the last one.
  voxel_topic_ = node_.advertise<ros_messages::MarkerArray>(options_.voxels_topic, 1, true);
  slice_topic_ = node_.advertise<ros_messages::MarkerArray>(options_.slice_topic, 1, true);
}

bool MapView::is_wanted() const {
  if (options_.rate_hz <= 0.0 || SteadyClock::now() < next_) return false;
  return voxel_topic_.getNumSubscribers() > 0 || slice_topic_.getNumSubscribers() > 0;
}

void MapView::show(std::shared_ptr<const DistanceField> field) {
  const ::ros::Time stamp = ::ros::Time::now();
  if (slice_topic_.getNumSubscribers() > 0) {
    slice_topic_.publish(slice_markers(*field, options_.slice_height_m, frame_, stamp));
  }
  if (voxel_topic_.getNumSubscribers() > 0) {
    voxels_.update(std::move(field));
    voxel_topic_.publish(voxel_markers(voxels_, frame_, stamp));
  } else {
    voxels_.clear();
  }
  // Counted from the end: what takes long is shown less often.
  next_ = SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(
                                   std::chrono::duration<double>(1.0 / options_.rate_hz));
}

}  // namespace sidestep::ros1_executor
