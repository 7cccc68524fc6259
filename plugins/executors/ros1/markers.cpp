#include "markers.hpp"

#include "conversions.hpp"

namespace sidestep::ros1_executor {
namespace {

using ros_messages::Marker;
using ros_messages::MarkerArray;

constexpr int kPathPoints = 60;
constexpr double kPathWidth_m = 0.015;

struct Colour {
  float r, g, b, a;
};
constexpr Colour kRobot{0.2F, 0.5F, 0.9F, 0.5F};
constexpr Colour kEnd{0.3F, 0.8F, 0.4F, 0.25F};
constexpr Colour kFollowed{0.1F, 0.7F, 0.2F, 1.0F};
constexpr Colour kProposed{0.95F, 0.6F, 0.1F, 1.0F};

void paint_in(const Colour& colour, Marker& marker) {
  marker.color.r = colour.r;
  marker.color.g = colour.g;
  marker.color.b = colour.b;
  marker.color.a = colour.a;
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
    ball.pose.position.x = centres_m_[s].x();
    ball.pose.position.y = centres_m_[s].y();
    ball.pose.position.z = centres_m_[s].z();
    ball.scale.x = ball.scale.y = ball.scale.z = 2.0 * spheres[s].radius_m;
    paint_in(group == "robot" ? kRobot : kEnd, ball);
    into.markers.push_back(std::move(ball));
  }
}

void MarkerPainter::add_path(const Trajectory& plan, double from_s, PlanState state, Stamp stamp,
                             MarkerArray& into) {
  Marker line = marker("plan", 0, Marker::LINE_STRIP, stamp);
  line.scale.x = kPathWidth_m;
  paint_in(state == PlanState::kFollowed ? kFollowed : kProposed, line);
  std::vector<double> q(static_cast<std::size_t>(plan.dof));
  for (int i = 0; i <= kPathPoints; ++i) {
    const double share = static_cast<double>(i) / kPathPoints;
    plan.sample(from_s + share * (plan.duration_s() - from_s), q, {});
    robot_->link_poses(q, T_world_link_, scratch_);
    const Eigen::Vector3d p = T_world_link_[static_cast<std::size_t>(link_)].translation();
    auto& point = line.points.emplace_back();
    point.x = p.x();
    point.y = p.y();
    point.z = p.z();
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

}  // namespace sidestep::ros1_executor
