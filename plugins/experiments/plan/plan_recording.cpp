#include <algorithm>
#include <cmath>
#include <limits>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>
#include <sidestep/planning/costs.hpp>
#include "plan_parts.hpp"

namespace sidestep {
namespace {

constexpr int kPoses = 25;        ///< At which the robot is drawn.
constexpr int kPathPoints = 201;  ///< Of the paths of base and hand.
constexpr double kSurround_m = 1.0;

/// Centres of all spheres at some instants of a motion.
struct Sweep {
  std::vector<double> shares;  ///< Of the motion's time, one a pose.
  std::vector<std::vector<Eigen::Vector3d>> centres_m;
};

Sweep sweep(const PlanRecord& plan, const RobotModel& robot, int poses) {
  const std::size_t spheres = robot.description().spheres.size();
  Sweep result;
  Scratch scratch;
  Eigen::VectorXd q = plan.q_start;
  const int count = plan.has_trajectory() ? poses : 2;
  for (int i = 0; i < count; ++i) {
    const double share = static_cast<double>(i) / (count - 1);
    if (plan.has_trajectory()) {
      plan.solution.trajectory.sample(share * plan.solution.trajectory.duration_s(), as_span(q),
                                      {});
    } else if (i == 1) {
      q = plan.q_goal;
    }
    result.shares.push_back(share);
    result.centres_m.emplace_back(spheres);
    robot.sphere_centres(as_span(q), result.centres_m.back(), scratch);
  }
  return result;
}

/// The links with spheres that are nearest to and farthest from the root of the robot.
struct Ends {
  int base;
  int tip;
};

Ends find_ends(const RobotDescription& robot) {
  const auto depth_of = [&](const CollisionSphere& sphere) {
    int depth = 0;
    for (int at = sphere.link; at >= 0; at = robot.links[idx(at)].parent) ++depth;
    return depth;
  };
  return {std::ranges::min_element(robot.spheres, {}, depth_of)->link,
          std::ranges::max_element(robot.spheres, {}, depth_of)->link};
}

Eigen::Vector3d link_centroid(const RobotDescription& robot, int link,
                              const std::vector<Eigen::Vector3d>& centres_m) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  int count = 0;
  for (std::size_t s = 0; s < centres_m.size(); ++s) {
    if (robot.spheres[s].link != link) continue;
    sum += centres_m[s];
    ++count;
  }
  return sum / std::max(1, count);
}

struct Plane {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< Where u = v = 0.
  Eigen::Vector3d u = Eigen::Vector3d::UnitX();
  Eigen::Vector3d v = Eigen::Vector3d::UnitY();

  [[nodiscard]] Eigen::Vector2d project(const Eigen::Vector3d& p) const {
    return {u.dot(p - origin), v.dot(p - origin)};
  }
  [[nodiscard]] double distance(const Eigen::Vector3d& p) const {
    return std::abs(u.cross(v).dot(p - origin));
  }
};

/// Where the robot comes, and some space around, as far as the field reaches.
Eigen::AlignedBox2d extent(const Plane& plane, const Sweep& swept, const GridSpec& grid) {
  Eigen::AlignedBox2d area, field;
  for (const auto& centres : swept.centres_m) {
    for (const Eigen::Vector3d& centre : centres) area.extend(plane.project(centre));
  }
  area.min().array() -= kSurround_m;
  area.max().array() += kSurround_m;
  const Eigen::AlignedBox3d grid_box(grid.origin_m, grid.upper_m());
  for (int corner = 0; corner < 8; ++corner) {
    field.extend(plane.project(grid_box.corner(Eigen::AlignedBox3d::CornerType(corner))));
  }
  area.clamp(field);
  // Pixels lie on voxel centres where the plane lies along the grid.
  const Eigen::Vector2d zero = plane.project(grid.origin_m);
  area.min() =
      zero + ((area.min() - zero) / grid.resolution_m).array().round().matrix() * grid.resolution_m;
  return area;
}

void sample_field(const Plane& plane, const PlanningContext& context, FieldSlice& slice) {
  const GridSpec& grid = context.occupancy.occupancy_grid();
  const VoxelBits occupied = context.occupancy.occupied();
  const int columns = slice.distance_m.columns;
  std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(columns));
  std::vector<double> distances(points.size());
  std::vector<FieldStatus> statuses(points.size());
  for (int row = 0; row < slice.distance_m.rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      points[idx(column)] = plane.origin + plane.u * (slice.u0_m + column * slice.step_m) +
                            plane.v * (slice.v0_m + row * slice.step_m);
    }
    context.field->query(points, distances, {}, statuses);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const Eigen::Vector3i voxel = grid.voxel_at(points[i]);
      SliceState state = SliceState::kFree;
      if (statuses[i] == FieldStatus::kOutside) {
        state = SliceState::kOutside;
      } else if (grid.contains(voxel) && occupied.at(grid, voxel)) {
        state = SliceState::kOccupied;
      } else if (statuses[i] == FieldStatus::kUnknown) {
        state = SliceState::kUnknown;
      }
      slice.distance_m.values.push_back(static_cast<float>(distances[i]));
      slice.state.values.push_back(static_cast<float>(state));
    }
  }
}

