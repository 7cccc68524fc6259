#include <sidestep/core/index.hpp>
#include <sidestep/runtime/shape_check.hpp>
#include <sidestep/trajectory/rolling.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "shape_collider.hpp"
#include "shape_motion.hpp"

namespace sidestep {
namespace {

constexpr double kShortestStep_s = 1e-6;

/// Of positions, relative.
constexpr double kRounding = 24e-15;

/// What is known at one instant, as far as the next step depends on it.
struct Instant {
  double clearance_m = 0.0;              ///< To obstacles, all shapes; capped.
  std::vector<double> pair_clearance_m;  ///< Of each pair of shapes; capped.
};

/// Bound on the speed of any point of a moving object; infinite for a half-space that turns.
double fastest_object_mps(const Scene* scene) {
  double fastest = 0.0;
  for (const SceneObject& object :
       scene != nullptr ? scene->objects() : std::vector<SceneObject>()) {
    CollisionShape shape;
    shape.shape = object.shape;
    const double radius_m = farthest_point_m(shape);
    for (std::size_t i = 1; i < object.waypoints.size(); ++i) {
      const Waypoint& a = object.waypoints[i - 1];
      const Waypoint& b = object.waypoints[i];
      const double turn_rad = Eigen::Quaterniond(a.T_world_object.linear())
                                  .angularDistance(Eigen::Quaterniond(b.T_world_object.linear()));
      double way_m = (b.T_world_object.translation() - a.T_world_object.translation()).norm();
      if (turn_rad > 1e-12) way_m += turn_rad * radius_m;
      fastest = std::max(fastest, way_m / (b.time_s - a.time_s));
    }
  }
  return fastest;
}

class ShapeCheck final : public ValidityCheck {
 public:
  ShapeCheck(std::shared_ptr<const RobotModel> robot, const ShapeObstacles& obstacles,
             ShapeCheckSettings settings)
      : robot_(std::move(robot)),
        settings_(std::move(settings)),
        scene_time_s_(obstacles.scene_time_s),
        motion_(*robot_),
        collider_(robot_->description(), obstacles, settings_.allowed_contacts),
        obstacle_speed_mps_(fastest_object_mps(obstacles.scene.get())) {}

  [[nodiscard]] Result<Verdict> check(const Trajectory& trajectory, double from_s,
                                      const Deadline& deadline) const override;

 private:
  class Run;

  std::shared_ptr<const RobotModel> robot_;
  ShapeCheckSettings settings_;
  double scene_time_s_;
  ShapeMotion motion_;
  ShapeCollider collider_;
  double obstacle_speed_mps_;
};

/// One check of one trajectory.
class ShapeCheck::Run {
 public:
  Run(const ShapeCheck& its, const Trajectory& trajectory)
      : its_(its),
        robot_(its.robot_->description()),
        trajectory_(trajectory),
        pose_(its.collider_.make_pose()),
        poses_(robot_.links.size()),
        q_(robot_.joints.size()),
        ways_(robot_.joints.size()) {
    verdict_.min_clearance_m = its.settings_.farthest_m;
    verdict_.min_self_clearance_m = its.settings_.farthest_m;
  }

  Result<Verdict> check(double from_s, const Deadline& deadline);

 private:
  void check_limits(int segment, double from, double to);
  void check_heading(int segment, double from, double to);
  void add_limit(Violation::Kind kind, std::size_t joint, const BezierJoint::Excess& excess,
                 const std::string& what, double begin_s, double h_s);
  Instant inspect(double time_s);
  void inspect_pairs(double time_s, Instant& instant);
  [[nodiscard]] double step_end_s(const Instant& now, int segment, double time_s, double to_s);
  void load_segment(int segment);
  [[nodiscard]] double duration_s(int segment) const;
  void measure_ways(double from_s, double to_s, int segment);
  [[nodiscard]] double obstacle_way_m(double h_s, double limit_m) const;
  [[nodiscard]] double pair_way_m(int pair, double limit_m) const;
  [[nodiscard]] double excess_way(const Instant& now, double h_s) const;
  void require_proof(const Instant& before, const Instant& after, double from_s, double to_s);
  void report(Violation violation);
  void finish();

