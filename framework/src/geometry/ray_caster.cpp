#include <sidestep/geometry/ray_caster.hpp>

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <vector>

#include <sidestep/core/index.hpp>

#include "ray_fan.hpp"

namespace sidestep {
namespace {

/// Where a ray meets a surface: `distance_m` along it, and the surface's outward normal.
struct ShapeHit {
  double distance_m = kInfinity;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// Both crossings of a convex surface, the nearer first; empty if enter_m > leave_m.
struct Crossings {
  double enter_m = kInfinity;
  double leave_m = -kInfinity;

  /// The crossing ahead of the ray's origin; infinity if there is none.
  [[nodiscard]] double first_ahead_m() const {
    if (enter_m > leave_m || leave_m <= 0.0) return kInfinity;
    return enter_m > 0.0 ? enter_m : leave_m;
  }
};

/// Where origin + t direction lies within [-half, half].
Crossings cross_slab(double origin, double direction, double half) {
  if (direction == 0.0) {
    return std::abs(origin) <= half ? Crossings{-kInfinity, kInfinity} : Crossings{};
  }
  const double a = (-half - origin) / direction;
  const double b = (half - origin) / direction;
  return {std::min(a, b), std::max(a, b)};
}

/// Where a t^2 + 2 b t + c <= 0. The form of the roots avoids cancellation.
Crossings cross_quadric(double a, double b, double c) {
  if (a <= 0.0) return c <= 0.0 ? Crossings{-kInfinity, kInfinity} : Crossings{};
  const double discriminant = b * b - a * c;
  if (discriminant < 0.0) return {};
  const double q = -(b + std::copysign(std::sqrt(discriminant), b));
  const double first = q / a;
  const double second = q != 0.0 ? c / q : first;
  return {std::min(first, second), std::max(first, second)};
}

Crossings cross_ball(const Eigen::Vector3d& centre, double radius_m, const Eigen::Vector3d& origin,
                     const Eigen::Vector3d& direction) {
  // Around the ray's point nearest to the centre, so that distant spheres keep their digits.
  const double nearest_m = (centre - origin).dot(direction);
  const double gap2 = (origin + nearest_m * direction - centre).squaredNorm();
  if (gap2 > radius_m * radius_m) return {};
  const double half_chord_m = std::sqrt(radius_m * radius_m - gap2);
  return {nearest_m - half_chord_m, nearest_m + half_chord_m};
}

Crossings cross_tube(double radius_m, const Eigen::Vector3d& origin,
                     const Eigen::Vector3d& direction) {
  return cross_quadric(direction.head<2>().squaredNorm(), origin.head<2>().dot(direction.head<2>()),
                       origin.head<2>().squaredNorm() - radius_m * radius_m);
}

Crossings intersection(const Crossings& a, const Crossings& b) {
  return {std::max(a.enter_m, b.enter_m), std::min(a.leave_m, b.leave_m)};
}

/// The first point of an analytic shape's surface that a ray in the shape's frame meets ahead
/// of its origin; infinity without one. `direction` has unit length.
ShapeHit first_hit(const Box& box, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  std::array<Crossings, 3> slabs;
  Crossings inside{-kInfinity, kInfinity};
  for (int axis = 0; axis < 3; ++axis) {
    auto& slab = slabs[idx(axis)];
    slab = cross_slab(origin[axis], direction[axis], 0.5 * box.size_m[axis]);
    inside = intersection(inside, slab);
  }
  ShapeHit hit{inside.first_ahead_m()};
  for (int axis = 0; axis < 3; ++axis) {
    const auto& slab = slabs[idx(axis)];
    if (hit.distance_m == slab.enter_m || hit.distance_m == slab.leave_m) {
      const bool enters = hit.distance_m == slab.enter_m;
      hit.normal = Eigen::Vector3d::Unit(axis) *
                   std::copysign(1.0, enters ? -direction[axis] : direction[axis]);
      break;
    }
  }
  return hit;
}

ShapeHit first_hit(const Sphere& sphere, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  ShapeHit hit{
      cross_ball(Eigen::Vector3d::Zero(), sphere.radius_m, origin, direction).first_ahead_m()};
  if (hit.distance_m < kInfinity) hit.normal = (origin + hit.distance_m * direction).normalized();
  return hit;
}

ShapeHit first_hit(const Cylinder& cylinder, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const Crossings slab = cross_slab(origin.z(), direction.z(), 0.5 * cylinder.length_m);
  const Crossings tube = cross_tube(cylinder.radius_m, origin, direction);
  ShapeHit hit{intersection(slab, tube).first_ahead_m()};
  if (hit.distance_m == kInfinity) return hit;
  const Eigen::Vector3d p = origin + hit.distance_m * direction;
  if (hit.distance_m == slab.enter_m || hit.distance_m == slab.leave_m) {
    hit.normal = Eigen::Vector3d::UnitZ() * std::copysign(1.0, p.z());
  } else {
    hit.normal = Eigen::Vector3d(p.x(), p.y(), 0.0).normalized();
  }
  return hit;
}

ShapeHit first_hit(const Capsule& capsule, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const Eigen::Vector3d top(0.0, 0.0, 0.5 * capsule.length_m);
  const Crossings tube = intersection(cross_slab(origin.z(), direction.z(), top.z()),
                                      cross_tube(capsule.radius_m, origin, direction));
  // Convex, so the parts' crossings that are not empty join without a gap.
  Crossings whole;
  for (const Crossings& part : {tube, cross_ball(top, capsule.radius_m, origin, direction),
                                cross_ball(-top, capsule.radius_m, origin, direction)}) {
    if (part.enter_m > part.leave_m) continue;
    whole.enter_m = std::min(whole.enter_m, part.enter_m);
    whole.leave_m = std::max(whole.leave_m, part.leave_m);
  }
  ShapeHit hit{whole.first_ahead_m()};
  if (hit.distance_m == kInfinity) return hit;
  const Eigen::Vector3d p = origin + hit.distance_m * direction;
  const Eigen::Vector3d on_axis(0.0, 0.0, std::clamp(p.z(), -top.z(), top.z()));
  hit.normal = (p - on_axis).normalized();
  return hit;
}

ShapeHit first_hit(const HalfSpace&, const Eigen::Vector3d& origin,
                   const Eigen::Vector3d& direction) {
  const double distance_m = direction.z() != 0.0 ? -origin.z() / direction.z() : kInfinity;
  if (!(distance_m > 0.0) || distance_m == kInfinity) return {};
  return {distance_m, Eigen::Vector3d::UnitZ()};
}

/// Half the edges of the smallest box around the origin, aligned with the shape's frame.
Eigen::Vector3d half_extent_m(const Box& box) { return 0.5 * box.size_m; }

Eigen::Vector3d half_extent_m(const Sphere& sphere) {
  return Eigen::Vector3d::Constant(sphere.radius_m);
}

Eigen::Vector3d half_extent_m(const Cylinder& cylinder) {
  return {cylinder.radius_m, cylinder.radius_m, 0.5 * cylinder.length_m};
}

Eigen::Vector3d half_extent_m(const Capsule& capsule) {
  return {capsule.radius_m, capsule.radius_m, 0.5 * capsule.length_m + capsule.radius_m};
}

/// Embree works in single precision: bounds grow by this share, so that rounding never culls a
/// hit that is then computed in double.
constexpr double kBoundsSlack = 1e-5;

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
struct GeometryDeleter {
  void operator()(RTCGeometry geometry) const { rtcReleaseGeometry(geometry); }
};
using DevicePtr = std::unique_ptr<RTCDeviceTy, DeviceDeleter>;
using ScenePtr = std::unique_ptr<RTCSceneTy, SceneDeleter>;
using GeometryPtr = std::unique_ptr<RTCGeometryTy, GeometryDeleter>;

/// An object as Embree holds it: an analytic shape as user geometry in world coordinates, a
/// mesh as an instance of a scene of its own.
struct CastObject {
  SceneObject source;
  Transform T_world_object = Transform::Identity();
  double radius_m = kInfinity;  ///< Of a ball around it.
  ScenePtr mesh_scene;
  GeometryPtr geometry;
};

/// Half the edges of the smallest box around an analytic shape, aligned with its frame.
Eigen::Vector3d half_extent_of(const Shape& shape) {
  return std::visit(
      [](const auto& analytic) -> Eigen::Vector3d {
        if constexpr (requires { half_extent_m(analytic); }) {
          return half_extent_m(analytic);
        } else {
          return Eigen::Vector3d::Zero();
        }
      },
      shape);
}

/// What travels with one ray through Embree: the ray in double, and the nearest analytic hit.
struct RayContext : RTCIntersectContext {
  const Eigen::Vector3d* origin = nullptr;
  const Eigen::Vector3d* direction = nullptr;
  ShapeHit hit;  ///< Normal in the world frame.
};

template <class S>
ShapeHit first_hit_world(const S& shape, const Transform& T_world_object,
                         const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const Eigen::Matrix3d& R_world_object = T_world_object.linear();
  ShapeHit hit =
      first_hit(shape, R_world_object.transpose() * (origin - T_world_object.translation()),
                R_world_object.transpose() * direction);
  hit.normal = R_world_object * hit.normal;
  return hit;
}

void analytic_bounds(const RTCBoundsFunctionArguments* arguments) {
  const auto& object = *static_cast<const CastObject*>(arguments->geometryUserPtr);
  Eigen::Vector3d half_m = half_extent_of(object.source.shape);
  half_m = object.T_world_object.linear().cwiseAbs() * half_m;
  const Eigen::Vector3d& centre = object.T_world_object.translation();
  half_m.array() += kBoundsSlack * (1.0 + centre.cwiseAbs().maxCoeff() + half_m.maxCoeff());
  const Eigen::Vector3f lower = (centre - half_m).cast<float>();
  const Eigen::Vector3f upper = (centre + half_m).cast<float>();
  *arguments->bounds_o =
      RTCBounds{lower.x(), lower.y(), lower.z(), 0.0F, upper.x(), upper.y(), upper.z(), 0.0F};
}

void intersect_analytic(const RTCIntersectFunctionNArguments* arguments) {
  if (arguments->valid[0] == 0) return;
  const auto& object = *static_cast<const CastObject*>(arguments->geometryUserPtr);
  auto& context = *static_cast<RayContext*>(arguments->context);
  const ShapeHit hit = std::visit(
      [&](const auto& shape) -> ShapeHit {
        if constexpr (requires { first_hit(shape, *context.origin, *context.direction); }) {
          return first_hit_world(shape, object.T_world_object, *context.origin, *context.direction);
        } else {
          return {};
        }
      },
      object.source.shape);
  auto& ray_hit = *reinterpret_cast<RTCRayHit*>(arguments->rayhit);
  if (!(hit.distance_m < static_cast<double>(ray_hit.ray.tfar))) return;
  context.hit = hit;
  ray_hit.ray.tfar = static_cast<float>(hit.distance_m);
  ray_hit.hit.geomID = arguments->geomID;
  ray_hit.hit.primID = arguments->primID;
  ray_hit.hit.instID[0] = arguments->context->instID[0];
}

ScenePtr build_mesh_scene(RTCDevice device, const Mesh& mesh) {
  GeometryPtr geometry(rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE));
  auto* vertices = static_cast<float*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                              3 * sizeof(float), mesh.vertices_m.size()));
  auto* indices = static_cast<unsigned*>(
      rtcSetNewGeometryBuffer(geometry.get(), RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              3 * sizeof(unsigned), mesh.triangles.size()));
  if (vertices == nullptr || indices == nullptr) {
    throw std::runtime_error("Embree has no memory for a mesh");
  }
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) {
    for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(vertex[axis]);
  }
  for (const Eigen::Vector3i& triangle : mesh.triangles) {
    for (int corner = 0; corner < 3; ++corner) *indices++ = static_cast<unsigned>(triangle[corner]);
  }
  rtcCommitGeometry(geometry.get());
  ScenePtr scene(rtcNewScene(device));
  rtcSetSceneFlags(scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcAttachGeometry(scene.get(), geometry.get());
  rtcCommitScene(scene.get());
  return scene;
}

