#include <sidestep/runtime/attached_settings.hpp>

#include <utility>

#include <sidestep/plugin/plugin.hpp>
#include <sidestep/robot/attached_object.hpp>
#include <sidestep/robot/sphere_fit.hpp>
#include <sidestep/runtime/entry_reading.hpp>

namespace sidestep {
namespace {

constexpr double kSmallest_m = 1e-6;
constexpr double kLargest_m = 1e3;

const ParameterOptions kPlace{.unit = "m", .min = -kLargest_m, .max = kLargest_m};
const ParameterOptions kLength{
    .unit = "m", .min = kSmallest_m, .max = kLargest_m, .required = true};

/// Appends where a shape of the object takes too many spheres.
AttachedObject object_of(const Node& block, const AttachedEntry& entry,
                         std::vector<Error>& errors) {
  AttachedObject object;
  object.name = entry.name;
  object.link = entry.link;
  object.T_link_object = transform_from_xyz_rpy(entry.position_m, entry.rpy_rad);
  object.touch_links = entry.touch_links;
  const auto add = [&](Shape shape, const Transform& T_object_shape) {
    const auto spheres = fit_spheres({0, shape, T_object_shape}, entry.protrusion_m);
    if (!spheres) {
      errors.push_back(block.error("object '" + entry.name + "': " + spheres.error().message,
                                   "allow it a larger `protrusion_m`"));
      return;
    }
    for (const CollisionSphere& sphere : *spheres) {
      object.spheres.push_back({sphere.centre_link_m, sphere.radius_m});
    }
    object.shapes.push_back({std::move(shape), T_object_shape});
  };
  for (const auto& sphere : entry.spheres) {
    add(Sphere{sphere.radius_m}, transform_from_xyz_rpy(sphere.centre_m, {0.0, 0.0, 0.0}));
  }
  for (const auto& box : entry.boxes) {
    add(Box{box.size_m}, transform_from_xyz_rpy(box.position_m, box.rpy_rad));
  }
  for (const auto& cylinder : entry.cylinders) {
    add(Cylinder{cylinder.radius_m, cylinder.length_m},
        transform_from_xyz_rpy(cylinder.position_m, cylinder.rpy_rad));
  }
  return object;
}

/// Appends what is wrong with the names of an object.
void check_names(const Node& block, const AttachedEntry& entry, const RobotDescription& robot,
                 std::vector<Error>& errors) {
  (void)has_link(robot, *block.find("link"), errors);
  if (const Node* list = block.find("touch_links")) {
    for (const Node& link : list->items()) (void)has_link(robot, link, errors);
  }
  const Node* name = block.find("name");
  const Node& named = name != nullptr ? *name : block;
  if (entry.name.empty()) errors.push_back(named.error("an attached object's name is empty"));
  if (robot.link_index(entry.name)) {
    errors.push_back(
        named.error("robot '" + robot.name + "' has a link '" + entry.name + "' already",
                    "give each attached object a `name` of its own"));
  }
}

}  // namespace

Parameters<AttachedSphereEntry> AttachedSphereEntry::parameters() {
  using E = AttachedSphereEntry;
  return Parameters<E>()
      .add("centre_m", &E::centre_m, "Its centre, in the object's frame.", kPlace)
      .add("radius_m", &E::radius_m, "Its radius.", kLength);
}

Parameters<AttachedBoxEntry> AttachedBoxEntry::parameters() {
  using E = AttachedBoxEntry;
  return Parameters<E>()
      .add("size_m", &E::size_m, "Its edges along x, y and z.", kLength)
      .add("position_m", &E::position_m, "Its centre, in the object's frame.", kPlace)
      .add("rpy_rad", &E::rpy_rad, "Its roll, pitch and yaw in the object's frame.",
           {.unit = "rad"});
}

Parameters<AttachedCylinderEntry> AttachedCylinderEntry::parameters() {
  using E = AttachedCylinderEntry;
  return Parameters<E>()
      .add("radius_m", &E::radius_m, "Its radius.", kLength)
      .add("length_m", &E::length_m, "Its length along z.", kLength)
      .add("position_m", &E::position_m, "Its centre, in the object's frame.", kPlace)
      .add("rpy_rad", &E::rpy_rad, "Its roll, pitch and yaw in the object's frame.",
           {.unit = "rad"});
}

Parameters<AttachedEntry> AttachedEntry::parameters() {
  using E = AttachedEntry;
  return Parameters<E>()
      .add("name", &E::name, "Of the link that the object becomes, e.g. in results.")
      .add("link", &E::link, "The link that holds it.", {.required = true})
      .add("position_m", &E::position_m, "Origin of the object's frame, in the link's frame.",
           kPlace)
      .add("rpy_rad", &E::rpy_rad, "Roll, pitch and yaw of the object's frame in the link's.",
           {.unit = "rad"})
      .add("spheres", &E::spheres, "Spheres that it is made of.")
      .add("boxes", &E::boxes, "Boxes that it is made of.")
      .add("cylinders", &E::cylinders, "Cylinders that it is made of.")
      .add("protrusion_m", &E::protrusion_m,
           "Planning sees boxes and cylinders as spheres that stand out by this much at most.",
           {.unit = "m", .min = 1e-4, .max = 1.0})
      .add("frame_only", &E::frame_only,
           "It has no extent: a frame alone, e.g. the point of a tool for `end_effector`, of which "
           "the robot has the shapes already.")
      .add("touch_links", &E::touch_links,
           "Links that may touch it, such as fingers; the one that holds it, and what is rigidly "
           "attached to that, always may.");
}

std::shared_ptr<const RobotModel> read_attached(const Node& plan,
                                                std::shared_ptr<const RobotModel> robot,
                                                std::vector<Error>& errors) {
  const Node* list = plan.find("attached");
  if (list == nullptr) return robot;
  for (const Node& block : list->items()) {
    AttachedEntry entry;
    if (!read_entry(block, entry)) continue;
    const std::size_t before = errors.size();
    check_names(block, entry, robot->description(), errors);
    const std::size_t fitted = errors.size();
    const AttachedObject object = object_of(block, entry, errors);
    if (object.spheres.empty() != entry.frame_only && errors.size() == fitted) {
      errors.push_back(
          entry.frame_only
              ? block.error("object '" + entry.name + "' is a frame alone, and has an extent",
                            "leave `frame_only` out")
              : block.error("object '" + entry.name + "' has no extent",
                            "give it spheres, boxes or cylinders, or `frame_only: true`"));
    }
    if (errors.size() != before) continue;
    auto carrying = attach_object(*robot, object);
    if (carrying) {
      robot = std::move(*carrying);
    } else {
      errors.push_back(block.error(carrying.error().message));
    }
  }
  return robot;
}

}  // namespace sidestep