  const ShapeCheck& its_;
  const RobotDescription& robot_;
  const Trajectory& trajectory_;
  ShapeCollider::PosePtr pose_;
  std::vector<Transform> poses_;         // of links, at the newest instant
  std::vector<Transform> poses_before_;  // at the one before
  std::vector<double> q_;
  std::vector<double> ways_;
  std::vector<BezierJoint> joints_;
  Scratch scratch_;
  Verdict verdict_;
};

Result<Verdict> ShapeCheck::check(const Trajectory& trajectory, double from_s,
                                  const Deadline& deadline) const {
  if (trajectory.dof != robot_->description().dof()) {
    return invalid("the trajectory has " + std::to_string(trajectory.dof) + " joints, but " +
                   robot_->description().name + " has " +
                   std::to_string(robot_->description().dof()));
  }
  SIDESTEP_TRY(trajectory.validate());
  if (std::isnan(from_s)) {
    return invalid("the time to check from is not a number");
  }
  return Run(*this, trajectory).check(std::clamp(from_s, 0.0, trajectory.duration_s()), deadline);
}

Result<Verdict> ShapeCheck::Run::check(double from_s, const Deadline& deadline) {
  const auto& times = trajectory_.times_s;
  int segment = 0;
  while (segment + 2 < trajectory_.size() && times[idx(segment) + 1] <= from_s) ++segment;
  Instant now = inspect(from_s);
  if (from_s >= trajectory_.duration_s()) {
    check_limits(segment, 1.0, 1.0);
    check_heading(segment, 1.0, 1.0);
    finish();
    return std::move(verdict_);
  }
  for (double time_s = from_s; segment + 1 < trajectory_.size(); ++segment) {
    const double begin_s = times[idx(segment)];
    const double end_s = times[idx(segment) + 1];
    check_limits(segment, (time_s - begin_s) / (end_s - begin_s), 1.0);
    check_heading(segment, (time_s - begin_s) / (end_s - begin_s), 1.0);
    while (time_s < end_s) {
      if (deadline.expired()) {
        return fail(ErrorCode::kDeadlineExceeded,
                    "the check of the robot's shapes ran out of time " + std::to_string(time_s) +
                        " s into " + std::to_string(trajectory_.duration_s()) + " s of motion");
      }
      const double next_s = step_end_s(now, segment, time_s, end_s);
      Instant next = inspect(next_s);
      measure_ways(time_s, next_s, segment);
      require_proof(now, next, time_s, next_s);
      now = std::move(next);
      time_s = next_s;
    }
  }
  finish();
  return std::move(verdict_);
}

void ShapeCheck::Run::load_segment(int segment) {
  const int next = std::min(segment + 1, trajectory_.size() - 1);  // one state alone stands still
  const double h_s = duration_s(segment);
  joints_.clear();
  for (std::size_t j = 0; j < robot_.joints.size(); ++j) {
    joints_.push_back(BezierJoint::between(trajectory_.q(segment)[j], trajectory_.qdot(segment)[j],
                                           trajectory_.q(next)[j], trajectory_.qdot(next)[j], h_s));
  }
}

double ShapeCheck::Run::duration_s(int segment) const {
  if (segment + 1 >= trajectory_.size()) return 1.0;
  return trajectory_.times_s[idx(segment) + 1] - trajectory_.times_s[idx(segment)];
}

void ShapeCheck::Run::check_limits(int segment, double from, double to) {
  load_segment(segment);
  const double begin_s = trajectory_.times_s[idx(segment)];
  const double h_s = duration_s(segment);
  const double tolerance = its_.settings_.limit_tolerance;
  const auto negated = [](auto controls) {
    for (double& control : controls) control = -control;
    return controls;
  };
  using Kind = Violation::Kind;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Joint& joint = robot_.joints[j];
    const BezierJoint& curve = joints_[j];
    const double speed = its_.settings_.speed_fraction * joint.max_velocity;
    const auto above = [&](const auto& controls, double limit) {
      return BezierJoint::above(controls, limit, tolerance, from, to);
    };
    add_limit(Kind::kPositionLimit, j, above(curve.position, joint.upper), "its upper limit",
              begin_s, h_s);
    add_limit(Kind::kPositionLimit, j, above(negated(curve.position), -joint.lower),
              "its lower limit", begin_s, h_s);
    add_limit(Kind::kVelocityLimit, j, above(curve.velocity, speed), "its velocity limit", begin_s,
              h_s);
    add_limit(Kind::kVelocityLimit, j, above(negated(curve.velocity), speed), "its velocity limit",
              begin_s, h_s);
    if (!(to > from && joint.max_acceleration > 0.0)) continue;  // at an instant, or not known
    // What the positions' last digits make of an acceleration is no acceleration.
    const double noise = kRounding * std::abs(curve.position[0]) / (h_s * h_s);
    const double most = its_.settings_.acceleration_fraction * joint.max_acceleration + noise;
    add_limit(Kind::kAccelerationLimit, j, above(curve.acceleration, most),
              "its acceleration limit", begin_s, h_s);
    add_limit(Kind::kAccelerationLimit, j, above(negated(curve.acceleration), most),
              "its acceleration limit", begin_s, h_s);
  }
}

/// What moves along the heading, at five instants of a segment, or one for each 0.1 rad.
void ShapeCheck::Run::check_heading(int segment, double from, double to) {
  if (!robot_.rolling) return;
  const auto [x, y, yaw] = *robot_.rolling;
  const double begin_s = trajectory_.times_s[idx(segment)];
  const double limit = its_.settings_.speed_fraction * robot_.joints[idx(x)].max_velocity;
  std::vector<double> qdot(idx(trajectory_.dof));
  const BezierJoint& heading = joints_[idx(yaw)];
  double turn = 0.0;  // along the control points: at least that of the curve
  for (std::size_t c = 1; c < heading.position.size(); ++c) {
    turn += std::abs(heading.position[c] - heading.position[c - 1]);
  }
  const int looks = 4 + static_cast<int>(std::min(1e4, turn / 0.1));
  for (int look = 0; look <= looks; ++look) {
    const double share = static_cast<double>(look) / looks;
    const double time_s = begin_s + (from + share * (to - from)) * duration_s(segment);
    trajectory_.sample(time_s, q_, qdot);
    const double speed = std::hypot(qdot[idx(x)], qdot[idx(y)]);
    const double off = std::atan2(qdot[idx(y)], qdot[idx(x)]) - q_[idx(yaw)];
    const double across = std::abs(speed * std::sin(off));
    const double along = std::abs(speed * std::cos(off));
    using Kind = Violation::Kind;
    if (across > kSlipTolerance_mps) {
      report({.kind = Kind::kSideways,
              .subject = kBaseName,
              .other = {},
              .time_s = time_s,
              .amount = across});
    }
    if (along > limit + its_.settings_.limit_tolerance) {
      report({.kind = Kind::kVelocityLimit,
              .subject = kBaseName,
              .other = "its velocity limit",
              .time_s = time_s,
              .amount = along - limit});
    }
  }
}

void ShapeCheck::Run::add_limit(Violation::Kind kind, std::size_t joint,
                                const BezierJoint::Excess& excess, const std::string& what,
                                double begin_s, double h_s) {
  if (excess.amount <= 0.0) return;
  Violation violation;
  violation.kind = kind;
  violation.subject = robot_.joints[joint].name;
  violation.other = what;
  violation.time_s = begin_s + excess.u * h_s;
  violation.amount = excess.amount;
  report(std::move(violation));
}

Instant ShapeCheck::Run::inspect(double time_s) {
  trajectory_.sample(time_s, q_, {});
  its_.robot_->link_poses(q_, poses_, scratch_);
  its_.collider_.place(*pose_, poses_, its_.scene_time_s_ + time_s);
  // Farther than both the least clearance so far and a whole step nothing matters.
  const double near_m = std::max(verdict_.min_clearance_m, its_.settings_.max_step_m);
  Instant instant;
  instant.clearance_m = near_m;
  for (int s = 0; s < its_.collider_.shape_count(); ++s) {
    const auto found = its_.collider_.to_obstacles(s, *pose_, std::max(0.0, near_m));
    if (found.other.empty()) continue;
    const std::string& link = robot_.links[idx(robot_.shapes[idx(s)].link)].name;
    instant.clearance_m = std::min(instant.clearance_m, found.clearance_m);
    if (found.clearance_m < verdict_.min_clearance_m) {
      verdict_.min_clearance_m = found.clearance_m;
      verdict_.min_clearance_link = link;
      verdict_.min_clearance_time_s = time_s;
    }
    if (found.clearance_m < 0.0) {
      report({Violation::Kind::kCollision, link, found.other, time_s, -found.clearance_m});
    }
  }
  inspect_pairs(time_s, instant);
  return instant;
}

void ShapeCheck::Run::inspect_pairs(double time_s, Instant& instant) {
  const double near_m = std::max(verdict_.min_self_clearance_m, 2.0 * its_.settings_.max_step_m);
  for (int p = 0; p < its_.collider_.pair_count(); ++p) {
    const double clearance_m = its_.collider_.between_pair(p, *pose_, near_m);
    instant.pair_clearance_m.push_back(clearance_m);
    verdict_.min_self_clearance_m = std::min(verdict_.min_self_clearance_m, clearance_m);
    if (clearance_m >= 0.0) continue;
    const auto [a, b] = its_.collider_.pair_links(p);
    report({Violation::Kind::kSelfCollision, robot_.links[idx(b)].name, robot_.links[idx(a)].name,
            time_s, -clearance_m});
  }
}

void ShapeCheck::Run::measure_ways(double from_s, double to_s, int segment) {
  const double begin_s = trajectory_.times_s[idx(segment)];
  const double h_s = duration_s(segment);
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    ways_[j] = (to_s - from_s) *
               joints_[j].fastest((from_s - begin_s) / h_s, std::min(1.0, (to_s - begin_s) / h_s));
  }
}