RTCRayHit embree_ray(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction,
                     double limit_m) {
  RTCRayHit query{};
  const Eigen::Vector3f o = origin.cast<float>();
  const Eigen::Vector3f d = direction.cast<float>();
  query.ray.org_x = o.x();
  query.ray.org_y = o.y();
  query.ray.org_z = o.z();
  query.ray.dir_x = d.x();
  query.ray.dir_y = d.y();
  query.ray.dir_z = d.z();
  query.ray.tfar = static_cast<float>(limit_m);
  query.ray.mask = ~0U;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return query;
}

/// Where the ray meets the plane of the triangle that Embree found, in double.
ShapeHit refined_mesh_hit(const CastObject& object, const RTCRayHit& query,
                          const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
  const Mesh& mesh = *std::get<std::shared_ptr<const Mesh>>(object.source.shape);
  const Eigen::Vector3i& triangle = mesh.triangles[query.hit.primID];
  const auto corner = [&](int i) -> Eigen::Vector3d {
    return object.T_world_object * mesh.vertices_m[idx(triangle[i])];
  };
  const Eigen::Vector3d a = corner(0);
  const Eigen::Vector3d normal = (corner(1) - a).cross(corner(2) - a).normalized();
  const double slope = normal.dot(direction);
  const auto found_m = static_cast<double>(query.ray.tfar);
  const double plane_m = normal.dot(a - origin) / slope;
  // Nearly along the plane the quotient says nothing.
  return {std::abs(slope) > 1e-6 && plane_m > 0.0 ? plane_m : found_m, normal};
}

}  // namespace

