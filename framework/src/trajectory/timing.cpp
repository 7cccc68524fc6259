#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include <Eigen/Core>

#include <sidestep/core/index.hpp>
#include <sidestep/trajectory/blend.hpp>
#include <sidestep/trajectory/motion_limits.hpp>
#include <sidestep/trajectory/trajectory.hpp>

namespace sidestep {
namespace {

bool is_known(double max_acceleration) {
  return max_acceleration > 0.0 && std::isfinite(max_acceleration);
}

double least_time_of_joint_s(double distance, double velocity, double acceleration) {
  const bool sound = velocity > 0.0 && acceleration > 0.0 && std::isfinite(distance);
  if (distance == 0.0) return 0.0;
  if (!sound) return std::numeric_limits<double>::infinity();
  if (std::isinf(acceleration)) return distance / velocity;
  // D / V + V / A grows with V beyond the peak of the triangle, which the joint does not reach.
  const double peak = std::min(velocity, std::sqrt(distance * acceleration));
  return distance / peak + peak / acceleration;
}

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
    const Joint& joint = robot.joints[idx(j)];
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
  const auto dof = idx(robot.dof());
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
  const auto vertex = [&](std::size_t i) { return ConstRow(path.data() + i * dof, dof); };
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

constexpr double kLeastLine = 1e-9;  ///< Of a line: less of it between two corners is rounding.

ConstRow state(const Trajectory& path, int i) { return {path.q(i).data(), path.dof}; }

Result<void> check(const Trajectory& path, double reach) {
  SIDESTEP_TRY(path.validate());
  if (!(reach > 0.0)) {
    return invalid("the reach of a rounded corner must be positive, not " + std::to_string(reach));
  }
  if (path.size() < 2) {
    return invalid("a path of fewer than two states has no lines");
  }
  for (int i = 0; i < path.size(); ++i) {
    const auto qdot = path.qdot(i);
    if (std::ranges::any_of(qdot, [](double v) { return v != 0.0; })) {
      return invalid("state " + std::to_string(i) + " of the path moves: it has no corner");
    }
    if (i > 0 && state(path, i) == state(path, i - 1)) {
      return invalid("states " + std::to_string(i - 1) + " and " + std::to_string(i) +
                     " of the path are one");
    }
  }
  return {};
}

}  // namespace

MotionLimits motion_limits(const RobotDescription& robot, const LimitShares& shares) {
  MotionLimits limits;
  const bool any_brakes =
      std::ranges::any_of(robot.joints, [](const Joint& j) { return j.max_braking.has_value(); });
  for (const Joint& joint : robot.joints) {
    const double acceleration = is_known(joint.max_acceleration)
                                    ? joint.max_acceleration
                                    : joint.max_velocity / shares.assumed_ramp_s;
    limits.velocity.push_back(shares.speed_fraction * joint.max_velocity);
    limits.acceleration.push_back(shares.acceleration_fraction * acceleration);
    if (any_brakes) {
      limits.braking.push_back(shares.acceleration_fraction *
                               joint.max_braking.value_or(acceleration));
    }
    limits.names.push_back(joint.name);
  }
  limits.rolling = robot.rolling;
  return limits;
}

std::vector<std::string> joints_of_unknown_acceleration(const RobotDescription& robot) {
  std::vector<std::string> names;
  for (const Joint& joint : robot.joints) {
    if (!is_known(joint.max_acceleration)) names.push_back(joint.name);
  }
  return names;
}

double least_time_s(const MotionLimits& limits, std::span<const double> q_from,
                    std::span<const double> q_to) noexcept {
  double least_s = 0.0;
  for (std::size_t j = 0; j < q_from.size(); ++j) {
    least_s = std::max(least_s, least_time_of_joint_s(std::abs(q_to[j] - q_from[j]),
                                                      limits.velocity[j], limits.acceleration[j]));
  }
  return least_s;
}

Horizon estimate_horizon(const RobotDescription& robot, std::span<const double> q_start,
                         std::span<const double> q_goal, double dt_s, double speed_fraction) {
  const auto row = [](std::span<const double> q) { return ConstRow(q.data(), q.size()); };
  const double intervals =
      std::ceil(rest_to_rest_s(robot, row(q_start), row(q_goal), speed_fraction) / dt_s);
  if (!(intervals > 2.0)) return {.states = 3, .dt_s = dt_s};
  return {.states = static_cast<int>(std::min<double>(intervals, kMaxStates - 1)) + 1,
          .dt_s = dt_s};
}

Result<Trajectory> time_path(const RobotDescription& robot, std::span<const double> path,
                             double speed_fraction) {
  SIDESTEP_TRY(check_path(robot, path, speed_fraction));
  const auto dof = idx(robot.dof());
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

Result<Trajectory> blend_corners(const Trajectory& path, double reach) {
  SIDESTEP_TRY(check(path, reach));
  const int lines = path.size() - 1;
  std::vector<Eigen::VectorXd> directions;
  std::vector<double> lengths;
  for (int i = 0; i < lines; ++i) {
    const Eigen::VectorXd line = state(path, i + 1) - state(path, i);
    lengths.push_back(line.norm());
    directions.push_back(line / lengths.back());
  }
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(path.dof);
  Trajectory out;
  out.dof = path.dof;
  const auto add = [&](const Eigen::VectorXd& q, const Eigen::VectorXd& qdot, double after_s) {
    out.times_s.push_back(out.times_s.empty() ? 0.0 : out.times_s.back() + after_s);
    out.positions.insert(out.positions.end(), q.begin(), q.end());
    out.velocities.insert(out.velocities.end(), qdot.begin(), qdot.end());
  };
  add(state(path, 0), rest, 0.0);
  double used = 0.0;  // of the line, by the corner before it
  for (std::size_t i = 0; i + 1 < lengths.size(); ++i) {
    const ConstRow corner = state(path, static_cast<int>(i) + 1);
    const double cut = std::min({reach, 0.5 * lengths[i], 0.5 * lengths[i + 1]});
    const double left = lengths[i] - used - cut;
    // From rest to unit speed a line takes twice its length.
    if (left > kLeastLine * lengths[i]) {
      add(corner - cut * directions[i], directions[i], (i == 0 ? 2 : 1) * left);
    }
    add(corner + cut * directions[i + 1], directions[i + 1], 2.0 * cut);
    used = cut;
  }
  add(state(path, lines), rest, 2.0 * (lengths.back() - used));
  return out;
}

}  // namespace sidestep