void cut_spheres(const Plane& plane, const RobotDescription& robot, const Sweep& swept,
                 FieldSlice& slice) {
  StoredArray& circles = slice.circles;
  circles.columns = 4;
  for (std::size_t pose = 0; pose < swept.shares.size(); ++pose) {
    for (std::size_t s = 0; s < robot.spheres.size(); ++s) {
      const Eigen::Vector3d& centre = swept.centres_m[pose][s];
      const double radius_m = robot.spheres[s].radius_m;
      const double off_m = plane.distance(centre);
      if (off_m >= radius_m) continue;
      const Eigen::Vector2d at = plane.project(centre);
      circles.add_row(Eigen::Vector4d(
          at.x(), at.y(), std::sqrt(radius_m * radius_m - off_m * off_m), swept.shares[pose]));
    }
  }
}

/// The way of one link's spheres; empty if it ends where it began.
StoredArray path_of(const Plane& plane, const RobotDescription& robot, int link,
                    const Sweep& path) {
  StoredArray points{0, 2, {}};
  for (const auto& centres : path.centres_m) {
    points.add_row(plane.project(link_centroid(robot, link, centres)));
  }
  return points;
}

FieldSlice cut(const Plane& plane, const PlanningContext& context, const Sweep& swept,
               const Sweep& path) {
  const RobotDescription& robot = context.robot->description();
  const GridSpec& grid = context.field->info().grid;
  const Eigen::AlignedBox2d area = extent(plane, swept, grid);
  FieldSlice slice;
  slice.step_m = grid.resolution_m;
  slice.u0_m = area.min().x() + 0.5 * grid.resolution_m;
  slice.v0_m = area.min().y() + 0.5 * grid.resolution_m;
  const Eigen::Vector2d size = area.sizes() / grid.resolution_m;
  slice.distance_m.columns = std::max(0, static_cast<int>(std::floor(size.x() + 1e-6)));
  slice.distance_m.rows = std::max(0, static_cast<int>(std::floor(size.y() + 1e-6)));
  slice.state.columns = slice.distance_m.columns;
  slice.state.rows = slice.distance_m.rows;
  sample_field(plane, context, slice);
  cut_spheres(plane, robot, swept, slice);
  const Ends ends = find_ends(robot);
  slice.tip_path = path_of(plane, robot, ends.tip, path);
  slice.base_path = StoredArray{0, 2, {}};
  if (ends.base != ends.tip) slice.base_path = path_of(plane, robot, ends.base, path);
  return slice;
}

/// Heights at which something of the robot is: the hand's at the goal, low, and in between.
std::vector<double> choose_heights(const RobotDescription& robot, const Sweep& swept) {
  double lowest = kInfinity;
  for (const auto& centres : swept.centres_m) {
    for (const Eigen::Vector3d& centre : centres) lowest = std::min(lowest, centre.z());
  }
  const double hand = link_centroid(robot, find_ends(robot).tip, swept.centres_m.back()).z();
  return {lowest, 0.5 * (lowest + hand), hand};
}

std::vector<FieldSlice> horizontal_slices(const PlanningContext& context,
                                          std::vector<double> heights, const Sweep& swept,
                                          const Sweep& path) {
  const GridSpec& grid = context.field->info().grid;
  if (heights.empty()) heights = choose_heights(context.robot->description(), swept);
  std::ranges::sort(heights);
  std::vector<FieldSlice> slices;
  int last_layer = std::numeric_limits<int>::min();
  for (const double height : heights) {
    const int layer = std::clamp(grid.voxel_at({0.0, 0.0, height}).z(), 0, grid.size_vox.z() - 1);
    if (layer == last_layer) continue;
    last_layer = layer;
    Plane plane;
    plane.origin = {0.0, 0.0, grid.centre_m({0, 0, layer}).z()};
    FieldSlice slice = cut(plane, context, swept, path);
    slice.title = format("Horizontal, %.2f m above the ground", plane.origin.z());
    slice.u_label = "x [m]";
    slice.v_label = "y [m]";
    slices.push_back(std::move(slice));
  }
  return slices;
}

