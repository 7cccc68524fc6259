#include "shape_collider.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <utility>

#include <fcl/broadphase/broadphase_dynamic_AABB_tree.h>
#include <fcl/geometry/bvh/BVH_model.h>
#include <fcl/geometry/octree/octree.h>
#include <fcl/geometry/shape/box.h>
#include <fcl/geometry/shape/capsule.h>
#include <fcl/geometry/shape/cylinder.h>
#include <fcl/geometry/shape/sphere.h>
#include <fcl/narrowphase/collision.h>
#include <fcl/narrowphase/collision_object.h>
#include <fcl/narrowphase/distance.h>
#include <octomap/OcTree.h>

#include <sidestep/core/index.hpp>
#include <sidestep/planning/validity_check.hpp>

#include "voxel_boxes.hpp"

namespace sidestep {
namespace {

using Geometry = std::shared_ptr<fcl::CollisionGeometryd>;
using Object = fcl::CollisionObjectd;

constexpr int kVoxelOwner = -1;
constexpr int kFloorOwner = -3;
constexpr double kTouching_m = 1e-6;  // FCL's own tolerance
// With FCL's default tolerance cylinders come out 5e-5 m too far away, in a third less time.
constexpr double kDistanceTolerance_m = 1e-9;
constexpr double kGapTolerance_m = 1e-6;
constexpr std::size_t kMaxContacts = 16;
const char* const kVoxelName = "occupied voxels";

/// FCL's geometry for a shape; null for a half-space, which FCL cannot measure distances to.
struct ToGeometry {
  Geometry operator()(const Box& box) const {
    return std::make_shared<fcl::Boxd>(box.size_m.x(), box.size_m.y(), box.size_m.z());
  }
  Geometry operator()(const Sphere& sphere) const {
    return std::make_shared<fcl::Sphered>(sphere.radius_m);
  }
  Geometry operator()(const Cylinder& cylinder) const {
    return std::make_shared<fcl::Cylinderd>(cylinder.radius_m, cylinder.length_m);
  }
  Geometry operator()(const Capsule& capsule) const {
    return std::make_shared<fcl::Capsuled>(capsule.radius_m, capsule.length_m);
  }
  Geometry operator()(const HalfSpace&) const { return nullptr; }
  Geometry operator()(const std::shared_ptr<const Mesh>& mesh) const {
    auto model = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
    model->beginModel(static_cast<int>(mesh->triangles.size()),
                      static_cast<int>(mesh->vertices_m.size()));
    std::vector<fcl::Triangle> triangles;
    for (const Eigen::Vector3i& t : mesh->triangles) {
      triangles.emplace_back(idx(t.x()), idx(t.y()), idx(t.z()));
    }
    model->addSubModel(mesh->vertices_m, triangles);
    model->endModel();
    return model;
  }
};

fcl::Transform3d to_fcl(const Transform& transform) {
  fcl::Transform3d out = fcl::Transform3d::Identity();
  out.linear() = transform.linear();
  out.translation() = transform.translation();
  return out;
}

void move(Object& object, const Transform& transform) {
  object.setTransform(to_fcl(transform));
  object.computeAABB();
}

/// The largest component along the unit vector `n` of any point of an object's shape; infinity for
/// an octree.
double reach_m(const Object& object, const Eigen::Vector3d& n) {
  const fcl::CollisionGeometryd* geometry = object.collisionGeometry().get();
  const Eigen::Vector3d n_shape = object.getRotation().transpose() * n;
  double reach_m = std::numeric_limits<double>::infinity();
  if (const auto* box = dynamic_cast<const fcl::Boxd*>(geometry)) {
    reach_m = 0.5 * box->side.dot(n_shape.cwiseAbs());
  } else if (const auto* sphere = dynamic_cast<const fcl::Sphered*>(geometry)) {
    reach_m = sphere->radius;
  } else if (const auto* cylinder = dynamic_cast<const fcl::Cylinderd*>(geometry)) {
    reach_m =
        0.5 * cylinder->lz * std::abs(n_shape.z()) + cylinder->radius * n_shape.head<2>().norm();
  } else if (const auto* capsule = dynamic_cast<const fcl::Capsuled*>(geometry)) {
    reach_m = 0.5 * capsule->lz * std::abs(n_shape.z()) + capsule->radius;
  } else if (const auto* mesh = dynamic_cast<const fcl::BVHModel<fcl::OBBRSSd>*>(geometry)) {
    reach_m = -reach_m;
    for (int i = 0; i < mesh->num_vertices; ++i) {
      reach_m = std::max(reach_m, n_shape.dot(mesh->vertices[i]));
    }
  }
  return n.dot(object.getTranslation()) + reach_m;
}

/// How far the lowest point of an object lies above the plane z = 0 of a frame.
double height_m(const Object& object, const Transform& T_plane_world) {
  const Eigen::Vector3d up = T_plane_world.linear().row(2).transpose();
  return T_plane_world.translation().z() - reach_m(object, -up);
}

/// The shortest of some translations that take two objects apart, along the axes of both and along
/// the line of their centres. No contact is deeper.
double way_apart_m(const Object& a, const Object& b) {
  double way_m = std::numeric_limits<double>::infinity();
  const auto try_along = [&](const Eigen::Vector3d& n) {
    way_m = std::min(way_m, reach_m(a, n) + reach_m(b, -n));
  };
  for (const Object* object : {&a, &b}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Eigen::Vector3d n = object->getRotation().col(axis);
      try_along(n);
      try_along(-n);
    }
  }
  const Eigen::Vector3d between = b.getTranslation() - a.getTranslation();
  if (between.norm() > 0.0) try_along(between.normalized());
  return way_m;
}

/// The depth of the deepest contact; 0 where there is none. FCL's depth is one along the line on
/// which its search ended, which may be that of a long box's length: way_apart_m() bounds it.
double contact_depth_m(const Object& a, const Object& b) {
  if (!a.getAABB().overlap(b.getAABB())) return 0.0;
  const fcl::CollisionRequestd request(kMaxContacts, true);
  fcl::CollisionResultd result;
  if (fcl::collide(&a, &b, request, result) == 0) return 0.0;
  double depth_m = 0.0;
  for (std::size_t i = 0; i < result.numContacts(); ++i) {
    depth_m = std::max(depth_m, std::abs(result.getContact(i).penetration_depth));
  }
  return std::max(std::min(depth_m, way_apart_m(a, b)), kTouching_m);
}

/// Distance of two objects that do not overlap, or `bound_m` if they are farther apart.
double separation_m(const Object& a, const Object& b, double bound_m,
                    double tolerance_m = kDistanceTolerance_m) {
  if (a.getAABB().distance(b.getAABB()) >= bound_m) return bound_m;
  const fcl::DistanceRequestd request(false, false, 0.0, 0.0, tolerance_m);
  fcl::DistanceResultd result;
  fcl::distance(&a, &b, request, result);
  return std::min(bound_m, std::max(0.0, result.min_distance));
}

/// Minus the depth if they overlap, else their distance up to the bound.
double proximity_m(const Object& a, const Object& b, double bound_m) {
  const double depth_m = contact_depth_m(a, b);
  return depth_m > 0.0 ? -depth_m : separation_m(a, b, bound_m);
}

struct RobotShape {
  int link = 0;
  Shape shape;
  Transform T_link_shape;
  Geometry geometry;
  std::set<int> ignored;          // scene objects this link may touch
  std::optional<double> floor_m;  // height of the floor, where there is one for this link
};

/// What a walk through the static obstacles carries along.
struct Nearest {
  const std::set<int>& ignored;
  double clearance_m;
  int owner = kVoxelOwner;
  bool is_found = false;