double ShapeCheck::Run::obstacle_way_m(double h_s, double limit_m) const {
  return its_.motion_.robot_way_m(poses_before_, ways_, limit_m) + h_s * its_.obstacle_speed_mps_;
}

double ShapeCheck::Run::pair_way_m(int pair, double limit_m) const {
  const auto [a, b] = its_.collider_.pair_links(pair);
  return its_.motion_.link_way_m(a, poses_before_, ways_, limit_m, b) +
         its_.motion_.link_way_m(b, poses_before_, ways_, limit_m, a);
}

/// The longest way of a step of h_s, measured by what may be moved: the clearance found, within
/// the settings; where there is contact there is nothing to show.
double ShapeCheck::Run::excess_way(const Instant& now, double h_s) const {
  const ShapeCheckSettings& settings = its_.settings_;
  const auto allowed_m = [&](double clearance_m, double longest_m) {
    if (clearance_m < 0.0) return longest_m;
    return std::clamp(clearance_m, settings.min_step_m, longest_m);
  };
  const double longest_m = settings.max_step_m;
  double excess = obstacle_way_m(h_s, longest_m) / allowed_m(now.clearance_m, longest_m);
  for (int p = 0; p < its_.collider_.pair_count(); ++p) {
    excess = std::max(excess, pair_way_m(p, longest_m) /
                                  allowed_m(now.pair_clearance_m[idx(p)], 2.0 * longest_m));
  }
  return excess;
}