struct RayCaster::Impl {
  DevicePtr device;
  ScenePtr scene;
  std::vector<CastObject> objects;
  std::vector<std::size_t> half_spaces;
  bool has_meshes = false;

  void add(std::size_t index) {
    CastObject& object = objects[index];
    if (std::holds_alternative<HalfSpace>(object.source.shape)) {
      half_spaces.push_back(index);
      return;
    }
    if (const auto* mesh = std::get_if<std::shared_ptr<const Mesh>>(&object.source.shape)) {
      has_meshes = true;
      object.mesh_scene = build_mesh_scene(device.get(), **mesh);
      object.geometry.reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_INSTANCE));
      rtcSetGeometryInstancedScene(object.geometry.get(), object.mesh_scene.get());
      rtcSetGeometryTimeStepCount(object.geometry.get(), 1);
    } else {
      object.radius_m = half_extent_of(object.source.shape).norm();
      object.geometry.reset(rtcNewGeometry(device.get(), RTC_GEOMETRY_TYPE_USER));
      rtcSetGeometryUserPrimitiveCount(object.geometry.get(), 1);
      rtcSetGeometryUserData(object.geometry.get(), &object);
      rtcSetGeometryBoundsFunction(object.geometry.get(), analytic_bounds, nullptr);
      rtcSetGeometryIntersectFunction(object.geometry.get(), intersect_analytic);
    }
    place(object);
    rtcAttachGeometryByID(scene.get(), object.geometry.get(), static_cast<unsigned>(index));
  }

  void place(CastObject& object) const {
    if (object.geometry == nullptr) return;
    if (object.mesh_scene != nullptr) {
      const Eigen::Matrix<float, 3, 4> matrix =
          object.T_world_object.matrix().topRows<3>().cast<float>();
      rtcSetGeometryTransform(object.geometry.get(), 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR,
                              matrix.data());
    }
    rtcCommitGeometry(object.geometry.get());
  }

  [[nodiscard]] RayHit cast(const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) const {
    RayHit nearest{kInfinity};
    const auto take = [&](const ShapeHit& hit, std::size_t object) {
      if (!(hit.distance_m < nearest.distance_m)) return;
      nearest = {hit.distance_m, static_cast<int>(object),
                 hit.normal.dot(direction) > 0.0 ? Eigen::Vector3d(-hit.normal) : hit.normal};
    };
    for (const std::size_t index : half_spaces) {
      take(first_hit_world(HalfSpace{}, objects[index].T_world_object, origin, direction), index);
    }
    RayContext context{};
    rtcInitIntersectContext(&context);
    context.origin = &origin;
    context.direction = &direction;
    RTCRayHit query = embree_ray(origin, direction, nearest.distance_m);
    rtcIntersect1(scene.get(), &context, &query);
    if (query.hit.instID[0] != RTC_INVALID_GEOMETRY_ID) {
      const std::size_t index = query.hit.instID[0];
      take(refined_mesh_hit(objects[index], query, origin, direction), index);
    } else if (query.hit.geomID != RTC_INVALID_GEOMETRY_ID) {
      take(context.hit, query.hit.geomID);
    }
    return nearest;
  }
};
RayCaster::RayCaster(const Scene& scene) : impl_(std::make_unique<Impl>()) {
#if defined(__SANITIZE_THREAD__)
  // ThreadSanitizer cannot see how TBB, which Embree works with, synchronises.
  constexpr const char* kDevice = "threads=1";
#else
  // Any other number of threads would be a limit for whoever uses TBB in this process.
  constexpr const char* kDevice = nullptr;
#endif
  impl_->device.reset(rtcNewDevice(kDevice));
  if (impl_->device == nullptr) throw std::runtime_error("Embree cannot start on this machine");
  impl_->scene.reset(rtcNewScene(impl_->device.get()));
  rtcSetSceneFlags(impl_->scene.get(), RTC_SCENE_FLAG_DYNAMIC | RTC_SCENE_FLAG_ROBUST);
  impl_->objects.reserve(scene.objects().size());  // Embree keeps pointers to them
  for (const SceneObject& object : scene.objects()) {
    CastObject& added = impl_->objects.emplace_back();
    added.source = object;
    added.T_world_object = object.T_world_object(0.0);
  }
  for (std::size_t i = 0; i < impl_->objects.size(); ++i) impl_->add(i);
  rtcCommitScene(impl_->scene.get());
  if (rtcGetDeviceError(impl_->device.get()) != RTC_ERROR_NONE) {
    throw std::runtime_error("Embree cannot build the scene");
  }
}