  void hear(double clearance, int its_owner) {
    if (clearance >= clearance_m) return;
    clearance_m = clearance;
    owner = its_owner;
    is_found = true;
  }
};

int owner_of(const Object& object) {
  return static_cast<int>(reinterpret_cast<std::intptr_t>(object.getUserData()));
}

/// FCL hands over the pair in either order; the robot's objects carry this owner.
constexpr int kRobotOwner = -2;
/// How FCL's objects carry their owner: as a pointer that nobody follows.
void* tag(int owner) {
  // NOLINTNEXTLINE(performance-no-int-to-ptr)
  return reinterpret_cast<void*>(static_cast<std::intptr_t>(owner));
}

const Object& obstacle_of(const Object& a, const Object& b) {
  return owner_of(a) == kRobotOwner ? b : a;
}

bool on_overlap(Object* a, Object* b, void* data) {
  auto& nearest = *static_cast<Nearest*>(data);
  const int owner = owner_of(obstacle_of(*a, *b));
  if (nearest.ignored.count(owner) != 0) return false;
  const double depth_m = contact_depth_m(*a, *b);
  if (depth_m > 0.0) nearest.hear(-depth_m, owner);
  return false;
}

bool on_distance_within(double tolerance_m, Object* a, Object* b, void* data, double& distance_m) {
  auto& nearest = *static_cast<Nearest*>(data);
  const int owner = owner_of(obstacle_of(*a, *b));
  if (nearest.ignored.count(owner) == 0) {
    nearest.hear(separation_m(*a, *b, nearest.clearance_m, tolerance_m), owner);
  }
  distance_m = nearest.clearance_m;
  return nearest.clearance_m <= 0.0;
}

bool on_distance(Object* a, Object* b, void* data, double& distance_m) {
  return on_distance_within(kDistanceTolerance_m, a, b, data, distance_m);
}

bool on_gap(Object* a, Object* b, void* data, double& distance_m) {
  return on_distance_within(kGapTolerance_m, a, b, data, distance_m);
}

}  // namespace

