#include <algorithm>
#include <cmath>
#include <string>

#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {
namespace {

constexpr int kMaxStates = 10'000;
constexpr double kLeastSegment_s = 1e-3;
constexpr double kCollinearTolerance = 1e-9;

using ConstRow = Eigen::Map<const Eigen::VectorXd>;

/// The least time of a straight cubic motion from rest to rest: its velocity peaks at
/// 1.5 distance / T, its acceleration at 6 distance / T^2.
double rest_to_rest_s(const RobotDescription& robot, const ConstRow& from, const ConstRow& to,
                      double speed_fraction) {
  double least_s = 0.0;
  for (int j = 0; j < robot.dof(); ++j) {
    const Joint& joint = robot.joints[static_cast<std::size_t>(j)];
    const double distance = std::abs(to[j] - from[j]);
    if (distance == 0.0) continue;
    least_s = std::max(least_s, 1.5 * distance / (speed_fraction * joint.max_velocity));
    if (joint.max_acceleration > 0.0 && std::isfinite(joint.max_acceleration)) {
      least_s = std::max(least_s, std::sqrt(6.0 * distance / joint.max_acceleration));
    }
  }
  return least_s * (1.0 + 1e-9);  // so that rounding never breaks a limit
}

Result<void> check_path(const RobotDescription& robot, std::span<const double> path,
                        double speed_fraction) {
  const auto dof = static_cast<std::size_t>(robot.dof());
  if (dof == 0) return invalid("the robot has no joints");
  if (path.empty() || path.size() % dof != 0) {
    return invalid("a path of " + std::to_string(path.size()) +
                   " values is not a list of configurations of " + std::to_string(dof) + " joints");
  }
  if (!(speed_fraction > 0.0 && speed_fraction <= 1.0)) {
    return invalid("the speed fraction must lie in (0, 1]");
  }
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (!std::isfinite(path[i])) {
      return invalid("joint " + robot.joints[i % dof].name + " of the path's configuration " +
                     std::to_string(i / dof) + " is not a finite number");
    }
  }
  for (const Joint& joint : robot.joints) {
    if (!(joint.max_velocity > 0.0)) {
      return invalid("joint " + joint.name + " has no positive velocity limit");
    }
  }
  return {};
}

/// True if the motion from `tip` to `next` goes on along the line from `from` through `via`.
bool continues_straight(const ConstRow& from, const ConstRow& via, const ConstRow& tip,
                        const ConstRow& next) {
  const Eigen::VectorXd direction = (via - from).normalized();
  const Eigen::VectorXd ahead = next - from;
  const double aside = (ahead - direction.dot(ahead) * direction).norm();
  return direction.dot(next - tip) > 0.0 && aside <= kCollinearTolerance * (1.0 + ahead.norm());
}

/// Indices of the vertices at which the direction changes, and of both ends; repeated vertices
/// and those on the line between their neighbours are left out.
std::vector<std::size_t> corners(std::span<const double> path, std::size_t dof) {
  const auto vertex = [&](std::size_t i) {
    return ConstRow(path.data() + i * dof, static_cast<Eigen::Index>(dof));
  };
  std::vector<std::size_t> distinct{0};
  for (std::size_t i = 1; i < path.size() / dof; ++i) {
    if (vertex(i) != vertex(distinct.back())) distinct.push_back(i);
  }
  std::vector<std::size_t> kept{0};
  std::size_t via = 1;  // distinct[via] fixes the direction of the line from kept.back()
  for (std::size_t i = 2; i < distinct.size(); ++i) {
    if (!continues_straight(vertex(kept.back()), vertex(distinct[via]), vertex(distinct[i - 1]),
                            vertex(distinct[i]))) {
      kept.push_back(distinct[i - 1]);
      via = i;
    }
  }
  if (distinct.size() > 1) kept.push_back(distinct.back());
  return kept;
}

}  // namespace

Horizon estimate_horizon(const RobotDescription& robot, std::span<const double> q_start,
                         std::span<const double> q_goal, double dt_s, double speed_fraction) {
  const auto row = [](std::span<const double> q) {
    return ConstRow(q.data(), static_cast<Eigen::Index>(q.size()));
  };
  const double intervals =
      std::ceil(rest_to_rest_s(robot, row(q_start), row(q_goal), speed_fraction) / dt_s);
  if (!(intervals > 2.0)) return {.states = 3, .dt_s = dt_s};
  return {.states = static_cast<int>(std::min<double>(intervals, kMaxStates - 1)) + 1,
          .dt_s = dt_s};
}

Result<Trajectory> time_path(const RobotDescription& robot, std::span<const double> path,
                             double speed_fraction) {
  SIDESTEP_TRY(check_path(robot, path, speed_fraction));
  const auto dof = static_cast<std::size_t>(robot.dof());
  std::vector<std::size_t> vertices = corners(path, dof);
  if (vertices.size() == 1) vertices.push_back(vertices.front());  // a path that stays put

  Trajectory out = make_trajectory(robot.dof(), static_cast<int>(vertices.size()), 0.0);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    std::ranges::copy(path.subspan(vertices[i] * dof, dof), out.q(static_cast<int>(i)).begin());
    if (i == 0) continue;
    const ConstRow from(path.data() + vertices[i - 1] * dof, robot.dof());
    const ConstRow to(path.data() + vertices[i] * dof, robot.dof());
    out.times_s[i] = out.times_s[i - 1] +
                     std::max(rest_to_rest_s(robot, from, to, speed_fraction), kLeastSegment_s);
  }
  return out;
}

}  // namespace sidestep