RayCaster::~RayCaster() = default;
RayCaster::RayCaster(RayCaster&&) noexcept = default;
RayCaster& RayCaster::operator=(RayCaster&&) noexcept = default;

void RayCaster::set_time(double time_s) {
  bool changed = false;
  for (CastObject& object : impl_->objects) {
    if (!object.source.moves()) continue;
    object.T_world_object = object.source.T_world_object(time_s);
    impl_->place(object);
    changed = true;
  }
  if (changed) rtcCommitScene(impl_->scene.get());
}

void RayCaster::set_poses(std::size_t first, std::span<const Transform> T_world_object) {
  if (T_world_object.empty()) return;
  for (std::size_t i = 0; i < T_world_object.size(); ++i) {
    CastObject& object = impl_->objects[first + i];
    object.T_world_object = T_world_object[i];
    impl_->place(object);
  }
  rtcCommitScene(impl_->scene.get());
}

void RayCaster::cast(std::span<const Eigen::Vector3d> origins,
                     std::span<const Eigen::Vector3d> directions, std::span<RayHit> hits) const {
  for (std::size_t i = 0; i < hits.size(); ++i) hits[i] = impl_->cast(origins[i], directions[i]);
}

void RayCaster::cast_distances(const Eigen::Vector3d& origin,
                               std::span<const Eigen::Vector3d> directions,
                               std::span<double> distances_m) const {
  if (impl_->has_meshes) {
    for (std::size_t i = 0; i < distances_m.size(); ++i) {
      distances_m[i] = impl_->cast(origin, directions[i]).distance_m;
    }
    return;
  }
  RayFan fan;
  for (std::size_t begin = 0; begin < distances_m.size(); begin += RayFan::kRays) {
    const std::size_t count = std::min<std::size_t>(RayFan::kRays, distances_m.size() - begin);
    fan.set(origin, directions.subspan(begin, count));
    for (const CastObject& object : impl_->objects) {
      if (!fan.may_meet(object.T_world_object.translation(), object.radius_m)) continue;
      std::visit(
          [&](const auto& shape) {
            if constexpr (requires { fan.meet(shape, object.T_world_object); }) {
              fan.meet(shape, object.T_world_object);
            }
          },
          object.source.shape);
    }
    std::ranges::copy(fan.distances_m(), distances_m.subspan(begin).begin());
  }
}

}  // namespace sidestep
