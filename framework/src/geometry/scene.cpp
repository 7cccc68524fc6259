#include <sidestep/geometry/scene.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include <sidestep/core/index.hpp>
#include <sidestep/core/seed.hpp>
#include <sidestep/geometry/crowd.hpp>

#include "node_reader.hpp"

namespace sidestep {
namespace {

double draw(const MotionRanges::Range& range, std::mt19937_64& generator) {
  return std::uniform_real_distribution<double>(range.lower, range.upper)(generator);
}

void draw_motion(SceneObject& object, const MotionRanges& ranges, std::uint64_t seed) {
  std::mt19937_64 generator(derive_seed(seed, object.name));
  const double delay_s = draw(ranges.delay_s, generator);
  const double speed = draw(ranges.speed, generator);
  Eigen::Vector3d offset_m;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    offset_m[axis] = draw(ranges.offset_m[axis], generator);
  }
  for (Waypoint& waypoint : object.waypoints) {
    waypoint.time_s = delay_s + waypoint.time_s / speed;
    waypoint.T_world_object.translation() += offset_m;
  }
}

/// Reads one document.
class SceneReader : private NodeReader {
 public:
  explicit SceneReader(std::vector<Error>& errors) : NodeReader(errors) {}

  Scene read(const Node& document) {
    std::vector<SceneObject> objects;
    People people;
    if (!document.is_map()) {
      add(document.error("expected a scene, which is a map with the key 'objects', found " +
                         document.kind()));
    } else {
      check_keys(document, {"objects", "people"});
      if (const Node* list = require(document, "objects", "a scene")) {
        if (!list->is_list()) add(list->error("expected a list of objects, found " + list->kind()));
        for (const Node& item : list->items()) objects.push_back(read_object(item));
      }
      if (const Node* block = document.find("people")) people = read_people(*block, errors());
    }
    return Scene(std::move(objects), std::move(people));
  }

 private:
  SceneObject read_object(const Node& node) {
    SceneObject object;
    if (!node.is_map()) {
      add(node.error("expected an object, which is a map, found " + node.kind()));
      return object;
    }
    check_keys(node, {"name", "shape", "pose", "waypoints", "repeat", "random"});
    read_name(node, object);
    if (const Node* shape = require(node, "shape", "an object")) object.shape = read_shape(*shape);
    if (const Node* repeat = node.find("repeat")) {
      object.repeat = keep(repeat->as_bool()).value_or(false);
    }
    const Node* pose = node.find("pose");
    const Node* waypoints = node.find("waypoints");
    if (pose != nullptr && waypoints != nullptr) {
      add(waypoints->error("an object has either a 'pose' or 'waypoints', not both"));
    }
    if (waypoints != nullptr) {
      read_waypoints(*waypoints, object);
    } else {
      object.waypoints.push_back(
          {0.0, pose != nullptr ? read_pose(*pose, {"xyz_m", "rpy_rad"}) : Transform::Identity()});
    }
    if (object.repeat && waypoints == nullptr) {
      add(node.find("repeat")->error("only an object with 'waypoints' can repeat"));
    }
    if (const Node* random = node.find("random")) object.random = read_ranges(*random, object);
    return object;
  }

  MotionRanges read_ranges(const Node& node, const SceneObject& object) {
    MotionRanges ranges;
    if (!node.is_map()) {
      add(node.error("expected ranges such as {delay_s: [0, 2], y_m: [-0.1, 0.1]}, found " +
                     node.kind()));
      return ranges;
    }
    check_keys(node, {"delay_s", "speed", "x_m", "y_m", "z_m"});
    ranges.delay_s = read_range(node, "delay_s", ranges.delay_s);
    ranges.speed = read_range(node, "speed", ranges.speed);
    const Names axes = {"x_m", "y_m", "z_m"};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      ranges.offset_m[axis] = read_range(node, axes[axis], ranges.offset_m[axis]);
    }
    for (const char* key : {"delay_s", "speed"}) {
      const Node* value = node.find(key);
      if (value != nullptr && !object.moves()) {
        add(value->error(std::string("only an object with 'waypoints' has a ") + key));
      }
    }
    if (!(ranges.speed.lower > 0.0)) {
      add(node.find("speed")->error("a factor of speed must be greater than 0"));
    }
    return ranges;
  }