double ShapeCheck::Run::step_end_s(const Instant& now, int segment, double time_s, double to_s) {
  poses_before_ = poses_;
  double h_s = to_s - time_s;
  while (h_s > kShortestStep_s) {
    measure_ways(time_s, time_s + h_s, segment);
    const double excess = excess_way(now, h_s);
    if (excess <= 1.0) break;
    h_s *= std::clamp(0.95 / excess, 0.05, 0.95);
  }
  return time_s + h_s >= to_s ? to_s : time_s + h_s;
}

/// Between two instants nothing comes nearer than half of what their clearances exceed the way.
void ShapeCheck::Run::require_proof(const Instant& before, const Instant& after, double from_s,
                                    double to_s) {
  const double limit_m = its_.settings_.max_step_m;
  const double middle_s = 0.5 * (from_s + to_s);
  const auto shortfall = [](double a, double b, double way) {
    return a < 0.0 || b < 0.0 ? 0.0 : 0.5 * (way - a - b);  // contacts are reported as such
  };
  const double field_m =
      shortfall(before.clearance_m, after.clearance_m, obstacle_way_m(to_s - from_s, limit_m));
  if (field_m > 0.0) {
    report(
        {Violation::Kind::kUnproven, verdict_.min_clearance_link, "obstacles", middle_s, field_m});
  }
  for (int p = 0; p < its_.collider_.pair_count(); ++p) {
    const double pair_m = shortfall(before.pair_clearance_m[idx(p)], after.pair_clearance_m[idx(p)],
                                    pair_way_m(p, limit_m));
    if (pair_m <= 0.0) continue;
    const auto [a, b] = its_.collider_.pair_links(p);
    report({Violation::Kind::kUnproven, robot_.links[idx(b)].name, robot_.links[idx(a)].name,
            middle_s, pair_m});
  }
}