/// Upright, through the two sphere centres of the goal that are farthest apart from above: along
/// the outstretched arm. Along the way for a robot without extent.
FieldSlice vertical_slice(const PlanningContext& context, const Sweep& swept, const Sweep& path) {
  const std::vector<Eigen::Vector3d>& goal = swept.centres_m.back();
  Eigen::Vector3d from = swept.centres_m.front().front();
  Eigen::Vector3d to = goal.front();
  double widest = 0.3;
  for (const Eigen::Vector3d& a : goal) {
    for (const Eigen::Vector3d& b : goal) {
      const double apart = (b - a).head<2>().norm();
      if (apart <= widest) continue;
      widest = apart;
      from = a;
      to = b;
    }
  }
  Plane plane;
  plane.v = Eigen::Vector3d::UnitZ();
  const Eigen::Vector2d along = (to - from).head<2>();
  if (along.norm() > 1e-6) plane.u << along.normalized(), 0.0;
  plane.origin << from.head<2>(), 0.0;
  FieldSlice slice = cut(plane, context, swept, path);
  slice.title = "Vertical, through the robot at the goal";
  slice.u_label = "along the slice [m]";
  slice.v_label = "height [m]";
  return slice;
}

constexpr int kMotionSamples = 401;

std::string of_item(std::string_view series, std::int64_t item) {
  return std::string(series) + "/" + std::to_string(item);
}

void record_verdict(std::string_view check, const std::optional<Verdict>& verdict,
                    std::int64_t item, Recorder& recorder) {
  if (!verdict) return;
  const std::string prefix(check);
  recorder.add("plan", item, prefix + ".valid", verdict->valid());
  recorder.add("plan", item, prefix + ".min_clearance_m", verdict->min_clearance_m);
  recorder.add("plan", item, prefix + ".clearance_is_bound", verdict->clearance_is_bound);
  recorder.add("plan", item, prefix + ".min_clearance_link", verdict->min_clearance_link);
  recorder.add("plan", item, prefix + ".min_clearance_time_s", verdict->min_clearance_time_s);
  recorder.add("plan", item, prefix + ".min_self_clearance_m", verdict->min_self_clearance_m);
  recorder.add("plan", item, prefix + ".unknown_share", verdict->unknown_share);
  for (std::size_t v = 0; v < verdict->violations.size(); ++v) {
    recorder.add("plan", item, prefix + ".violation." + std::to_string(v),
                 verdict->violations[v].describe());
  }
}

void record_outcome(const PlanRecord& plan, std::int64_t item, Recorder& recorder) {
  recorder.add("plan", item, "name", plan.name);
  recorder.add("plan", item, "success", plan.success());
  recorder.add("plan", item, "reason", plan.reason);
  recorder.add("plan", item, "attempts", plan.attempts);
  recorder.add("plan", item, "status", to_string(plan.solution.status));
  recorder.add("plan", item, "solve_ms", plan.solution.solve_ms);
  recorder.add("plan", item, "iterations", plan.solution.iterations);
  if (plan.retiming) {
    recorder.add("plan", item, "before_retiming_s", plan.retiming->before_s);
    recorder.add("plan", item, "retiming_deviation", plan.retiming->deviation);
    recorder.add("plan", item, "retime_ms", plan.retiming->retime_ms);
  }
  recorder.add("plan", item, "initial_cost", plan.solution.initial_cost);
  recorder.add("plan", item, "cost", plan.solution.cost);
  for (const TermCost& term : plan.solution.terms) {
    recorder.add("plan", item, "cost." + term.name, term.cost);
  }
  if (plan.solution.explanation) {
    const auto& hindrances = plan.solution.explanation->hindrances;
    for (std::size_t h = 0; h < hindrances.size(); ++h) {
      recorder.add("plan", item, "hindrance." + std::to_string(h), hindrances[h].describe());
    }
  }
  record_verdict("snapshot", plan.field_verdict, item, recorder);
  record_verdict("voxels", plan.voxel_verdict, item, recorder);
  record_verdict("scene", plan.scene_verdict, item, recorder);
}

void record_trajectory(const PlanRecord& plan, std::int64_t item, const RobotDescription& robot,
                       Recorder& recorder) {
  const Trajectory& trajectory = plan.solution.trajectory;
  const std::string series = of_item("trajectory", item);
  for (int i = 0; i < trajectory.size(); ++i) {
    recorder.add(series, i, "time_s", trajectory.times_s[static_cast<std::size_t>(i)]);
    for (std::size_t j = 0; j < robot.joints.size(); ++j) {
      recorder.add(series, i, "q." + robot.joints[j].name, trajectory.q(i)[j]);
      recorder.add(series, i, "qdot." + robot.joints[j].name, trajectory.qdot(i)[j]);
    }
  }
}