  MotionRanges::Range read_range(const Node& map, const std::string& key,
                                 MotionRanges::Range otherwise) {
    const Node* node = map.find(key);
    if (node == nullptr) return otherwise;
    const auto read = range(*node, key);
    return read ? MotionRanges::Range{read->first, read->second} : otherwise;
  }

  void read_name(const Node& node, SceneObject& object) {
    const Node* name = require(node, "name", "an object");
    if (name == nullptr) return;
    object.name = keep(name->as_string()).value_or("");
    if (name->is_scalar() && object.name.empty()) add(name->error("an object's name is empty"));
    if (!object.name.empty() && !names_.insert(object.name).second) {
      add(name->error("another object is named '" + object.name + "' already"));
    }
  }

  Shape read_shape(const Node& node) {
    const Names kinds = {"box", "sphere", "cylinder", "capsule", "half_space", "plane", "mesh"};
    if (node.is_scalar() && (node.text() == "half_space" || node.text() == "plane")) {
      return HalfSpace{};
    }
    if (!node.is_map() || node.entries().size() != 1) {
      add(node.error(
          "expected a shape such as {sphere: {radius_m: 0.1}}, found " +
              (node.is_map() ? "a map of " + std::to_string(node.entries().size()) + " entries"
                             : node.kind()),
          "shapes are: " + joined(kinds)));
      return Box{};
    }
    const auto& [kind, kind_mark, sizes] = node.entries().front();
    if (std::ranges::find(kinds, kind) == kinds.end()) {
      add(Error{ErrorCode::kConfig, "there is no shape '" + kind + "'", kind_mark.to_string(),
                did_you_mean(kind, kinds, "shapes are: " + joined(kinds)), nullptr});
      return Box{};
    }
    if (kind == "half_space" || kind == "plane") {
      check_keys(sizes, {});
      return HalfSpace{};
    }
    if (!sizes.is_map()) {
      add(sizes.is_null() ? node.error("a " + kind + " needs its sizes")
                          : sizes.error("expected a map with the sizes, found " + sizes.kind()));
      return Box{};
    }
    return read_sizes(kind, sizes);
  }

  Shape read_sizes(const std::string& kind, const Node& sizes) {
    if (kind == "box") {
      check_keys(sizes, {"size_m"});
      return Box{read_box_size(sizes)};
    }
    if (kind == "sphere") {
      check_keys(sizes, {"radius_m"});
      return Sphere{read_length(sizes, "radius_m", kind)};
    }
    if (kind == "mesh") return read_mesh_shape(sizes);
    check_keys(sizes, {"radius_m", "length_m"});
    const double radius_m = read_length(sizes, "radius_m", kind);
    const double length_m = read_length(sizes, "length_m", kind);
    if (kind == "cylinder") return Cylinder{radius_m, length_m};
    return Capsule{radius_m, length_m};
  }

  double read_length(const Node& map, const std::string& key, const std::string& kind) {
    const Node* node = require(map, key, "a " + kind);
    return node == nullptr ? 1.0 : positive(*node, key);
  }

  Eigen::Vector3d read_box_size(const Node& sizes) {
    const Node* node = require(sizes, "size_m", "a box");
    Eigen::Vector3d size_m = Eigen::Vector3d::Ones();
    if (node == nullptr || !keep(node->as_doubles(3))) return size_m;
    for (int axis = 0; axis < 3; ++axis) {
      size_m[axis] = positive(node->items()[idx(axis)], "size_m");
    }
    return size_m;
  }

  Shape read_mesh_shape(const Node& node) {
    check_keys(node, {"file", "scale"});
    double scale = 1.0;
    if (const Node* factor = node.find("scale")) scale = positive(*factor, "scale");
    const Node* file = require(node, "file", "a mesh");
    if (file == nullptr) return Box{};
    const auto path = keep(file->as_path());
    if (!path) return Box{};
    auto mesh = read_mesh(path->string());
    if (!mesh) {
      add(mesh.error().wrapped(ErrorCode::kConfig, "the mesh cannot be used",
                               file->mark().to_string()));
      return Box{};
    }
    for (Eigen::Vector3d& vertex : mesh->vertices_m) vertex *= scale;
    return indexed_mesh(std::move(*mesh));
  }