void ShapeCheck::Run::report(Violation violation) {
  for (Violation& known : verdict_.violations) {
    if (known.kind != violation.kind || known.subject != violation.subject) continue;
    if (violation.amount > known.amount) known = std::move(violation);
    return;
  }
  verdict_.violations.push_back(std::move(violation));
}

void ShapeCheck::Run::finish() {
  verdict_.clearance_is_bound = verdict_.min_clearance_link.empty();
  const auto is_open = [](const Violation& v) { return v.kind == Violation::Kind::kUnproven; };
  std::stable_sort(verdict_.violations.begin(), verdict_.violations.end(),
                   [&](const Violation& a, const Violation& b) {
                     return a.kind != b.kind ? a.kind < b.kind : a.amount > b.amount;
                   });
  verdict_.outcome = verdict_.violations.empty()            ? Verdict::Outcome::kValid
                     : is_open(verdict_.violations.front()) ? Verdict::Outcome::kUnproven
                                                            : Verdict::Outcome::kInvalid;
}

Result<void> validate_obstacles(const ShapeObstacles& obstacles) {
  if (obstacles.occupied_centres_m.empty()) return {};
  if (!(obstacles.resolution_m > 0.0) || !std::isfinite(obstacles.resolution_m)) {
    return invalid("the obstacles' voxels have no size");
  }
  for (const Eigen::Vector3d& centre : obstacles.occupied_centres_m) {
    if (!centre.allFinite()) {
      return invalid("the centre of an occupied voxel is not finite");
    }
  }
  return {};
}

Result<void> validate_contacts(const RobotDescription& robot, const Scene* scene,
                               const std::vector<AllowedContact>& contacts) {
  std::vector<std::string> links;
  std::vector<std::string> objects;
  for (const Link& link : robot.links) links.push_back(link.name);
  if (scene != nullptr) {
    for (const SceneObject& object : scene->objects()) objects.push_back(object.name);
  }
  const auto require = [](const std::string& name, const std::vector<std::string>& names,
                          const std::string& what) -> Result<void> {
    if (std::find(names.begin(), names.end(), name) != names.end()) return {};
    return fail(ErrorCode::kInvalidArgument,
                "an allowed contact names " + what + " \"" + name + "\", which does not exist", {},
                did_you_mean(name, names));
  };
  for (const AllowedContact& contact : contacts) {
    SIDESTEP_TRY(require(contact.link, links, "the link"));
    SIDESTEP_TRY(require(contact.object, objects, "the object"));
  }
  return {};
}

}  // namespace

std::vector<Eigen::Vector3d> occupied_centres(const OccupancyView& view) {
  const GridSpec& grid = view.occupancy_grid();
  const VoxelBits bits = view.occupied();
  std::vector<Eigen::Vector3d> centres;
  for (int k = 0; k < grid.size_vox.z(); ++k) {
    for (int j = 0; j < grid.size_vox.y(); ++j) {
      for (int i = 0; i < grid.size_vox.x(); ++i) {
        if (bits.at(grid, {i, j, k})) centres.push_back(grid.centre_m({i, j, k}));
      }
    }
  }
  return centres;
}

Result<std::unique_ptr<ValidityCheck>> make_shape_check(std::shared_ptr<const RobotModel> robot,
                                                        const ShapeObstacles& obstacles,
                                                        ShapeCheckSettings settings) {
  const RobotDescription& description = robot->description();
  if (description.shapes.empty()) {
    return fail(ErrorCode::kInvalidArgument, description.name + " has no collision shapes", {},
                "give its links <collision> elements in the URDF");
  }
  for (const CollisionShape& shape : description.shapes) {
    if (!std::isfinite(farthest_point_m(shape))) {
      return invalid("a collision shape of link " + description.links[idx(shape.link)].name +
                     " is not bounded");
    }
  }
  if (!(settings.max_step_m > 0.0 && settings.min_step_m > 0.0 && settings.farthest_m > 0.0)) {
    return invalid("the steps of the shape check must be positive");
  }
  settings.min_step_m = std::min(settings.min_step_m, settings.max_step_m);
  SIDESTEP_TRY(validate_obstacles(obstacles));
  SIDESTEP_TRY(validate_contacts(description, obstacles.scene.get(), settings.allowed_contacts));
  return std::make_unique<ShapeCheck>(std::move(robot), obstacles, std::move(settings));
}

}  // namespace sidestep