struct ShapeCollider::Impl {
  /// Two links with shapes.
  struct Pair {
    int first, second;  // links
    std::vector<std::size_t> of_first, of_second;
  };
  std::vector<RobotShape> shapes;
  std::vector<Pair> pairs;
  std::shared_ptr<const Scene> scene;
  std::vector<Geometry> scene_geometry;  // per scene object; null for half-spaces
  std::vector<std::unique_ptr<Object>> fixed;
  fcl::DynamicAABBTreeCollisionManagerd fixed_tree;
  std::vector<int> moving;       // scene objects
  std::vector<int> half_spaces;  // scene objects

  void add_fixed(const Geometry& geometry, const Transform& T_world_shape, int owner) {
    fixed.push_back(std::make_unique<Object>(geometry, to_fcl(T_world_shape)));
    fixed.back()->computeAABB();
    fixed.back()->setUserData(tag(owner));
  }
  void add_robot(const RobotDescription& robot) {
    for (const CollisionShape& shape : robot.shapes) {
      shapes.push_back(
          {shape.link, shape.shape, shape.T_link_shape, std::visit(ToGeometry{}, shape.shape), {}});
    }
    for (const auto& [first, second] : robot.self_collision_pairs) {
      Pair pair{first, second, shapes_of(first), shapes_of(second)};
      if (!pair.of_first.empty() && !pair.of_second.empty()) pairs.push_back(std::move(pair));
    }
  }
  [[nodiscard]] std::vector<std::size_t> shapes_of(int link) const {
    std::vector<std::size_t> found;
    for (std::size_t s = 0; s < shapes.size(); ++s) {
      if (shapes[s].link == link) found.push_back(s);
    }
    return found;
  }

  void add_voxels(const ShapeObstacles& obstacles) {
    if (obstacles.voxels_in_octree) {
      add_octree(obstacles);
      return;
    }
    for (const Eigen::AlignedBox3d& box :
         merge_voxels(obstacles.occupied_centres_m, obstacles.resolution_m)) {
      Transform pose = Transform::Identity();
      pose.translation() = box.center();
      add_fixed(ToGeometry{}(Box{box.sizes()}), pose, kVoxelOwner);
    }
  }

  /// OctoMap's voxels lie on multiples of their size, so the octree has a frame of its own.
  void add_octree(const ShapeObstacles& obstacles) {
    const std::vector<Eigen::Vector3d>& centres_m = obstacles.occupied_centres_m;
    if (centres_m.empty()) return;
    Eigen::Vector3d lowest_m = centres_m.front();
    for (const Eigen::Vector3d& centre : centres_m) lowest_m = lowest_m.cwiseMin(centre);
    const double side_m = obstacles.resolution_m;
    Transform T_world_tree = Transform::Identity();
    T_world_tree.translation() = lowest_m.array() - 0.5 * side_m;
    auto tree = std::make_shared<octomap::OcTree>(side_m);
    for (const Eigen::Vector3d& centre_m : centres_m) {
      const Eigen::Vector3d p_tree = centre_m - T_world_tree.translation();
      tree->setNodeValue(p_tree.x(), p_tree.y(), p_tree.z(), tree->getClampingThresMaxLog(), true);
    }
    tree->updateInnerOccupancy();
    tree->prune();
    add_fixed(std::make_shared<fcl::OcTreed>(tree), T_world_tree, kVoxelOwner);
  }