  Transform read_pose(const Node& node, const Names& known) {
    if (!node.is_map()) {
      add(node.error("expected a pose such as {xyz_m: [0, 0, 1], rpy_rad: [0, 0, 0]}, found " +
                     node.kind()));
      return Transform::Identity();
    }
    check_keys(node, known);
    const Eigen::Vector3d xyz_m = read_vector(node, "xyz_m");
    return transform_from_xyz_rpy(xyz_m, read_vector(node, "rpy_rad"));
  }

  Eigen::Vector3d read_vector(const Node& map, const std::string& key) {
    const Node* node = map.find(key);
    if (node == nullptr) return Eigen::Vector3d::Zero();
    const auto values = keep(node->as_doubles(3));
    return values ? Eigen::Vector3d((*values)[0], (*values)[1], (*values)[2])
                  : Eigen::Vector3d(Eigen::Vector3d::Zero());
  }

  void read_waypoints(const Node& list, SceneObject& object) {
    if (!list.is_list() || list.items().empty()) {
      add(list.error("expected a list of at least one waypoint, found " +
                     (list.is_list() ? "an empty one" : list.kind())));
      return;
    }
    std::optional<double> previous_s;
    for (const Node& item : list.items()) {
      Waypoint waypoint;
      waypoint.T_world_object = read_pose(item, {"time_s", "xyz_m", "rpy_rad"});
      const Node* time = item.is_map() ? require(item, "time_s", "a waypoint") : nullptr;
      const auto time_s = time != nullptr ? keep(time->as_double()) : std::nullopt;
      if (!time_s) continue;
      if (previous_s && *time_s <= *previous_s) {
        add(time->error("time_s must increase from waypoint to waypoint, found " + time->text() +
                        " after " + previous_text_));
      }
      previous_s = time_s;
      previous_text_ = time->text();
      waypoint.time_s = *time_s;
      object.waypoints.push_back(waypoint);
    }
    if (object.repeat && list.items().size() < 2) {
      add(list.error("an object that repeats needs at least two waypoints"));
    }
  }

  std::set<std::string> names_;
  std::string previous_text_;
};

}  // namespace

Transform SceneObject::T_world_object(double time_s) const {
  const Waypoint& first = waypoints.front();
  const Waypoint& last = waypoints.back();
  if (repeat && moves() && time_s >= last.time_s) {
    time_s = first.time_s + std::fmod(time_s - first.time_s, last.time_s - first.time_s);
  }
  if (time_s >= last.time_s) return last.T_world_object;
  const auto after = std::ranges::upper_bound(waypoints, time_s, {}, &Waypoint::time_s);
  if (after == waypoints.begin() || after == waypoints.end()) return first.T_world_object;
  const auto before = std::prev(after);
  const double s = (time_s - before->time_s) / (after->time_s - before->time_s);
  const Eigen::Quaterniond from(before->T_world_object.linear());
  const Eigen::Quaterniond to(after->T_world_object.linear());
  Transform pose = Transform::Identity();
  pose.linear() = from.slerp(s, to).toRotationMatrix();
  pose.translation() =
      (1.0 - s) * before->T_world_object.translation() + s * after->T_world_object.translation();
  return pose;
}

Result<Scene> Scene::drawn(std::uint64_t seed) const {
  std::vector<SceneObject> objects = objects_;
  for (SceneObject& object : objects) {
    if (!object.random) continue;
    draw_motion(object, *object.random, seed);
    object.random.reset();
  }
  if (people_.groups.empty() && people_.persons.empty()) return Scene(std::move(objects));
  return with_people(std::move(objects), people_, seed);
}

SceneDistance Scene::signed_distance(const Eigen::Vector3d& p_world, double time_s) const {
  SceneDistance nearest{std::numeric_limits<double>::infinity(), -1};
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    const SceneObject& object = objects_[i];
    const Transform pose =
        object.moves() ? object.T_world_object(time_s) : object.waypoints.front().T_world_object;
    const Eigen::Vector3d p_object = pose.linear().transpose() * (p_world - pose.translation());
    const double distance_m = signed_distance_m(object.shape, p_object);
    if (distance_m < nearest.distance_m) nearest = {distance_m, static_cast<int>(i)};
  }
  return nearest;
}

SceneReading read_scene(const Node& document) {
  SceneReading reading;
  Scene scene = SceneReader(reading.errors).read(document);
  // An object whose reading failed is not fit for use; neither is a scene that lacks it.
  if (reading.errors.empty()) reading.scene = std::move(scene);
  return reading;
}

}  // namespace sidestep
