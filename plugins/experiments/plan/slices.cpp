#include "slices.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>

#include <sidestep/core/index.hpp>

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
    const std::span values(q.data(), static_cast<std::size_t>(q.size()));
    if (plan.has_trajectory()) {
      plan.solution.trajectory.sample(share * plan.solution.trajectory.duration_s(), values, {});
    } else if (i == 1) {
      q = plan.q_goal;
    }
    result.shares.push_back(share);
    result.centres_m.emplace_back(spheres);
    robot.sphere_centres(as_span(q), result.centres_m.back(), scratch);
  }
  return result;
}

int depth_of(const RobotDescription& robot, int link) {
  int depth = 0;
  for (int at = link; at >= 0; at = robot.links[idx(at)].parent) ++depth;
  return depth;
}

/// The links with spheres that are nearest to and farthest from the root of the robot.
struct Ends {
  int base = -1;
  int tip = -1;
};

Ends find_ends(const RobotDescription& robot) {
  Ends ends;
  for (const CollisionSphere& sphere : robot.spheres) {
    const int depth = depth_of(robot, sphere.link);
    if (ends.base < 0 || depth < depth_of(robot, ends.base)) ends.base = sphere.link;
    if (ends.tip < 0 || depth > depth_of(robot, ends.tip)) ends.tip = sphere.link;
  }
  return ends;
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

struct Rectangle {
  Eigen::Vector2d lower;
  Eigen::Vector2d upper;
};

/// Where the robot comes, and some space around, as far as the field reaches.
Rectangle extent(const Plane& plane, const Sweep& swept, const GridSpec& grid) {
  const double infinity = std::numeric_limits<double>::infinity();
  Rectangle wanted{Eigen::Vector2d::Constant(infinity), Eigen::Vector2d::Constant(-infinity)};
  for (const auto& centres : swept.centres_m) {
    for (const Eigen::Vector3d& centre : centres) {
      wanted.lower = wanted.lower.cwiseMin(plane.project(centre));
      wanted.upper = wanted.upper.cwiseMax(plane.project(centre));
    }
  }
  wanted.lower.array() -= kSurround_m;
  wanted.upper.array() += kSurround_m;
  Rectangle there{Eigen::Vector2d::Constant(infinity), Eigen::Vector2d::Constant(-infinity)};
  for (int corner = 0; corner < 8; ++corner) {
    Eigen::Vector3d p = grid.origin_m;
    for (int axis = 0; axis < 3; ++axis) {
      if ((corner >> axis & 1) != 0) p[axis] = grid.upper_m()[axis];
    }
    there.lower = there.lower.cwiseMin(plane.project(p));
    there.upper = there.upper.cwiseMax(plane.project(p));
  }
  Rectangle area{wanted.lower.cwiseMax(there.lower), wanted.upper.cwiseMin(there.upper)};
  // Pixels lie on voxel centres where the plane lies along the grid.
  const Eigen::Vector2d zero = plane.project(grid.origin_m);
  area.lower =
      zero + ((area.lower - zero) / grid.resolution_m).array().round().matrix() * grid.resolution_m;
  return area;
}

void sample_field(const Plane& plane, const PlanSurroundings& around, FieldSlice& slice) {
  const GridSpec& grid = around.occupancy.occupancy_grid();
  const VoxelBits occupied = around.occupancy.occupied();
  const int columns = slice.distance_m.columns;
  std::vector<Eigen::Vector3d> points(static_cast<std::size_t>(columns));
  std::vector<double> distances(points.size());
  std::vector<FieldStatus> statuses(points.size());
  for (int row = 0; row < slice.distance_m.rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      points[idx(column)] = plane.origin + plane.u * (slice.u0_m + column * slice.step_m) +
                            plane.v * (slice.v0_m + row * slice.step_m);
    }
    around.field.query(points, distances, {}, statuses);
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
      for (const double value :
           {at.x(), at.y(), std::sqrt(radius_m * radius_m - off_m * off_m), swept.shares[pose]}) {
        circles.values.push_back(static_cast<float>(value));
      }
      ++circles.rows;
    }
  }
}

/// The way of one link's spheres; empty if it ends where it began.
StoredArray path_of(const Plane& plane, const RobotDescription& robot, int link,
                    const Sweep& path) {
  StoredArray points{0, 2, {}};
  for (const auto& centres : path.centres_m) {
    const Eigen::Vector2d at = plane.project(link_centroid(robot, link, centres));
    points.values.push_back(static_cast<float>(at.x()));
    points.values.push_back(static_cast<float>(at.y()));
    ++points.rows;
  }
  return points;
}