  void add_scene(const std::shared_ptr<const Scene>& its) {
    scene = its;
    if (!scene) return;
    for (int i = 0; i < static_cast<int>(scene->objects().size()); ++i) {
      const SceneObject& object = scene->objects()[idx(i)];
      scene_geometry.push_back(std::visit(ToGeometry{}, object.shape));
      if (scene_geometry.back() == nullptr) {
        half_spaces.push_back(i);
      } else if (object.moves()) {
        moving.push_back(i);
      } else {
        add_fixed(scene_geometry.back(), object.T_world_object(0.0), i);
      }
    }
  }

  void allow(const RobotDescription& robot, const std::vector<AllowedContact>& allowed) {
    for (const AllowedContact& contact : allowed) {
      for (int i = 0; scene && i < static_cast<int>(scene->objects().size()); ++i) {
        if (scene->objects()[idx(i)].name != contact.object) continue;
        for (RobotShape& shape : shapes) {
          if (robot.links[idx(shape.link)].name == contact.link) shape.ignored.insert(i);
        }
      }
    }
  }

  void add_floor(const RobotDescription& robot, const Floor& floor) {
    for (RobotShape& shape : shapes) {
      const auto& name = robot.links[idx(shape.link)].name;
      if (std::ranges::find(floor.except_links, name) == floor.except_links.end()) {
        shape.floor_m = floor.height_m;
      }
    }
  }

  /// The smallest that `measure` finds of two shapes of a pair of links, given the smallest so far,
  /// which is `bound_m` at first.
  template <class Measure>
  [[nodiscard]] double least_of_pair(int number, const Pose& pose, double bound_m,
                                     const Measure& measure) const;
  /// Floor and half-spaces, which FCL cannot measure distances to.
  void hear_planes(int shape, const Pose& pose, Nearest& nearest) const;
  [[nodiscard]] std::string name(int owner) const {
    if (owner == kFloorOwner) return kFloorName;
    return owner == kVoxelOwner ? kVoxelName : scene->objects()[idx(owner)].name;
  }
};

class ShapeCollider::Pose {
 public:
  std::vector<Object> shapes;
  std::vector<fcl::AABBd> boxes;  // about all shapes of a link, by link
  std::vector<Object> moving;     // in Impl::moving's order
  std::vector<Transform> T_half_space_world;
};
template <class Measure>
double ShapeCollider::Impl::least_of_pair(int number, const Pose& pose, double bound_m,
                                          const Measure& measure) const {
  const Pair& pair = pairs[idx(number)];
  const double apart_m = pose.boxes[idx(pair.first)].distance(pose.boxes[idx(pair.second)]);
  // Boxes that touch say nothing of shapes that do.
  if (apart_m > 0.0 && apart_m >= bound_m) return bound_m;
  double least_m = bound_m;
  for (const std::size_t a : pair.of_first) {
    for (const std::size_t b : pair.of_second) {
      least_m = std::min(least_m, measure(pose.shapes[a], pose.shapes[b], std::max(0.0, least_m)));
    }
  }
  return least_m;
}

void ShapeCollider::Impl::hear_planes(int shape, const Pose& pose, Nearest& nearest) const {
  const RobotShape& of = shapes[idx(shape)];
  const Object& object = pose.shapes[idx(shape)];
  if (of.floor_m) {
    nearest.hear(height_m(object, Transform::Identity()) - *of.floor_m, kFloorOwner);
  }
  for (std::size_t i = 0; i < half_spaces.size(); ++i) {
    if (of.ignored.count(half_spaces[i]) != 0) continue;
    nearest.hear(height_m(object, pose.T_half_space_world[i]), half_spaces[i]);
  }
}

ShapeCollider::ShapeCollider(const RobotDescription& robot, const ShapeObstacles& obstacles,
                             const std::vector<AllowedContact>& allowed) {
  auto impl = std::make_unique<Impl>();
  impl->add_robot(robot);
  impl->add_voxels(obstacles);
  impl->add_scene(obstacles.scene);
  impl->allow(robot, allowed);
  if (obstacles.floor) impl->add_floor(robot, *obstacles.floor);
  std::vector<Object*> objects;
  for (const auto& object : impl->fixed) objects.push_back(object.get());
  impl->fixed_tree.registerObjects(objects);
  impl->fixed_tree.setup();
  impl_ = std::move(impl);
}

ShapeCollider::~ShapeCollider() = default;
void ShapeCollider::PoseDeleter::operator()(Pose* pose) const noexcept { delete pose; }

