#include "view_messages.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include <sidestep/core/format.hpp>
#include <sidestep/core/index.hpp>

namespace sidestep {
namespace {

using Json = nlohmann::ordered_json;

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json mesh_json(const Mesh& mesh) {
  Json vertices = Json::array(), triangles = Json::array();
  for (const Eigen::Vector3d& vertex : mesh.vertices_m) vertices.push_back(point_json(vertex));
  for (const Eigen::Vector3i& t : mesh.triangles) {
    triangles.push_back(Json::array({t.x(), t.y(), t.z()}));
  }
  return {{"type", "mesh"}, {"vertices", std::move(vertices)}, {"triangles", std::move(triangles)}};
}

struct ShapeJson {
  Json operator()(const Box& box) const {
    return {{"type", "box"}, {"size_m", point_json(box.size_m)}};
  }
  Json operator()(const Sphere& sphere) const {
    return {{"type", "sphere"}, {"radius_m", sphere.radius_m}};
  }
  Json operator()(const Cylinder& cylinder) const {
    return {{"type", "cylinder"}, {"radius_m", cylinder.radius_m}, {"length_m", cylinder.length_m}};
  }
  Json operator()(const Capsule& capsule) const {
    return {{"type", "capsule"}, {"radius_m", capsule.radius_m}, {"length_m", capsule.length_m}};
  }
  Json operator()(const HalfSpace&) const { return {{"type", "half_space"}}; }
  Json operator()(const std::shared_ptr<const Mesh>& mesh) const { return mesh_json(*mesh); }
};

Json shape_json(const Shape& shape) { return std::visit(ShapeJson{}, shape); }

Json joints_json(const RobotDescription& robot) {
  Json joints = Json::array();
  for (const Joint& joint : robot.joints) {
    joints.push_back({{"name", joint.name},
                      {"unit", joint.unit()},
                      {"lower", finite(joint.lower)},
                      {"upper", finite(joint.upper)},
                      {"max_velocity", finite(joint.max_velocity)}});
  }
  return joints;
}

Json shapes_json(const RobotDescription& robot) {
  Json shapes = Json::array();
  for (const CollisionShape& one : robot.shapes) {
    shapes.push_back({{"link", one.link},
                      {"shape", shape_json(one.shape)},
                      {"pose", pose_json(one.T_link_shape)}});
  }
  return shapes;
}

Json spheres_json(const RobotDescription& robot) {
  Json spheres = Json::array();
  for (const CollisionSphere& sphere : robot.spheres) {
    spheres.push_back({{"link", sphere.link},
                       {"centre_m", point_json(sphere.centre_link_m)},
                       {"radius_m", sphere.radius_m}});
  }
  return spheres;
}

Json objects_json(const Scene* scene) {
  Json objects = Json::array();
  if (scene == nullptr) return objects;
  for (const SceneObject& object : scene->objects()) {
    objects.push_back({{"name", object.name},
                       {"shape", shape_json(object.shape)},
                       {"pose", pose_json(object.T_world_object(0.0))},
                       {"moves", object.moves()}});
  }
  return objects;
}

/// Poses of all links.
Json poses_json(const RobotModel& robot, const Eigen::VectorXd& q) {
  Json poses = Json::array();
  for (const Transform& pose : link_poses(robot, as_span(q))) poses.push_back(pose_json(pose));
  return poses;
}

constexpr int kFrameColumns = 160;  ///< Most of a depth image that are sent.

std::string_view status_name(Replanner::Status status) noexcept {
  switch (status) {
    case Replanner::Status::kMoving: return "moving";
    case Replanner::Status::kWaiting: return "waiting";
    case Replanner::Status::kReached: return "reached";
  }
  return "";
}

Json values(const Eigen::VectorXd& q) {
  Json json = Json::array();
  for (const double value : q) json.push_back(value);
  return json;
}

Json camera_json(const CameraIntrinsics& camera) {
  return {{"width_px", camera.width_px}, {"height_px", camera.height_px}, {"fx_px", camera.fx_px},
          {"fy_px", camera.fy_px},       {"cx_px", camera.cx_px},         {"cy_px", camera.cy_px}};
}

std::uint16_t depth_mm(float depth_m) noexcept {
  if (!(depth_m > 0.0F)) return 0;
  return static_cast<std::uint16_t>(std::lround(std::min(1e3F * depth_m, 65535.0F)));
}

constexpr double kPathStep_s = 0.05;
constexpr int kMostPathSamples = 400;
constexpr int kMostSwept = 24;

/// `count` times from 0 to the end, evenly.
std::vector<double> times_of(double duration_s, int count) {
  std::vector<double> times_s;
  for (int i = 0; i < count; ++i) times_s.push_back(duration_s * i / std::max(1, count - 1));
  return times_s;
}

std::int16_t millimetres(double distance_m, FieldStatus status) noexcept {
  if (status != FieldStatus::kKnown || std::isnan(distance_m)) return FieldSlice::kUnknown;
  return static_cast<std::int16_t>(std::lround(std::clamp(1e3 * distance_m, -32767.0, 32767.0)));
}

}  // namespace

std::vector<Transform> link_poses(const RobotModel& robot, std::span<const double> q) {
  std::vector<Transform> T_world_link(robot.description().links.size());
  Scratch scratch;
  robot.link_poses(q, T_world_link, scratch);
  return T_world_link;
}

int base_link(const RobotDescription& robot) noexcept {
  int first = static_cast<int>(robot.links.size());
  for (const CollisionSphere& sphere : robot.spheres) first = std::min(first, sphere.link);
  return robot.spheres.empty() ? 0 : first;
}

int tool_link(const RobotDescription& robot) noexcept {
  int last = 0;
  for (const CollisionSphere& sphere : robot.spheres) last = std::max(last, sphere.link);
  return last;
}

ViewMessage world_message(const ObservedWorld& world) {
  const RobotDescription& robot = world.robot->description();
  Json links = Json::array();
  for (const Link& link : robot.links) links.push_back(link.name);
  return make_message(ViewKind::kWorld, Stamp{},
                      {{"title", world.title},
                       {"episode", world.episode},
                       {"robot", robot.name},
                       {"joints", joints_json(robot)},
                       {"links", std::move(links)},
                       {"tool_link", tool_link(robot)},
                       {"shapes", shapes_json(robot)},
                       {"spheres", spheres_json(robot)},
                       {"objects", objects_json(world.scene.get())},
                       {"start", poses_json(*world.robot, world.q_start)},
                       {"goal", poses_json(*world.robot, world.q_goal)}});
}

ViewMessage recorded_world(const ViewMessage& world) {
  const std::string& bytes = *world.bytes;
  std::uint32_t length = 0;
  if (bytes.size() < sizeof(length)) return world;
  std::memcpy(&length, bytes.data(), sizeof(length));
  Json header = Json::parse(bytes.substr(sizeof(length), length), nullptr, false);
  if (!header.is_object()) return world;
  header["recorded"] = true;
  return make_message(ViewKind::kWorld, world.stamp, std::move(header));
}

ViewMessage plan_message(Stamp time, std::string_view role, const Trajectory& trajectory,
                         Stamp start, const RobotModel& robot) {
  const bool is_empty = trajectory.size() == 0;
  const double duration_s = trajectory.duration_s();
  const int steps =
      static_cast<int>(std::min(std::ceil(duration_s / kPathStep_s), kMostPathSamples - 1.0));
  const std::vector<double> times_s = times_of(duration_s, is_empty ? 0 : steps + 1);
  const std::vector<double> swept_s =
      times_of(duration_s, is_empty ? 0 : std::min(steps + 1, kMostSwept));
  Payload payload;
  std::vector<double> q(static_cast<std::size_t>(trajectory.dof));
  const auto poses_at = [&](double time_s) {
    trajectory.sample(time_s, q, {});
    return link_poses(robot, q);
  };
  for (const int link : {tool_link(robot.description()), base_link(robot.description())}) {
    for (const double time_s : times_s) {
      payload.add(Eigen::Vector3d(poses_at(time_s)[idx(link)].translation()));
    }
  }
  for (const double time_s : swept_s) {
    for (const Transform& pose : poses_at(time_s)) payload.add(pose);
  }
  return make_message(
      ViewKind::kPlan, time,
      {{"role", role}, {"start_s", start.seconds()}, {"times_s", times_s}, {"swept_s", swept_s}},
      payload);
}

ViewMessage map_message(Stamp time, Stamp stamp, const OccupancyBits& bits,
                        std::span<const std::int32_t> blocks, bool full) {
  const GridSpec& grid = bits.grid();
  Payload payload;
  payload.reserve(blocks.size() * sizeof(BlockBits));
  for (const std::int32_t block : blocks) {
    payload.add(std::span<const std::uint16_t>(bits.block(block).occupied));
    payload.add(std::span<const std::uint16_t>(bits.block(block).known));
  }
  return make_message(
      ViewKind::kMap, time,
      {{"stamp_s", stamp.seconds()},
       {"full", full},
       {"origin_m", point_json(grid.origin_m)},
       {"voxel_m", grid.resolution_m},
       {"size_vox", Json::array({grid.size_vox.x(), grid.size_vox.y(), grid.size_vox.z()})},
       {"blocks", std::vector<std::int32_t>(blocks.begin(), blocks.end())}},
      payload);
}

ViewMessage state_message(const ObservedStep& step, std::span<const Transform> T_world_link,
                          std::span<const Transform> T_world_object,
                          const std::optional<Clearance>& clearance) {
  Payload payload;
  for (const Transform& pose : T_world_link) payload.add(pose);
  for (const Transform& pose : T_world_object) payload.add(pose);
  Json nearest = nullptr;
  if (clearance) {
    nearest = {{"distance_m", clearance->distance_m},
               {"link", clearance->link},
               {"object", clearance->object},
               {"point_m", point_json(clearance->point_m)}};
  }
  return make_message(ViewKind::kState, step.stamp,
                      {{"status", status_name(step.status)},
                       {"q", values(step.q)},
                       {"true_q", step.q_true.size() == 0 ? Json(nullptr) : values(step.q_true)},
                       {"clearance", std::move(nearest)}},
                      payload);
}

ViewMessage tracks_message(Stamp time, const Tracks* tracks, const Prediction* prediction) {
  Json tracked = Json::array(), sets = Json::array();
  for (const Track& track : tracks != nullptr ? tracks->tracks : std::vector<Track>{}) {
    tracked.push_back({{"id", track.id},
                       {"position_m", values(track.position_m)},
                       {"velocity_mps", values(track.velocity_mps)},
                       {"radius_m", track.radius_m},
                       {"bottom_m", track.bottom_m},
                       {"top_m", track.top_m}});
  }
  for (const PredictedSet& set :
       prediction != nullptr ? prediction->sets() : std::vector<PredictedSet>{}) {
    Json knots = Json::array();
    for (const PredictedSet::Knot& knot : set.knots) {
      const double time_s = prediction->stamp().seconds() + knot.time_s;
      knots.push_back({time_s, knot.centre_m.x(), knot.centre_m.y(), knot.radius_m});
    }
    sets.push_back({{"track", set.track},
                    {"likelihood", set.likelihood},
                    {"bottom_m", set.bottom_m},
                    {"top_m", set.top_m},
                    {"knots", std::move(knots)}});
  }
  return make_message(ViewKind::kTracks, time,
                      {{"tracks", std::move(tracked)}, {"sets", std::move(sets)}});
}

std::optional<ViewMessage> frame_message(Stamp time, const Frame& frame) {
  const auto* const image = std::get_if<DepthImage>(&frame.measurement);
  if (image == nullptr || image->camera.width_px <= 0 || image->camera.height_px <= 0) {
    return std::nullopt;
  }
  const int width = image->camera.width_px;
  const int height = image->camera.height_px;
  const int stride = (width + kFrameColumns - 1) / kFrameColumns;
  std::vector<std::uint16_t> pixels;
  for (int v = 0; v < height; v += stride) {
    for (int u = 0; u < width; u += stride) pixels.push_back(depth_mm(image->at(u, v)));
  }
  Payload payload;
  payload.add(std::span<const std::uint16_t>(pixels));
  return make_message(ViewKind::kFrame, time,
                      {{"stamp_s", frame.stamp.seconds()},
                       {"pose", pose_json(frame.T_world_camera)},
                       {"camera", camera_json(image->camera)},
                       {"columns", (width + stride - 1) / stride},
                       {"rows", (height + stride - 1) / stride}},
                      payload);
}

Json event_json(const ObservedEvent& observed) {
  const ReplannerEvent& event = observed.event;
  const auto& latency = observed.stamp_to_trajectory_ms;
  return {{"event", to_string(event.kind)},
          {"reason", to_string(event.reason)},
          {"cause", event.cause},
          {"solve_ms", event.solve_ms},
          {"guess", event.guess},
          {"tried", event.tried},
          {"attempts", event.attempts},
          {"cost", event.cost},
          {"takeover_s", event.takeover.seconds()},
          {"map_stamp_s", event.map_stamp.seconds()},
          {"stamp_to_trajectory_ms", latency ? Json(*latency) : Json(nullptr)}};
}

ViewMessage event_message(const ObservedEvent& observed) {
  return make_message(ViewKind::kEvent, observed.event.stamp, event_json(observed));
}

Json contact_json(const TrueContact& contact) {
  return {{"event", contact.is_by_robot() ? "contact_by_robot" : "contact_by_others"},
          {"reason", "contact"},
          {"cause", contact.link + " and " + contact.object +
                        format(" touched, %.0f mm deep; the robot went towards it at %.2f m/s",
                               1e3 * contact.depth_m, contact.approach_mps)}};
}

ViewMessage contact_message(const TrueContact& contact) {
  return make_message(ViewKind::kEvent, Stamp::from_seconds(contact.begin_s),
                      contact_json(contact));
}

ViewMessage timing_message(Stamp time, const ViewTiming& timing) {
  return make_message(ViewKind::kTiming, time,
                      {{"frames", timing.frames},
                       {"steps", timing.steps},
                       {"checks", timing.checks},
                       {"frames_dropped", timing.frames_dropped}});
}

FieldSlice make_slice(const DistanceField& field, SliceRequest request,
                      const Prediction* prediction, Stamp now) {
  const GridSpec& grid = field.info().grid;
  const int axis = request.axis;
  const int across = axis == 0 ? 1 : 0;
  const int down = axis == 2 ? 1 : 2;
  FieldSlice slice;
  if (prediction == nullptr) request.ahead_s.reset();
  slice.request = request;
  slice.first_m = grid.centre_m(Eigen::Vector3i::Zero());
  slice.request.position_m = std::clamp(
      request.position_m, slice.first_m[axis],
      std::max(slice.first_m[axis], grid.centre_m(grid.size_vox)[axis] - grid.resolution_m));
  slice.first_m[axis] = slice.request.position_m;
  slice.max_distance_m = std::min(field.info().max_distance_m, 32.767);

  const int largest = std::max(grid.size_vox[across], grid.size_vox[down]);
  const int stride = (largest + FieldSlice::kMostSamples - 1) / FieldSlice::kMostSamples;
  if (stride == 0) return slice;
  slice.step_m = stride * grid.resolution_m;
  slice.columns = (grid.size_vox[across] + stride - 1) / stride;
  slice.rows = (grid.size_vox[down] + stride - 1) / stride;

  const auto columns = static_cast<std::size_t>(slice.columns);
  std::vector<Eigen::Vector3d> points_m(columns, slice.first_m);
  std::vector<double> distances_m(columns);
  std::vector<double> predicted_m(columns, std::numeric_limits<double>::infinity());
  std::vector<FieldStatus> statuses(columns);
  for (int row = 0; row < slice.rows; ++row) {
    for (std::size_t c = 0; c < columns; ++c) {
      points_m[c][across] = slice.first_m[across] + static_cast<double>(c) * slice.step_m;
      points_m[c][down] = slice.first_m[down] + row * slice.step_m;
    }
    field.query(points_m, distances_m, {}, statuses);
    if (request.ahead_s) {
      const double time_s = now.seconds() + *request.ahead_s - prediction->stamp().seconds();
      prediction->query(time_s, points_m, predicted_m, {});
    }
    for (std::size_t c = 0; c < columns; ++c) {
      // Who is predicted where nobody has looked is shown there, too.
      if (predicted_m[c] <= 0.0) statuses[c] = FieldStatus::kKnown;
      distances_m[c] = std::min(distances_m[c], predicted_m[c]);
      slice.distance_mm.push_back(millimetres(distances_m[c], statuses[c]));
    }
  }
  return slice;
}

ViewMessage slice_message(Stamp time, Stamp stamp, const FieldSlice& slice) {
  Payload payload;
  payload.add(std::span<const std::int16_t>(slice.distance_mm));
  const std::optional<double>& ahead_s = slice.request.ahead_s;
  return make_message(ViewKind::kSlice, time,
                      {{"stamp_s", stamp.seconds()},
                       {"axis", std::string(1, "xyz"[slice.request.axis])},
                       {"position_m", slice.request.position_m},
                       {"ahead_s", ahead_s ? Json(*ahead_s) : Json(nullptr)},
                       {"first_m", point_json(slice.first_m)},
                       {"step_m", slice.step_m},
                       {"columns", slice.columns},
                       {"rows", slice.rows},
                       {"max_m", slice.max_distance_m}},
                      payload);
}

ViewMessage end_message(const ObservedEnd& end) {
  return make_message(ViewKind::kEnd, end.stamp,
                      {{"success", end.success}, {"verdict", end.verdict}});
}

}  // namespace sidestep