/// Joints and clearance over time, one array column each: time, clearance, q..., qdot....
void record_motion(const PlanRecord& plan, std::int64_t item, const PlanningContext& context,
                   Recorder& recorder) {
  const Trajectory& trajectory = plan.solution.trajectory;
  const RobotDescription& robot = context.robot->description();
  const auto dof = static_cast<std::size_t>(robot.dof());
  std::vector<double> q(dof), qdot(dof), distances(robot.spheres.size());
  std::vector<Eigen::Vector3d> centres(robot.spheres.size());
  std::vector<FieldStatus> statuses(robot.spheres.size());
  StoredArray motion{kMotionSamples, static_cast<int>(2 + 2 * dof), {}};
  const FloorClearance above_floor(context.planning.space(), robot);
  Scratch scratch;
  for (int i = 0; i < kMotionSamples; ++i) {
    const double time_s = trajectory.duration_s() * i / (kMotionSamples - 1);
    trajectory.sample(time_s, q, qdot);
    context.robot->sphere_centres(q, centres, scratch);
    query_with_policy(*context.field, context.planning.space(), centres, distances, {}, statuses);
    double clearance_m = kInfinity;
    for (std::size_t s = 0; s < centres.size(); ++s) {
      clearance_m = std::min(
          {clearance_m, distances[s] - robot.spheres[s].radius_m, above_floor(s, centres[s])});
    }
    motion.values.push_back(static_cast<float>(time_s));
    motion.values.push_back(static_cast<float>(clearance_m));
    motion.values.insert(motion.values.end(), q.begin(), q.end());
    motion.values.insert(motion.values.end(), qdot.begin(), qdot.end());
  }
  const std::string series = of_item("motion", item);
  recorder.add(series, 0, "motion", motion);
  recorder.add(series, 0, "speed_fraction", context.check.speed_fraction);
  recorder.add(series, 0, "margin_m", context.check.margin_m);
}

/// Horizontal cuts at heights that matter to the plan, then one vertical cut through the robot
/// where it ends. A plan without a trajectory shows its start and its goal.
void record_slices(const PlanRecord& plan, std::int64_t item, const PlanningContext& context,
                   std::span<const double> heights_m, Recorder& recorder) {
  if (context.robot->description().spheres.empty()) return;
  const Sweep swept = sweep(plan, *context.robot, kPoses);
  const Sweep path = plan.has_trajectory() ? sweep(plan, *context.robot, kPathPoints) : Sweep{};
  std::vector<FieldSlice> slices =
      horizontal_slices(context, {heights_m.begin(), heights_m.end()}, swept, path);
  slices.push_back(vertical_slice(context, swept, path));
  stored_slice().record_all(slices, of_item("slice", item), recorder);
}

}  // namespace

StoredRow<FieldSlice> stored_slice() {
  return StoredRow<FieldSlice>()
      .add("title", &FieldSlice::title)
      .add("u_label", &FieldSlice::u_label)
      .add("v_label", &FieldSlice::v_label)
      .add("u0_m", &FieldSlice::u0_m)
      .add("v0_m", &FieldSlice::v0_m)
      .add("step_m", &FieldSlice::step_m)
      .add("distance_m", &FieldSlice::distance_m)
      .add("state", &FieldSlice::state)
      .add("circles", &FieldSlice::circles)
      .add("base_path", &FieldSlice::base_path)
      .add("tip_path", &FieldSlice::tip_path);
}

StoredRow<Joint> stored_joint() {
  return StoredRow<Joint>()
      .add("name", &Joint::name)
      .add(
          "unit", [](const Joint& joint) { return std::string(joint.unit()); },
          [](Joint& joint, std::string_view unit) {
            joint.type = unit == "m" ? Joint::Type::kPrismatic : Joint::Type::kRevolute;
          })
      .add("lower", &Joint::lower)
      .add("upper", &Joint::upper)
      .add("max_velocity", &Joint::max_velocity);
}

void record_plan(const PlanRecord& plan, std::int64_t item, const PlanningContext& context,
                 std::span<const double> slice_heights_m, Recorder& recorder) {
  record_outcome(plan, item, recorder);
  if (plan.has_trajectory()) {
    record_trajectory(plan, item, context.robot->description(), recorder);
    record_motion(plan, item, context, recorder);
  }
  record_slices(plan, item, context, slice_heights_m, recorder);
}

}  // namespace sidestep