ShapeCollider::PosePtr ShapeCollider::make_pose() const {
  PosePtr pose(new Pose());
  for (const RobotShape& shape : impl_->shapes) {
    pose->shapes.emplace_back(shape.geometry);
    pose->shapes.back().setUserData(tag(kRobotOwner));
  }
  for (const int object : impl_->moving) {
    pose->moving.emplace_back(impl_->scene_geometry[idx(object)]);
  }
  pose->T_half_space_world.resize(impl_->half_spaces.size());
  return pose;
}

void ShapeCollider::place(Pose& pose, std::span<const Transform> T_world_link,
                          double scene_time_s) const {
  pose.boxes.assign(T_world_link.size(), fcl::AABBd());
  for (std::size_t i = 0; i < impl_->shapes.size(); ++i) {
    const RobotShape& shape = impl_->shapes[i];
    move(pose.shapes[i], T_world_link[idx(shape.link)] * shape.T_link_shape);
    pose.boxes[idx(shape.link)] += pose.shapes[i].getAABB();
  }
  for (std::size_t i = 0; i < impl_->moving.size(); ++i) {
    const SceneObject& object = impl_->scene->objects()[idx(impl_->moving[i])];
    move(pose.moving[i], object.T_world_object(scene_time_s));
  }
  for (std::size_t i = 0; i < impl_->half_spaces.size(); ++i) {
    const SceneObject& object = impl_->scene->objects()[idx(impl_->half_spaces[i])];
    pose.T_half_space_world[i] = object.T_world_object(scene_time_s).inverse();
  }
}

int ShapeCollider::shape_count() const noexcept { return static_cast<int>(impl_->shapes.size()); }
int ShapeCollider::pair_count() const noexcept { return static_cast<int>(impl_->pairs.size()); }
std::pair<int, int> ShapeCollider::pair_links(int pair) const noexcept {
  return {impl_->pairs[idx(pair)].first, impl_->pairs[idx(pair)].second};
}

ShapeCollider::Proximity ShapeCollider::to_obstacles(int shape, const Pose& pose,
                                                     double bound_m) const {
  const RobotShape& robot_shape = impl_->shapes[idx(shape)];
  // FCL's interface is not const-correct; neither call changes the object or the tree.
  auto* object = const_cast<Object*>(&pose.shapes[idx(shape)]);
  Nearest nearest{robot_shape.ignored, bound_m};
  if (!impl_->fixed.empty()) {
    impl_->fixed_tree.collide(object, &nearest, on_overlap);
    if (nearest.clearance_m > 0.0) impl_->fixed_tree.distance(object, &nearest, on_distance);
  }
  for (std::size_t i = 0; i < impl_->moving.size(); ++i) {
    if (robot_shape.ignored.count(impl_->moving[i]) != 0) continue;
    nearest.hear(proximity_m(*object, pose.moving[i], std::max(0.0, nearest.clearance_m)),
                 impl_->moving[i]);
  }
  impl_->hear_planes(shape, pose, nearest);
  return {nearest.clearance_m, nearest.is_found ? impl_->name(nearest.owner) : std::string()};
}

double ShapeCollider::gap_to_obstacles_m(int shape, const Pose& pose, double bound_m) const {
  const RobotShape& robot_shape = impl_->shapes[idx(shape)];
  auto* object = const_cast<Object*>(&pose.shapes[idx(shape)]);  // see to_obstacles()
  Nearest nearest{robot_shape.ignored, bound_m};
  if (!impl_->fixed.empty()) impl_->fixed_tree.distance(object, &nearest, on_gap);
  for (std::size_t i = 0; i < impl_->moving.size(); ++i) {
    if (robot_shape.ignored.count(impl_->moving[i]) != 0) continue;
    nearest.hear(separation_m(*object, pose.moving[i], nearest.clearance_m, kGapTolerance_m),
                 impl_->moving[i]);
  }
  impl_->hear_planes(shape, pose, nearest);
  return std::max(0.0, nearest.clearance_m);
}

double ShapeCollider::gap_between_pair_m(int pair, const Pose& pose, double bound_m) const {
  return impl_->least_of_pair(pair, pose, bound_m,
                              [](const Object& a, const Object& b, double least_m) {
                                return separation_m(a, b, least_m, kGapTolerance_m);
                              });
}

double ShapeCollider::between_pair(int pair, const Pose& pose, double bound_m) const {
  return impl_->least_of_pair(pair, pose, bound_m, proximity_m);
}

}  // namespace sidestep