FieldSlice cut(const Plane& plane, const PlanSurroundings& around, const Sweep& swept,
               const Sweep& path) {
  const RobotDescription& robot = around.robot.description();
  const GridSpec& grid = around.field.info().grid;
  const Rectangle area = extent(plane, swept, grid);
  FieldSlice slice;
  slice.step_m = grid.resolution_m;
  slice.u0_m = area.lower.x() + 0.5 * grid.resolution_m;
  slice.v0_m = area.lower.y() + 0.5 * grid.resolution_m;
  const Eigen::Vector2d size = (area.upper - area.lower) / grid.resolution_m;
  slice.distance_m.columns = std::max(0, static_cast<int>(std::floor(size.x() + 1e-6)));
  slice.distance_m.rows = std::max(0, static_cast<int>(std::floor(size.y() + 1e-6)));
  slice.state.columns = slice.distance_m.columns;
  slice.state.rows = slice.distance_m.rows;
  sample_field(plane, around, slice);
  cut_spheres(plane, robot, swept, slice);
  const Ends ends = find_ends(robot);
  slice.base_path = StoredArray{0, 2, {}};
  slice.tip_path = StoredArray{0, 2, {}};
  if (ends.tip >= 0) slice.tip_path = path_of(plane, robot, ends.tip, path);
  if (ends.base >= 0 && ends.base != ends.tip) {
    slice.base_path = path_of(plane, robot, ends.base, path);
  }
  return slice;
}

/// Heights at which something of the robot is: the hand's at the goal, low, and in between.
std::vector<double> choose_heights(const RobotDescription& robot, const Sweep& swept) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const auto& centres : swept.centres_m) {
    for (const Eigen::Vector3d& centre : centres) lowest = std::min(lowest, centre.z());
  }
  const double hand = link_centroid(robot, find_ends(robot).tip, swept.centres_m.back()).z();
  return {lowest, 0.5 * (lowest + hand), hand};
}

std::vector<FieldSlice> horizontal_slices(const PlanSurroundings& around, const Sweep& swept,
                                          const Sweep& path) {
  const GridSpec& grid = around.field.info().grid;
  std::vector<double> heights(around.slice_heights_m.begin(), around.slice_heights_m.end());
  if (heights.empty()) heights = choose_heights(around.robot.description(), swept);
  std::ranges::sort(heights);
  std::vector<FieldSlice> slices;
  int last_layer = std::numeric_limits<int>::min();
  for (const double height : heights) {
    const int layer = std::clamp(grid.voxel_at({0.0, 0.0, height}).z(), 0, grid.size_vox.z() - 1);
    if (layer == last_layer) continue;
    last_layer = layer;
    Plane plane;
    plane.origin = {0.0, 0.0, grid.centre_m({0, 0, layer}).z()};
    FieldSlice slice = cut(plane, around, swept, path);
    char title[64];
    std::snprintf(title, sizeof title, "Horizontal, %.2f m above the ground", plane.origin.z());
    slice.title = title;
    slice.u_label = "x [m]";
    slice.v_label = "y [m]";
    slices.push_back(std::move(slice));
  }
  return slices;
}

/// Upright, through the two sphere centres of the goal that are farthest apart from above: along
/// the outstretched arm. Along the way for a robot without extent.
FieldSlice vertical_slice(const PlanSurroundings& around, const Sweep& swept, const Sweep& path) {
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
  FieldSlice slice = cut(plane, around, swept, path);
  slice.title = "Vertical, through the robot at the goal";
  slice.u_label = "along the slice [m]";
  slice.v_label = "height [m]";
  return slice;
}

}  // namespace

std::vector<FieldSlice> cut_slices(const PlanRecord& plan, const PlanSurroundings& around) {
  if (around.robot.description().spheres.empty()) return {};
  const Sweep swept = sweep(plan, around.robot, kPoses);
  const Sweep path = plan.has_trajectory() ? sweep(plan, around.robot, kPathPoints) : Sweep{};
  std::vector<FieldSlice> slices = horizontal_slices(around, swept, path);
  slices.push_back(vertical_slice(around, swept, path));
  return slices;
}

}  // namespace sidestep
